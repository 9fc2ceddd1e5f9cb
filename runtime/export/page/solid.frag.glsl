// SPDX-License-Identifier: MIT
precision highp float;
in vec3 facing;
uniform vec3 tint;
out vec4 colour;

void main() {
  float light = 0.7 + 0.3 * max(dot(normalize(facing), normalize(vec3(-0.45, 0.65, 0.75))), 0.0);
  colour = vec4(tint * light, 1.0);
}
