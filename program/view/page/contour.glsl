// SPDX-License-Identifier: MIT
// Return the fraction of a pixel that contour lines of a value cover. Lines are at the positive multiples of
// `spacing`, and fade out where they are too close to be told apart. program/view/render/draw.c draws similar lines.
float contour(float value, float spacing) {
  float steps = value / spacing;
  float width = fwidth(steps);
  float away = abs(fract(steps - 0.5) - 0.5) / max(width, 1e-6);
  return (1.0 - smoothstep(0.3, 1.2, away)) * (1.0 - smoothstep(0.3, 0.8, width)) * step(0.5, steps);
}

/** Darken a colour where `value` is on a contour line. If `spacing` is 0, there are no lines. */
vec3 lined(vec3 colour, float value, float spacing) {
  return spacing > 0.0 ? mix(colour, colour * 0.45, 0.5 * contour(value, spacing)) : colour;
}
