/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Make a basis file from lungs. */
#ifndef SUPINE_PRECOMPUTE_H
#define SUPINE_PRECOMPUTE_H

#include "precompute/prepare.h"
#include "precompute/projection/accuracy.h"

/** The user's choices for a basis. */
typedef struct supine_basis_choice {
  const char *path;     /**< file to write */
  size_t band;          /**< highest degree of the harmonics */
  size_t modes;         /**< largest number of modes; 0 uses the harmonics instead of modes */
  size_t held_out;      /**< number of held-out directions of gravity, or 0 for the default */
  bool without_normals; /**< leave the modes of the normals out of the file */
  const char *made_by;  /**< for the metadata: the command line that makes the basis, or NULL */
  /** Receives the fraction of the work done, 0 to 1; returns false to stop. NULL: none. */
  bool (*progress)(void *context, double fraction);
  void *progress_context;
} supine_basis_choice;

typedef struct supine_precompute_report {
  size_t mode_count;
  supine_accuracy accuracy;
  /** Share of triangles that turn over, 0 to 1 (supine_accuracy_turned_over). */
  double turned_over;
} supine_precompute_report;

/** Make a basis from lungs and their model, measure its error, and write the file atomically.
 * @param report  optional */
supine_status supine_precompute(const supine_prepared *prepared, const supine_basis_choice *choice,
                                supine_precompute_report *report, supine_error *error);

#endif
