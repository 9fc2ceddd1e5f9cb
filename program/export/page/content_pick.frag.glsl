// SPDX-License-Identifier: MIT
// Which part inside is under the pointer, as a number that is none, and where.
in vec3 body;
flat in uint part;
out uvec4 picked;

void main() {
  picked = uvec4(0x7fc00001u + part, floatBitsToUint(body));
}
