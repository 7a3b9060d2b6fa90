// The robot and its human in 3-D: unit shapes, one light, a camera to turn.

import { handlePointer, viewOf } from "./camera.js";
import { SHADOW, drawFloor, shadowOn, upright } from "./floor.js";
import { between, distance, fromPose, multiply } from "./matrix.js";
import { makePainter } from "./painter.js";
import { openCanvas } from "./pixels.js";
import { extent, reach, robotPart } from "./robot.js";

const HUMAN = [1.0, 0.69, 0.4, 1];
const HUMAN_M = 1.7;
const HEAD = 15;

export function makeStage(canvas, scene) {
  const { gl, ratio } = openCanvas(canvas);
  if (!gl) {
    document.getElementById("seen").textContent = "(this browser cannot draw in 3-D)";
    return { show() {}, draw() {}, turned: () => false };
  }
  const painter = makePainter(gl);
  const robot = scene.shapes.map(robotPart);
  const meshes = new Set(scene.shapes.filter((shape) => "mesh" in shape).map((shape) => shape.mesh));
  const camera = { yaw: 0.5, pitch: 0.16, zoom: 1, turned: true, human: true };
  makeLooks(canvas, camera);
  handlePointer(canvas, camera);
  new ResizeObserver(() => (camera.turned = true)).observe(canvas);
  let frame = null;
  let ground = null;
  let stands = false;
  for (const mesh of meshes) fetchMesh(mesh).then((corners) => {
    painter.add(`mesh ${mesh}`, corners);
    camera.turned = true;
  });

  function draw() {
    camera.turned = false;
    canvas.width = Math.max(1, canvas.clientWidth * ratio());
    canvas.height = Math.max(1, canvas.clientHeight * ratio());
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.078, 0.094, 0.122, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (!frame) return;
    const links = frame.links.map(fromPose);
    const parts = robot.map((part) => ({ ...part, world: multiply(links[part.link], part.pose) }));
    // Before torque nobody knows where the robot stands.
    if (!stands && frame.activity !== "waiting" && frame.activity !== "starting") [ground, stands] = [null, true];
    ground ??= extent(parts);
    const { floor, height } = ground;
    const beside = camera.human ? 0.9 * height : 0;
    // An arm reaches farther than it is high: the picture grows with what it has shown.
    ground.side = Math.max(ground.side ?? 0, Math.min(reach(parts) + 0.1 * height, 2 * height));
    painter.look(viewOf(camera, [0, beside / 2, floor + height / 2], height, canvas, beside / 2 + ground.side));
    drawFloor(painter, floor, height, beside, frame.beat);
    if (frame.human && camera.human) parts.push(...humanParts(scene.bones, frame.human, floor, height, beside));
    const flat = shadowOn(floor + height / 600);
    painter.lit(false);
    for (const part of parts) painter.draw(part.shape, multiply(flat, part.world), part.size, SHADOW);
    painter.lit(true);
    for (const part of parts) painter.draw(part.shape, part.world, part.size, part.colour);
  }

  return {
    show(next) {
      frame = next;
      draw();
    },
    draw,
    turned: () => camera.turned,
  };
}

// Buttons on the picture: without the human, and as large as the screen.
function makeLooks(canvas, camera) {
  const [human, full] = ["with-human", "full-screen"].map((id) => document.getElementById(id));
  human.onclick = () => {
    camera.human = !camera.human;
    camera.turned = true;
    human.setAttribute("aria-pressed", camera.human);
  };
  // Where it is not allowed there is no such button.
  full.hidden = !document.fullscreenEnabled;
  full.onclick = () => (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen());
  addEventListener("fullscreenchange", () => document.body.classList.toggle("full", document.fullscreenElement !== null));
}

// The page's own connection may be refused while many are open: once more then.
async function fetchMesh(mesh) {
  for (let tries = 0; tries < 60; tries++) {
    try {
      const answer = await fetch(`api/mesh/${mesh}`);
      if (answer.ok) return new Float32Array(await answer.arrayBuffer());
    } catch {
      // Nobody answered.
    }
    await new Promise((later) => setTimeout(later, 1000));
  }
  return new Float32Array();
}

// As tall as the robot, and always on its left: the robot stays on the spot.
function humanParts(bones, human, floor, height, beside) {
  const scale = height / HUMAN_M;
  const [x, y] = human[0];
  const lowest = Math.min(...human.map((point) => point[2]), 0);
  const at = human.map((p) => [(p[0] - x) * scale, (p[1] - y) * scale + beside, (p[2] - lowest) * scale + floor]);
  const thick = 0.032 * height;
  const part = (shape, world, size) => ({ shape, world, size, colour: HUMAN });
  const limbs = bones.flatMap(([from, to]) => [
    part("cylinder", between(at[from], at[to]), [thick * 0.7, thick * 0.7, distance(at[from], at[to])]),
    part("ball", upright(at[to]), [thick, thick, thick]),
  ]);
  return [...limbs, part("ball", upright(at[HEAD]), [thick * 2, thick * 2, thick * 2.4])];
}
