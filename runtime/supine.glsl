// SPDX-License-Identifier: MIT
// A vertex of a deformed lung, for vertex shaders. GLSL ES 3.00 and GLSL 3.30 core: put this text
// after the #version line (and, for ES, "precision highp float;").
//
//     x = rest + (w . c) direction        w: 16 numbers, c: 16 numbers a vertex
//
// Attributes come from supine_gl_pack, supine_weights from supine_gl_weights (both in
// supine/runtime.h). Weights include the breath scale: draw the lungs one after the other where
// their scales differ. 19 multiplications and 18 additions a vertex.

uniform vec4 supine_weights[4];

vec3 supine_displace(vec3 rest, vec3 direction, vec4 c0, vec4 c1, vec4 c2, vec4 c3) {
  float amount = dot(supine_weights[0], c0) + dot(supine_weights[1], c1) +
                 (dot(supine_weights[2], c2) + dot(supine_weights[3], c3));
  return rest + amount * direction;
}
