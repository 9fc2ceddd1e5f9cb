/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The laws by name. */
#include "precompute/physics/model.h"

supine_model supine_physics_model(supine_law law) {
  static const supine_model laws[SUPINE_LAW_COUNT] = {
      [SUPINE_LAW_DEEP] = {.law = SUPINE_LAW_DEEP,
                           .force =
                               {.base = 0.9, .gain = 0.4, .box = {0.0, -0.2, 0.0}, .pair = true},
                           .direction = {.c = {6.0, 2.6, 15.0, 1.0, 16.0, 1.3}},
                           .reach = 10.0,
                           .share = {1.0, 1.0}},
      [SUPINE_LAW_TIDAL] = {.law = SUPINE_LAW_TIDAL,
                            .force =
                                {.base = 1.1, .gain = 0.4, .box = {0.0, -0.6, 0.0}, .pair = true},
                            .direction = {.c = {3.0, 2.5, 2.5, 2.0, 16.0, 1.2}},
                            .reach = 10.0,
                            .share = {1.0, 1.0}},
      [SUPINE_LAW_COHORT] = {.law = SUPINE_LAW_COHORT,
                             .force = {.base = 0.775,
                                       .gain = 0.4,
                                       .box = {0.1, -0.05, 0.0},
                                       .pair = true},
                             .direction = {.c = {2.3, 3.0, 8.6, 0.8, 16.0, 1.15}},
                             .reach = 10.0,
                             .share = {1.0, 1.0}},
      [SUPINE_LAW_PAPER] = {.law = SUPINE_LAW_PAPER,
                            .force = {.gain = 1.0},
                            .direction = {.c = {2.0, 1.5, 1.5, 1.0, 16.0, 1.4}},
                            .share = {1.0, 1.0}}};
  return laws[law];
}

const char *supine_physics_law_name(supine_law law) {
  static const char *const names[SUPINE_LAW_COUNT] = {"deep", "tidal", "cohort", "paper"};
  return names[law];
}
