// SPDX-License-Identifier: MIT
// Compute the position of each vertex of the surface, or of the structures inside the lungs, for transform feedback.
// AXES is 1 if the displacement has one coefficient for each mode, along `direction`, and 3 if it has one along x, y, z.
layout(location = 0) in vec4 reference; // reference position, mm; w: lung
layout(location = 1) in vec3 direction;
uniform highp isampler2D coefficients; // in steps of `unit`, four modes in each texel, [AXES, vertices, modes]
uniform int vertices; // number of vertices in `coefficients`
uniform float unit;   // mm
out vec4 moved;

float amount(int axis) {
  int width = textureSize(coefficients, 0).x;
  int at = (axis * vertices + gl_VertexID * every) * SUPINE_VECTORS;
  float sum = 0.0;
  for (int i = at; i < at + SUPINE_VECTORS; ++i) {
    sum += dot(supine_weights[supine_first(reference) + i - at], vec4(texelFetch(coefficients, ivec2(i % width, i / width), 0)));
  }
  return unit * sum;
}

void main() {
#if AXES == 3
  vec3 computed = supine_displace(reference, vec3(amount(0), amount(1), amount(2)));
#else
  vec3 computed = supine_place(reference, direction, amount(0));
#endif
  moved = vec4(computed + deviation(), 1.0);
}
