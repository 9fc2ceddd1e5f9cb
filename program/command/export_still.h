/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make what a page shows where no script may run. */
#ifndef SUPINE_COMMAND_EXPORT_STILL_H
#define SUPINE_COMMAND_EXPORT_STILL_H

#include <jansson.h>

#include "program/options/inside.h"
#include "program/options/state_options.h"

/* The lungs of a page. */
typedef struct supine_still {
  const char *path; /* of the basis */
  supine_basis *basis;
  const char *inside_path; /* of the structures inside; NULL if there are none */
  supine_basis *inside;
  const supine_options_names *names;
  supine_from from; /* state from which displacements are measured */
  bool allow_folds;
} supine_still;

/* Make {picture, reference, tables}: a picture of the patient on the left side, WebP as
 * base64; and as in supine_report_matrix, the displacement of each target, or else of the surface,
 * in four postures. What cannot be made, such as a picture without cairo, is left
 * out. The caller frees the object, also after a failure. */
supine_status supine_command_still(const supine_still *still, json_t **made, supine_error *error);

#endif
