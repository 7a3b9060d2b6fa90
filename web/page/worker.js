// The dance in a thread of its own: a song is danced as fast as this machine can, a
// microphone as its sound comes. Answers carry the number of the dance that they belong to.

import { openStudio } from "./studio.js";

// Samples are danced to in pieces of this length, and messages read in between.
const PIECE_S = 0.5;

let studio = null;
// The dance of the moment; an older one that is still at work ends by itself.
let dance = 0;
let heard_s = 0;
let spent_s = 0;

const say = (message, transfer = []) => postMessage(message, transfer);

function dancePiece(number, work, seconds) {
  const began = performance.now();
  const { music, robot } = work();
  spent_s += (performance.now() - began) / 1000;
  heard_s += seconds;
  say({ say: "rows", dance: number, music, robot, heard_s, spent_s }, [music.buffer, robot.buffer]);
}

async function danceAll(number, samples, rate_hz) {
  const piece = Math.round(PIECE_S * rate_hz);
  let at = 0;
  // Once also without samples: the frame of the beginning is there before any sound.
  do {
    const block = samples.subarray(at, at + piece);
    dancePiece(number, () => studio.hear(block), block.length / rate_hz);
    await new Promise((later) => setTimeout(later));
    if (number !== dance) return;
    at += piece;
  } while (at < samples.length);
  dancePiece(number, () => studio.finish(), 0);
  say({ say: "whole", dance: number });
}

const requests = {
  async open() {
    studio = await openStudio((share) => say({ say: "loading", share }));
    say({ say: "open", choices: studio.choices });
  },
  song: () => {
    const { samples, rate_hz } = studio.song();
    say({ say: "song", samples, rate_hz }, [samples.buffer]);
  },
  // With samples: a whole song. Without: sound comes by `hear`.
  async start({ number, options, samples }) {
    dance = number;
    heard_s = spent_s = 0;
    say({ say: "scene", dance: number, scene: studio.start(options) });
    if (samples) await danceAll(number, samples, options.rate_hz);
  },
  hear({ number, samples, rate_hz }) {
    if (number === dance) dancePiece(number, () => studio.hear(samples), samples.length / rate_hz);
  },
};

addEventListener("message", async ({ data }) => {
  try {
    await requests[data.do](data);
  } catch (error) {
    // A module that has failed once holds no whole dance any more.
    const failed = error instanceof WebAssembly.RuntimeError;
    const text = failed ? `the dance failed (${error.message}): load the page again` : error.message;
    say({ say: "error", during: data.do, dance: data.number, text });
  }
});
