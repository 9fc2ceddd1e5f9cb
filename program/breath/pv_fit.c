/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The inverse problem: the limb that fits samples best. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include <gsl/gsl_errno.h>
#include <gsl/gsl_multifit_nlinear.h>

#include "program/breath/pv_internal.h"

enum { LOW = SUPINE_PV_CONTROLS, HIGH }; /* V_low and V_high among the unknowns */

/* Samples sorted by pressure, x in [-1, 1] and V in shares of the volume range. */
typedef struct problem {
  size_t count;
  double *x;      /* [count] */
  double *v;      /* [count] */
  double *states; /* [count, PV_STATE_WITH_RESPONSES] */
  supine_status status;
} problem;

/* Residuals, and the Jacobian where it is asked for. With q = y / y(1):
 *   V = (1 - q) V_low + q V_high      dq/dc_i = (dy/dc_i - q dy(1)/dc_i) / y(1) */
static int problem_evaluate(const gsl_vector *unknowns, problem *limb, gsl_vector *residual,
                            gsl_matrix *jacobian) {
  static const double wall = 1e6; /* residual that makes the search step back */
  const size_t size = jacobian != NULL ? PV_STATE_WITH_RESPONSES : PV_STATE;
  const double *control = unknowns->data;
  for (size_t i = 0; i < SUPINE_PV_CONTROLS; ++i) {
    if (!(fabs(control[i]) <= SUPINE_PV_CONTROL_MAX) && residual != NULL) {
      gsl_vector_set_all(residual, wall);
      return GSL_SUCCESS;
    }
  }
  limb->status = supine_breath_integrate(control, limb->count, limb->x, size, limb->states);
  if (limb->status != SUPINE_OK) {
    return GSL_EFAILED;
  }
  const double low = gsl_vector_get(unknowns, LOW);
  const double high = gsl_vector_get(unknowns, HIGH);
  const double *end = limb->states + (limb->count - 1) * size;
  for (size_t j = 0; j < limb->count; ++j) {
    const double *state = limb->states + j * size;
    const double q = state[0] / end[0];
    if (residual != NULL) {
      gsl_vector_set(residual, j, (1.0 - q) * low + q * high - limb->v[j]);
    }
    for (size_t i = 0; jacobian != NULL && i < SUPINE_PV_CONTROLS; ++i) {
      const size_t k = PV_STATE + 2 * i;
      gsl_matrix_set(jacobian, j, i, (high - low) * (state[k] - q * end[k]) / end[0]);
    }
    if (jacobian != NULL) {
      gsl_matrix_set(jacobian, j, LOW, 1.0 - q);
      gsl_matrix_set(jacobian, j, HIGH, q);
    }
  }
  return GSL_SUCCESS;
}

static int problem_residual(const gsl_vector *unknowns, void *context, gsl_vector *residual) {
  return problem_evaluate(unknowns, context, residual, NULL);
}

static int problem_jacobian(const gsl_vector *unknowns, void *context, gsl_matrix *jacobian) {
  return problem_evaluate(unknowns, context, NULL, jacobian);
}

/* Levenberg-Marquardt from the straight line between the end samples. */
static supine_status problem_solve(problem *limb, gsl_multifit_nlinear_workspace *work) {
  enum { STEPS_MAX = 300 };
  static const double tolerance = 1e-13;
  double start[SUPINE_PV_UNKNOWNS] = {0};
  start[LOW] = limb->v[0];
  start[HIGH] = limb->v[limb->count - 1];
  gsl_vector_view unknowns = gsl_vector_view_array(start, SUPINE_PV_UNKNOWNS);
  gsl_multifit_nlinear_fdf system = {.f = problem_residual,
                                     .df = problem_jacobian,
                                     .n = limb->count,
                                     .p = SUPINE_PV_UNKNOWNS,
                                     .params = limb};
  int info = 0;
  int code = gsl_multifit_nlinear_init(&unknowns.vector, &system, work);
  if (code == GSL_SUCCESS) {
    code =
        gsl_multifit_nlinear_driver(STEPS_MAX, tolerance, tolerance, 0.0, NULL, NULL, &info, work);
  }
  if (limb->status != SUPINE_OK) {
    return limb->status;
  }
  /* A minimum reached to rounding makes no further progress. */
  return code == GSL_SUCCESS || code == GSL_ENOPROG ? SUPINE_OK : SUPINE_ERROR_NUMERICAL;
}

/* Samples by rising pressure, shifted and scaled to the unit range. */
static void problem_fill(problem *limb, const double *pressures, const double *volumes,
                         const supine_pv_curve *curve, double span) {
  const size_t last = limb->count - 1;
  const bool falling = pressures[last] < pressures[0];
  for (size_t j = 0; j < limb->count; ++j) {
    const size_t from = falling ? last - j : j;
    limb->x[j] = supine_breath_normalise(curve, pressures[from]);
    limb->v[j] = (volumes[from] - curve->volume[0]) / span;
  }
}

static supine_status fit_curve(problem *limb, double span, double confidence,
                               supine_pv_curve *curve, supine_pv_report *report, double *sigma) {
  gsl_multifit_nlinear_parameters options = gsl_multifit_nlinear_default_parameters();
  gsl_multifit_nlinear_workspace *work = gsl_multifit_nlinear_alloc(
      gsl_multifit_nlinear_trust, &options, limb->count, SUPINE_PV_UNKNOWNS);
  if (work == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  supine_status status = problem_solve(limb, work);
  if (status == SUPINE_OK) {
    const double *found = gsl_multifit_nlinear_position(work)->data;
    const double shift = curve->volume[0];
    for (size_t i = 0; i < SUPINE_PV_CONTROLS; ++i) {
      curve->control[i] = found[i];
    }
    curve->volume[0] = shift + span * found[LOW];
    curve->volume[1] = shift + span * found[HIGH];
    status = supine_breath_report_fill(gsl_multifit_nlinear_jac(work),
                                       gsl_multifit_nlinear_residual(work), span, confidence,
                                       report, sigma);
  }
  gsl_multifit_nlinear_free(work);
  return status;
}

/* Fit both limbs. Nine parameters, over 60 lines: samples, options of the fit, and its results. */
supine_status supine_breath_fit(size_t count, const double *pressures, const double *volumes,
                                const size_t *lines, const char *name, double confidence,
                                supine_pv_curve *curve, supine_pv_report *report,
                                supine_error *error) {
  enum { TELLING = 15 }; /* samples that let noise be estimated beside the unknowns */
  static const double allowed_share_few = 0.08;
  static const double allowed_share = 0.15;
  static const double allowed_sigmas = 7.0;
  if (!(confidence > 0.0 && confidence < 1.0)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                            "confidence %g is not between 0 and 1: give "
                            "--confidence 0.95, for example",
                            confidence);
  }
  const pv_origin origin = {name, lines, count, pressures, volumes};
  supine_status status = supine_breath_samples_check(&origin, error);
  if (status != SUPINE_OK) {
    return status;
  }
  double span = 0.0;
  supine_pv_curve found = {0};
  supine_pv_report told = {0};
  supine_breath_samples_range(&origin, &found, &span);
  double sigma = 0.0;
  problem limb = {.count = count,
                  .x = calloc(count, sizeof(double)),
                  .v = calloc(count, sizeof(double)),
                  .states = calloc(count, PV_STATE_WITH_RESPONSES * sizeof(double))};
  if (limb.x == NULL || limb.v == NULL || limb.states == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
    goto cleanup;
  }
  problem_fill(&limb, pressures, volumes, &found, span);
  status = supine_breath_check_falls(&origin, limb.v,
                                     count < TELLING ? allowed_share_few : allowed_share, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  status = fit_curve(&limb, span, confidence, &found, &told, &sigma);
  if (status != SUPINE_OK) {
    (void)supine_error_set(error, status, "%s: %s", name != NULL ? name : "samples",
                           status == SUPINE_ERROR_MEMORY
                               ? "out of memory"
                               : "no pressure-volume curve fits: look for an outlier and "
                                 "remove it");
    goto cleanup;
  }
  if (count >= TELLING) {
    status = supine_breath_check_falls(&origin, limb.v, allowed_sigmas * sqrt(2.0) * sigma, error);
  }
  if (status == SUPINE_OK) {
    status = supine_breath_curve_check(&found, error);
  }
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  *curve = found;
  if (report != NULL) {
    *report = told;
  }
cleanup:
  free(limb.states);
  free(limb.v);
  free(limb.x);
  return status;
}
