// SPDX-License-Identifier: MIT
// Write the structure inside the lungs that is under the pointer. The first component is a NaN whose lowest bits are
// the index of the structure plus 1. The other components are the position, mm LPS.
in vec3 body;
flat in uint part;
out uvec4 picked;

void main() {
  picked = uvec4(0x7fc00001u + part, floatBitsToUint(body));
}
