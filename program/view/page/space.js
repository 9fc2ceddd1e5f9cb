// SPDX-License-Identifier: MIT
// Calculate with vectors, quaternions [x, y, z, w] and column-major 4 x 4 matrices.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => {
  const length = Math.sqrt(a.reduce((sum, x) => sum + x * x, 0));
  return a.map((x) => x / length);
};

const IDENTITY = [0, 0, 0, 1];

const turn = (axis, angle) => {
  const s = Math.sin(angle / 2);
  return [axis[0] * s, axis[1] * s, axis[2] * s, Math.cos(angle / 2)];
};

/** Return the quaternion of the rotation by b, followed by a. */
const compose = (a, b) =>
  unit([
    a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
    a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
    a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
    a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
  ]);

const inverse = (q) => [-q[0], -q[1], -q[2], q[3]];

const rotate = (q, v) => {
  const t = cross(q, v);
  const u = cross(q, t);
  return [v[0] + 2 * (q[3] * t[0] + u[0]), v[1] + 2 * (q[3] * t[1] + u[1]), v[2] + 2 * (q[3] * t[2] + u[2])];
};

function slerp(a, b, t) {
  let cosine = a.reduce((sum, x, i) => sum + x * b[i], 0);
  const sign = cosine < 0 ? -1 : 1;
  cosine = Math.min(1, Math.abs(cosine));
  const angle = Math.acos(cosine);
  const [p, q] =
    angle < 1e-4 ? [1 - t, t] : [Math.sin((1 - t) * angle) / Math.sin(angle), Math.sin(t * angle) / Math.sin(angle)];
  return unit(a.map((x, i) => p * x + sign * q * b[i]));
}

/** Return the matrix that rotates by the quaternion q, then adds `offset`. */
function rigid(q, offset) {
  const columns = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
  ].map((axis) => rotate(q, axis));
  return new Float32Array([...columns[0], 0, ...columns[1], 0, ...columns[2], 0, ...offset, 1]);
}

function perspective(fieldOfView, aspect, near, far) {
  const f = 1 / Math.tan(fieldOfView / 2);
  return new Float32Array([
    f / aspect,
    0,
    0,
    0,
    0,
    f,
    0,
    0,
    0,
    0,
    (far + near) / (near - far),
    -1,
    0,
    0,
    (2 * far * near) / (near - far),
    0,
  ]);
}
