/* SPDX-License-Identifier: MIT */
/* Compute the pose of a state: the weights of the modes and the gains (factors of displacement). */
#include <math.h>
#include <string.h>

#include <supine/inputs.h>
#include <supine/sh.h>

#include "base/arena.h"
#include "base/vec3.h"
#include "runtime/simulated.h"

static const double default_above_scan = 500; /* default volume minus the volume in the scan, mL */

supine_status supine_basis_weights(const supine_basis *basis, const double gravity[3],
                                   double *weights) {
  double y[(SUPINE_SH_BAND_MAX + 1) * (SUPINE_SH_BAND_MAX + 1)];
  const size_t count = supine_sh_count(basis->info.band);
  if (basis->info.order > 0) {
    return SUPINE_ERROR_UNSUPPORTED;
  }
  SUPINE_TRY(supine_sh_evaluate(basis->info.band, gravity, y));
  for (size_t k = 0; k < basis->info.mode_count; ++k) {
    double sum = 0;
    for (size_t i = 0; i < count; ++i) {
      sum += basis->info.modes[k * count + i] * y[i];
    }
    weights[k] = sum;
  }
  return SUPINE_OK;
}

static double sum_of(const double *values, size_t count) {
  double sum = 0;
  for (size_t i = 0; i < count; ++i) {
    sum += values[i];
  }
  return sum;
}

/* Volumes in one posture, mL, each minus the volume of the reference surface. */
typedef struct volumes {
  size_t lung_count;
  supine_volume_form form[SUPINE_LUNGS_MAX];
  double rest[SUPINE_LUNGS_MAX]; /* volumes at rest; 0 if the file has none */
  double full[SUPINE_LUNGS_MAX];
  double rest_total;
} volumes;

static supine_status find_volumes(const supine_basis *basis, const double gravity[3],
                                  const double *weights, volumes *v, supine_error *error) {
  double y[RESTING_TERMS];
  *v = (volumes){.lung_count = basis->info.lung_count};
  double unit[3];
  if (supine_sh_evaluate(2, gravity, y) != SUPINE_OK || !supine_normalise(gravity, unit)) {
    return supine_basis_refuse_gravity(error);
  }
  const double up = fmax(0, -unit[2]);
  for (size_t lung = 0; lung < v->lung_count; ++lung) {
    supine_basis_contract(basis, lung, weights, &v->form[lung]);
    v->full[lung] = basis->upright_gain * up * up * basis->info.reference_volume[lung];
    if (basis->info.has_rest) {
      v->rest[lung] = supine_basis_sum_harmonics(basis->resting + lung * RESTING_TERMS, y);
    }
  }
  v->rest_total = sum_of(v->rest, v->lung_count);
  return SUPINE_OK;
}

static supine_status refuse(const char *what, supine_error *error) {
  return supine_error_set(
      error, SUPINE_ERROR_ARGUMENT,
      "this basis has no volume at %s, as its scan was used unchanged: give scan+ML or an absolute "
      "volume such as 2600mL, or make the basis with the law deep and the state of its scan",
      what);
}

/* Convert a volume of any kind to the volume of all lungs minus the reference volume, mL. */
static supine_status total_of(const supine_basis *basis, const volumes *v,
                              const supine_volume *volume, double *total, supine_error *error) {
  switch (volume->kind) {
  case SUPINE_VOLUME_REST:
    *total = v->rest_total + volume->ml;
    return basis->info.has_rest ? SUPINE_OK : refuse("rest", error);
  case SUPINE_VOLUME_FULL:
    *total = sum_of(v->full, v->lung_count) + volume->ml;
    return basis->info.has_full ? SUPINE_OK : refuse("full inflation", error);
  case SUPINE_VOLUME_ABSOLUTE:
    *total = volume->ml - sum_of(basis->info.reference_volume, v->lung_count);
    return SUPINE_OK;
  case SUPINE_VOLUME_SCAN:
    *total = basis->scan_volume + volume->ml;
    return SUPINE_OK;
  default:
    return supine_basis_refuse_kind(volume->kind, error);
  }
}

/* Divide a total volume among the lungs (supine_basis_pose). Volumes are mL above the reference
 * volume. */
static void share_out(const supine_basis *basis, const volumes *v, double total, double *lung_ml) {
  const double *reference = basis->info.reference_volume;
  const double whole = sum_of(reference, v->lung_count);
  const double part = (total - v->rest_total) / (sum_of(v->full, v->lung_count) - v->rest_total);
  const double shrunk = (whole + total) / (whole + v->rest_total);
  for (size_t lung = 0; lung < v->lung_count; ++lung) {
    lung_ml[lung] = total >= v->rest_total
                        ? v->rest[lung] + part * (v->full[lung] - v->rest[lung])
                        : (reference[lung] + v->rest[lung]) * shrunk - reference[lung];
  }
}

/* Find the gain (factor of the displacement), equal for all lungs and axes, at which the lungs
 * together hold `total` mL more than the reference surface. */
static supine_status common_gains(const volumes *v, double total, supine_pose *pose,
                                  supine_error *error) {
  static const double straight[3] = {0, 0, 0};
  supine_volume_form sum = {{0}};
  for (size_t lung = 0; lung < v->lung_count; ++lung) {
    for (size_t i = 0; i < 7; ++i) {
      sum.of[i] += v->form[lung].of[i];
    }
  }
  double gains[3] = {0, 0, 0};
  const supine_status status = supine_volume_form_gains(&sum, straight, 0, total, gains, error);
  for (size_t lung = 0; lung < v->lung_count; ++lung) {
    memcpy(pose->gains[lung], gains, sizeof gains);
  }
  return status;
}

/* Find the gains (factors of the displacement) at which all lungs together hold `total` mL more
 * than the reference surface. */
static supine_status total_gains(const supine_basis *basis, const volumes *v, double total,
                                 supine_pose *pose, supine_error *error) {
  if (!basis->info.has_rest) {
    return common_gains(v, total, pose, error);
  }
  double lung_ml[SUPINE_LUNGS_MAX];
  share_out(basis, v, total, lung_ml);
  for (size_t lung = 0; lung < v->lung_count; ++lung) {
    SUPINE_TRY(supine_volume_form_gains(&v->form[lung], basis->info.bend, v->rest[lung],
                                        lung_ml[lung], pose->gains[lung], error));
  }
  return SUPINE_OK;
}

/* Find the gains (factors of the displacement) for a state that names each lung with a volume. A
 * volume relative to rest, full inflation or the scan is added to the volume that the named lung
 * has when all lungs are at rest, at full inflation or as in the scan. */
static supine_status named_gains(const supine_basis *basis, const volumes *v,
                                 const supine_state *state, supine_pose *pose,
                                 supine_error *error) {
  size_t lungs[SUPINE_LUNGS_MAX];
  SUPINE_TRY(supine_basis_find_lungs(basis, state, lungs, error));
  for (size_t i = 0; i < state->lung_count; ++i) {
    const supine_volume *volume = &state->lungs[i].volume;
    const size_t lung = lungs[i];
    double ml = volume->ml - basis->info.reference_volume[lung];
    if (volume->kind != SUPINE_VOLUME_ABSOLUTE) {
      double total = 0;
      supine_pose together;
      SUPINE_TRY(total_of(basis, v, &(supine_volume){volume->kind, 0}, &total, error));
      SUPINE_TRY(total_gains(basis, v, total, &together, error));
      ml = supine_volume_form_at(&v->form[lung], together.gains[lung]) + volume->ml;
    }
    SUPINE_TRY(supine_volume_form_gains(&v->form[lung], basis->info.bend, v->rest[lung], ml,
                                        pose->gains[lung], error));
  }
  return SUPINE_OK;
}

/* Set all gains (factors of the displacement) to 0 if the state is that of the reference surface.
 * Refuse all other states of an open surface or of another simulator's fields, because they need
 * volumes. For such fields, the state `scan` is refused in other postures than that of the scan. */
static supine_status reference_gains(const supine_basis *basis, const supine_state *state,
                                     supine_pose *pose, supine_error *error) {
  const supine_volume *volume = &state->volume;
  const bool reference = (volume->kind == SUPINE_VOLUME_SCAN ||
                          (volume->kind == SUPINE_VOLUME_FULL && basis->info.has_full)) &&
                         volume->ml == 0 && state->lung_count == 0;
  if (basis->info.is_fields &&
      !(reference && supine_distance(state->gravity, basis->scan_gravity) < 1e-6)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "this basis holds another simulator's fields of gravity, which have "
                            "no volumes and no breaths: give the posture alone");
  }
  if (!reference) {
    return supine_error_set(error, SUPINE_ERROR_OPEN_SURFACE,
                            "the surface is open and encloses no volume: close the mesh, and make "
                            "the basis again");
  }
  supine_pose_fill(pose, 0);
  return SUPINE_OK;
}

supine_volume supine_basis_default_volume(const supine_basis *basis) {
  if (basis->info.has_rest) {
    return (supine_volume){SUPINE_VOLUME_REST, 0};
  }
  if (basis->info.order > 0) {
    return basis->simulated.usual;
  }
  if (basis->info.is_fields) {
    return (supine_volume){SUPINE_VOLUME_DEFAULT, 0};
  }
  return (supine_volume){SUPINE_VOLUME_SCAN, default_above_scan};
}

/* Return whether a volume is finite, and not so large that it cannot be one of lungs. */
static bool is_volume(double ml) {
  return supine_input_judge(SUPINE_INPUT_VOLUME_FINITE, fabs(ml)) == SUPINE_INPUT_TAKEN;
}

/* Refuse numbers of lungs and volumes that are out of range or not finite. Other functions check
 * the kinds and the gravity. */
static supine_status check_state(const supine_state *state, supine_error *error) {
  bool finite = is_volume(state->lung_count > 0 ? 0 : state->volume.ml);
  if (state->lung_count > SUPINE_STATE_LUNGS_MAX) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "the state names %zu lungs: name at most %d", state->lung_count,
                            (int)SUPINE_STATE_LUNGS_MAX);
  }
  for (size_t i = 0; i < state->lung_count; ++i) {
    finite = finite && is_volume(state->lungs[i].volume.ml);
  }
  return finite ? SUPINE_OK
                : supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                   "a volume of the state is not finite, or above %g mL: give a "
                                   "number of mL",
                                   supine_input_get(SUPINE_INPUT_VOLUME_FINITE)->refused);
}

/* Find the gains (factors of the displacement) at which the lungs hold the volume of a state, in a
 * pose that has the weights for its gravity. */
static supine_status find_gains(const supine_basis *basis, const supine_state *state,
                                supine_pose *pose, supine_error *error) {
  supine_state asked = *state;
  volumes v;
  double total = 0;
  if (asked.lung_count == 0 && asked.volume.kind == SUPINE_VOLUME_DEFAULT) {
    asked.volume = supine_basis_default_volume(basis);
    if (asked.volume.kind == SUPINE_VOLUME_DEFAULT) {
      supine_pose_fill(pose, 1);
      return SUPINE_OK;
    }
  }
  if (!basis->info.has_volume || basis->info.is_fields) {
    return reference_gains(basis, &asked, pose, error);
  }
  SUPINE_TRY(find_volumes(basis, asked.gravity, pose->weights, &v, error));
  if (asked.lung_count > 0) {
    return named_gains(basis, &v, &asked, pose, error);
  }
  SUPINE_TRY(total_of(basis, &v, &asked.volume, &total, error));
  return total_gains(basis, &v, total, pose, error);
}

double supine_basis_expansion(const supine_basis *basis, const supine_pose *pose) {
  double largest = 0;
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    largest = fmax(largest, fabs(pose->expansion[lung]));
  }
  return largest;
}

bool supine_basis_is_scan(const supine_basis *basis, const supine_state *state) {
  double unit[3];
  return state->lung_count == 0 && state->volume.kind == SUPINE_VOLUME_SCAN &&
         state->volume.ml == 0 && supine_normalise(state->gravity, unit) &&
         supine_distance(unit, basis->scan_gravity) < 1e-6;
}

/* Find the weights and the gains of a pose. */
static supine_status move_modes(const supine_basis *basis, const supine_state *state,
                                supine_pose *pose, supine_error *error) {
  pose->basis = basis->info.identity;
  if (basis->info.order > 0) {
    double unit[3];
    if (!supine_normalise(state->gravity, unit)) {
      return supine_basis_refuse_gravity(error);
    }
    return supine_simulated_pose(basis, state, pose, error);
  }
  if (supine_basis_weights(basis, state->gravity, pose->weights) != SUPINE_OK) {
    return supine_basis_refuse_gravity(error);
  }
  return find_gains(basis, state, pose, error);
}

supine_status supine_basis_pose_any(const supine_basis *basis, const supine_state *state,
                                    supine_pose *pose, supine_error *error) {
  SUPINE_TRY(check_state(state, error));
  SUPINE_TRY(move_modes(basis, state, pose, error));
  memset(pose->expansion, 0, sizeof pose->expansion);
  if (supine_basis_is_scan(basis, state)) {
    memcpy(pose->expansion, basis->scan_expansion, sizeof pose->expansion);
  }
  return SUPINE_OK;
}

void supine_pose_fill(supine_pose *pose, double gain) {
  for (size_t lung = 0; lung < SUPINE_LUNGS_MAX; ++lung) {
    for (size_t axis = 0; axis < 3; ++axis) {
      pose->gains[lung][axis] = gain;
    }
  }
  memset(pose->expansion, 0, sizeof pose->expansion);
}

supine_state supine_basis_scan(const supine_basis *basis) {
  return (supine_state){
      .gravity = {basis->scan_gravity[0], basis->scan_gravity[1], basis->scan_gravity[2]},
      .volume = {SUPINE_VOLUME_SCAN, 0}};
}

supine_status supine_basis_volumes(const supine_basis *basis, const supine_pose *pose,
                                   double *volumes_ml) {
  if (!basis->info.has_volume || !supine_basis_has_pose(basis, pose)) {
    return basis->info.has_volume ? SUPINE_ERROR_ARGUMENT : SUPINE_ERROR_OPEN_SURFACE;
  }
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    supine_volume_form form;
    supine_basis_contract(basis, lung, supine_basis_lung_weights(basis, pose, lung), &form);
    volumes_ml[lung] =
        basis->info.reference_volume[lung] + supine_volume_form_at(&form, pose->gains[lung]);
    const double length = 1 + pose->expansion[lung];
    volumes_ml[lung] *= length * length * length;
  }
  return SUPINE_OK;
}

supine_status supine_basis_add_volume(const supine_basis *basis, double volume, supine_pose *pose) {
  volumes v = {.lung_count = basis->info.lung_count};
  for (size_t lung = 0; lung < v.lung_count; ++lung) {
    supine_basis_contract(basis, lung, pose->weights, &v.form[lung]);
  }
  return common_gains(&v, volume, pose, NULL);
}
