// SPDX-License-Identifier: MIT
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
uniform mat4 toEye;
uniform mat4 projection;
out vec3 facing;

void main() {
  facing = mat3(toEye) * normal;
  gl_Position = projection * (toEye * vec4(position, 1.0));
}
