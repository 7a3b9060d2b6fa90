// Buttons, fields and keys. What the program says is what is shown, except in
// a field that somebody is changing.

import { stopByKeys } from "./stop.js";

const byId = (id) => document.getElementById(id);

export function makeControls(scene, { ask }, stop) {
  const [amplitude, idle, seed, mirror] = ["amplitude", "idle", "seed", "mirror"].map(byId);
  const estop = byId("estop");
  const playing = scene.recording_s !== null;
  const steers = scene.operator && !playing;
  const styles = scene.styles.map((name) => {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: name });
    button.onclick = () => set({ style: name });
    return button;
  });
  byId("styles").append(...styles);
  for (const name of scene.idle) idle.append(new Option(name, name));
  byId("controls").hidden = !steers;
  byId("stopping").hidden = !steers;

  const set = (wanted) => ask({ set: wanted });
  amplitude.oninput = () => set({ amplitude: amplitude.value / 100 });
  idle.onchange = () => set({ idle: idle.value });
  mirror.onchange = () => set({ mirror: mirror.checked });
  seed.onchange = () => {
    if (seed.value !== "" && seed.checkValidity()) set({ seed: Number(seed.value) });
  };
  byId("dice").onclick = () => set({ seed: Math.floor(Math.random() * 1e6) });

  const actions = [...document.querySelectorAll("[data-do]")];
  for (const button of actions) button.onclick = () => ask({ do: button.dataset.do });
  estop.onclick = stop.press;
  if (steers) {
    addEventListener("keydown", (event) => {
      if (event.repeat) return;
      if (event.key === "t" && !event.target.matches("input, select")) ask({ do: "tap" });
    });
    stopByKeys(stop);
  }

  const player = makePlayer(scene, ask);

  function show(frame) {
    const { settings, activity } = frame;
    const waiting = activity === "waiting";
    const free = (field) => document.activeElement !== field;
    if (!amplitude.matches(":active")) amplitude.value = Math.round(settings.amplitude * 100);
    byId("amplitude-now").textContent = `${Math.round(frame.amplitude * 100)} %`;
    for (const button of styles) {
      button.setAttribute("aria-pressed", button.textContent === settings.style);
    }
    if (free(idle)) idle.value = settings.idle;
    if (free(seed)) seed.value = settings.seed;
    mirror.checked = settings.mirror;
    const possible = {
      start: waiting && !frame.estop,
      hold: !waiting && !frame.hold && activity !== "over",
      resume: !waiting && frame.hold,
      stop: !waiting && activity !== "over" && activity !== "finale",
      release: waiting && frame.estop,
      tap: !waiting && activity !== "over",
    };
    for (const button of actions) {
      const { do: name } = button.dataset;
      button.disabled = !possible[name];
      button.hidden = !scene.waits && (name === "start" || name === "release");
    }
    if (steers) stop.show(frame);
    player.show(frame);
  }
  return { show };
}

// The slider of a recording.
function makePlayer(scene, ask) {
  if (scene.recording_s === null) return { show() {} };
  const [play, time, clock] = ["play", "time", "clock"].map(byId);
  const [first, last] = scene.recording_s;
  byId("player").hidden = false;
  play.hidden = time.disabled = !scene.operator;
  time.min = first;
  time.max = last;
  let held = false;
  if (!scene.operator) return { show };
  time.oninput = () => ask({ set: { time_s: Number(time.value) } });
  play.onclick = () => ask({ do: held ? "resume" : "hold" });
  addEventListener("keydown", (event) => {
    if (event.key === " " && !event.target.matches("button, input, select")) {
      event.preventDefault();
      play.onclick();
    }
  });
  return { show };

  function show(frame) {
    held = frame.hold;
    play.textContent = held ? "play" : "pause";
    if (!time.matches(":active")) time.value = frame.music_s;
    clock.textContent = `${frame.music_s.toFixed(1)} / ${last.toFixed(1)} s`;
  }
}
