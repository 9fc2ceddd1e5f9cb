/* SPDX-License-Identifier: MIT */
/* A colour map of even steps in OKLab: B. Ottosson, "A perceptual color space for image
 * processing", 2020. */
#include <math.h>

#include "runtime/render/render.h"

static const double degree = 3.14159265358979323846 / 180;

/* Linear sRGB of an OKLab colour. */
static void linear_rgb(double lightness, double a, double b, double rgb[3]) {
  const double l = pow(lightness + 0.3963377774 * a + 0.2158037573 * b, 3);
  const double m = pow(lightness - 0.1055613458 * a - 0.0638541728 * b, 3);
  const double s = pow(lightness - 0.0894841775 * a - 1.2914855480 * b, 3);
  rgb[0] = 4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s;
  rgb[1] = -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s;
  rgb[2] = -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s;
}

static double encode(double x) {
  const double clipped = fmin(1, fmax(0, x));
  return clipped <= 0.0031308 ? 12.92 * clipped : 1.055 * pow(clipped, 1 / 2.4) - 0.055;
}

/* Lightness rises and hue turns at constant rates, within what sRGB holds. */
void supine_render_colour(double t, double rgb[3]) {
  const double at = fmin(1, fmax(0, t));
  const double lightness = 0.36 + 0.56 * at;
  const double hue = (300 - 200 * at) * degree;
  const double chroma = 0.1 + 0.05 * (2 * at - 0.85) * (2 * at - 0.85);
  double linear[3];
  linear_rgb(lightness, chroma * cos(hue), chroma * sin(hue), linear);
  for (int i = 0; i < 3; ++i) {
    rgb[i] = encode(linear[i]);
  }
}
