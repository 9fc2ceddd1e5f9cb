// SPDX-License-Identifier: MIT
// Compute the position of each vertex of the content, for transform feedback. picture.js appends attributes with the
// coefficients of the displacement along each axis, and `amount(axis)`, which multiplies them by the weights and adds.
layout(location = 0) in vec4 reference; // reference position, mm; w: lung
out vec4 moved;

float amount(int axis);

void main() {
  moved = vec4(supine_place(reference, vec3(amount(0), amount(1), amount(2)), 1.0), 1.0);
}
