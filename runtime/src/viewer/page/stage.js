// The robot and its human in 3-D: unit shapes, one light, a camera to turn.

import { handlePointer, viewOf } from "./camera.js";
import { between, distance, fromPose, multiply } from "./matrix.js";
import { makePainter } from "./painter.js";

const HUMAN = [1.0, 0.69, 0.4, 1];
const GRID = [0.16, 0.19, 0.24, 1];
const FLOOR = [0.105, 0.125, 0.165];
const SHADOW = [0.062, 0.074, 0.1, 1];
// Where the light comes from; shadows are cast along it.
const LIGHT = [0.4, -0.25, 1];
const SHELL = [0.5, 0.58, 0.7, 1];
const STICK = [0.55, 0.6, 0.68, 1];
const HUMAN_M = 1.7;
const HEAD = 15;
const upright = (at) => fromPose([...at, 0, 0, 0, 1]);

export function makeStage(canvas, scene) {
  const gl = canvas.getContext("webgl2", { antialias: true });
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
    const ratio = Math.min(devicePixelRatio, 2);
    canvas.width = Math.max(1, canvas.clientWidth * ratio);
    canvas.height = Math.max(1, canvas.clientHeight * ratio);
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
    painter.look(viewOf(camera, [0, beside / 2, floor + height / 2], height, canvas));
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

// A shape of the scene as what the painter draws.
function robotPart(shape) {
  // A shape without a colour of its own says so by being transparent.
  const plain = (rgba) => rgba[3] === 0;
  const light = (rgba) => (plain(rgba) ? SHELL : [...rgba.slice(0, 3).map((part) => 0.16 + 0.8 * part), 1]);
  if (shape.stick) {
    const long = Math.max(distance([0, 0, 0], shape.stick), 1e-4);
    const size = [shape.radius, shape.radius, long];
    return { shape: "cylinder", link: shape.link, pose: between([0, 0, 0], shape.stick), size, colour: STICK };
  }
  const part = { link: shape.link, pose: fromPose(shape.pose), colour: light(shape.rgba) };
  if ("mesh" in shape) return { ...part, shape: `mesh ${shape.mesh}`, size: shape.scale, bounds: shape.bounds };
  if (shape.box) return { ...part, shape: "box", size: shape.box };
  if (shape.cylinder) {
    const [radius, long] = shape.cylinder;
    return { ...part, shape: "cylinder", size: [radius, radius, long] };
  }
  return { ...part, shape: "ball", size: [shape.sphere, shape.sphere, shape.sphere] };
}

// Where the lowest part is, and how tall all of them are.
function extent(parts) {
  let [low, high] = [Infinity, -Infinity];
  for (const { shape, world, size, bounds } of parts) {
    if (bounds) {
      for (let corner = 0; corner < 8; corner++) {
        const at = [0, 1, 2].map((axis) => bounds[(corner >> axis) & 1][axis] * size[axis]);
        const z = world[2] * at[0] + world[6] * at[1] + world[10] * at[2] + world[14];
        low = Math.min(low, z);
        high = Math.max(high, z);
      }
      continue;
    }
    const half = shape === "box" ? 0.5 : 1;
    const sides = [half * size[0], half * size[1], shape === "ball" ? size[2] : 0.5 * size[2]];
    const reach = Math.abs(world[2]) * sides[0] + Math.abs(world[6]) * sides[1] + Math.abs(world[10]) * sides[2];
    low = Math.min(low, world[14] - reach);
    high = Math.max(high, world[14] + reach);
  }
  return Number.isFinite(low) ? { floor: low, height: Math.max(high - low, 0.05) } : { floor: 0, height: 0.5 };
}

// Everything flat on the floor, along the light.
function shadowOn(floor) {
  const [x, y] = [LIGHT[0] / LIGHT[2], LIGHT[1] / LIGHT[2]];
  return new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, -x, -y, 0, 0, x * floor, y * floor, floor, 1]);
}

// A round floor that lights up on the beat.
function drawFloor(painter, floor, height, beside, beat) {
  const step = height / 3;
  const thick = height / 500;
  const glow = beat.lock === "lost" ? 0 : 0.5 * Math.exp(-4 * beat.phase) * beat.confidence;
  const wide = 1.9 * height;
  painter.lit(false);
  painter.draw("cylinder", upright([0, beside / 2, floor - thick]), [wide, wide, thick], [...FLOOR.map((part) => part * (1 + glow)), 1]);
  painter.lit(true);
  for (let n = -5; n <= 5; n++) {
    const half = Math.sqrt(wide * wide - n * step * n * step);
    for (const [from, to] of [
      [[n * step, beside / 2 - half, floor], [n * step, beside / 2 + half, floor]],
      [[-half, beside / 2 + n * step, floor], [half, beside / 2 + n * step, floor]],
    ]) {
      painter.draw("box", between(from, to), [thick, thick, distance(from, to)], GRID);
    }
  }
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
