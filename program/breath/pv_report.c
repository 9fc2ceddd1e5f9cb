/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Quality of the fit of a limb. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include <gsl/gsl_cdf.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_multifit_nlinear.h>
#include <gsl/gsl_sort_vector.h>
#include <gsl/gsl_statistics.h>
#include <lapacke.h>

#include "program/breath/pv_internal.h"

/* Ratio of the extreme singular values of J with columns scaled to unit length, in `scaled`; 0
 * where none are found. */
static double jacobian_condition(const gsl_matrix *jacobian, double *scaled) {
  const int rows = (int)jacobian->size1;
  const int columns = (int)jacobian->size2;
  double s[SUPINE_PV_UNKNOWNS];
  for (int j = 0; j < columns; ++j) {
    cblas_dcopy(rows, jacobian->data + j, (int)jacobian->tda, scaled + j, columns);
    const double length = cblas_dnrm2(rows, scaled + j, columns);
    cblas_dscal(rows, length > 0.0 ? 1.0 / length : 1.0, scaled + j, columns);
  }
  const bool found = LAPACKE_dgesdd(LAPACK_ROW_MAJOR, 'N', rows, columns, scaled, columns, s, NULL,
                                    columns, NULL, columns) == 0;
  return found ? s[0] / s[columns - 1] : 0.0;
}

/* Estimate sigma from the median absolute residual, which is robust against outliers. */
static double residual_sigma(const gsl_vector *residual, gsl_vector *scratch) {
  static const double normal = 1.4826; /* sigma over median |error| of the normal distribution */
  const size_t count = residual->size;
  for (size_t j = 0; j < count; ++j) {
    gsl_vector_set(scratch, j, fabs(gsl_vector_get(residual, j)));
  }
  gsl_sort_vector(scratch);
  const double median = gsl_stats_median_from_sorted_data(scratch->data, scratch->stride, count);
  return normal * median * sqrt((double)count / (double)(count - SUPINE_PV_UNKNOWNS));
}

supine_status supine_breath_report_fill(const gsl_matrix *jacobian, const gsl_vector *residual,
                                        double span, double confidence, supine_pv_report *report,
                                        double *sigma) {
  const size_t count = residual->size;
  gsl_matrix *covariance = gsl_matrix_alloc(SUPINE_PV_UNKNOWNS, SUPINE_PV_UNKNOWNS);
  gsl_vector *scratch = gsl_vector_alloc(count);
  double *scaled = malloc(count * SUPINE_PV_UNKNOWNS * sizeof *scaled);
  const supine_status status =
      covariance == NULL || scratch == NULL || scaled == NULL ? SUPINE_ERROR_MEMORY : SUPINE_OK;
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  const double misfit = cblas_dnrm2((int)count, residual->data, (int)residual->stride);
  const double freedom = (double)(count - SUPINE_PV_UNKNOWNS);
  const double variance = misfit * misfit / freedom;
  const double t = gsl_cdf_tdist_Pinv(0.5 + 0.5 * confidence, freedom);
  *sigma = residual_sigma(residual, scratch);
  /* covariance = sigma^2 (J^T J)^-1 */
  (void)gsl_multifit_nlinear_covar(jacobian, 0.0, covariance);
  *report = (supine_pv_report){.samples = count,
                               .confidence = confidence,
                               .rms = span * misfit / sqrt((double)count),
                               .rms_percent = 100.0 * misfit / sqrt((double)count),
                               .condition = jacobian_condition(jacobian, scaled)};
  for (size_t i = 0; i < SUPINE_PV_UNKNOWNS; ++i) {
    const double unit_i = i < SUPINE_PV_CONTROLS ? 1.0 : span; /* from shares of the range to mL */
    for (size_t j = 0; j < SUPINE_PV_UNKNOWNS; ++j) {
      const double unit_j = j < SUPINE_PV_CONTROLS ? 1.0 : span;
      report->covariance[i][j] = unit_i * unit_j * variance * gsl_matrix_get(covariance, i, j);
    }
    const double interval = t * sqrt(report->covariance[i][i]);
    if (i < SUPINE_PV_CONTROLS) {
      report->control_interval[i] = interval;
    } else {
      report->volume_interval[i - SUPINE_PV_CONTROLS] = interval;
    }
  }
cleanup:
  free(scaled);
  gsl_vector_free(scratch);
  gsl_matrix_free(covariance);
  return status;
}
