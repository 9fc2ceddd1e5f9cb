// SPDX-License-Identifier: MIT
// Project the structures inside the lungs: meshes, and balls that show points. `ball` is the offset of a vertex from
// the centre of its ball, in radii; 0 for the vertices of meshes.
layout(location = 0) in vec3 ball;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 moved;
layout(location = 3) in float number; // index of the structure
uniform mat4 toEye;
uniform mat4 projection;
uniform vec4 lens;
uniform float chosen; // index of the chosen structure
uniform float tint;   // index of the colour; -1: 1 for the chosen structure, 0 for others
uniform float radius; // radius of a ball, mm
out vec3 eye;
out vec3 facing;
out vec3 body;
out float value;
flat out uint part;

void main() {
  body = moved + radius * ball;
  vec4 at = toEye * vec4(body, 1.0);
  eye = at.xyz;
  facing = mat3(toEye) * normal;
  value = tint >= 0.0 ? tint : (number == chosen ? 1.0 : 0.0);
  part = uint(number);
  vec4 clip = projection * at;
  gl_Position = vec4((clip.xy - lens.xy * clip.w) * lens.zw, clip.zw);
}
