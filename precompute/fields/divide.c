/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Divide volumes that all lungs hold together among the lungs. */
#include "precompute/fields/fields.h"
#include "precompute/physics/resting.h"

/* Find the volume of each lung in one state, mL. */
static supine_status divide_in(const supine_basis *basis, const supine_state *state,
                               const char *name, double held[2], supine_error *error) {
  char text[160];
  supine_pose pose;
  supine_error inner;
  if (supine_basis_pose(basis, state, &pose, &inner) != SUPINE_OK) {
    (void)supine_state_describe(state, text, sizeof text);
    return supine_error_wrap(error, &inner, "%s, %s: ", name, text);
  }
  return supine_basis_volumes(basis, &pose, held);
}

supine_status supine_fields_divide_volume(const supine_basis *basis, const double totals[6],
                                          const char *name, double (*harmonics)[9],
                                          supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  double volume[2][6];
  for (size_t axis = 0; axis < 6; ++axis) {
    supine_state state = {.volume = {SUPINE_VOLUME_ABSOLUTE, totals[axis]}};
    double held[SUPINE_LUNGS_MAX];
    supine_physics_resting_axis(axis, state.gravity);
    SUPINE_TRY(divide_in(basis, &state, name, held, error));
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      volume[lung][axis] = held[lung] - info->reference_volume[lung];
    }
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    supine_physics_resting_harmonics(volume[lung], harmonics[lung]);
  }
  return SUPINE_OK;
}
