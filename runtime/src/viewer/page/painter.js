// Draws unit shapes with WebGL: each with a pose, a size and a colour, one light.

import { ball, box, cylinder } from "./shapes.js";

const VERTEX = `#version 300 es
in vec3 at; in vec3 normal;
uniform mat4 world, view; uniform vec3 size;
out vec3 facing;
void main() {
  facing = mat3(world) * (normal / size);
  gl_Position = view * world * vec4(at * size, 1.0);
}`;
const FRAGMENT = `#version 300 es
precision mediump float;
in vec3 facing; uniform vec4 colour; uniform float light; out vec4 shown;
void main() {
  vec3 n = normalize(facing);
  float sky = 0.5 + 0.5 * n.z;
  float sun = max(dot(n, normalize(vec3(0.7, -0.4, 0.8))), 0.0);
  shown = vec4(colour.rgb * mix(1.0, 0.35 + 0.3 * sky + 0.55 * sun, light), colour.a);
}`;

export function makePainter(gl) {
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  gl.useProgram(program);
  gl.enable(gl.DEPTH_TEST);
  const place = (name) => gl.getUniformLocation(program, name);
  const [world, view, size, colour, light] = ["world", "view", "size", "colour", "light"].map(place);
  gl.uniform1f(light, 1);
  const shapes = {};
  // Six numbers a corner: position and normal.
  function add(name, corners) {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    ["at", "normal"].forEach((attribute, n) => {
      const slot = gl.getAttribLocation(program, attribute);
      gl.enableVertexAttribArray(slot);
      gl.vertexAttribPointer(slot, 3, gl.FLOAT, false, 24, 12 * n);
    });
    shapes[name] = { array, count: corners.length / 6 };
  }
  for (const [name, corners] of Object.entries({ box: box(), cylinder: cylinder(), ball: ball() })) add(name, corners);
  return {
    add,
    // Whether what is drawn from now on is lit, or has its colour on all sides.
    lit: (on) => gl.uniform1f(light, on ? 1 : 0),
    look: (matrix) => gl.uniformMatrix4fv(view, false, matrix),
    draw(name, pose, sides, rgba) {
      if (!shapes[name]) return; // a mesh that is still on its way
      gl.bindVertexArray(shapes[name].array);
      gl.uniformMatrix4fv(world, false, pose);
      gl.uniform3fv(size, sides);
      gl.uniform4fv(colour, rgba);
      gl.drawArrays(gl.TRIANGLES, 0, shapes[name].count);
    },
  };
}
