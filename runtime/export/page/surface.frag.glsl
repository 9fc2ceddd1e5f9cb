// SPDX-License-Identifier: MIT
// Colour by millimetres, shaded softly so that the colours stay readable.
precision highp float;
in vec3 eye;
in vec3 facing;
in vec3 body;
in float value;
uniform sampler2D colours;
uniform float range;    // mm at the end of the colours
uniform float step_mm;  // between contour lines; 0: none
uniform float dark;     // 1 on a dark background
out vec4 colour;

void main() {
  vec3 n = normalize(facing);
  vec3 view = normalize(-eye);
  n = dot(n, view) < 0.0 ? -n : n;
  vec3 base = texture(colours, vec2(clamp(value / range, 0.0, 1.0) * (255.0 / 256.0) + 0.5 / 256.0, 0.5)).rgb;
  if (step_mm > 0.0) {
    float lines = value / step_mm;
    float width = fwidth(lines);
    float distance_to = abs(fract(lines - 0.5) - 0.5) / max(width, 1e-6);
    float line = (1.0 - smoothstep(0.4, 1.4, distance_to)) * (1.0 - smoothstep(0.15, 0.5, width));
    base = mix(base, base * 0.55, 0.55 * line * step(0.5, lines));
  }
  vec3 key = normalize(vec3(-0.45, 0.65, 0.75));
  vec3 fill = normalize(vec3(0.8, -0.1, 0.45));
  float diffuse = 0.56 + 0.4 * max(dot(n, key), 0.0) + 0.14 * max(dot(n, fill), 0.0) + 0.06 * n.y;
  float rim = pow(1.0 - max(dot(n, view), 0.0), 3.0);
  float shine = pow(max(dot(n, normalize(key + view)), 0.0), 42.0);
  vec3 lit = base * diffuse + 0.13 * shine;
  lit = mix(lit, dark > 0.5 ? lit + vec3(0.10, 0.13, 0.16) : lit * 0.72, rim);
  colour = vec4(lit, 1.0);
}
