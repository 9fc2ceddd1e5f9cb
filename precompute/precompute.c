/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The offline pipeline: project, compress, measure, write. */
#include <math.h>
#include <stdlib.h>

#include <supine/precompute.h>

#include "basis_file.h"

enum { HELD_OUT_DEFAULT = 100 };

static const double reference_volume = 500.0; /* mL, that errors in mm are stated at */

/* Between the steps: has the caller had enough? */
static supine_status report_progress(const supine_precompute_options *options, double fraction,
                                     supine_error *error) {
  if (options->progress != NULL && !options->progress(options->progress_context, fraction)) {
    return supine_error_set(error, SUPINE_ERROR_INTERRUPTED, "interrupted: nothing was written");
  }
  return SUPINE_OK;
}

/* The truth of the linear route at the held-out directions: functions [D, R] and, on closed lungs,
 * cubic [D, 3], from the forms of the projection's columns. */
static supine_status linear_truth(const supine_lungs *lungs, const supine_force_law *law,
                                  const supine_projection *projection,
                                  const supine_volume_forms *forms, size_t count,
                                  const double *directions, double *functions, double *cubic) {
  double *range = malloc(2 * count * sizeof *range);
  if (range == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  const supine_status status =
      supine_height_range(&lungs->mesh, count, directions, range, range + count);
  for (size_t d = 0; d < count && status == SUPINE_OK; ++d) {
    double *row = functions + d * projection->rank;
    supine_force_functions(lungs, law, directions + 3 * d, range[d], range[count + d], row);
    if (forms->linear != NULL) {
      supine_volume_forms_contract(forms, row, cubic + 3 * d);
    }
  }
  free(range);
  return status;
}

supine_status supine_precompute(const supine_lungs *lungs, const supine_precompute_options *options,
                                const char *path, supine_precompute_report *report,
                                supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  const size_t held_out = options->held_out > 0 ? options->held_out : HELD_OUT_DEFAULT;
  supine_projection projection = {0};
  supine_compression compression = {0};
  supine_volume_forms column_forms = {0};
  supine_volume_forms forms = {0};
  supine_accuracy accuracy = {0};
  double *functions = NULL;
  double *directions = malloc(3 * n * sizeof *directions);
  double *gravity = malloc(3 * held_out * sizeof *gravity);
  double *cubic = malloc(3 * held_out * sizeof *cubic);
  supine_status status = SUPINE_OK;
  if (directions == NULL || gravity == NULL || cubic == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
    goto cleanup;
  }
  status = supine_directions(lungs, &options->model.direction, directions, error);
  if (status == SUPINE_OK) {
    status = report_progress(options, 0.0, error);
  }
  if (status == SUPINE_OK) {
    status = supine_project_linear(lungs, &options->model.force, options->model.stiffness,
                                   options->band, &projection, error);
  }
  if (status == SUPINE_OK) {
    status = options->modes == 0 ? supine_compress_harmonics(&projection, &compression, error)
                                 : supine_compress_modes(&projection, NULL, options->modes,
                                                         &compression, NULL, NULL, error);
  }
  if (status == SUPINE_OK) {
    status = report_progress(options, 0.4, error);
  }
  if (status == SUPINE_OK && lungs->topology.closed) {
    status = supine_volume_forms_create(lungs, directions, projection.columns, projection.rank,
                                        &column_forms, error);
    if (status == SUPINE_OK) {
      status =
          supine_volume_forms_mix(&column_forms, compression.mix, compression.mode_count, &forms);
    }
  }
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  functions = malloc(held_out * projection.rank * sizeof *functions);
  if (functions == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu directions", held_out);
    goto cleanup;
  }
  supine_held_out_directions(held_out, gravity);
  status = linear_truth(lungs, &options->model.force, &projection, &column_forms, held_out, gravity,
                        functions, cubic);
  if (status == SUPINE_OK) {
    const bool closed = lungs->topology.closed;
    const supine_truth truth = {.direction_count = held_out,
                                .directions = gravity,
                                .rank = projection.rank,
                                .columns = projection.columns,
                                .functions = functions,
                                .cubic = closed ? cubic : NULL};
    status = supine_accuracy_measure(&truth, &compression, directions, closed ? &forms : NULL,
                                     reference_volume, &accuracy, error);
  }
  if (status == SUPINE_OK) {
    status = report_progress(options, 0.8, error);
  }
  if (status == SUPINE_OK) {
    const supine_basis_content content = {.lungs = lungs,
                                          .model = &options->model,
                                          .directions = directions,
                                          .compression = &compression,
                                          .forms = forms.linear != NULL ? &forms : NULL,
                                          .accuracy = &accuracy,
                                          .harmonics = options->modes == 0,
                                          .made_by = options->made_by};
    status = supine_basis_file_write(path, &content, error);
  }
  if (status == SUPINE_OK) {
    (void)report_progress(options, 1.0, NULL);
    *report = (supine_precompute_report){compression.mode_count, projection.solve_count,
                                         projection.iterations, projection.residual, accuracy};
  }
cleanup:
  supine_projection_free(&projection);
  supine_compression_free(&compression);
  supine_volume_forms_free(&column_forms);
  supine_volume_forms_free(&forms);
  free(functions);
  free(directions);
  free(gravity);
  free(cubic);
  return status;
}
