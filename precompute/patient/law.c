/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The law (15)-(18) at rows, its derivatives, and its size by least squares. */
#include <math.h>
#include <string.h>

#include <lapacke.h>

#include "precompute/patient/rows.h"

/* Beyond these exponents all motion is at one face; beyond these slopes the force changes sign. */
const double supine_patient_exponent_least = 0.5, supine_patient_exponent_most = 4.0,
             supine_patient_slope_most = 2.5;

double supine_patient_power_design(const supine_patient_power *law, const supine_patient_row *row,
                                   double x[SUPINE_PATIENT_TERMS]) {
  const double *slopes = law->powers + 3;
  const double force = row->force[0] + slopes[0] * row->force[1] + slopes[1] * row->force[2] +
                       slopes[2] * row->force[3]; /* (18) */
  double even = 0.0;                              /* displacement for a force of 1 */
  double left = -row->value;
  for (size_t a = 0; a < 3; ++a) {
    const double box = fmin(1.0, fmax(1e-12, row->place.box[a]));
    const double sign = a == 0 ? row->place.side : -1.0;
    const double along = row->axis[a] * sign * pow(box, law->powers[a]); /* (15)-(17) */
    const size_t b = (a + 1) % 3;
    const size_t c = (a + 2) % 3;
    even += law->linear[a] * along;
    x[a] = force * along;
    x[3 + a] = law->linear[a] * x[a] * law->powers[a] * log(box);
    x[9 + a] = row->axis[a];
    x[12 + a] = row->axis[c] * row->place.arm[b] - row->axis[b] * row->place.arm[c];
    left += law->linear[3 + a] * x[9 + a] + law->linear[6 + a] * x[12 + a];
  }
  for (size_t k = 0; k < 3; ++k) {
    x[6 + k] = even * row->force[1 + k];
  }
  x[15] = even * force;
  return left + x[15];
}

void supine_patient_take(const supine_patient_power *law, supine_patient *patient) {
  memcpy(patient->powers, law->powers, sizeof patient->powers);
  memcpy(patient->lengths, law->linear, sizeof patient->lengths);
  memcpy(patient->motion, law->linear + 3, sizeof patient->motion);
  patient->correction.count = 0;
}

double supine_patient_power_residual(const supine_patient_power *law,
                                     const supine_patient_row *row) {
  double x[SUPINE_PATIENT_TERMS];
  return supine_patient_power_design(law, row, x);
}

void supine_patient_power_displacement(const supine_patient_power *law,
                                       const supine_patient_row *row, double u[3]) {
  supine_patient_row all = *row;
  double x[SUPINE_PATIENT_TERMS];
  all.axis[0] = all.axis[1] = all.axis[2] = 1.0;
  (void)supine_patient_power_design(law, &all, x);
  for (size_t a = 0; a < 3; ++a) {
    u[a] = law->linear[a] * x[a];
  }
}

double supine_patient_power_along(const supine_patient_power *law, const supine_patient_row *row) {
  supine_patient_row even = *row;
  double x[SUPINE_PATIENT_TERMS];
  even.force[0] = 1.0;
  even.force[1] = even.force[2] = even.force[3] = 0.0;
  (void)supine_patient_power_design(law, &even, x);
  return law->linear[0] * x[0] + law->linear[1] * x[1] + law->linear[2] * x[2];
}

supine_status supine_patient_scale_fit(const supine_patient_row *rows, size_t count,
                                       supine_patient_moved moved,
                                       const supine_patient_power *shape, supine_patient_power *fit,
                                       supine_error *error) {
  const size_t n = moved == SUPINE_PATIENT_STILL ? 1 : moved == SUPINE_PATIENT_TRANSLATION ? 4 : 7;
  double matrix[7 * 7] = {0.0};
  double right[7] = {0.0};
  *fit = *shape;
  memset(fit->linear + 3, 0, 6 * sizeof *fit->linear);
  for (size_t i = 0; i < count; ++i) {
    double x[SUPINE_PATIENT_TERMS];
    double *column = x + 8; /* columns of the law, then of the motion */
    (void)supine_patient_power_design(fit, &rows[i], x);
    column[0] = x[15];
    for (size_t a = 0; a < n; ++a) {
      for (size_t b = 0; b < n; ++b) {
        matrix[a * n + b] += rows[i].weight * column[a] * column[b];
      }
      right[a] += rows[i].weight * column[a] * rows[i].value;
    }
  }
  const lapack_int size = (lapack_int)n;
  if (LAPACKE_dposv(LAPACK_COL_MAJOR, 'U', size, 1, matrix, size, right, size) != 0) {
    return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                            "the points do not determine the law, as if they lay in one plane: "
                            "give points all over the lungs");
  }
  for (size_t a = 0; a < 3; ++a) {
    fit->linear[a] *= right[0];
  }
  memcpy(fit->linear + 3, right + 1, (n - 1) * sizeof *right);
  return SUPINE_OK;
}
