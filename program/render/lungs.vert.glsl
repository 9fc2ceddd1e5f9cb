// SPDX-License-Identifier: GPL-3.0-or-later
// Where a vertex of the lungs stands in the picture.
layout(location = 0) in vec4 rest;
layout(location = 1) in vec3 direction;
layout(location = 2) in vec4 c0;
layout(location = 3) in vec4 c1;
layout(location = 4) in vec4 c2;
layout(location = 5) in vec4 c3;
layout(location = 6) in vec3 normal;
layout(location = 7) in float value;
uniform mat3 view; // body axes to right, up, towards the viewer
uniform vec3 centre; // of the lungs, mm
uniform vec4 frame; // x, y: middle of the projected lungs, mm; z, w: mm to the edges
uniform vec2 depth; // distance of the viewer; half the depth that is drawn, mm
out vec3 v_normal;
out vec3 v_eye;
out float v_value;
void main() {
  vec4 c[4] = vec4[4](c0, c1, c2, c3);
  float amount = 0.0;
  for (int i = 0; i < SUPINE_VECTORS; ++i) {
    amount += dot(supine_weights[i], c[i]);
  }
  vec3 p = view * (supine_place(rest, direction, amount) - centre);
  float w = depth.x - p.z;
  float near = depth.x - depth.y;
  float far = depth.x + depth.y;
  gl_Position = vec4((p.xy * depth.x - frame.xy * w) * frame.zw,
                     (w * (far + near) - 2.0 * far * near) / (far - near), w);
  v_normal = view * normal;
  v_eye = vec3(0.0, 0.0, depth.x) - p;
  v_value = value;
}
