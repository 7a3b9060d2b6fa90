// All robots of a stage in 3-D, side by side, each as tall as the others.

import { handlePointer, viewOf } from "./camera.js";
import { SHADOW, drawFloor, shadowOn } from "./floor.js";
import { fromPose, multiply } from "./matrix.js";
import { makePainter } from "./painter.js";
import { openCanvas } from "./pixels.js";
import { extent, robotPart } from "./robot.js";

const APART = 0.95;

export function makeRobots(canvas, names) {
  const { gl, ratio } = openCanvas(canvas);
  if (!gl) {
    names.textContent = "This browser cannot draw in 3-D.";
    return { show() {}, draw() {}, turned: () => false, count: () => 0 };
  }
  const painter = makePainter(gl);
  const camera = { yaw: 0.25, pitch: 0.14, zoom: 1, turned: true };
  handlePointer(canvas, camera);
  new ResizeObserver(() => (camera.turned = true)).observe(canvas);
  // What is known of a robot: its look's number and shapes, and how tall it stands.
  const known = new Map();
  const labels = new Map();
  let shown = { robots: [], beat: { lock: "lost" } };

  async function fetchLook(id, look) {
    const robot = { look, parts: null, ground: null };
    known.set(id, robot);
    const answer = await fetch(`api/part/${id}`);
    if (answer.ok) robot.parts = (await answer.json()).shapes.map(robotPart);
    else known.delete(id);
    camera.turned = true;
  }

  // The robots that can be drawn, each with its parts where they are.
  function placed() {
    const there = shown.robots.filter((robot) => robot.links && known.get(robot.id)?.parts);
    return there.map((robot, place) => {
      const about = known.get(robot.id);
      const links = robot.links.map(fromPose);
      const parts = about.parts.map((part) => ({ ...part, world: multiply(links[part.link], part.pose) }));
      // Before torque nobody knows where a robot stands.
      const stands = robot.safety === "running";
      if (!about.ground || (stands && !about.stands)) [about.ground, about.stands] = [extent(parts), stands];
      const { floor, height } = about.ground;
      const y = (place - (there.length - 1) / 2) * APART;
      const size = 1 / height;
      const at = new Float32Array([size, 0, 0, 0, 0, size, 0, 0, 0, 0, size, 0, 0, y, -floor * size, 1]);
      return { robot, y, parts: parts.map((part) => ({ ...part, world: multiply(at, part.world) })) };
    });
  }

  function draw() {
    camera.turned = false;
    canvas.width = Math.max(1, canvas.clientWidth * ratio());
    canvas.height = Math.max(1, canvas.clientHeight * ratio());
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.078, 0.094, 0.122, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const robots = placed();
    const wide = Math.max(1, robots.length) * APART;
    const aspect = canvas.width / canvas.height;
    // Far enough away for all of them, however wide the picture is.
    const tall = Math.max(0.95, (wide + 0.3) / (1.58 * Math.max(aspect, 1.4)));
    const view = viewOf(camera, [0, 0, 0.5], tall, canvas);
    painter.look(view);
    drawFloor(painter, 0, 1, 0, shown.beat, Math.max(1.9, 0.9 + wide / 2));
    const parts = robots.flatMap((robot) => robot.parts);
    const flat = shadowOn(1 / 600);
    painter.lit(false);
    for (const part of parts) painter.draw(part.shape, multiply(flat, part.world), part.size, SHADOW);
    painter.lit(true);
    for (const part of parts) painter.draw(part.shape, part.world, part.size, part.colour);
    label(robots, view);
  }

  function label(robots, view) {
    const there = new Set(robots.map(({ robot }) => robot.id));
    for (const [id, element] of labels) {
      if (there.has(id)) continue;
      element.remove();
      labels.delete(id);
    }
    for (const { robot, y } of robots) {
      let element = labels.get(robot.id);
      if (!element) {
        element = document.createElement("span");
        labels.set(robot.id, element);
        names.append(element);
      }
      if (element.textContent !== robot.name) element.textContent = robot.name;
      const [x, top, w] = [0, 1, 3].map((row) => view[row + 4] * y + view[row + 8] * 1.12 + view[row + 12]);
      element.style.left = `${50 + (50 * x) / w}%`;
      element.style.top = `${50 - (50 * top) / w}%`;
    }
  }

  return {
    show(frame) {
      shown = frame;
      for (const { id, look } of frame.robots) {
        if (look && known.get(id)?.look !== look) fetchLook(id, look);
      }
      draw();
    },
    draw,
    turned: () => camera.turned,
    count: () => placed().length,
  };
}
