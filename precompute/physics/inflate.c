/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Move a scan to full inflation. The surface p at full inflation is the fixed point of the image
 * scan_j - A_j F(g; p) d_j(p), as reference.h explains. It is found by Anderson acceleration (D. G.
 * Anderson, J. ACM 12, 1965): the next p is that combination of the last few images whose residual
 * (image - p) is predicted to be smallest. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_linalg.h>

#include <supine/volume.h>

#include "precompute/physics/reference.h"
#include "precompute/physics/solve.h"
#include "precompute/physics/volume_forms.h"

enum { SOLVES_MAX = 30, DEPTH = 4 };

/* RMS residuals, mm. The iteration ends if the residual is at most `converged`. It also ends if the
 * residual is at most `stalled` and the last step did not halve it: near an almost degenerate
 * triangle, some vertices oscillate by about 0.03 mm. */
static const double converged = 5e-4;
static const double stalled = 5e-3;
static const double folded_share = 0.01; /* largest accepted share of triangles that turn over */
static const double ridge = 1e-12; /* relative increase of the diagonal, to avoid singularity */

typedef struct ascent {
  supine_lungs lungs; /* current estimate of full inflation; the caller owns its vertices */
  supine_lungs scan;
  supine_model model;
  supine_reference *found;
  supine_solution field;     /* solution for the current estimate */
  size_t size;               /* 3 x number of vertices */
  double *image;             /* [size] image of the current estimate, mm */
  double *previous_image;    /* [size] mm */
  double *previous_residual; /* [size] mm */
  double rms;                /* RMS residual of the current estimate, mm */
  double *image_changes;     /* [DEPTH, size] differences between successive images, mm */
  double *residual_changes;  /* [DEPTH, size] mm */
  size_t stored, history;    /* number of stored changes, and of those in use */
} ascent;

static supine_status check_folds(const ascent *a, supine_error *error) {
  const double share = supine_mesh_turned_over(&a->scan.mesh, a->lungs.mesh.vertices);
  return share <= folded_share
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                                "the scan folds on its way to full inflation: %.3g %% of its "
                                "triangles turn over. If the scan is fuller than --scanned says, "
                                "change --scanned or --resting; --scanned none uses the scan as it "
                                "is",
                                100.0 * share);
}

/* Find the gains A of one lung in the scan. The path of supine/volume.h leads from full inflation
 * (sigma = 0) to rest (sigma = 1), with gains of s times the ratios of supine_volume_bend() at
 * sigma. Applied to the scan, gains of -A lead to full inflation and must add `to_full` mL; gains
 * of s - A lead to rest and must add `to_rest` mL. These two conditions determine s and the scan's
 * sigma: the first gives s for any sigma; secant steps find the sigma that satisfies the second.
 * @param form  volume that the displacement field adds to the lung in the scan */
static supine_status find_lung_gains(const supine_volume_form *form, const double bend[3],
                                     bool at_rest, double to_full, double to_rest, double gains[3],
                                     supine_error *error) {
  enum { STEPS = 50 };
  static const double tolerance = 1e-9; /* largest accepted error of the volume, mL */
  const bool straight = at_rest || (bend[0] == 0.0 && bend[1] == 0.0 && bend[2] == 0.0);
  double sigma = straight ? 1.0 : to_full / (to_full - to_rest);
  double last_sigma = 0.0;
  double last_miss = 0.0;
  for (int i = 0; i < STEPS; ++i) {
    double ratio[3];
    double cubic[3];
    double scale = 0.0;
    supine_volume_bend(bend, sigma, ratio);
    supine_volume_form_along(form, ratio, cubic);
    const supine_status status = supine_volume_scale(cubic, to_full, &scale, error);
    if (status != SUPINE_OK) {
      return status;
    }
    double beyond[3];
    for (size_t axis = 0; axis < 3; ++axis) {
      gains[axis] = -scale * ratio[axis];
      beyond[axis] = -scale - gains[axis];
    }
    const double miss = supine_volume_form_at(form, beyond) - to_rest;
    if (straight || fabs(miss) <= tolerance) {
      return SUPINE_OK;
    }
    const double next =
        i == 0 ? 1.01 * sigma : sigma - miss * (sigma - last_sigma) / (miss - last_miss);
    last_sigma = sigma;
    last_miss = miss;
    sigma = next;
  }
  return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                          "no path from full inflation through the scan to rest was found: change "
                          "--scanned or --resting");
}

supine_status supine_reference_find_gains(const supine_lungs *scan, const double bend[3],
                                          const double *directions, const double *amounts,
                                          supine_reference *reference, supine_error *error) {
  const supine_state *state = &reference->scan.state;
  const bool at_rest = state->volume.kind == SUPINE_VOLUME_REST && state->volume.ml == 0.0;
  supine_volume_form forms[2];
  supine_status status = SUPINE_OK;
  supine_physics_volume_of_fields(scan, NULL, directions, amounts, 1, forms);
  for (size_t lung = 0; lung < scan->lung_count && status == SUPINE_OK; ++lung) {
    const double beyond = reference->scan_volume[lung];
    status = find_lung_gains(&forms[lung], bend, at_rest, -beyond,
                             reference->scan_rest[lung] - reference->full_volume[lung] - beyond,
                             reference->scan_gains[lung], error);
  }
  return status;
}

/* Compute the image of the current estimate: the vertices of the scan minus the displacements that
 * the estimate predicts. Choose the gains so that each lung gets its reference volume. */
static supine_status find_image(ascent *a, supine_error *error) {
  supine_solution *field = &a->field;
  a->rms = 0.0;
  ++a->found->solves;
  supine_mesh_box(&a->lungs.mesh, a->lungs.minimum, a->lungs.maximum);
  supine_status status =
      supine_physics_solve(&a->lungs, &a->model, a->found->scan.state.gravity, field, error);
  if (status == SUPINE_OK) {
    status = supine_reference_find_gains(&a->scan, a->model.bend, field->directions, field->catch_,
                                         a->found, error);
  }
  for (size_t lung = 0; lung < a->scan.lung_count && status == SUPINE_OK; ++lung) {
    const double *gains = a->found->scan_gains[lung];
    for (size_t i = 3 * a->scan.lung_begin[lung]; i < 3 * a->scan.lung_begin[lung + 1]; ++i) {
      a->image[i] =
          a->scan.mesh.vertices[i] - gains[i % 3] * field->catch_[i / 3] * field->directions[i];
      const double residual = a->image[i] - a->lungs.mesh.vertices[i];
      a->rms += residual * residual;
    }
  }
  a->rms = sqrt(a->rms / (double)(a->size / 3));
  return status;
}

static double product(const double *a, const double *b, size_t size) {
  double sum = 0.0;
  for (size_t i = 0; i < size; ++i) {
    sum += a[i] * b[i];
  }
  return sum;
}

/* Store image and residual of the current estimate, and their changes since the previous step. */
static void store_differences(ascent *a) {
  double *images = a->image_changes + a->stored % DEPTH * a->size;
  double *residuals = a->residual_changes + a->stored % DEPTH * a->size;
  const bool first = a->found->solves == 1;
  for (size_t i = 0; i < a->size; ++i) {
    const double residual = a->image[i] - a->lungs.mesh.vertices[i];
    images[i] = a->image[i] - a->previous_image[i];
    residuals[i] = residual - a->previous_residual[i];
    a->previous_image[i] = a->image[i];
    a->previous_residual[i] = residual;
  }
  if (!first) {
    ++a->stored;
    a->history = a->history < DEPTH ? a->history + 1 : DEPTH;
  }
}

/* Replace the estimate by that combination of images whose predicted residual is smallest. */
static supine_status advance(ascent *a, supine_error *error) {
  double matrix[DEPTH * DEPTH];
  double weights[DEPTH] = {0.0};
  const size_t n = a->history;
  for (size_t j = 0; j < n; ++j) {
    const double *r = a->residual_changes + j * a->size;
    weights[j] = product(r, a->previous_residual, a->size);
    for (size_t k = 0; k <= j; ++k) {
      matrix[j * n + k] = matrix[k * n + j] =
          product(r, a->residual_changes + k * a->size, a->size);
    }
    matrix[j * n + j] *= 1.0 + ridge;
  }
  if (n > 0) {
    gsl_matrix_view system = gsl_matrix_view_array(matrix, n, n);
    gsl_vector_view right = gsl_vector_view_array(weights, n);
    if (gsl_linalg_HH_svx(&system.matrix, &right.vector) != 0) {
      return supine_error_set(
          error, SUPINE_ERROR_NUMERICAL,
          "no surface at full inflation was found: the iteration does not progress. If the scan is "
          "fuller than --scanned says, change --scanned or --resting; --scanned none uses the scan "
          "as it is");
    }
  }
  double *to = a->lungs.mesh.vertices;
  memcpy(to, a->image, a->size * sizeof *to);
  for (size_t j = 0; j < n; ++j) {
    const double *image = a->image_changes + j * a->size;
    for (size_t i = 0; i < a->size; ++i) {
      to[i] -= weights[j] * image[i];
    }
  }
  return SUPINE_OK;
}

static supine_status iterate(ascent *a, supine_error *error) {
  supine_status status = SUPINE_OK;
  while (status == SUPINE_OK && a->found->solves < SOLVES_MAX) {
    const double before = a->rms;
    status = find_image(a, error);
    if (status == SUPINE_OK &&
        (a->rms <= converged || (a->rms <= stalled && a->rms > 0.5 * before))) {
      memcpy(a->lungs.mesh.vertices, a->image, a->size * sizeof(double));
      return SUPINE_OK;
    }
    if (status == SUPINE_OK) {
      store_differences(a);
      status = advance(a, error);
    } else if (status == SUPINE_ERROR_NUMERICAL && a->history > 0) {
      /* The step was too long: restart from the last image. */
      a->history = 0;
      a->stored = 0;
      memcpy(a->lungs.mesh.vertices, a->previous_image, a->size * sizeof(double));
      status = SUPINE_OK;
    }
  }
  return status == SUPINE_OK
             ? supine_error_set(
                   error, SUPINE_ERROR_NUMERICAL,
                   "no surface at full inflation was found: after %d steps it still "
                   "changes by %.3g mm RMS. If the scan is fuller than --scanned says, "
                   "change --scanned or --resting; --scanned none uses the scan as it is",
                   SOLVES_MAX, a->rms)
             : status;
}

supine_status supine_reference_inflate(supine_lungs *lungs, const supine_model *model,
                                       supine_reference *found, supine_error *error) {
  ascent a = {.lungs = *lungs,
              .scan = *lungs,
              .model = *model,
              .found = found,
              .size = 3 * lungs->mesh.vertex_count};
  const size_t bytes = a.size * sizeof(double);
  supine_status status = SUPINE_OK;
  a.model.share[0] = a.model.share[1] = 1.0; /* healthy lungs; collapse is applied later */
  a.scan.mesh.vertices = malloc(bytes);
  a.image = malloc(bytes);
  a.previous_image = calloc(a.size, sizeof *a.previous_image);
  a.previous_residual = calloc(a.size, sizeof *a.previous_residual);
  a.image_changes = malloc(DEPTH * bytes);
  a.residual_changes = malloc(DEPTH * bytes);
  if (a.scan.mesh.vertices == NULL || a.image == NULL || a.previous_image == NULL ||
      a.previous_residual == NULL || a.image_changes == NULL || a.residual_changes == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", a.size / 3);
    goto cleanup;
  }
  memcpy(a.scan.mesh.vertices, lungs->mesh.vertices, bytes);
  status = iterate(&a, error);
  if (status == SUPINE_OK) {
    status = check_folds(&a, error);
  }
  supine_mesh_box(&lungs->mesh, lungs->minimum, lungs->maximum);
  if (status == SUPINE_OK) {
    free(lungs->scanned);
    lungs->scanned = a.scan.mesh.vertices;
    a.scan.mesh.vertices = NULL;
  }
cleanup:
  supine_physics_solution_free(&a.field);
  free(a.scan.mesh.vertices);
  free(a.image);
  free(a.previous_image);
  free(a.previous_residual);
  free(a.image_changes);
  free(a.residual_changes);
  return status;
}
