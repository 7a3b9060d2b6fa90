// The song, played from any moment. What is heard now is what the stage shows.

const FADE_S = 0.02;

export function makePlayer() {
  let context = null;
  let gain = null;
  let volume = 0.8;
  let buffer = null;
  let source = null;
  // The moment of the song that was heard at a time of the audio clock.
  let from_s = 0;
  let begun = 0;

  // Browsers let a page sound after somebody has touched it: call this from a press.
  function wake() {
    if (!context) {
      context = new AudioContext();
      gain = new GainNode(context, { gain: volume });
      gain.connect(context.destination);
    }
    context.resume();
  }
  const heardTime = () => context.currentTime - (context.outputLatency || context.baseLatency || 0);
  const at_s = () => {
    if (!source) return from_s;
    return Math.min(Math.max(from_s + heardTime() - begun, from_s), buffer.duration);
  };
  function pause() {
    if (!source) return;
    from_s = at_s();
    source.onended = null;
    source.stop();
    source = null;
  }
  function play(ended) {
    if (source || !buffer) return;
    if (from_s >= buffer.duration) from_s = 0;
    source = new AudioBufferSourceNode(context, { buffer });
    source.connect(gain);
    source.onended = () => {
      pause();
      from_s = buffer.duration;
      ended();
    };
    begun = context.currentTime;
    source.start(0, from_s);
  }
  return {
    wake,
    play,
    pause,
    at_s,
    playing: () => source !== null,
    duration_s: () => buffer?.duration ?? 0,
    // Takes another song, and stands at its beginning.
    load(song) {
      pause();
      [buffer, from_s] = [song, 0];
    },
    seek(time_s) {
      pause();
      from_s = time_s;
    },
    setVolume(share) {
      volume = share;
      gain?.gain.setTargetAtTime(volume, context.currentTime, FADE_S);
    },
  };
}
