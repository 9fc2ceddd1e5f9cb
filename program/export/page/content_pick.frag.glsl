// SPDX-License-Identifier: MIT
// Write the part under the pointer as a NaN with the index of the part plus 1 in its low bits, and the bits of the
// position.
in vec3 body;
flat in uint part;
out uvec4 picked;

void main() {
  picked = uvec4(0x7fc00001u + part, floatBitsToUint(body));
}
