/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Fit a lung's pressure-volume relation (supine/breath.h) to samples; read its parameters. The
 * functions are thread-safe. Turn off GSL's default error handler first: it would abort. */
#ifndef SUPINE_PV_H
#define SUPINE_PV_H

#include <stddef.h>

#include <supine/breath.h>

/** Unknowns of a fit: the control parameters and the volumes at the two ends. */
enum { SUPINE_PV_UNKNOWNS = SUPINE_PV_CONTROLS + 2 };

typedef struct supine_pv_sample {
  double pressure; /**< cmH2O */
  double volume;   /**< mL */
  size_t line;     /**< line of the file, for messages */
} supine_pv_sample;

/** Quality of the fit of one limb. */
typedef struct supine_pv_report {
  size_t samples; /**< number; 0: the limb has the other limb's curve */
  double control_interval[SUPINE_PV_CONTROLS]; /**< half-width of the confidence interval of c_i */
  double volume_interval[2];                   /**< confidence half-widths of V_low, V_high, mL */
  double rms;                                  /**< root mean square residual, mL */
  double rms_percent; /**< rms as a percentage of the samples' range of volumes */
} supine_pv_report;

/** Fit the curve of a limb to samples:
 *
 *     minimise over c, V_low, V_high:  sum of (V(P_j) - V_j)^2
 *
 * by Levenberg-Marquardt; intervals are Student's t with the covariance at the minimum. The curve
 * covers the range of the samples' pressures. Where a limb is flat over much of its range, the
 * samples determine some parameters poorly: these stay within +-SUPINE_PV_CONTROL_MAX and have wide
 * intervals, while the curve itself still fits.
 *
 * Pressures must keep rising or keep falling. Volumes must rise with pressure except for noise: a
 * volume may be less than a volume at a lower pressure by up to 10 % of the range of volumes.
 *
 * @param name        the samples' file, for messages
 * @param count       at least SUPINE_PV_UNKNOWNS + 1
 * @param samples     [count] finite
 * @param confidence  confidence level of the intervals, between 0 and 1
 * @retval SUPINE_ERROR_FORMAT     too few samples, repeated or unordered pressures, falling volumes
 * @retval SUPINE_ERROR_NUMERICAL  no minimum was found
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_breath_fit(const char *name, size_t count, const supine_pv_sample *samples,
                                double confidence, supine_pv_curve *curve, supine_pv_report *report,
                                supine_error *error);

/** Fit both limbs to a file of samples. A limb without samples takes the other limb's curve.
 *
 * The file is CSV with the columns pressure_cmH2O, volume_mL and, optionally, limb (inhale or
 * exhale; without it all samples are inhale).
 * @param reports  [SUPINE_PV_LIMB_COUNT]
 * @retval SUPINE_ERROR_READ; else as supine_breath_fit */
supine_status supine_breath_fit_file(const char *path, double confidence, supine_pv *pv,
                                     supine_pv_report *reports, supine_error *error);

/** Read the parameters that 'supine pv fit -o' wrote. A file with one limb sets both limbs.
 * @retval SUPINE_ERROR_READ, SUPINE_ERROR_FORMAT, SUPINE_ERROR_MEMORY */
supine_status supine_breath_load(const char *path, supine_pv *pv, supine_error *error);

#endif
