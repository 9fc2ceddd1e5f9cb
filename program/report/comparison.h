/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the results of 'supine compare', and print them as text, JSON and HTML. */
#ifndef SUPINE_COMPARISON_H
#define SUPINE_COMPARISON_H

#include <stdio.h>

#include <jansson.h>

#include <supine/compare.h>

#include "program/options/basis_input.h"
#include "program/options/facts.h"
#include "program/options/hilum.h"
#include "program/options/inside.h"
#include "program/options/state_options.h"

enum {
  SUPINE_COMPARISON_SLABS = 10,
  SUPINE_COMPARISON_SCHEMA = 1 /* version of the keys and columns in docs/compare.md */
};

/* Results for one posture. */
typedef struct supine_compared_posture {
  const supine_posture_item *item; /* name and state */
  const char *label;               /* name for texts, such as "left side" */
  supine_pose pose;
  supine_distance_statistics displacement; /* displacement from the reference pose, mm */
  /* Expected RMS errors over the surface, mm; 0 if unknown: of positions, in the session of the
   * scan and on another day, and of displacements. */
  double expected_error, another_error, moved_error;
  supine_hilum hilum;     /* from the reference pose */
  supine_target *targets; /* [names.count] structures inside the lungs, or NULL */
  bool has_breath; /* whether the lungs can hold the breath; if not, the members from `gain` on are
                      0 */
  double volume[SUPINE_LUNGS_MAX];           /* volume of each lung, gas and tissue, mL */
  double gain[SUPINE_LUNGS_MAX];             /* volume that each lung gains in the breath, mL */
  supine_slab slab[SUPINE_COMPARISON_SLABS]; /* horizontal slabs, uppermost first */
} supine_compared_posture;

typedef struct supine_comparison {
  const char *path;             /* path of the basis file */
  const char *made_by;          /* command line, which the report prints */
  const char *title;            /* of the report; NULL for the name of the basis file */
  supine_volume_options volume; /* its state is supine, at the volume of postures that name none */
  supine_from from;
  double breath;     /* volume that a breath adds, mL; 0 if no breath is computed */
  bool breath_given; /* whether it was asked for: then lungs that cannot hold it are an error */
  supine_basis *basis;
  supine_basis *inside;       /* structures inside the lungs; NULL if there are none */
  supine_options_names names; /* their names */
  supine_posture_list postures;
  supine_options_reference_pose reference; /* pose from which displacements are measured */
  bool has_errors;                         /* whether the expected error of any posture is known */
  supine_compare *compare;
  supine_compared_posture *posture; /* [postures.count] */
} supine_comparison;

/* Compute the results: `reference` and all members below it. Free them with supine_report_free,
 * also after a failure. */
supine_status supine_report_find(supine_comparison *comparison, supine_error *error);

void supine_report_free(supine_comparison *comparison);

/* Return whether a posture is the state from which displacements are measured. */
static inline bool supine_report_is_reference(const supine_comparison *comparison, size_t posture) {
  return comparison->posture[posture].displacement.max < 0.05;
}

/* Write the volume of `comparison->volume` to `text`, for example "at rest + 300 mL". */
void supine_report_volume(const supine_comparison *comparison, char *text, size_t size);

/* Return the regional expansion of a slab: the volume that it gains / its volume before. */
static inline double supine_report_expansion(const supine_slab *slab) {
  return slab->volume > 0.0 ? slab->gain / slab->volume : 0.0;
}

/* Return the volume of a lung in a posture, mL. */
supine_fact supine_report_held(const supine_comparison *comparison, size_t posture, size_t lung);

/* Print the comparison to standard output, with --json or as text with tables of the postures: what
 * was asked for, and with `all` the breath and the regional expansion by height. */
void supine_report_print(const supine_comparison *comparison, bool all);

/* Write the comparison as CSV. A write error sets the error indicator of `file`. */
void supine_report_table(const supine_comparison *comparison, FILE *file);

/* Print the comparison as HTML. If pictures cannot be drawn, the page states the reason in their
 * place. A write error sets the error indicator of `file`. */
supine_status supine_report_html(const supine_comparison *comparison, FILE *file,
                                 supine_error *error);

/* Return the name of a posture, and the colour and the dashes of its lines in charts: no two of the
 * first twelve postures have both in common, and colours of like lightness have other dashes. */
json_t *supine_report_line(const supine_comparison *comparison, size_t posture);

/* Return the values of the tags of report.html that have these names. */
json_t *supine_report_findings(const supine_comparison *comparison);
json_t *supine_report_postures(const supine_comparison *comparison);
json_t *supine_report_profile(const supine_comparison *comparison);
json_t *supine_report_footnotes(const supine_comparison *comparison);

/* Return the tables with a row for each target, or for each structure that is anatomy, and a column
 * for each posture but the reference; NULL if there are no rows or no columns. */
json_t *supine_report_matrix(const supine_comparison *comparison, bool anatomy);

/* Draw the outlines in slices of the lungs. Return an error only if memory is refused. */
supine_status supine_report_outlines(const supine_comparison *comparison, json_t **made,
                                     supine_error *error);

/* Draw the outlines in three planes through each target, or set `made` to NULL if there are no
 * targets. Return an error only if memory is refused. */
supine_status supine_report_target_outlines(const supine_comparison *comparison, json_t **made,
                                            supine_error *error);

/* Return the value of the tag {{pictures}}. If pictures cannot be drawn, set `error` and return
 * NULL. */
json_t *supine_report_pictures(const supine_comparison *comparison, supine_error *error);

#endif
