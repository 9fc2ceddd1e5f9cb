// SPDX-License-Identifier: MIT
// The deformed surface on the screen, or on the one pixel under the pointer.
layout(location = 0) in vec3 moved;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 origin; // what the colour measures from: rest, or the pinned posture
uniform mat4 toEye;
uniform mat4 projection;
uniform vec4 lens; // part of the picture that is drawn: centre, magnification
out vec3 eye;
out vec3 facing;
out vec3 body;
out float value;

void main() {
  vec4 at = toEye * vec4(moved, 1.0);
  eye = at.xyz;
  facing = mat3(toEye) * normal;
  body = moved;
  value = distance(moved, origin);
  vec4 clip = projection * at;
  gl_Position = vec4((clip.xy - lens.xy * clip.w) * lens.zw, clip.zw);
}
