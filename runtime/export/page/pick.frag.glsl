// SPDX-License-Identifier: MIT
// The value and the place under the pointer, bit by bit.
precision highp float;
in vec3 eye;
in vec3 facing;
in vec3 body;
in float value;
out uvec4 picked;

void main() {
  picked = floatBitsToUint(vec4(value, body));
}
