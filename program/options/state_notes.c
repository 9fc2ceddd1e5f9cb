/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Say what a volume means where the model has to assume something or does not hold. */
#include <math.h>

#include <supine/facts.h>

#include "precompute/physics/resting.h"
#include "precompute/posed/posed.h"
#include "program/options/state_notes.h"

/* Volume after a full expiration divided by that at full inflation: 1400 mL of gas and 860 mL of
 * tissue (precompute/physics/resting.h) in lungs of 6500 mL, the middle of the range of adults. */
static const double residual_share = (SUPINE_RESIDUAL_ML + SUPINE_TISSUE_ML) / 6500.0;

/* Say how far the volume of all lungs is from rest, if rest is assumed and the state is given in
 * mL. */
static void tell_rest(const char *command, const supine_basis *basis, const supine_state *state,
                      const supine_state *rest, const supine_pose *pose,
                      const supine_pose *resting) {
  bool absolute = state->lung_count == 0 && state->volume.kind == SUPINE_VOLUME_ABSOLUTE;
  bool assumed = false;
  for (size_t lung = 0; lung < state->lung_count; ++lung) {
    absolute = absolute || state->lungs[lung].volume.kind == SUPINE_VOLUME_ABSOLUTE;
  }
  for (size_t lung = 0; lung < supine_basis_get_info(basis)->lung_count; ++lung) {
    assumed = assumed ||
              supine_basis_lung_volume(basis, rest, resting, lung).source == SUPINE_SOURCE_ASSUMED;
  }
  if (absolute && assumed) {
    const double held = supine_posed_volume(basis, pose);
    const double above = held - supine_posed_volume(basis, resting);
    supine_options_note(
        command,
        "%.0f mL are rest %c %.0f mL, with a volume at rest assumed from other "
        "people: if this is the end of an expiration, make the basis with --resting",
        held, above < 0.0 ? '-' : '+', fabs(above));
  }
}

void supine_options_tell_state(const char *command, const supine_basis *basis,
                               const supine_state *state, const supine_pose *pose) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  supine_state rest = {.volume = {SUPINE_VOLUME_REST, 0.0}};
  supine_pose resting;
  double held[SUPINE_LUNGS_MAX];
  double at_rest[SUPINE_LUNGS_MAX];
  for (size_t k = 0; k < 3; ++k) {
    rest.gravity[k] = state->gravity[k];
  }
  if (!info->has_rest || supine_basis_pose(basis, &rest, &resting, NULL) != SUPINE_OK) {
    return;
  }
  tell_rest(command, basis, state, &rest, pose, &resting);
  if (info->is_fields) {
    return; /* the volumes of a simulator's lungs have no law */
  }
  (void)supine_basis_volumes(basis, pose, held);
  (void)supine_basis_volumes(basis, &resting, at_rest);
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    const double share = held[lung] / info->reference_volume[lung];
    if (share < residual_share && held[lung] < at_rest[lung] - 1.0) {
      supine_options_note(command,
                          "the %s lung holds %.0f mL, %.0f %% of full inflation, less than a "
                          "full expiration leaves (about %.0f %%): a collapsing lung moves to its "
                          "hilum, but this law moves it to the back and the head",
                          info->lung_names[lung], held[lung], 100.0 * share,
                          100.0 * residual_share);
    }
  }
}
