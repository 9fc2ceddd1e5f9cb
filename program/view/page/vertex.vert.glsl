// SPDX-License-Identifier: MIT
// Compute the position of each vertex of the surface, for transform feedback.
layout(location = 0) in vec4 reference; // reference position, mm; w: lung
layout(location = 1) in vec3 direction;
layout(location = 2) in vec4 c0;
layout(location = 3) in vec4 c1;
layout(location = 4) in vec4 c2;
layout(location = 5) in vec4 c3;
out vec4 moved;

void main() {
  vec4 c[4] = vec4[4](c0, c1, c2, c3);
  float amount = 0.0;
  for (int i = 0; i < SUPINE_VECTORS; ++i) amount += dot(supine_weights[i], c[i]);
  moved = vec4(supine_place(reference, direction, amount), 1.0);
}
