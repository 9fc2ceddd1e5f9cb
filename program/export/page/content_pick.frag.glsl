// SPDX-License-Identifier: MIT
// Write what is under the pointer: a NaN whose low bits are the index of the part plus 1, and the position.
in vec3 body;
flat in uint part;
out uvec4 picked;

void main() {
  picked = uvec4(0x7fc00001u + part, floatBitsToUint(body));
}
