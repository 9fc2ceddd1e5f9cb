// SPDX-License-Identifier: MIT
// Compute the normal of each vertex of the surface, for transform feedback: the sum over the triangles around it.
layout(location = 0) in vec2 range; // first and last + 1 of the triangles around the vertex, in `fans`
uniform sampler2D places;   // position of each vertex, mm
uniform highp usampler2D fans; // two corners of each triangle around a vertex; the third is the vertex
out vec4 turned; // unit normal; w: twice the area of the triangles, mm^2

vec3 place(uint i) {
  int width = textureSize(places, 0).x;
  return texelFetch(places, ivec2(int(i) % width, int(i) / width), 0).xyz;
}

void main() {
  vec3 at = place(uint(gl_VertexID));
  int width = textureSize(fans, 0).x;
  vec3 sum = vec3(0.0);
  float area = 0.0;
  for (int i = int(range.x); i < int(range.y); ++i) {
    uvec2 pair = texelFetch(fans, ivec2(i % width, i / width), 0).xy;
    vec3 normal = cross(place(pair.x) - at, place(pair.y) - at);
    sum += normal;
    area += length(normal);
  }
  float size = length(sum);
  turned = vec4(size > 0.0 ? sum / size : vec3(0.0), area);
}
