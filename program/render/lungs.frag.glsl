// SPDX-License-Identifier: GPL-3.0-or-later
// Light and colour of the lungs.
in vec3 v_normal;
in vec3 v_eye;
in float v_value;
uniform sampler2D colours;
uniform float largest;
uniform float line_step;
uniform float dark;
out vec4 colour;
float lambert(vec3 n, vec3 to_light) { return max(dot(n, normalize(to_light)), 0.0); }
void main() {
  float t = clamp(v_value / largest, 0.0, 1.0);
  vec3 base = pow(texture(colours, vec2((t * 255.0 + 0.5) / 256.0, 0.5)).rgb, vec3(2.2));
  vec3 n = normalize(v_normal) * (gl_FrontFacing ? 1.0 : -1.0);
  vec3 eye = normalize(v_eye);
  vec3 key = vec3(-0.55, 0.75, 0.8);
  float facing = max(dot(n, eye), 0.0);
  float light = 0.46 + 0.14 * n.y + 0.58 * lambert(n, key) +
                0.16 * lambert(n, vec3(0.9, -0.1, 0.5));
  light *= mix(0.72, 1.0, smoothstep(0.0, 0.45, facing)); // darker towards the outline
  vec3 lit = base * light;
  lit = lined(lit, v_value, line_step);
  float shine = pow(lambert(n, normalize(key) + eye), 48.0);
  lit += vec3(0.08 * shine);
  lit += dark * vec3(0.10, 0.14, 0.20) * pow(1.0 - facing, 3.0);
  colour = vec4(pow(clamp(lit, 0.0, 1.0), vec3(1.0 / 2.2)), 1.0);
}
