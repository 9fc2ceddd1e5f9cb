// SPDX-License-Identifier: MIT
// Where each vertex goes, and its normal; kept in buffers by transform feedback. After this text come
// the normal's words as attributes, and `turned_by_words()`, their sum, as many as the basis has.
layout(location = 0) in vec4 rest; // w: which lung
layout(location = 1) in vec3 direction;
layout(location = 2) in vec4 c0;
layout(location = 3) in vec4 c1;
layout(location = 4) in vec4 c2;
layout(location = 5) in vec4 c3;
out vec4 moved;
out vec4 turned; // normal; the area around, beside that of the basis' own surface

vec3 turned_by_words();

void main() {
  vec4 c[4] = vec4[4](c0, c1, c2, c3);
  float amount = 0.0;
  for (int i = 0; i < SUPINE_VECTORS; ++i) amount += dot(supine_weights[i], c[i]);
  moved = vec4(supine_place(rest, direction, amount), 1.0);
  vec3 sum = turned_by_words();
  float size = length(sum);
  turned = vec4(size > 0.0 ? sum / size : vec3(0.0), size);
}
