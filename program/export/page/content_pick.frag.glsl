// SPDX-License-Identifier: MIT
// Write which structure inside the lungs is under the pointer, and the position, mm LPS. A NaN marks a structure; the
// lowest bits of the NaN are the index of the structure plus 1.
in vec3 body;
flat in uint part;
out uvec4 picked;

void main() {
  picked = uvec4(0x7fc00001u + part, floatBitsToUint(body));
}
