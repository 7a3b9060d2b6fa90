// Triangles of unit shapes: box and cylinder from -1/2 to 1/2, ball of radius 1.
// Each corner is a position and a normal.

const AROUND = 20;
const UP = 10;

export function box() {
  const corners = [];
  for (const axis of [0, 1, 2]) {
    for (const sign of [-1, 1]) {
      const at = (u, v) => {
        const p = [0, 0, 0];
        p[axis] = sign / 2;
        p[(axis + 1) % 3] = u / 2;
        p[(axis + 2) % 3] = v / 2;
        const n = [0, 0, 0];
        n[axis] = sign;
        return [...p, ...n];
      };
      corners.push(...quad(at(-1, -1), at(1, -1), at(1, 1), at(-1, 1)));
    }
  }
  return new Float32Array(corners);
}

export function cylinder() {
  const corners = [];
  const point = (turn, z, normal) => {
    const [x, y] = [Math.cos(turn), Math.sin(turn)];
    return [x, y, z, ...(normal ?? [x, y, 0])];
  };
  for (let step = 0; step < AROUND; step++) {
    const [a, b] = [step, step + 1].map((n) => (n / AROUND) * 2 * Math.PI);
    corners.push(...quad(point(a, -0.5), point(b, -0.5), point(b, 0.5), point(a, 0.5)));
    for (const z of [-0.5, 0.5]) {
      const normal = [0, 0, Math.sign(z)];
      corners.push(0, 0, z, ...normal, ...point(a, z, normal), ...point(b, z, normal));
    }
  }
  return new Float32Array(corners);
}

export function ball() {
  const corners = [];
  const point = (i, j) => {
    const turn = (i / AROUND) * 2 * Math.PI;
    const rise = (j / UP) * Math.PI;
    const p = [Math.sin(rise) * Math.cos(turn), Math.sin(rise) * Math.sin(turn), Math.cos(rise)];
    return [...p, ...p];
  };
  for (let i = 0; i < AROUND; i++) {
    for (let j = 0; j < UP; j++) {
      corners.push(...quad(point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)));
    }
  }
  return new Float32Array(corners);
}

const quad = (a, b, c, d) => [...a, ...b, ...c, ...a, ...c, ...d];
