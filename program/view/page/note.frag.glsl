// SPDX-License-Identifier: MIT
// Draw a panel of text.
in vec2 at;
uniform sampler2D words;
out vec4 colour;

void main() {
  colour = texture(words, at);
}
