// Puts the page together: one connection, one frame at a time.

import { connect } from "./connection.js";
import { makeControls } from "./controls.js";
import { makePanels } from "./panels.js";
import { showLinks } from "./links.js";
import { makeSongs } from "./songs.js";
import { makeSound } from "./sound.js";
import { makeStage } from "./stage.js";
import { makeStop } from "./stop.js";

const KEPT = 30;
const byId = (id) => document.getElementById(id);

async function start() {
  const scene = await (await fetch("api/scene")).json();
  byId("robot").textContent = scene.robot;
  document.title = `${scene.robot} · servodance`;
  const stage = makeStage(byId("scene"), scene);
  const panels = makePanels(scene);
  let newest = null;
  // Frames of the last second: what is heard now may have been said a moment ago.
  let frames = [];
  let news = "";
  const sound = makeSound(byId("sound"), scene.speaker);
  const songs = makeSongs(byId("songs"), scene);
  const connection = connect({
    operator: scene.operator,
    onFrame(frame) {
      newest = frame;
      frames = [...frames.slice(-KEPT), frame];
      sound.hear(frame);
      songs.show(frame);
      controls.show(frame);
    },
    onRefused(why) {
      byId("refused").textContent = why;
    },
    onSilence(seconds) {
      const text = silence(newest, seconds);
      document.body.classList.toggle("silent", text !== "");
      byId("link").hidden = text === "";
      if (text !== news) byId("link").textContent = news = text;
    },
  });
  const stop = makeStop(byId("estop"), connection);
  const controls = makeControls(scene, connection, stop);
  byId("role").hidden = scene.operator;
  if (scene.operator) showLinks(byId("links"));
  const heard = () => {
    const music_s = sound.heard_s();
    if (music_s === null) return newest;
    return frames.findLast((frame) => frame.music_s <= music_s) ?? frames[0];
  };
  // Drawn when the browser wants to draw; frames in between are skipped.
  let drawn = null;
  const draw = () => {
    const shown = heard();
    if (shown && shown !== drawn) {
      panels.show(shown, newest);
      stage.show(shown);
      drawn = shown;
    } else if (stage.turned()) {
      stage.draw();
    }
    requestAnimationFrame(draw);
  };
  draw();
}

// What is said while nothing new comes: from the program, or from the robot's control loop.
function silence(frame, seconds) {
  if (!frame) return seconds > 0 ? "no connection" : "";
  if (seconds > 0) {
    const over = frame.activity === "over" && frame.safety === "disarmed";
    return over ? "the program has ended" : `no news for ${seconds.toFixed(1)} s`;
  }
  // Before torque and after it no control loop runs.
  const idle = frame.safety === "disarmed" && ["starting", "over"].includes(frame.activity);
  return frame.age_s > 0.5 && !idle ? `no news from the robot for ${frame.age_s.toFixed(1)} s` : "";
}

start().catch((error) => {
  byId("link").hidden = false;
  byId("link").textContent = "no connection";
  throw error;
});
