// SPDX-License-Identifier: MIT
// Compute the position of each vertex of the structures inside the lungs, for transform feedback. picture.js appends to
// this text: attributes with a coefficient for each axis and mode, and the function `amount(axis)`, which sums weight
// times coefficient over the modes.
layout(location = 0) in vec4 reference; // reference position, mm; w: lung
out vec4 moved;

float amount(int axis);

void main() {
  moved = vec4(supine_place(reference, vec3(amount(0), amount(1), amount(2)), 1.0), 1.0);
}
