// SPDX-License-Identifier: MIT
// Write the surface point under the pointer. The first component is the value that colours show there, a float whose
// lowest 4 bits are replaced by the index of the lung. The other components are the position, mm LPS.
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
