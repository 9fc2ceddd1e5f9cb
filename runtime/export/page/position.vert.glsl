// SPDX-License-Identifier: MIT
// Where each vertex goes; kept in a buffer by transform feedback.
layout(location = 0) in vec3 rest;
layout(location = 1) in vec3 direction;
layout(location = 2) in vec4 c0;
layout(location = 3) in vec4 c1;
layout(location = 4) in vec4 c2;
layout(location = 5) in vec4 c3;
out vec4 moved;

void main() {
  moved = vec4(supine_displace(rest, direction, c0, c1, c2, c3), 1.0);
}
