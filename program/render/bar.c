/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Ticks of colour bars. */
#include <math.h>

#include "program/render/render.h"

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
