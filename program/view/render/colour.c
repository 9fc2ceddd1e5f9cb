/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The palettes, and the colour maps: colours at equal distances along curves in OKLab. Lightness
 * rises along each curve, so that colours keep their order in grey copies and for any colour
 * vision. [Ottosson2020] B. Ottosson, "A perceptual color space for image processing". */
#include <math.h>
#include <stdint.h>

#include "program/view/render/render.h"

enum { COLOURS = 33 };

/* Colours of each map, 12 bits for each of red, green and blue. They were sampled from Catmull-Rom
 * curves through six colours of rising lightness, given by OKLab lightness, chroma and hue. */
static const uint64_t colours[SUPINE_COLOURS_COUNT][COLOURS] = {
    {0x4c83ab93f, 0x49942b9a2, 0x4634a99fb, 0x421528a4a, 0x3d35a6a8c, 0x37a624abf, 0x31769fadf,
     0x2bf718ae8, 0x28378dae1, 0x26a7fead2, 0x27286dac0, 0x2898dbab2, 0x29694aaa8, 0x2a09b7a98,
     0x2bda23a7e, 0x2faa8ba59, 0x35caf0a2a, 0x3dfb519f2, 0x47cbae9b3, 0x522c0996e, 0x5c4c6191d,
     0x670cb58be, 0x729d03852, 0x7f3d4b7dc, 0x8ccd8e761, 0x9b3dcb6e7, 0xaa4e0367f, 0xb97e39642,
     0xc7fe70634, 0xd61ea9650, 0xe36ee368e, 0xf02f1e6e7, 0xfccf59745},
    {0x327464733, 0x3c24687eb, 0x47645d887, 0x53b449902, 0x60843095b, 0x6d941a990, 0x7a64089a7,
     0x8703f79a4, 0x9363e9988, 0x9f43e0957, 0xaac3e0911, 0xb593ee8bb, 0xbfa40e858, 0xc884477ec,
     0xd0449977c, 0xd6e50170e, 0xdc95796a7, 0xe195fd64b, 0xe616895fa, 0xea57185b4, 0xee77aa57b,
     0xf23841553, 0xf578dc543, 0xf8197c551, 0xfa0a1f585, 0xfb2ac45e4, 0xfb9b6b673, 0xfbac0d727,
     0xfb9cae7f6, 0xfb9d4a8d6, 0xfbdddf9bf, 0xfc9e70ab1, 0xfdeefbba4},
};

void supine_render_colour(supine_colours map, double t, double rgb[3]) {
  const double at = fmin(1, fmax(0, t)) * (COLOURS - 1);
  const int i = (int)fmin(floor(at), COLOURS - 2);
  for (int k = 0; k < 3; ++k) {
    const double from = (double)(colours[map][i] >> (24 - 12 * k) & 4095U);
    const double to = (double)(colours[map][i + 1] >> (24 - 12 * k) & 4095U);
    rgb[k] = (from + (at - i) * (to - from)) / 4095;
  }
}

void supine_render_hex(supine_colours map, double t, char text[7]) {
  double rgb[3];
  supine_render_colour(map, t, rgb);
  for (int k = 0; k < 3; ++k) {
    (void)snprintf(text + 2 * k, 3, "%02x", (unsigned)(255 * rgb[k] + 0.5) & 255U);
  }
}

double supine_render_bar_step(double value) {
  if (!(value > 0)) {
    return 0.2;
  }
  const double power = pow(10, floor(log10(value / 4)));
  const double steps = value / 4 / power;
  if (steps >= 5) {
    return power * 5;
  }
  return power * (steps >= 2 ? 2 : 1);
}

double supine_render_bar_end(double value) {
  const double step = supine_render_bar_step(value);
  return value > 0 ? step * ceil(value / step - 1e-9) : 5 * step;
}

uint32_t supine_render_palette(supine_palette palette, size_t i) {
  enum { POSTURES = 6, TARGETS = 2 };
  static const uint32_t targets[TARGETS] = {0x8edadf, 0xfa7d33};
  static const uint32_t anatomy[SUPINE_RENDER_TINTS] = {0x3f78d8, 0xb993f0, 0x2f8254,
                                                        0xd0ac3c, 0xd0587e, 0x9aa6b3};
  /* [OkabeIto2008] M. Okabe and K. Ito, "Color Universal Design". */
  static const uint32_t postures[POSTURES] = {0x0072b2, 0xd55e00, 0x009e73,
                                              0xcc79a7, 0x56b4e9, 0xe69f00};
  switch (palette) {
  case SUPINE_PALETTE_TARGETS:
    return targets[i % TARGETS];
  case SUPINE_PALETTE_ANATOMY:
    return anatomy[i % SUPINE_RENDER_TINTS];
  case SUPINE_PALETTE_POSTURES:
    return postures[i % POSTURES];
  case SUPINE_PALETTE_COUNT:
    break;
  }
  return 0;
}
