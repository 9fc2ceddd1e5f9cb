/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The differential equation of a limb, and its responses to the control parameters. */
#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>
#include <gsl/gsl_sf_legendre.h>

#include "program/breath/pv_internal.h"

typedef struct equation {
  const double *control;
  size_t size;
} equation;

/* y'' = u y';  (dy/dc_i)'' = u (dy/dc_i)' + P_i-1 y' */
static int equation_derivative(double x, const double state[], double derivative[], void *context) {
  const equation *limb = context;
  double basis[SUPINE_PV_CONTROLS];
  const double inside = x < -1.0 ? -1.0 : x > 1.0 ? 1.0 : x;
  if (gsl_sf_legendre_Pl_array(SUPINE_PV_CONTROLS - 1, inside, basis) != GSL_SUCCESS) {
    return GSL_EBADFUNC;
  }
  double u = 0.0;
  for (size_t i = 0; i < SUPINE_PV_CONTROLS; ++i) {
    u += limb->control[i] * basis[i];
  }
  derivative[0] = state[1];
  derivative[1] = u * state[1];
  for (size_t k = PV_STATE; k < limb->size; k += 2) {
    derivative[k] = state[k + 1];
    derivative[k + 1] = u * state[k + 1] + basis[k / 2 - 1] * state[1];
  }
  return GSL_SUCCESS;
}

double supine_breath_normalise(const supine_pv_curve *curve, double pressure) {
  const double low = curve->pressure[0];
  const double high = curve->pressure[1];
  const double x = ((pressure - low) - (high - pressure)) / (high - low);
  return x < -1.0 ? -1.0 : x > 1.0 ? 1.0 : x;
}

supine_status supine_breath_integrate(const double control[SUPINE_PV_CONTROLS], size_t count,
                                      const double *x, size_t size, double *states) {
  static const double first_step = 1e-3;
  static const double absolute = 1e-14;
  static const double relative = 1e-12;
  equation limb = {control, size};
  const gsl_odeiv2_system system = {equation_derivative, NULL, size, &limb};
  gsl_odeiv2_driver *driver =
      gsl_odeiv2_driver_alloc_y_new(&system, gsl_odeiv2_step_rk8pd, first_step, absolute, relative);
  if (driver == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  supine_status status = SUPINE_OK;
  double at = -1.0;
  double state[PV_STATE_WITH_RESPONSES] = {0.0, 1.0};
  for (size_t j = 0; j < count && status == SUPINE_OK; ++j) {
    if (gsl_odeiv2_driver_apply(driver, &at, x[j], state) != GSL_SUCCESS) {
      status = SUPINE_ERROR_NUMERICAL;
    }
    for (size_t k = 0; k < size; ++k) {
      states[j * size + k] = state[k];
    }
  }
  gsl_odeiv2_driver_free(driver);
  return status;
}
