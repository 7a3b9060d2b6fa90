// A robot's shapes as what the painter draws, and how much room they take.

import { between, distance, fromPose } from "./matrix.js";

const SHELL = [0.5, 0.58, 0.7, 1];
const STICK = [0.55, 0.6, 0.68, 1];

// A shape of the scene as what the painter draws.
export function robotPart(shape) {
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

// How far parts are from the middle, level.
export function reach(parts) {
  return Math.max(0, ...parts.map(({ world }) => Math.hypot(world[12], world[13])));
}

// Where the lowest part is, and how tall all of them are.
export function extent(parts) {
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
