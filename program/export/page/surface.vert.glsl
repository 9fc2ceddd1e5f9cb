// SPDX-License-Identifier: MIT
// The deformed surface on the screen, or on the one pixel under the pointer.
layout(location = 0) in vec3 moved;
layout(location = 1) in vec4 turned; // normal; area around, beside that of the basis' own surface
layout(location = 2) in vec3 origin; // what the colour measures from: rest, or the reference posture
layout(location = 3) in vec4 before; // as `turned`, in that state
uniform mat4 toEye;
uniform mat4 projection;
uniform vec4 lens;    // part of the picture that is drawn: centre, magnification
uniform int kind;     // 0: mm from origin; 1: % that the area has grown; 2: mm above the lowest point
uniform vec4 gravity; // direction, and how far the lowest point is along it
out vec3 eye;
out vec3 facing;
out vec3 body;
out float value;

void main() {
  vec4 at = toEye * vec4(moved, 1.0);
  eye = at.xyz;
  facing = mat3(toEye) * turned.xyz;
  body = moved;
  value = kind == 0 ? distance(moved, origin)
        : kind == 1 ? 100.0 * (turned.w / max(before.w, 1e-12) - 1.0)
        : gravity.w - dot(gravity.xyz, moved);
  vec4 clip = projection * at;
  gl_Position = vec4((clip.xy - lens.xy * clip.w) * lens.zw, clip.zw);
}
