/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Fit spherical harmonics of the direction of gravity to the displacement fields of another
 * simulator, and compress the fit. The field u(g_j) holds the displacements of all vertices for the
 * direction of gravity g_j, and Y(g_j) holds the values of the harmonics at g_j. The coefficients C
 * minimise
 *
 *     sum over j of |u(g_j) - C Y(g_j)|^2
 *
 * The band of a fit is the highest degree of its harmonics. By default, bands are tried in rising
 * order, and a higher band is chosen if it reduces the leave-one-out error by more than 1 %. */
#ifndef SUPINE_FIELDS_H
#define SUPINE_FIELDS_H

#include "precompute/lungs/lungs.h"
#include "precompute/precompute.h"

/** Displacements of all vertices for several directions of gravity, made by another simulator. */
typedef struct supine_fields {
  size_t direction_count; /**< number of directions of gravity */
  size_t vertex_count;
  double *directions;   /**< [direction_count, 3] unit vectors along gravity */
  double *displacement; /**< [direction_count, vertex_count, 3] displacement of each vertex, mm */
} supine_fields;

/** Read displacement fields from a safetensors file with three tensors, F32 or F64: points [P, 3],
 * the positions of P points; gravity [M, 3], M directions of gravity; and displacement [M, P, 3],
 * the displacement of each point for each direction. All are in the same axes and unit. Each vertex
 * of `lungs` takes the displacement of the point at its position, within 1e-4 of the diagonal of
 * the bounding box. Other points, such as inner nodes of a volume mesh, are left out.
 * @param lungs   the reference surface
 * @param frame   axes and unit of the file, which are those of the files of the lungs; a frame of
 *   zeros stands for LPS and mm
 * @param fields  release with supine_fields_free */
supine_status supine_fields_load(const char *path, const supine_lungs *lungs,
                                 const supine_scan_frame *frame, supine_fields *fields,
                                 supine_error *error);
void supine_fields_free(supine_fields *fields);

enum { SUPINE_FIT_BAND_MAX = 11 };

typedef struct supine_fit_report {
  size_t band_highest; /**< highest degree that the directions of gravity determine */
  size_t band;         /**< highest degree of the harmonics in the chosen fit */
  size_t mode_count;   /**< number of modes, or of harmonics instead of modes */
  /** [l] relative RMS leave-one-out error with harmonics to degree l. */
  double error[SUPINE_FIT_BAND_MAX + 1];
  supine_accuracy accuracy; /**< leave-one-out errors of the chosen fit; its member `volume` is 0 */
} supine_fit_report;

typedef struct supine_fit_options {
  int band; /**< highest degree of the harmonics; if negative, chosen by the leave-one-out error */
  size_t modes; /**< largest number of modes; 0 uses the harmonics instead of modes */
  /** Whether to leave out modes that raise the leave-one-out error by less than 1 % together. */
  bool fewest_modes;
  /** [3] gravity in the scan, which is then not displaced in its own posture; NULL if the reference
   * surface is not displaced by gravity */
  const double *scan_gravity;
} supine_fit_options;

/** Fit harmonics to the fields, compress the fit, and measure its leave-one-out error.
 * @param compression  written; it has one row for each coordinate of each vertex. Release it
 *   with supine_sh_compression_free */
supine_status supine_fields_fit(const supine_fields *fields, const supine_fit_options *options,
                                supine_compression *compression, supine_fit_report *report,
                                supine_error *error);

/** Fit the fields (supine_fields_fit), and write a basis file. Gain 1 (the factor on the
 * displacement) reproduces the given displacements. Of `prepared`, the model is not used. */
supine_status supine_fields_write(const supine_prepared *prepared, const supine_fields *fields,
                                  const supine_fit_options *options,
                                  const supine_basis_choice *basis, supine_fit_report *report,
                                  supine_error *error);

#endif
