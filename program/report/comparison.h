/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the results of 'supine compare', and print them as text, JSON and HTML. */
#ifndef SUPINE_COMPARISON_H
#define SUPINE_COMPARISON_H

#include <stdio.h>

#include <supine/compare.h>

#include "program/options/basis_input.h"
#include "program/options/state_options.h"

enum { SUPINE_COMPARISON_SLABS = 10 };

/* Results for one posture at the volume of the comparison. */
typedef struct supine_compared_posture {
  supine_pose pose;
  supine_distance_statistics displacement; /* from the comparison's reference, mm */
  double expected_error;           /* expected error of the displacement, mm RMS; 0 if unknown */
  double volume[SUPINE_LUNGS_MAX]; /* volume of each lung, tissue included, mL */
  double gain[SUPINE_LUNGS_MAX];   /* volume that each lung gains in the breath, mL */
  supine_slab slab[SUPINE_COMPARISON_SLABS]; /* all lungs together, uppermost first */
} supine_compared_posture;

typedef struct supine_comparison {
  const char *path;    /* file of the basis, for output */
  const char *command; /* name of the running command, for messages */
  const char *made_by; /* command line that made the report */
  bool allow_folds;
  const supine_basis *basis;
  supine_state state; /* holds the volume of every posture; its gravity is supine */
  supine_from from;
  double breath; /* volume that a breath adds, mL */
  supine_posture_list postures;
  supine_reference_pose reference; /* displacements are measured from this pose */
  supine_compare *compare;
  supine_compared_posture *posture; /* [count] */
  size_t directions;                /* number of sampled directions that reach the volume */
  double farthest[3];               /* sampled direction farthest from supine, a unit vector */
  double farthest_rms;              /* RMS distance of that direction from supine, mm */
} supine_comparison;

/* Compute all members after `postures`. Free them with supine_report_free, also after failure. */
supine_status supine_report_find(supine_comparison *comparison, supine_error *error);

/* Free what supine_report_find allocated. */
void supine_report_free(supine_comparison *comparison);

/* Write the volume of all postures to `text`: "at rest" or "at rest + 300 mL". */
void supine_report_volume(const supine_comparison *comparison, char *text, size_t size);

/* Return the RMS distance of a direction of gravity from supine, mm; NaN if the lungs cannot reach
 * the volume of the comparison. */
double supine_report_from_supine(const supine_comparison *comparison, const double gravity[3]);

/* Return whether any expected error is known. */
bool supine_report_has_errors(const supine_comparison *comparison);

/* Return the volume that all lungs together gain by the breath in a posture, mL. */
double supine_report_gain(const supine_comparison *comparison, size_t posture);

/* Print the comparison to standard output, as JSON or as text with tables of the postures. */
void supine_report_print(const supine_comparison *comparison, bool json);

/* Print the comparison as HTML. If pictures cannot be drawn, print the reason in their place. Write
 * errors stay in the stream.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_report_html(const supine_comparison *comparison, FILE *file,
                                 supine_error *error);

#endif
