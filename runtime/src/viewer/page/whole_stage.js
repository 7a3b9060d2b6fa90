// The page of a whole stage: every robot, the timeline, cues.

import { connect } from "./connection.js";
import { makeCues } from "./cues.js";
import { showLinks } from "./links.js";
import { makeRobots } from "./robots.js";
import { makeSound } from "./sound.js";
import { makeStop, stopByKeys } from "./stop.js";
import { makeTimeline } from "./timeline.js";

const byId = (id) => document.getElementById(id);

async function start() {
  const scene = await (await fetch("api/scene")).json();
  byId("stage-name").textContent = `stage ${scene.stage}`;
  document.title = `stage ${scene.stage} · servodance`;
  const robots = makeRobots(byId("scene"), byId("names"));
  const sound = makeSound(byId("sound"));
  let newest = null;
  let connection = null;
  const ask = (request) => connection.ask(request);
  const timeline = makeTimeline(byId("timeline"), byId("moment"), byId("cue-list"), scene, ask);
  const cues = makeCues(byId("cues"), scene, ask, timeline.moment);
  connection = connect({
    operator: scene.operator,
    onFrame(frame) {
      newest = frame;
      if (frame.music_s !== null) sound.hear(frame);
    },
    onRefused: (why) => (byId("refused").textContent = why),
    onSilence(seconds) {
      const text = seconds === 0 ? "" : newest ? `no news for ${seconds.toFixed(1)} s` : "no connection";
      document.body.classList.toggle("silent", text !== "");
      byId("link").hidden = text === "";
      byId("link").textContent = text;
    },
  });
  const stop = makeStop(byId("estop"), connection);
  byId("estop").onclick = stop.press;
  byId("stopping").hidden = !scene.operator;
  if (scene.operator) stopByKeys(stop);
  byId("role").hidden = scene.operator;
  byId("save").hidden = byId("end").hidden = !scene.operator;
  byId("end").onclick = () => ask({ do: "end" });
  if (scene.operator) showLinks(byId("links"));
  let drawn = null;
  let pictures = [];
  const draw = () => {
    if (newest && newest !== drawn) {
      drawn = newest;
      robots.show(newest);
      cues.show(newest);
      timeline.show(newest);
      showNow(newest);
      if (scene.operator) stop.show(newest);
      // Pictures of the last second, for whoever asks how smooth it is.
      const now = performance.now();
      pictures = [...pictures.filter((at) => at > now - 1000), now];
      byId("scene").dataset.pictures = pictures.length;
      byId("scene").dataset.robots = robots.count();
    } else if (robots.turned()) robots.draw();
    requestAnimationFrame(draw);
  };
  draw();
}

function showNow({ robots, beat, music_s }) {
  const heard = beat.lock !== "lost" && beat.tempo_bpm > 0;
  const place = heard && beat.place !== null ? `, beat ${beat.place} of ${beat.meter}` : "";
  byId("beat").textContent = heard ? `${beat.tempo_bpm.toFixed(0)} BPM${place}` : "no beat";
  const waits = music_s === null || music_s < 0;
  byId("clock").textContent = waits ? "before the music" : `${music_s.toFixed(1)} s`;
  const count = robots.length;
  byId("count").textContent = count === 0 ? "no robot follows yet" : `${count} ${count === 1 ? "robot" : "robots"}`;
}

start().catch((error) => {
  byId("link").hidden = false;
  byId("link").textContent = "no connection";
  throw error;
});
