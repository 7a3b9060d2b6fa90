// Songs as what the player plays and the dance hears: a buffer, and mono samples.

// The rate that files are brought to; most are made at it.
const RATE_HZ = 44_100;

export function songOfSamples(name, samples, rate_hz) {
  const buffer = new AudioBuffer({ length: samples.length, sampleRate: rate_hz });
  buffer.copyToChannel(samples, 0);
  return { name, buffer, samples, rate_hz };
}

// Any format that this browser plays.
export async function songOfFile(file) {
  const context = new OfflineAudioContext(1, 1, RATE_HZ);
  let buffer;
  try {
    buffer = await context.decodeAudioData(await file.arrayBuffer());
  } catch {
    throw new Error(`${file.name} is no sound file that this browser can play`);
  }
  if (buffer.length === 0) throw new Error(`${file.name} is empty`);
  return { name: file.name, buffer, samples: mono(buffer), rate_hz: buffer.sampleRate };
}

// The mean of all channels.
function mono(buffer) {
  const count = buffer.numberOfChannels;
  const sum = buffer.getChannelData(0).slice();
  for (let channel = 1; channel < count; channel++) {
    buffer.getChannelData(channel).forEach((sample, n) => (sum[n] += sample));
  }
  return count > 1 ? sum.map((sample) => sample / count) : sum;
}
