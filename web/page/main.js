// Puts the page together: a worker that dances, a player that is heard, a stage that shows
// the moment that is heard.

import { makePlayer } from "./player.js";
import { makeRows } from "./rows.js";
import { openMicrophone } from "./microphone.js";
import { showMusic } from "./heard.js";
import { songOfFile, songOfSamples } from "./songs.js";
import { makeStage } from "./stage.js";

const FRAME_RATE_HZ = 20;
// So much of a dance is there before the song begins.
const AHEAD_S = 2;
// Of a microphone's dance this much is kept.
const KEPT_S = 10;
const LOCKS = ["lost", "holding", "locked", "changing"];

const byId = (id) => document.getElementById(id);
const worker = new Worker("worker.js", { type: "module" });
const player = makePlayer();
const choices = {};
// The dance of the moment: number, scene, rows, figures; its music is a song, "live" or
// "none" while the robot waits for some.
let dance = null;
let number = 0;
let stage = null;
let microphone = null;
let songWanted = false;
let wantsToPlay = false;

const ask = (request, transfer = []) => worker.postMessage(request, transfer);
function showState(text, quality = "warn") {
  byId("state").textContent = text;
  byId("state").className = `badge ${quality}`;
}
function showError(text) {
  byId("error").hidden = text === "";
  byId("error").textContent = text;
}

// One of the lists on the page.
function fill(select, names, chosen) {
  select.replaceChildren(...names.map((name) => new Option(name, name, name === chosen, name === chosen)));
}

const answers = {
  loading: ({ share }) => showState(`loading ${Math.round(100 * share)} %`),
  open({ choices: told }) {
    Object.assign(choices, told);
    fill(byId("robot"), told.robots.map(({ name }) => name), told.robots[0].name);
    fill(byId("style"), told.styles, told.default_style);
    aboutRobot();
    for (const control of document.querySelectorAll("#controls :disabled")) control.disabled = false;
    wait();
  },
  song({ samples, rate_hz }) {
    if (songWanted) begin(songOfSamples("built-in song", samples, rate_hz));
    songWanted = false;
  },
  scene({ dance: of, scene }) {
    if (of !== number) return;
    dance.scene = scene;
    dance.music = makeRows(choices.music_row, FRAME_RATE_HZ);
    dance.robot = makeRows(scene.row, scene.rate_hz);
    stage = makeStage(freshCanvas(), scene);
  },
  rows({ dance: of, music, robot, heard_s, spent_s }) {
    if (of !== number) return;
    dance.music.append(music);
    dance.robot.append(robot);
    Object.assign(dance, { heard_s, spent_s });
    if (dance.music_of === "live") {
      dance.music.keep(KEPT_S);
      dance.robot.keep(KEPT_S);
    }
  },
  whole({ dance: of }) {
    if (of === number) dance.whole = true;
  },
  error({ dance: of, text, during }) {
    if (of !== undefined && of !== number) return;
    showError(text);
    if (during === "open") showState("not loaded", "bad");
    wantsToPlay = false;
  },
};
worker.onmessage = ({ data }) => answers[data.say](data);
worker.onerror = (event) => {
  showError(`the dance failed: ${event.message || "this browser cannot run it"}`);
};

// A stage holds on to its canvas; the next robot gets another one.
function freshCanvas() {
  const old = byId("scene");
  const fresh = old.cloneNode(true);
  if (stage) old.getContext("webgl2")?.getExtension("WEBGL_lose_context")?.loseContext();
  old.replaceWith(fresh);
  byId("with-human").setAttribute("aria-pressed", "true");
  return fresh;
}

function options(rate_hz) {
  const seed = byId("seed");
  if (seed.value === "" || !seed.checkValidity()) seed.value = 1;
  return { robot: byId("robot").value, style: byId("style").value, seed: Number(seed.value), rate_hz };
}

// Another dance in place of the one before; without samples sound comes later.
function start(music_of, rate_hz, samples) {
  number += 1;
  dance = { number, music_of, song: null, heard_s: 0, spent_s: 0, whole: false };
  ask({ do: "start", number, options: options(rate_hz), samples });
}

// The robot stands and waits for music.
function wait() {
  showState("ready", "good");
  byId("song-name").textContent = "choose one to dance to";
  start("none", 44_100, new Float32Array());
}

// Dances to a song from its beginning.
function begin(song) {
  closeMicrophone();
  showError("");
  start("song", song.rate_hz, song.samples);
  dance.song = song;
  player.load(song.buffer);
  byId("song-name").textContent = song.name;
  byId("time").max = song.buffer.duration;
  byId("play").disabled = byId("time").disabled = false;
  wantsToPlay = true;
}

async function listen() {
  player.pause();
  wantsToPlay = false;
  showError("");
  try {
    microphone = await openMicrophone((samples) => {
      if (dance?.music_of === "live") ask({ do: "hear", number, samples, rate_hz: microphone.rate_hz }, [samples.buffer]);
    });
  } catch (error) {
    return showError(error.message);
  }
  byId("microphone").setAttribute("aria-pressed", "true");
  byId("song-name").textContent = "the microphone";
  byId("play").disabled = byId("time").disabled = true;
  start("live", microphone.rate_hz);
}

function closeMicrophone() {
  microphone?.close();
  microphone = null;
  byId("microphone").setAttribute("aria-pressed", "false");
}

// The same music with what was chosen anew.
function again() {
  if (dance?.song) begin(dance.song);
  else if (dance?.music_of === "live") start("live", microphone.rate_hz);
  else wait();
}

function aboutRobot() {
  const robot = choices.robots.find(({ name }) => name === byId("robot").value);
  byId("about").textContent = robot.description;
}

// What is there of the dance, to draw a moment of it.
function shownEnd_s() {
  return dance?.robot ? Math.min(dance.robot.end_s(), dance.music.end_s()) : 0;
}

// Plays as long as the dance is there; a machine that is too slow makes it wait.
function playIfPossible() {
  if (!dance?.song || !dance.scene) return;
  const ready_s = shownEnd_s() - player.at_s();
  if (player.playing()) {
    if (!dance.whole && ready_s < 0.1) player.pause();
  } else if (wantsToPlay && (dance.whole || ready_s > AHEAD_S)) {
    player.play(() => (wantsToPlay = false));
  }
}

function frameAt(time_s) {
  const { row } = dance.robot.at(time_s);
  const heard = dance.music.at(time_s);
  const links = dance.scene.links.map((_, n) => row.subarray(7 * n, 7 * n + 7));
  // From the human's axes (left, up, forward) to the robot's (forward, left, up).
  const human = [];
  for (let at = choices.heard_row; at < heard.row.length; at += 3) {
    const [x, y, z] = [0, 1, 2].map((n) => heard.row[at + n] + heard.share * (heard.next[at + n] - heard.row[at + n]));
    human.push([z, x, y]);
  }
  const [phase, tempo_bpm, confidence, lock, presence, place, meter] = heard.row;
  const now = (phase + (heard.share * tempo_bpm) / 60 / FRAME_RATE_HZ) % 1;
  const beat = { phase: now, tempo_bpm, confidence, lock: LOCKS[lock], presence, place, meter };
  return { links, human, beat, activity: "dancing" };
}

function showFigures(time_s) {
  const { song, heard_s, spent_s, whole } = dance;
  byId("clock").textContent = song ? `${time_s.toFixed(1)} / ${song.buffer.duration.toFixed(1)} s` : "live";
  if (song && !byId("time").matches(":active")) byId("time").value = time_s;
  byId("play").textContent = wantsToPlay ? "pause" : "play";
  byId("danced").textContent = whole ? "the whole song" : `${heard_s.toFixed(1)} s`;
  if (spent_s > 0) {
    byId("speed").textContent = `${(heard_s / spent_s).toFixed(1)} × real time`;
    byId("rate").textContent = `${((heard_s / spent_s) * FRAME_RATE_HZ).toFixed(0)} computed`;
  }
  const waits = song && wantsToPlay && !player.playing();
  showState(!song ? "listening" : waits ? "getting ready" : wantsToPlay ? "dancing" : "pause", waits ? "warn" : "good");
}

let drawn = null;
function draw() {
  requestAnimationFrame(draw);
  playIfPossible();
  if (!stage || !dance?.scene || shownEnd_s() === 0) return;
  // A microphone's dance is seen as soon as it is there.
  const time_s = dance.song ? Math.min(player.at_s(), shownEnd_s()) : shownEnd_s();
  const moment = `${number} ${time_s}`;
  if (moment !== drawn) {
    const frame = frameAt(time_s);
    stage.show(frame);
    showMusic(frame.beat);
    drawn = moment;
  } else if (stage.turned()) stage.draw();
  if (dance.music_of !== "none") showFigures(time_s);
}

byId("built-in").onclick = () => {
  player.wake();
  songWanted = true;
  ask({ do: "song" });
};
byId("choose").onclick = () => byId("file").click();
byId("microphone").onclick = () => {
  player.wake();
  if (!microphone) return listen();
  closeMicrophone();
  wait();
};
byId("robot").onchange = () => {
  aboutRobot();
  again();
};
byId("style").onchange = byId("seed").onchange = again;
byId("dice").onclick = () => {
  byId("seed").value = Math.floor(Math.random() * 1e6);
  again();
};
byId("volume").oninput = () => player.setVolume(byId("volume").value / 100);
byId("play").onclick = () => {
  player.wake();
  wantsToPlay = !wantsToPlay;
  if (!wantsToPlay) player.pause();
};
byId("time").oninput = () => player.seek(Math.min(Number(byId("time").value), shownEnd_s()));

async function take(file) {
  player.wake();
  try {
    begin(await songOfFile(file));
  } catch (error) {
    showError(error.message);
  }
}
byId("file").onchange = ({ target }) => {
  if (target.files[0]) take(target.files[0]);
  target.value = "";
};
for (const kind of ["dragover", "dragleave", "drop"]) {
  addEventListener(kind, (event) => {
    event.preventDefault();
    document.body.classList.toggle("over", kind === "dragover");
    const file = event.dataTransfer?.files[0];
    if (kind === "drop" && file && choices.robots) take(file);
  });
}

// For tests, and for whoever wants the numbers.
globalThis.servodance = { dance: () => dance };
ask({ do: "open" });
draw();
