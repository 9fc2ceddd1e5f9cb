/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The full solve at directions that no grid used. */
#include <cblas.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/vec3.h"

#include "precompute/projection/held_out.h"

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

/* Find the volume of each direction's field as a polynomial of the gain. */
static supine_status find_cubics(const supine_lungs *lungs, const double *share,
                                 const double *directions, const supine_truth *truth, double *cubic,
                                 supine_error *error) {
  enum { AT_ONCE = SUPINE_VOLUME_FIELDS };
  const size_t n = lungs->mesh.vertex_count;
  const int rank = (int)truth->rank;
  supine_volume_form forms[2 * AT_ONCE];
  double *fields = malloc(AT_ONCE * n * sizeof *fields);
  if (fields == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for the fields of %d directions",
                            AT_ONCE);
  }
  memset(cubic, 0, 3 * truth->direction_count * sizeof *cubic);
  for (size_t first = 0; first < truth->direction_count; first += AT_ONCE) {
    const size_t left = truth->direction_count - first;
    const size_t count = left < AT_ONCE ? left : AT_ONCE;
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, (int)n, (int)count, rank, 1.0,
                truth->columns, rank, truth->functions + first * truth->rank, rank, 0.0, fields,
                (int)count);
    supine_physics_volume_of_fields(lungs, share, directions, fields, count, forms);
    for (size_t i = 0; i < lungs->lung_count * count; ++i) {
      supine_physics_volume_form_add(&forms[i], cubic + 3 * (first + i % count));
    }
  }
  free(fields);
  return SUPINE_OK;
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
