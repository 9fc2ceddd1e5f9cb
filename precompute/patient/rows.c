/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make measurements from landmarks, group measurements by position, and predict their values. */
#include <math.h>

#include <gsl/gsl_rng.h>

#include "precompute/patient/krige.h"

#include "base/vec3.h"

/* Side of the cubes whose measurements are held out together, mm. Landmarks a third of this
 * distance apart have displacements that differ by only a few mm, so that holding out single
 * landmarks would make the error seem too small. */
static const double block_side = 40.0;

static const double landmark_noise = 2.0; /* standard deviation of a displacement, mm */

void supine_patient_rows_of_pairs(const supine_patient_frame *frame,
                                  const supine_patient_pairs *pairs, supine_patient_row *rows) {
  for (size_t i = 0; i < 3 * pairs->count; ++i) {
    rows[i] = (supine_patient_row){
        .place = supine_patient_find(frame, pairs->from + i / 3 * 3,
                                     pairs->side != NULL ? pairs->side[i / 3] : 0),
        .value = pairs->to[i] - pairs->from[i],
        .weight = 1.0,
        .landmark = 1 + i / 3,
        .noise = landmark_noise};
    rows[i].axis[i % 3] = 1.0;
  }
}

supine_status supine_patient_rows_block(const supine_patient_frame *frame, supine_patient_row *rows,
                                        size_t count, unsigned long seed, size_t *blocks,
                                        supine_error *error) {
  enum { CELLS = 64 }; /* number of cubes along each axis */
  *blocks = 0;
  double origin[3] = {0.0};
  /* [cube] index of the cube in the list of cubes with measurements, plus 1; else 0 */
  SUPINE_ARENA arena = {0};
  size_t *number = supine_arena_zeros(&arena, (size_t)CELLS * CELLS * CELLS, sizeof *number);
  gsl_rng *random = gsl_rng_alloc(gsl_rng_mt19937);
  if (arena.failed || random == NULL) {
    gsl_rng_free(random);
    return supine_error_memory(error, "%zu values", count);
  }
  gsl_rng_set(random, seed);
  for (int k = 0; k < 3; ++k) {
    const double half = 0.5 * (frame->maximum[k] - frame->minimum[k]);
    origin[k] = -half - block_side * gsl_rng_uniform(random);
  }
  gsl_rng_free(random);
  for (size_t i = 0; i < count; ++i) {
    size_t cell = 0;
    for (int k = 0; k < 3; ++k) {
      const double at = floor((rows[i].place.offset[k] - origin[k]) / block_side);
      cell = cell * CELLS + (size_t)fmin(CELLS - 1, fmax(0.0, at));
    }
    if (number[cell] == 0) {
      number[cell] = ++*blocks;
    }
    rows[i].block = number[cell] - 1;
  }
  return SUPINE_OK;
}

/* Along axis k, a force f displaces by f c_(2k-1) d_k, where d_k is proportional to box_k^c_(2k),
 * and f is linear in c7, c8 and c9. With e_k = axis_k d_k, the prediction is
 *
 *     f sum_k c_(2k-1) e_k + axis . motion */
double supine_patient_power_design(const supine_patient_power *law, const supine_patient_row *row,
                                   double x[SUPINE_PATIENT_TERMS]) {
  const supine_patient_place *place = &row->place;
  const double force = supine_patient_force_at(law, place);
  double e[3];
  double motion[3];
  double turned[3];
  double sum = 0.0;
  supine_patient_power unit = *law;
  unit.c[0] = unit.c[2] = unit.c[4] = 1.0;
  supine_patient_direction(&unit, place, 1.0, e);
  supine_patient_motion(law, place, motion);
  supine_cross(place->offset, row->axis, turned);
  for (size_t a = 0; a < 3; ++a) {
    e[a] *= row->axis[a];
    sum += law->c[2 * a] * e[a];
  }
  for (size_t a = 0; a < 3; ++a) {
    const double size = law->c[2 * a];
    const double exponent = law->c[2 * a + 1];
    const double box = fmin(1.0, fmax(1e-12, place->box[a]));
    x[SUPINE_PATIENT_BY_SIZE + a] = force * e[a];
    x[SUPINE_PATIENT_BY_EXPONENT + a] = size * (force * e[a]) * exponent * log(box);
    x[SUPINE_PATIENT_BY_SLOPE + a] = sum * place->force[1 + a];
    x[SUPINE_PATIENT_BY_TRANSLATION + a] = row->axis[a];
    x[SUPINE_PATIENT_BY_ROTATION + a] = turned[a];
  }
  x[SUPINE_PATIENT_BY_SCALE] = sum * force;
  return x[SUPINE_PATIENT_BY_SCALE] + supine_dot(motion, row->axis) - row->value;
}
