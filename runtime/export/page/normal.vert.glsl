// SPDX-License-Identifier: MIT
// Normal of each vertex of the deformed surface, its triangles' sum by area; and the area of that sum.
layout(location = 0) in uvec2 span; // first corner and number of corners in `ring`
uniform highp sampler2D positions;
uniform highp usampler2D ring;      // the two other vertices of each triangle at a vertex
out vec4 turned;

vec3 position_of(uint vertex) {
  uint width = uint(textureSize(positions, 0).x);
  return texelFetch(positions, ivec2(vertex % width, vertex / width), 0).xyz;
}

void main() {
  uint width = uint(textureSize(ring, 0).x);
  vec3 here = position_of(uint(gl_VertexID));
  vec3 sum = vec3(0.0);
  float area = 0.0;
  for (uint i = span.x; i < span.x + span.y; ++i) {
    uvec2 others = texelFetch(ring, ivec2(i % width, i / width), 0).xy;
    vec3 piece = cross(position_of(others.x) - here, position_of(others.y) - here);
    sum += piece;
    area += length(piece);
  }
  float size = length(sum);
  turned = vec4(size > 0.0 ? sum / size : vec3(0.0, 0.0, 1.0), area);
}
