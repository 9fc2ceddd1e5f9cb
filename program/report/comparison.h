/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Results of 'supine compare', and their output forms. */
#ifndef SUPINE_COMPARISON_H
#define SUPINE_COMPARISON_H

#include <stdio.h>

#include <supine/compare.h>

#include "program/options/expected_output.h"
#include "program/options/orientation.h"
#include "program/options/state_options.h"

enum { SUPINE_COMPARISON_SLABS = 10, SUPINE_COMPARISON_DIRECTIONS = 2048 };

/* Results for one posture at the volume of the comparison. */
typedef struct supine_compared_posture {
  supine_pose pose;
  supine_distance_statistics displacement; /* from the comparison's reference */
  double expected_error;           /* expected error of the displacement, mm RMS; 0 where unknown */
  double volume[SUPINE_LUNGS_MAX]; /* mL that each lung holds, tissue included; closed */
  double gain[SUPINE_LUNGS_MAX];   /* mL that each takes of the breath; closed */
  supine_slab slab[SUPINE_COMPARISON_SLABS]; /* both lungs together, uppermost first; closed */
} supine_compared_posture;

typedef struct supine_comparison {
  const char *path;    /* of the basis, for showing */
  const char *command; /* that compares, for what it says */
  bool allow_folds;
  const supine_basis *basis;
  supine_state state; /* its volume is that of every posture */
  double rms;         /* mm, instead of the volume where above 0 */
  supine_from from;
  double breath; /* mL, on top of the volume */
  supine_posture_list postures;
  supine_reference_pose reference; /* displacements are measured from this pose */
  supine_compare *compare;
  supine_compared_posture *posture; /* [count] */
  supine_distance_statistics *pair; /* [count, count], symmetric, zero on the diagonal */
  double *pair_error;               /* [count, count] expected error of it, mm RMS, likewise */
  double constant, odd, even;       /* shares of energy: l = 0, odd bands, even bands beyond 0 */
  supine_extremes extremes;         /* farthest: from supine */
} supine_comparison;

/* Fills in everything after `postures`. Release with supine_report_free also after failure. */
supine_status supine_report_find(supine_comparison *comparison, supine_error *error);
void supine_report_free(supine_comparison *comparison);

/* "at rest", "at rest + 300 mL" or "5 mm RMS displacement". */
void supine_report_volume(const supine_comparison *comparison, char *text, size_t size);

/* Are expected errors known? */
bool supine_report_has_errors(const supine_comparison *comparison);

/* Return the share of a breath that all lungs take in a posture, mL. */
double supine_report_gain(const supine_comparison *comparison, size_t posture);

/* The forms. They leave errors of writing to be found when the file is closed. */
void supine_report_text(const supine_comparison *comparison, FILE *file);
bool supine_report_json(const supine_comparison *comparison, FILE *file);
void supine_report_csv(const supine_comparison *comparison, FILE *file);

/* Print without pictures where nothing can draw; print the reason. */
supine_status supine_report_html(const supine_comparison *comparison, FILE *file,
                                 supine_error *error);

#endif
