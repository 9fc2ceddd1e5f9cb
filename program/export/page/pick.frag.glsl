// SPDX-License-Identifier: MIT
// Write the bits of the value and of the position under the pointer. The index of the lung replaces the lowest 4 bits
// of the value.
in vec3 eye;
in vec3 facing;
in vec3 body;
in float value;
uniform vec4 cut;
uniform uint lung;
out uvec4 picked;

void main() {
  if (dot(body, cut.xyz) > cut.w) discard;
  picked = floatBitsToUint(vec4(value, body));
  picked.x = (picked.x & ~15u) | lung;
}
