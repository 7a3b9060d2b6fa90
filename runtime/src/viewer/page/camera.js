// A camera that goes around the middle of the stage.

import { lookAt, multiply, perspective } from "./matrix.js";

// `half`: how far what is seen reaches to each side of the target.
export function viewOf(camera, target, height, canvas, half = 0) {
  const aspect = canvas.width / canvas.height;
  const width = 1.4 * Math.max(1, half / (1.1 * height));
  const far = (2.35 * height * Math.max(1, width / aspect)) / camera.zoom;
  const level = Math.cos(camera.pitch);
  const eye = [
    target[0] + far * level * Math.cos(camera.yaw),
    target[1] + far * level * Math.sin(camera.yaw),
    target[2] + far * Math.sin(camera.pitch),
  ];
  return multiply(perspective(0.65, aspect, 0.02 * height, 40 * height), lookAt(eye, target));
}

// Drag turns, wheel and two fingers come nearer, arrow keys do both.
export function handlePointer(canvas, camera) {
  const fingers = new Map();
  const turn = (yaw, pitch) => {
    camera.yaw -= yaw;
    camera.pitch = Math.min(Math.max(camera.pitch + pitch, -0.2), 1.5);
    camera.turned = true;
  };
  const nearer = (factor) => {
    camera.zoom = Math.min(Math.max(camera.zoom * factor, 0.3), 6);
    camera.turned = true;
  };
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  };
  canvas.onpointerdown = (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  };
  canvas.onpointermove = (event) => {
    const last = fingers.get(event.pointerId);
    if (!last) return;
    const before = fingers.size === 2 ? spread() : 0;
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (fingers.size === 1) turn((event.clientX - last[0]) * 0.008, (event.clientY - last[1]) * 0.008);
    else if (fingers.size === 2) nearer(spread() / (before || 1));
  };
  canvas.onpointerup = canvas.onpointercancel = (event) => fingers.delete(event.pointerId);
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    nearer(Math.exp(-event.deltaY * 0.001));
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const keys = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
    if (keys[event.key]) {
      event.preventDefault();
      turn(...keys[event.key]);
    } else if (event.key === "+" || event.key === "-") nearer(event.key === "+" ? 1.15 : 1 / 1.15);
  });
}
