// The floor: it lights up on the beat, and shadows fall on it.

import { between, distance, fromPose } from "./matrix.js";

const GRID = [0.16, 0.19, 0.24, 1];
const FLOOR = [0.105, 0.125, 0.165];
// Where the light comes from; shadows are cast along it.
const LIGHT = [0.4, -0.25, 1];
export const SHADOW = [0.062, 0.074, 0.1, 1];
export const upright = (at) => fromPose([...at, 0, 0, 0, 1]);

// Everything flat on the floor, along the light.
export function shadowOn(floor) {
  const [x, y] = [LIGHT[0] / LIGHT[2], LIGHT[1] / LIGHT[2]];
  return new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, -x, -y, 0, 0, x * floor, y * floor, floor, 1]);
}

// A round floor that lights up on the beat, around a point beside the robot.
export function drawFloor(painter, floor, height, beside, beat, wide = 1.9 * height) {
  const step = height / 3;
  const thick = height / 500;
  const glow = beat.lock === "lost" ? 0 : 0.5 * Math.exp(-4 * beat.phase) * beat.confidence;
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
