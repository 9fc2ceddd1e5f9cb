/* SPDX-License-Identifier: MIT */
/* The normal adult lung. */
#include <supine/breath.h>

const supine_pv *supine_breath_normal(void) {
  static const supine_pv normal = {
      /* Fitted to a + b / (1 + exp(-(P - 10) / 6)), a and b such that it spans 0 to 6000 mL. */
      {{{0.0, 30.0},
        {0.0, 6000.0},
        {-0.697448914, -2.22791741, 0.470886417, 0.269525392, -0.132010658}},
       /* c_1 = -k (P_high - P_low) / 2, k = ln 2 / 7.58 [Salazar1964] */
       {{0.0, 30.0}, {0.0, 6000.0}, {-1.3716632861, 0.0, 0.0, 0.0, 0.0}}}};
  return &normal;
}
