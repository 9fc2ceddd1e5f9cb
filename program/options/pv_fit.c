/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fit a pressure-volume curve to samples by least squares, with confidence intervals. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_cblas.h>
#include <gsl/gsl_cdf.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_multifit_nlinear.h>

#include "base/arena.h"
#include "program/options/pv.h"

enum {
  LOW = SUPINE_PV_CONTROLS, /* index, among the unknowns, of the volume at the lower end */
  HIGH                      /* index of the volume at the upper end */
};

typedef struct problem {
  const char *name;
  size_t count;
  supine_pv_sample *sample; /* [count] sorted by rising pressure */
  gsl_multifit_nlinear_workspace *work;
  double *x; /* [count] pressures, mapped linearly to the range -1 to 1 */
  double *v; /* [count] (volume - first volume) / range of volumes */
  double *q; /* [count] volumes of the curve at the pressures x, scaled to rise from 0 to 1 */
} problem;

static supine_status refuse(const problem *limb, const supine_pv_sample *sample, const char *why,
                            supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_FORMAT, "%.200s:%zu: %s", limb->name, sample->line,
                          why);
}

static supine_status refuse_fall(const problem *limb, const supine_pv_sample *sample, double larger,
                                 supine_error *error) {
  return supine_error_set(
      error, SUPINE_ERROR_FORMAT,
      "%.200s:%zu: volume %g mL is not above the %g mL at a lower pressure: volume must rise with "
      "pressure, apart from a little noise; correct or remove the sample",
      limb->name, sample->line, sample->volume, larger);
}

/* Check that pressures keep rising or keep falling, and sort the samples by rising pressure. */
static supine_status sort(problem *limb, const supine_pv_sample *samples, supine_error *error) {
  const size_t count = limb->count;
  supine_pv_sample *sorted = limb->sample;
  const bool falling = samples[count - 1].pressure < samples[0].pressure;
  sorted[falling ? count - 1 : 0] = samples[0];
  for (size_t j = 1; j < count; ++j) {
    const double step = samples[j].pressure - samples[j - 1].pressure;
    if (step == 0.0) {
      return refuse(limb, &samples[j],
                    "the pressure repeats the one before: keep one of the samples, or their mean",
                    error);
    }
    if ((step > 0.0) != (samples[1].pressure > samples[0].pressure)) {
      return refuse(limb, &samples[j],
                    "the pressure changes direction: within a limb it must only rise or only fall; "
                    "sort the samples, or name the limbs in a column \"limb\"",
                    error);
    }
    sorted[falling ? count - 1 - j : j] = samples[j];
  }
  return sorted[count - 1].volume > sorted[0].volume
             ? SUPINE_OK
             : refuse_fall(limb, &sorted[count - 1], sorted[0].volume, error);
}

/* Refuse samples if the volume falls with rising pressure by more than noise explains. */
static supine_status check_falls(const problem *limb, double span, supine_error *error) {
  static const double allowed = 0.1; /* largest fall, as a fraction of the range of volumes */
  double peak = limb->sample[0].volume;
  for (size_t j = 1; j < limb->count; ++j) {
    const supine_pv_sample *sample = &limb->sample[j];
    if (peak - sample->volume > allowed * span) {
      return refuse_fall(limb, sample, peak, error);
    }
    peak = fmax(peak, sample->volume);
  }
  return SUPINE_OK;
}

/* Compute q, the volumes of the curve scaled to rise from 0 to 1. Return false for parameters out
 * of bounds. */
static bool find_shape(const problem *limb, const double *control, double *q) {
  supine_pv_curve curve = {{-1.0, 1.0}, {0.0, 1.0}, {0.0}};
  memcpy(curve.control, control, sizeof curve.control);
  return supine_breath_curve_evaluate(&curve, limb->count, limb->x, q, NULL, NULL) == SUPINE_OK;
}

/* Compute the residuals (1 - q) V_low + q V_high - v. Here q is the curve scaled to rise from 0 to
 * 1, V_low and V_high are the volumes at its ends, and v are the volumes of the samples. */
static int find_residuals(const gsl_vector *unknowns, void *context, gsl_vector *residual) {
  static const double wall = 1e6; /* residual for parameters that are out of bounds */
  const problem *limb = context;
  if (!find_shape(limb, unknowns->data, limb->q)) {
    gsl_vector_set_all(residual, wall);
    return GSL_SUCCESS;
  }
  for (size_t j = 0; j < limb->count; ++j) {
    const double q = limb->q[j];
    gsl_vector_set(residual, j,
                   (1.0 - q) * unknowns->data[LOW] + q * unknowns->data[HIGH] - limb->v[j]);
  }
  return GSL_SUCCESS;
}

/* Compute the derivatives of the residuals. Those with respect to the curve's control parameters
 * (supine/breath.h) are central differences, accurate to about 1e-10. Those with respect to the
 * volumes V_low and V_high at the curve's ends are exact. */
static int find_jacobian(const gsl_vector *unknowns, void *context, gsl_matrix *jacobian) {
  static const double step = 1e-5;
  const problem *limb = context;
  const double span = unknowns->data[HIGH] - unknowns->data[LOW];
  double control[SUPINE_PV_CONTROLS];
  memcpy(control, unknowns->data, sizeof control);
  for (size_t i = 0; i < SUPINE_PV_CONTROLS; ++i) {
    const double up = fmin(control[i] + step, SUPINE_PV_CONTROL_MAX);
    const double down = fmax(control[i] - step, -SUPINE_PV_CONTROL_MAX);
    for (int side = 0; side < 2; ++side) {
      control[i] = side == 0 ? up : down;
      (void)find_shape(limb, control, limb->q);
      for (size_t j = 0; j < limb->count; ++j) {
        double *entry = gsl_matrix_ptr(jacobian, j, i);
        *entry = side == 0 ? limb->q[j] : span * (*entry - limb->q[j]) / (up - down);
      }
    }
    control[i] = unknowns->data[i];
  }
  (void)find_shape(limb, control, limb->q);
  for (size_t j = 0; j < limb->count; ++j) {
    gsl_matrix_set(jacobian, j, LOW, 1.0 - limb->q[j]);
    gsl_matrix_set(jacobian, j, HIGH, limb->q[j]);
  }
  return GSL_SUCCESS;
}

static void describe(const problem *limb, double span, double confidence,
                     supine_pv_report *report) {
  const gsl_matrix *jacobian = gsl_multifit_nlinear_jac(limb->work);
  const gsl_vector *residual = gsl_multifit_nlinear_residual(limb->work);
  const size_t count = residual->size;
  const double freedom = (double)(count - SUPINE_PV_UNKNOWNS);
  const double misfit = cblas_dnrm2((int)count, residual->data, (int)residual->stride);
  const double share = misfit / sqrt((double)count);
  *report = (supine_pv_report){.samples = count, .rms = span * share, .rms_percent = 100.0 * share};
  /* Compute (J^T J)^-1 for the Jacobian J. Times misfit^2 / freedom, it is the covariance of the
   * unknowns. */
  double entries[SUPINE_PV_UNKNOWNS * SUPINE_PV_UNKNOWNS];
  gsl_matrix_view covariance =
      gsl_matrix_view_array(entries, SUPINE_PV_UNKNOWNS, SUPINE_PV_UNKNOWNS);
  (void)gsl_multifit_nlinear_covar(jacobian, 0.0, &covariance.matrix);
  const double t = gsl_cdf_tdist_Pinv(0.5 + 0.5 * confidence, freedom);
  for (size_t i = 0; i < SUPINE_PV_UNKNOWNS; ++i) {
    const double interval = t * misfit * sqrt(gsl_matrix_get(&covariance.matrix, i, i) / freedom);
    if (i < LOW) {
      report->control_interval[i] = interval;
    } else {
      report->volume_interval[i - LOW] = span * interval;
    }
  }
}

/* Minimise the residuals, starting from the straight line from the first to the last sample. */
static supine_status minimise(problem *limb) {
  enum { STEPS_MAX = 300 };
  static const double tolerance = 1e-13;
  double start[SUPINE_PV_UNKNOWNS] = {0};
  start[LOW] = limb->v[0];
  start[HIGH] = limb->v[limb->count - 1];
  gsl_vector_view unknowns = gsl_vector_view_array(start, SUPINE_PV_UNKNOWNS);
  gsl_multifit_nlinear_fdf system = {.f = find_residuals,
                                     .df = find_jacobian,
                                     .n = limb->count,
                                     .p = SUPINE_PV_UNKNOWNS,
                                     .params = limb};
  int info = 0;
  int code = gsl_multifit_nlinear_init(&unknowns.vector, &system, limb->work);
  if (code == GSL_SUCCESS) {
    code = gsl_multifit_nlinear_driver(STEPS_MAX, tolerance, tolerance, 0.0, NULL, NULL, &info,
                                       limb->work);
  }
  /* GSL_ENOPROG: the minimum is reached, and rounding hides any further decrease. */
  return code == GSL_SUCCESS || code == GSL_ENOPROG ? SUPINE_OK : SUPINE_ERROR_NUMERICAL;
}

static supine_status fit_sorted(problem *limb, double confidence, supine_pv_curve *curve,
                                supine_pv_report *report, supine_error *error) {
  const size_t count = limb->count;
  const supine_pv_sample *s = limb->sample;
  const double low = s[0].pressure;
  const double high = s[count - 1].pressure;
  double least = s[0].volume;
  double largest = s[0].volume;
  for (size_t j = 1; j < count; ++j) {
    least = fmin(least, s[j].volume);
    largest = fmax(largest, s[j].volume);
  }
  const double span = largest - least;
  for (size_t j = 0; j < count; ++j) {
    limb->x[j] = ((s[j].pressure - low) - (high - s[j].pressure)) / (high - low);
    limb->v[j] = (s[j].volume - s[0].volume) / span;
  }
  SUPINE_TRY(check_falls(limb, span, error));
  const supine_status status = minimise(limb);
  SUPINE_REFUSE_IF(status != SUPINE_OK, error, SUPINE_ERROR_NUMERICAL,
                   "%s: no pressure-volume curve fits: look for an outlier and remove it",
                   limb->name);
  const double *found = gsl_multifit_nlinear_position(limb->work)->data;
  *curve = (supine_pv_curve){
      .pressure = {low, high},
      .volume = {s[0].volume + span * found[LOW], s[0].volume + span * found[HIGH]}};
  memcpy(curve->control, found, sizeof curve->control);
  describe(limb, span, confidence, report);
  return supine_breath_curve_check(curve, error);
}

static void free_workspace(problem *limb) {
  gsl_multifit_nlinear_free(limb->work);
}

supine_status supine_options_pv_fit(const char *name, size_t count, const supine_pv_sample *samples,
                                    double confidence, supine_pv_curve *curve,
                                    supine_pv_report *report, supine_error *error) {
  gsl_multifit_nlinear_parameters options = gsl_multifit_nlinear_default_parameters();
  SUPINE_REFUSE_IF(count <= SUPINE_PV_UNKNOWNS, error, SUPINE_ERROR_FORMAT,
                   "%s: a limb has %zu sample%s, too few for %d unknowns: give at least %d", name,
                   count, count == 1 ? "" : "s", (int)SUPINE_PV_UNKNOWNS,
                   (int)SUPINE_PV_UNKNOWNS + 1);
  SUPINE_ARENA arena = {0};
  SUPINE_FREED_BY(free_workspace)
  problem limb = {.name = name,
                  .count = count,
                  .sample = supine_arena_take(&arena, count, sizeof *limb.sample),
                  .work = gsl_multifit_nlinear_alloc(gsl_multifit_nlinear_trust, &options, count,
                                                     SUPINE_PV_UNKNOWNS),
                  .x = supine_arena_take(&arena, count, sizeof(double)),
                  .v = supine_arena_take(&arena, count, sizeof(double)),
                  .q = supine_arena_take(&arena, count, sizeof(double))};
  if (arena.failed || limb.work == NULL) {
    return supine_error_memory(error, "%s: %zu samples", name, count);
  }
  SUPINE_TRY(sort(&limb, samples, error));
  return fit_sorted(&limb, confidence, curve, report, error);
}
