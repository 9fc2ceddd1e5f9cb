/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * The pressure-volume relation from samples: what supine/breath.h breathes by, fitted, read,
 * written. Everything here is thread-safe. GSL's default error handler aborts: programs turn it
 * off. */
#ifndef SUPINE_PV_H
#define SUPINE_PV_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/breath.h>

/** What a fit determines: the control parameters and the volumes at the two ends. */
enum { SUPINE_PV_UNKNOWNS = SUPINE_PV_CONTROLS + 2 };

/** Quality of the fit of one limb. */
typedef struct supine_pv_report {
  size_t samples;    /**< 0: the limb had none, and its curve is the other limb's */
  double confidence; /**< of the intervals, 0 to 1 */
  double control_interval[SUPINE_PV_CONTROLS]; /**< half-width of the Student t interval of c_i */
  double volume_interval[2]; /**< half-widths of the intervals of V_low and V_high, mL */
  double covariance[SUPINE_PV_UNKNOWNS][SUPINE_PV_UNKNOWNS]; /**< c_1 ... c_5, V_low, V_high */
  double rms;                                                /**< root mean square misfit, mL */
  double rms_percent; /**< the same as a percentage of the samples' volume range */
  double condition;   /**< of the least-squares problem, columns scaled to unit length */
} supine_pv_report;

/** The limb that fits samples best: the inverse problem.
 *
 *     minimise over c, V_low, V_high:  sum of (V(P_j) - V_j)^2
 *
 * by Levenberg-Marquardt on the equation and its variational equations, which give the response of
 * V to each basis function; covariance and Student-t intervals follow from the responses at the
 * minimum. The range of the limb is that of the samples. Where a limb is flat over much of its
 * range the samples say little about some parameters: those stop at +-SUPINE_PV_CONTROL_MAX at the
 * latest and their intervals are wide, while the curve itself still fits. Samples that no lung
 * gives, such as a single step, end there too: `rms_percent` tells.
 *
 * Pressures must rise or fall strictly. Volumes must rise with pressure, but for noise: a sample
 * may step back from the local trend, or from the greatest volume so far, by up to 8 % of the
 * volume range. Where at least 15 samples tell what the noise is, by up to 7 sigma of the
 * difference of two samples, sigma estimated from the median misfit, and never more than 15 %.
 *
 * @param count       more than SUPINE_PV_UNKNOWNS
 * @param pressures   [count] cmH2O
 * @param volumes     [count] mL
 * @param lines       [count] line of each sample, for messages; NULL: samples count from 1
 * @param name        of the samples, for messages; NULL: none
 * @param confidence  of the intervals, e.g. 0.95, between 0 and 1
 * @param curve       written
 * @param report      written; NULL: not wanted
 * @retval SUPINE_ERROR_FORMAT     too few samples, not finite, repeated or unordered pressures,
 *                                 volumes that fall: the message names the line
 * @retval SUPINE_ERROR_ARGUMENT   confidence
 * @retval SUPINE_ERROR_NUMERICAL  no minimum was reached
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_breath_fit(size_t count, const double *pressures, const double *volumes,
                                const size_t *lines, const char *name, double confidence,
                                supine_pv_curve *curve, supine_pv_report *report,
                                supine_error *error);

/** Samples of a lung as a file holds them. */
typedef struct supine_pv_samples {
  char *name; /**< the file's */
  size_t count[SUPINE_PV_LIMB_COUNT];
  double *pressure[SUPINE_PV_LIMB_COUNT]; /**< [count] cmH2O, in the file's order */
  double *volume[SUPINE_PV_LIMB_COUNT];   /**< [count] mL */
  size_t *line[SUPINE_PV_LIMB_COUNT];     /**< [count] where each stood */
} supine_pv_samples;

/** Reads samples: CSV with a header naming the columns pressure_cmH2O, volume_mL and, optionally,
 * limb (inhale or exhale; without it all are inhale), in any order. Lines that begin with # and
 * empty lines are skipped.
 * @retval SUPINE_ERROR_READ    missing file
 * @retval SUPINE_ERROR_FORMAT  the message names the line
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_breath_samples_load(const char *path, supine_pv_samples *samples,
                                         supine_error *error);

/** Frees what load allocated; legal on a zeroed struct, and twice. */
void supine_breath_samples_clear(supine_pv_samples *samples);

/** Fits both limbs. A limb without samples takes the other's curve.
 * @param reports  [SUPINE_PV_LIMB_COUNT] written; NULL: not wanted
 * Statuses as supine_breath_fit. */
supine_status supine_breath_fit_samples(const supine_pv_samples *samples, double confidence,
                                        supine_pv *pv, supine_pv_report *reports,
                                        supine_error *error);

/** Writes parameters, whole or not at all: CSV, one row a limb, digits enough to read back the very
 * same numbers.
 * @retval SUPINE_ERROR_WRITE, SUPINE_ERROR_ARGUMENT (a bad curve), SUPINE_ERROR_MEMORY */
supine_status supine_breath_save(const char *path, const supine_pv *pv, supine_error *error);

/** Reads what supine_breath_save wrote. Where a file has one limb alone it serves for both.
 * @retval SUPINE_ERROR_READ, SUPINE_ERROR_FORMAT, SUPINE_ERROR_MEMORY */
supine_status supine_breath_load(const char *path, supine_pv *pv, supine_error *error);

#endif
