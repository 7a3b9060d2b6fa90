// The music of the dance, in step with the robot: the page's audio clock is steered by its rate,
// too little to be heard, and what the page shows is the moment that is heard.

import { makeMusicClock } from "./music_clock.js";

const LOOK_MS = 200;
// What is further off than this is begun anew; less is made up for by the rate.
const FAR_S = 0.12;
const MOST_RATE = 0.01;
const FADE_S = 0.03;
// Ahead of the start of a source, so that it begins on time.
const AHEAD_S = 0.06;

// Silent at first where a loudspeaker beside the robot plays.
export function makeSound(panel, silent = false) {
  const [button, volume, told] = panel.querySelectorAll("button, input, output");
  const context = new AudioContext();
  const gain = new GainNode(context, { gain: 0 });
  gain.connect(context.destination);
  const clock = makeMusicClock();
  let on = !silent;
  // The song, and its number among those of the session.
  let buffer = null;
  let number = null;
  // The source, and the moment of the music that it plays at a time of the audio clock.
  let playing = null;

  const now = () => performance.now() / 1000;
  // The time of the audio clock that is heard now.
  const heardTime = () => {
    const { contextTime, performanceTime } = context.getOutputTimestamp();
    if (contextTime > 0) return contextTime + (performance.now() - performanceTime) / 1000;
    return context.currentTime - (context.outputLatency || context.baseLatency || 0);
  };
  const at = (time) => playing.music_s + (time - playing.time) * playing.rate;

  const end = () => {
    if (!playing) return;
    playing.gain.gain.setTargetAtTime(0, context.currentTime, FADE_S / 3);
    playing.source.stop(context.currentTime + 2 * FADE_S);
    playing = null;
  };
  const begin = (music_s) => {
    const time = context.currentTime + AHEAD_S;
    const from = music_s + (time - heardTime());
    if (from >= buffer.duration) return;
    const source = new AudioBufferSourceNode(context, { buffer });
    const fade = new GainNode(context, { gain: 0 });
    source.connect(fade).connect(gain);
    const start = time + Math.max(-from, 0);
    source.start(start, Math.max(from, 0));
    fade.gain.setTargetAtTime(1, start, FADE_S / 3);
    playing = { source, gain: fade, time, music_s: from, rate: 1, start };
  };
  const steer = (off_s) => {
    const time = context.currentTime;
    if (time < playing.start) return;
    const rate = 1 + Math.min(Math.max(off_s / 4, -MOST_RATE), MOST_RATE);
    Object.assign(playing, { music_s: at(time), time, rate });
    playing.source.playbackRate.setValueAtTime(rate, time);
  };
  const look = () => {
    if (!buffer) return;
    const music_s = clock.at(now());
    const runs = context.state === "running";
    button.textContent = !on ? "sound on" : runs ? "mute" : "press for sound";
    if (music_s === null || !on || !runs || music_s > buffer.duration) {
      told.textContent = "";
      delete told.dataset.offMs;
      return end();
    }
    if (!playing) return begin(music_s);
    const off_s = music_s - at(heardTime());
    if (music_s > 0) {
      told.textContent = `${Math.abs(off_s * 1000).toFixed(0)} ms off the robot`;
      told.dataset.offMs = off_s * 1000;
    }
    if (Math.abs(off_s) > FAR_S) {
      end();
      begin(music_s);
    } else steer(off_s);
  };

  volume.oninput = () => gain.gain.setTargetAtTime(volume.value / 100, context.currentTime, FADE_S);
  button.onclick = () => {
    on = context.state !== "running" || !on;
    context.resume();
  };
  // Browsers let a page sound after somebody has touched it.
  addEventListener("pointerdown", () => on && context.resume(), { once: true });

  const load = async (wanted) => {
    number = wanted;
    end();
    buffer = null;
    panel.hidden = true;
    if (wanted === null) return;
    const answer = await fetch("api/song");
    if (!answer.ok) return;
    const decoded = await context.decodeAudioData(await answer.arrayBuffer());
    if (wanted !== number) return;
    buffer = decoded;
    panel.hidden = false;
  };

  volume.oninput();
  setInterval(look, LOOK_MS);
  return {
    hear(frame) {
      clock.hear(frame, now());
      if (frame.song !== number) load(frame.song);
    },
    // The moment that is heard now, or null in silence.
    heard_s: () => (playing ? at(heardTime()) : null),
  };
}
