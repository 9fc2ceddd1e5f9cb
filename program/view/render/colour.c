/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the colour maps: colours at equal distances along curves in OKLab. Lightness rises along
 * each curve, so that colours keep their order in grey copies and for any colour vision.
 * [Ottosson2020] B. Ottosson, "A perceptual color space for image processing". */
#include <math.h>
#include <pthread.h>

#include "base/vec3.h"

#include "program/view/render/render.h"

enum { KNOTS = 6, FINE = 4096, COLOURS = 256 };

/* OKLab lightness, chroma and hue (degrees) at the knots of the curve of each colour map. */
static const double curves[SUPINE_COLOURS_COUNT][KNOTS][3] = {
    {{0.42, 0.14, 288},
     {0.51, 0.125, 258},
     {0.61, 0.098, 218},
     {0.72, 0.115, 170},
     {0.84, 0.16, 130},
     {0.95, 0.15, 106}},
    {{0.4, 0.08, 265},
     {0.47, 0.14, 305},
     {0.57, 0.175, 350},
     {0.68, 0.155, 390},
     {0.81, 0.13, 425},
     {0.95, 0.07, 455}},
};

static double colours[SUPINE_COLOURS_COUNT][COLOURS][3]; /* written once, by make_colours */
static pthread_once_t made = PTHREAD_ONCE_INIT;

static void linear_rgb(const double lab[3], double rgb[3]) {
  const double l = pow(lab[0] + 0.3963377774 * lab[1] + 0.2158037573 * lab[2], 3);
  const double m = pow(lab[0] - 0.1055613458 * lab[1] - 0.0638541728 * lab[2], 3);
  const double s = pow(lab[0] - 0.0894841775 * lab[1] - 1.2914855480 * lab[2], 3);
  rgb[0] = 4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s;
  rgb[1] = -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s;
  rgb[2] = -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s;
}

static double encode(double x) {
  const double clipped = fmin(1, fmax(0, x));
  return clipped <= 0.0031308 ? 12.92 * clipped : 1.055 * pow(clipped, 1 / 2.4) - 0.055;
}

/* Compute the OKLab colour at the parameter t of a curve, 0 to 1, by Catmull-Rom interpolation. */
static void curve_at(const double curve[KNOTS][3], double t, double lab[3]) {
  const double at = t * (KNOTS - 1);
  const int k = (int)fmin(floor(at), KNOTS - 2);
  const double u = at - k;
  double polar[3];
  for (int j = 0; j < 3; ++j) {
    const double p = curve[k > 0 ? k - 1 : 0][j];
    const double q = curve[k][j];
    const double r = curve[k + 1][j];
    const double s = curve[k + 2 < KNOTS ? k + 2 : KNOTS - 1][j];
    polar[j] = 0.5 * (2 * q + (r - p) * u + (2 * p - 5 * q + 4 * r - s) * u * u +
                      (3 * q - p - 3 * r + s) * u * u * u);
  }
  const double hue = polar[2] * 3.14159265358979323846 / 180;
  lab[0] = polar[0];
  lab[1] = polar[1] * cos(hue);
  lab[2] = polar[1] * sin(hue);
}

static void make_map(const double curve[KNOTS][3], double map[COLOURS][3]) {
  double lab[FINE + 1][3];
  double length[FINE + 1] = {0};
  for (int i = 0; i <= FINE; ++i) {
    curve_at(curve, i / (double)FINE, lab[i]);
    if (i > 0) {
      const double *a = lab[i - 1];
      const double *b = lab[i];
      length[i] = length[i - 1] + supine_distance(b, a);
    }
  }
  for (int i = 0, at = 0; i < COLOURS; ++i) {
    double linear[3];
    while (at < FINE && length[at] < i / (double)(COLOURS - 1) * length[FINE]) {
      ++at;
    }
    linear_rgb(lab[at], linear);
    for (int k = 0; k < 3; ++k) {
      map[i][k] = encode(linear[k]);
    }
  }
}

static void make_colours(void) {
  for (int map = 0; map < SUPINE_COLOURS_COUNT; ++map) {
    make_map(curves[map], colours[map]);
  }
}

void supine_render_colour(supine_colours map, double t, double rgb[3]) {
  (void)pthread_once(&made, make_colours);
  const double at = fmin(1, fmax(0, t)) * (COLOURS - 1);
  const int i = (int)fmin(floor(at), COLOURS - 2);
  for (int k = 0; k < 3; ++k) {
    rgb[k] = colours[map][i][k] + (at - i) * (colours[map][i + 1][k] - colours[map][i][k]);
  }
}

double supine_render_bar_step(double value) {
  if (!(value > 0)) {
    return 0.2;
  }
  const double power = pow(10, floor(log10(value / 4)));
  const double steps = value / 4 / power;
  return power * (steps >= 5 ? 5 : steps >= 2 ? 2 : 1);
}

double supine_render_bar_end(double value) {
  const double step = supine_render_bar_step(value);
  return value > 0 ? step * ceil(value / step - 1e-9) : 5 * step;
}
