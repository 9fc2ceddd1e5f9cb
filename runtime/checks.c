/* SPDX-License-Identifier: MIT */
/* Check that lungs can hold the volumes of a state, by the range that the file holds. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <supine/inputs.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/remedy.h"
#include "base/vec3.h"
#include "runtime/checks.h"
#include "runtime/internal.h"

/* Interpolate the range of volumes of a lung, mL, in a direction of gravity. The file has it in 26
 * directions, towards the faces, edges and corners of a cube: interpolate on the face of the cube
 * that the direction meets. */
static void find_range(const supine_basis *basis, const double gravity[3], size_t lung,
                       double range[2]) {
  const size_t lungs = basis->info.lung_count;
  const double most = fmax(fabs(gravity[0]), fmax(fabs(gravity[1]), fabs(gravity[2])));
  double weight[3][3] = {{0}}; /* of the nodes at -1, 0 and 1 on each axis */
  for (size_t axis = 0; axis < 3; ++axis) {
    const double at = gravity[axis] / most;
    const size_t first = at < 0 ? 0U : 1U;
    const double part = at < 0 ? at + 1 : at;
    weight[axis][first] = 1 - part;
    weight[axis][first + 1] = part;
  }
  range[0] = 0;
  range[1] = 0;
  for (size_t node = 0; node < SUPINE_RANGE_NODES; ++node) {
    const double w = weight[0][node % 3] * weight[1][node / 3 % 3] * weight[2][node / 9];
    const double *volumes = basis->volume_range + (node * lungs + lung) * 2;
    range[0] += w * volumes[0];
    range[1] += w * volumes[1];
  }
}

static bool is_outside(double share) {
  return supine_input_judge(SUPINE_INPUT_VOLUME_LEAST, share) == SUPINE_INPUT_REFUSED ||
         supine_input_judge(SUPINE_INPUT_VOLUME_MOST, share) == SUPINE_INPUT_REFUSED;
}

static void describe_share(const char *whose, double volume, double full, char *wrong,
                           size_t size) {
  (void)supine_print_text(
      wrong, size,
      "%s%.0f mL are %.0f %% of full inflation (%.0f mL), outside the %.0f to %.0f %% "
      "that lungs hold",
      whose, volume, 100 * volume / full, full,
      100 * supine_input_get(SUPINE_INPUT_VOLUME_LEAST)->refused,
      100 * supine_input_get(SUPINE_INPUT_VOLUME_MOST)->refused);
}

bool supine_basis_has_range_of_volumes(const supine_basis *basis) {
  return basis->volume_range != NULL;
}

bool supine_basis_allows_folds(const supine_basis *basis) {
  return basis->allow_folds;
}

/* Return whether the gains of a pose can be right. They are limited where no volume limits them: if
 * a state names none, and the file does not say what its lungs can hold. */
static bool can_gain(const supine_basis *basis, const supine_state *state, const supine_pose *pose,
                     char *wrong, size_t size) {
  double gain = 0;
  if (basis->volume_range != NULL || state->lung_count > 0 ||
      state->volume.kind != SUPINE_VOLUME_DEFAULT) {
    return true;
  }
  for (size_t i = 0; i < 3 * basis->info.lung_count; ++i) {
    const double of_axis = pose->gains[i / 3][i % 3];
    gain = fabs(of_axis) > fabs(gain) ? of_axis : gain;
  }
  const double most = supine_input_get(SUPINE_INPUT_GAIN)->refused;
  (void)supine_print_text(wrong, size,
                          "the gain %.6g multiplies every displacement, outside -%g to %g", gain,
                          most, most);
  return supine_input_judge(SUPINE_INPUT_GAIN, fabs(gain)) == SUPINE_INPUT_TAKEN;
}

/* Return whether lungs can hold the volumes of a pose. If not, write to `wrong` what is wrong. */
static bool can_hold(const supine_basis *basis, const supine_state *state, const supine_pose *pose,
                     char *wrong, size_t size) {
  const supine_basis_info *info = &basis->info;
  const double most = supine_input_get(SUPINE_INPUT_VOLUME_MOST)->refused;
  double volumes[SUPINE_LUNGS_MAX];
  double total = 0;
  double full = 0;
  if (!info->has_rest || info->is_fields || supine_basis_is_scan(basis, state) ||
      supine_basis_volumes(basis, pose, volumes) != SUPINE_OK) {
    return true;
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    total += volumes[lung];
    full += info->reference_volume[lung];
  }
  if (is_outside(total / full)) {
    describe_share("", total, full, wrong, size);
    return false;
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    const double own_full = info->reference_volume[lung];
    char whose[48] = "";
    double range[2];
    if (info->lung_count > 1) {
      (void)snprintf(whose, sizeof whose, "%s lung: ", info->lung_names[lung]);
    }
    if (state->lung_count > 0 && is_outside(volumes[lung] / own_full)) {
      describe_share(whose, volumes[lung], own_full, wrong, size);
      return false;
    }
    if (basis->volume_range == NULL) {
      continue;
    }
    find_range(basis, state->gravity, lung, range);
    if (range[1] >= (1 - 1e-9) * most * own_full) { /* the surface does not fold up to there */
      range[1] = fmax(range[1], volumes[lung]);
    }
    if (!(volumes[lung] >= range[0] && volumes[lung] <= range[1])) {
      (void)supine_print_text(
          wrong, size,
          "%sthe surface folds at %.0f mL; at %.0f to %.0f mL, at most %g %% of its triangles turn "
          "over",
          whose, volumes[lung], range[0], range[1],
          100 * supine_input_get(SUPINE_INPUT_FOLDS)->refused);
      return false;
    }
  }
  return true;
}

/* Return what to do about a pose that lungs cannot hold, or NULL if they can. Write the state and
 * what is wrong to `text`. */
static const char *judge(const supine_basis *basis, const supine_state *state,
                         const supine_pose *pose, char text[420]) {
  char wrong[256];
  const char *remedy = "give a smaller gain";
  if (can_gain(basis, state, pose, wrong, sizeof wrong)) {
    if (can_hold(basis, state, pose, wrong, sizeof wrong)) {
      return NULL;
    }
    remedy = "choose a volume nearer to rest";
  }
  (void)supine_state_describe(state, text, 160);
  const size_t length = strlen(text);
  (void)supine_print_text(text + length, 420 - length, ": %s", wrong);
  return remedy;
}

supine_status supine_basis_check(const supine_basis *basis, const supine_state *state,
                                 const supine_pose *pose, supine_error *error) {
  char text[420];
  const char *remedy = judge(basis, state, pose, text);
  if (remedy == NULL) {
    return SUPINE_OK;
  }
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_allow_folds()};
  (void)supine_error_set(error, SUPINE_ERROR_NUMERICAL, "%s: %s", text, remedy);
  return supine_error_advised(error, advice, SUPINE_ERROR_NUMERICAL);
}

void supine_basis_tell(const supine_basis *basis, const supine_state *state,
                       const supine_pose *pose, supine_findings *findings) {
  char text[420];
  if (judge(basis, state, pose, text) != NULL) {
    supine_findings_warn(findings, "%s", text);
  }
}

supine_status supine_basis_pose(const supine_basis *basis, const supine_state *state,
                                supine_pose *pose, supine_error *error) {
  SUPINE_TRY(supine_basis_pose_any(basis, state, pose, error));
  return basis->allow_folds ? SUPINE_OK : supine_basis_check(basis, state, pose, error);
}

supine_status supine_basis_pose_gain(const supine_basis *basis, const double gravity[3],
                                     double gain, supine_pose *pose, supine_error *error) {
  const supine_state state = {.gravity = {gravity[0], gravity[1], gravity[2]}};
  if (!isfinite(gain)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the gain is %g: give a finite number, such as 1", gain);
  }
  *pose = (supine_pose){.basis = basis->info.identity};
  switch (supine_basis_weights(basis, gravity, pose->weights)) {
  case SUPINE_OK:
    break;
  case SUPINE_ERROR_UNSUPPORTED:
    return supine_error_set(error, SUPINE_ERROR_UNSUPPORTED,
                            "displacements of this basis depend on the volume: give a volume "
                            "instead of a gain");
  default:
    return supine_basis_refuse_gravity(error);
  }
  supine_pose_fill(pose, gain);
  return basis->allow_folds ? SUPINE_OK : supine_basis_check(basis, &state, pose, error);
}

supine_status supine_basis_scan_pose(const supine_basis *basis, supine_pose *pose,
                                     supine_error *error) {
  const supine_state scan = supine_basis_scan(basis);
  if (basis->info.is_fields) {
    *pose = (supine_pose){.basis = basis->info.identity};
    return SUPINE_OK;
  }
  return supine_basis_pose_any(basis, &scan, pose, error);
}
