// SPDX-License-Identifier: MIT
// Return how far the plausible lungs that are shown differ from the computed ones at the vertex, mm.
uniform highp sampler2D doubt; // of each vertex, mm
uniform bool doubted;          // whether plausible lungs are shown
uniform int every;             // the vertices 0, every, 2 every ... are drawn

vec3 deviation() {
  int width = textureSize(doubt, 0).x;
  int i = gl_VertexID * every;
  return doubted ? texelFetch(doubt, ivec2(i % width, i / width), 0).xyz : vec3(0.0);
}
