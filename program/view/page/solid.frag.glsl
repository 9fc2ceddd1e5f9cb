// SPDX-License-Identifier: MIT
// Shade arrows, or the table under the patient, in one colour.
in vec3 facing;
in vec3 body;
uniform vec4 tint;
uniform vec4 cut;
out vec4 colour;

void main() {
  if (dot(body, cut.xyz) > cut.w) discard;
  float light = 0.7 + 0.3 * max(dot(normalize(facing), normalize(vec3(-0.45, 0.65, 0.75))), 0.0);
  colour = vec4(tint.rgb * light, 1.0) * tint.a;
}
