// SPDX-License-Identifier: MIT
// Compute the position of each vertex of a surface in clusters of vertices that move alike, for transform feedback.
layout(location = 0) in vec4 reference; // reference position, mm; w: lung
layout(location = 1) in vec3 own;       // the vertex's two scalars, and the index of its cluster
out vec4 moved;

void main() {
  moved = vec4(supine_displace(reference.xyz, own.xy, uint(own.z)) + deviation(), 1.0);
}
