// SPDX-License-Identifier: MIT
// Project the table under the patient, or the arrows that show displacements. `position` is on
// an arrow of length 1 from the origin along -z, or on the table, a box from -1 to 1 along each axis.
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 tail;     // start of each arrow of a displacement, mm
layout(location = 3) in vec3 head;     // end of each arrow of a displacement, mm
uniform mat4 toEye;
uniform mat4 projection;
uniform float thick; // largest width of a displacement's arrow, mm; 0 for the patient's table
out vec3 facing;
out vec3 body;

void main() {
  vec3 at = position;
  vec3 n = normal;
  if (thick > 0.0) {
    vec3 along = head - tail;
    float size = max(length(along), 1e-6);
    vec3 z = -along / size;
    vec3 x = normalize(cross(abs(z.x) < 0.8 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0), z));
    mat3 turn = mat3(x, cross(z, x), z);
    at = tail + turn * (position * vec3(vec2(min(thick, size * 1.2)), size));
    n = turn * normal;
  }
  facing = mat3(toEye) * n;
  body = at;
  gl_Position = projection * (toEye * vec4(at, 1.0));
}
