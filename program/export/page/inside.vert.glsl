// SPDX-License-Identifier: MIT
// Where each vertex inside goes; kept in a buffer by transform feedback. After this text come
// `amount(axis)` and its attributes: the displacement's coefficients along each axis.
layout(location = 0) in vec4 rest; // w: which lung
out vec4 moved;

float amount(int axis);

void main() {
  moved = vec4(supine_place(rest, vec3(amount(0), amount(1), amount(2)), 1.0), 1.0);
}
