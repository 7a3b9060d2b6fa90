// 4 by 4 matrices, column after column as WebGL takes them; z is up.

// A rigid pose [x, y, z, qx, qy, qz, qw].
export function fromPose([x, y, z, i, j, k, w]) {
  return new Float32Array([
    1 - 2 * (j * j + k * k), 2 * (i * j + k * w), 2 * (i * k - j * w), 0,
    2 * (i * j - k * w), 1 - 2 * (i * i + k * k), 2 * (j * k + i * w), 0,
    2 * (i * k + j * w), 2 * (j * k - i * w), 1 - 2 * (i * i + j * j), 0,
    x, y, z, 1,
  ]);
}

export function multiply(a, b) {
  const out = new Float32Array(16);
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 4; row++) {
      let sum = 0;
      for (let n = 0; n < 4; n++) sum += a[n * 4 + row] * b[column * 4 + n];
      out[column * 4 + row] = sum;
    }
  }
  return out;
}

const minus = (a, b) => a.map((value, n) => value - b[n]);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a) => Math.hypot(...a);
const unit = (a) => a.map((value) => value / (length(a) || 1));

// Centre between two points, z along the way from one to the other.
export function between(from, to) {
  const z = unit(minus(to, from));
  const x = unit(cross(Math.abs(z[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0], z));
  const y = cross(z, x);
  const at = from.map((value, n) => (value + to[n]) / 2);
  return new Float32Array([...x, 0, ...y, 0, ...z, 0, ...at, 1]);
}

export const distance = (a, b) => length(minus(a, b));

export function lookAt(eye, target) {
  const back = unit(minus(eye, target));
  const right = unit(cross([0, 0, 1], back));
  const up = cross(back, right);
  return new Float32Array([
    right[0], up[0], back[0], 0,
    right[1], up[1], back[1], 0,
    right[2], up[2], back[2], 0,
    -dot(right, eye), -dot(up, eye), -dot(back, eye), 1,
  ]);
}

export function perspective(fovY, aspect, near, far) {
  const f = 1 / Math.tan(fovY / 2);
  return new Float32Array([
    f / aspect, 0, 0, 0,
    0, f, 0, 0,
    0, 0, (far + near) / (near - far), -1,
    0, 0, (2 * far * near) / (near - far), 0,
  ]);
}
