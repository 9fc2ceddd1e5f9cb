/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The full solve at directions that no grid used. */
#include <cblas.h>
#include <stdlib.h>

#include "sh/base/vec3.h"

#include "precompute/projection/held_out.h"

enum { AT_ONCE = 16 }; /* directions whose fields are held */

void supine_accuracy_held_out_directions(size_t count, double *directions) {
  static const double off_the_grids = 0.3; /* rad: grids have a node at longitude 0 */
  for (size_t i = 0; i < count; ++i) {
    supine_spiral((double)i, (double)count, off_the_grids, directions + 3 * i);
  }
}

void supine_accuracy_held_out_free(supine_held_out *held_out) {
  free(held_out->directions);
  free(held_out->functions);
  free(held_out->cubic);
  *held_out = (supine_held_out){0};
}

/* The volume against breath scale of each direction's field. */
static supine_status find_cubics(const supine_lungs *lungs, const double *share,
                                 const double *directions, const supine_truth *truth, double *cubic,
                                 supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  const int rank = (int)truth->rank;
  double *fields = malloc(AT_ONCE * n * sizeof *fields);
  supine_status status =
      fields != NULL ? SUPINE_OK
                     : supine_error_set(error, SUPINE_ERROR_MEMORY,
                                        "no memory for the fields of %d directions", AT_ONCE);
  for (size_t d = 0; d < truth->direction_count && status == SUPINE_OK; ++d) {
    if (d % AT_ONCE == 0) {
      const size_t left = truth->direction_count - d;
      cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, (int)(left < AT_ONCE ? left : AT_ONCE),
                  (int)n, rank, 1.0, truth->functions + d * truth->rank, rank, truth->columns, rank,
                  0.0, fields, (int)n);
    }
    supine_volume_forms forms = {0};
    const double one = 1.0;
    status = supine_physics_volume_forms_create(lungs, share, directions, fields + d % AT_ONCE * n,
                                                1, &forms, error);
    if (status == SUPINE_OK) {
      supine_physics_volume_forms_contract(&forms, &one, cubic + 3 * d);
    }
    supine_physics_volume_forms_free(&forms);
  }
  free(fields);
  return status;
}

/* Eight parameters: the lungs and their law, what was solved, and what comes of it. */
supine_status supine_accuracy_held_out(const supine_lungs *lungs, const supine_model *model,
                                       const double *directions,
                                       const supine_projection *projection,
                                       const supine_volume_forms *forms, size_t count,
                                       supine_held_out *held_out, supine_error *error) {
  const size_t rank = projection->rank;
  double *range = malloc(2 * count * sizeof *range);
  supine_held_out made = {.directions = malloc(3 * count * sizeof(double)),
                          .functions = malloc(count * rank * sizeof(double)),
                          .cubic = malloc(3 * count * sizeof(double))};
  supine_status status = SUPINE_ERROR_MEMORY;
  if (range != NULL && made.directions != NULL && made.functions != NULL && made.cubic != NULL) {
    supine_accuracy_held_out_directions(count, made.directions);
    status = supine_physics_height_range(lungs, model->force.pair, count, made.directions, range,
                                         range + count);
  }
  if (status == SUPINE_OK) {
    const supine_gravities gravities = {count, made.directions, range, range + count};
    status = supine_projection_span_weights(lungs, &model->force, projection->span, &gravities,
                                            made.functions);
  }
  made.truth = (supine_truth){.direction_count = count,
                              .directions = made.directions,
                              .rank = rank,
                              .columns = projection->columns,
                              .functions = made.functions,
                              .cubic = lungs->topology.closed ? made.cubic : NULL};
  if (status != SUPINE_OK) {
    (void)supine_error_set(error, status, "no memory for %zu held-out directions", count);
  } else if (lungs->topology.closed && forms == NULL) {
    status = find_cubics(lungs, model->share, directions, &made.truth, made.cubic, error);
  }
  for (size_t d = 0; d < count && status == SUPINE_OK && forms != NULL; ++d) {
    supine_physics_volume_forms_contract(forms, made.functions + d * rank, made.cubic + 3 * d);
  }
  free(range);
  if (status == SUPINE_OK) {
    *held_out = made;
  } else {
    supine_accuracy_held_out_free(&made);
  }
  return status;
}
