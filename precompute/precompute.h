/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Make a basis from lungs. precompute.c lists the steps. */
#ifndef SUPINE_PRECOMPUTE_H
#define SUPINE_PRECOMPUTE_H

#include "precompute/basis_file.h"
#include "precompute/fields/storage.h"
#include "precompute/prepare.h"
#include "precompute/projection/accuracy.h"

/** The user's choices for a basis. */
typedef struct supine_basis_choice {
  size_t band;          /**< highest degree of the harmonics */
  size_t modes;         /**< largest number of modes; 0 uses the harmonics instead of modes */
  size_t held_out;      /**< number of held-out directions of gravity, or 0 for the default */
  bool without_normals; /**< leave the modes of the normals out of the file */
  const char *made_by;  /**< for the metadata: the command line that makes the basis, or NULL */
  /** Displacements that another simulator computed, in place of the model's; or NULL. With them: */
  const supine_fields *fields;
  bool choose_band; /**< choose the band by the leave-one-out error, instead of `band` */
  bool keep_modes;  /**< keep all `modes`, even those that hardly lower the error */
  supine_warp_storage storage; /**< how displacements are stored */
  const double *scan_gravity;   /**< [3] gravity in the scan, which is then not displaced in its own
                                   posture; NULL if gravity does not displace the scan */
  /** Receives the fraction of the work done, 0 to 1; returns false to stop. NULL: none. */
  bool (*progress)(void *context, double fraction);
  void *progress_context;
} supine_basis_choice;

typedef struct supine_basis_report {
  size_t band, mode_count;
  size_t cluster_count; /**< 0 if the basis stores modes */
  supine_accuracy accuracy;
  double turned_over;    /**< share of triangles, 0 to 1 (supine_projection_turned_over) */
  supine_fit_report fit; /**< of another simulator's fields */
} supine_basis_report;

/** Make a basis from lungs and their model, or from lungs and another simulator's fields, and
 * measure its error. Fields displace the lungs without scaling: gain 1 reproduces them.
 * @param bytes   the content of the basis file; release it with free(), also after an error
 * @param report  optional */
supine_status supine_precompute(const supine_prepared *prepared, const supine_basis_choice *choice,
                                supine_bytes *bytes, supine_basis_report *report,
                                supine_error *error);

/** Write a basis file atomically: a failure leaves no partial file. */
supine_status supine_precompute_save(const char *path, const supine_bytes *bytes,
                                     supine_error *error);

#endif
