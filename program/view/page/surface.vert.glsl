// SPDX-License-Identifier: MIT
// Project the deformed surface to the screen, or, to find the point under the pointer, to an image of one pixel.
layout(location = 0) in vec3 moved;
layout(location = 1) in vec4 turned; // unit normal; w: area around the vertex
layout(location = 2) in vec3 origin; // position from which displacements are measured
layout(location = 3) in vec4 before; // normal and area in the state from which displacements are measured
uniform mat4 toEye;
uniform mat4 projection;
uniform vec4 lens;    // part of the picture to draw: x and y of its centre, -1 to 1; magnifications in x and y
uniform int kind;     // meaning of `value`: 0 distance from `origin`, mm; 1 growth of the area, %
out vec3 eye;
out vec3 facing;
out vec3 body;
out float value;

void main() {
  vec4 at = toEye * vec4(moved, 1.0);
  eye = at.xyz;
  facing = mat3(toEye) * turned.xyz;
  body = moved;
  value = kind == 0 ? distance(moved, origin) : 100.0 * (turned.w / max(before.w, 1e-12) - 1.0);
  vec4 clip = projection * at;
  gl_Position = vec4((clip.xy - lens.xy * clip.w) * lens.zw, clip.zw);
}
