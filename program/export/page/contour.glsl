// SPDX-License-Identifier: MIT
// Contour lines, the same in pictures (program/render/draw.c), report and page: how much of one is here, 0 to 1, at multiples
// of `spacing` above 0; none where they would lie closer than can be seen.
float contour(float value, float spacing) {
  float steps = value / spacing;
  float width = fwidth(steps);
  float away = abs(fract(steps - 0.5) - 0.5) / max(width, 1e-6);
  return (1.0 - smoothstep(0.3, 1.2, away)) * (1.0 - smoothstep(0.3, 0.8, width)) * step(0.5, steps);
}

/** A colour that has one on it. */
vec3 lined(vec3 colour, float value, float spacing) {
  return spacing > 0.0 ? mix(colour, colour * 0.45, 0.5 * contour(value, spacing)) : colour;
}
