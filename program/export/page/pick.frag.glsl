// SPDX-License-Identifier: MIT
// Write which point of the surface is under the pointer: the value that its colour shows, with the index of the lung
// in the lowest 4 bits, and the position, mm LPS.
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
