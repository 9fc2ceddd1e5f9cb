// SPDX-License-Identifier: MIT
// Position of a vertex: p + (w . c) d, for up to 16 modes; the breath scale is in the weights.
vec3 supine_deform(vec3 rest, vec3 direction, vec4 c0, vec4 c1, vec4 c2, vec4 c3, vec4 weights[4]) {
  float amount = dot(weights[0], c0) + dot(weights[1], c1) + dot(weights[2], c2) + dot(weights[3], c3);
  return rest + amount * direction;
}
