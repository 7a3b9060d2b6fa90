// Puts the page together: one connection, one frame at a time.

import { connect } from "./connection.js";
import { makeControls } from "./controls.js";
import { makePanels } from "./panels.js";
import { makeStage } from "./stage.js";

const byId = (id) => document.getElementById(id);

async function start() {
  const scene = await (await fetch("api/scene")).json();
  byId("robot").textContent = scene.robot;
  document.title = `${scene.robot} · servodance`;
  const stage = makeStage(byId("scene"), scene);
  const panels = makePanels(scene);
  let newest = null;
  const connection = connect({
    onFrame(frame) {
      newest = frame;
      controls.show(frame);
    },
    onRefused(why) {
      byId("refused").textContent = why;
    },
    onLink(up) {
      byId("link").hidden = up;
      document.body.classList.toggle("lost", !up);
    },
  });
  const controls = makeControls(scene, connection);
  // Drawn when the browser wants to draw; frames in between are skipped.
  let drawn = null;
  const draw = () => {
    if (newest && newest !== drawn) {
      panels.show(newest);
      stage.show(newest);
      drawn = newest;
    } else if (stage.turned()) {
      stage.draw();
    }
    requestAnimationFrame(draw);
  };
  draw();
}

start().catch((error) => {
  byId("link").hidden = false;
  byId("link").textContent = "no connection";
  throw error;
});
