// SPDX-License-Identifier: MIT
// Project a panel of text that faces the viewer.
layout(location = 0) in vec2 corner; // -1 to 1
uniform mat4 toEye;
uniform mat4 projection;
uniform vec3 place; // centre of the panel, m
uniform vec2 size;  // half its width and height, m
out vec2 at;

void main() {
  at = vec2(0.5 + 0.5 * corner.x, 0.5 - 0.5 * corner.y);
  gl_Position = projection * (toEye * vec4(place, 1.0) + vec4(corner * size, 0.0, 0.0));
}
