/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A known displacement law, with which tests deform lungs before they fit a law to the result. */
#ifndef SUPINE_PATIENT_HELPERS_H
#define SUPINE_PATIENT_HELPERS_H

#include "precompute/physics/model.h"

#include "tests/helpers/lungs_helpers.h"

static const double supine_gravity[3] = {0.0, 1.0, 0.0};

/* Return a law with known constants for the force, equation (18) of [Santhanam2008], and for the
 * direction of displacement, equations (15) to (17). */
static supine_model truth(void) {
  supine_model model = supine_physics_model(SUPINE_LAW_PAPER);
  model.reach = 10.0;
  model.force = (supine_force_law){.base = 0.875, .gain = 0.4, .box = {0.0, -0.15, 0.0}};
  model.direction = (supine_direction_law){.c = {6.0, 2.6, 15.0, 1.0, 26.0, 1.3}};
  return model;
}

#endif
