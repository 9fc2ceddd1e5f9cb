/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make what a page shows where no script may run. */
#include <stdlib.h>

#include "base/locale.h"

#include "program/command/export_still.h"
#include "program/command/render_pictures.h"
#include "program/report/comparison.h"
#include "program/view/export/template.h"

enum {
  PICTURE_MAX = 45000, /* bytes of the picture, which are 60 kB as text */
  WIDTH = 600,
  HEIGHT = 400
};

/* Return whether something is only missing from the page: a library is not installed, or the lungs
 * cannot be in a posture. */
static bool is_left_out(supine_status status) {
  return status == SUPINE_ERROR_UNSUPPORTED || status == SUPINE_ERROR_NUMERICAL ||
         status == SUPINE_ERROR_ARGUMENT;
}

/* Add a picture, as base64, unless it is too large. */
static supine_status add_picture(const supine_still *still, json_t *made, supine_error *error) {
  const supine_pictures wanted = {
      .postures = "left",
      .volume = {.state = {.gravity = {0.0, 1.0, 0.0}}, .allow_folds = still->allow_folds},
      .from = still->from,
      .inside = still->inside_path,
      .look = SUPINE_LOOK_SHELL,
      .size = {WIDTH, HEIGHT},
      .view = {SUPINE_VIEW_LYING},
      .view_count = 1};
  char *bytes = NULL;
  size_t size = 0;
  FILE *file = open_memstream(&bytes, &size);
  if (file == NULL) {
    return supine_error_memory(error, "a picture");
  }
  supine_status status = supine_command_pictures_still(&wanted, still->path, file, error);
  if (fclose(file) != 0 && status == SUPINE_OK) {
    status = supine_error_memory(error, "a picture");
  }
  if (status == SUPINE_OK && size <= PICTURE_MAX) {
    (void)json_object_set_new(made, "picture", supine_export_template_base64(bytes, size));
  }
  free(bytes);
  return status;
}

/* Return the table of the surface: a row, and a column for each posture but the reference. */
static json_t *surface_table(const supine_comparison *c) {
  SUPINE_C_LOCALE;
  json_t *heads = json_array();
  json_t *cells = json_array();
  for (size_t i = 0; i < c->postures.count; ++i) {
    const supine_compared_posture *at = &c->posture[i];
    if (!supine_report_is_reference(c, i)) {
      (void)json_array_append_new(heads, json_pack("{s:s}", "name", at->label));
      (void)json_array_append_new(
          cells, json_pack("{s:o, s:o}", "size", json_sprintf("%.1f", at->displacement.mean),
                           "words", json_sprintf("at most %.1f", at->displacement.max)));
    }
  }
  return json_pack("{s:[{s:o, s:[{s:s, s:o}]}]}", "tables", "heads", heads, "rows", "name",
                   "surface, on average", "cells", cells);
}

/* Add the tables of the targets, or of the surface. */
static supine_status add_tables(const supine_still *still, json_t *made, supine_error *error) {
  supine_comparison c = {.path = still->path,
                         .volume = {.state = {.gravity = {0.0, 1.0, 0.0}}},
                         .from = still->from,
                         .basis = still->basis,
                         .inside = still->inside,
                         .names = *still->names};
  supine_state *state = &c.volume.state;
  state->volume = supine_basis_default_volume(c.basis);
  SUPINE_TRY(
      supine_options_posture_list_parse("supine,prone,left,right", state, &c.postures, error));
  const supine_status status = supine_report_find(&c, error);
  if (status == SUPINE_OK) {
    json_t *matrix = supine_report_matrix(&c, false);
    json_t *shown = matrix != NULL ? matrix : surface_table(&c);
    (void)json_object_update(made, shown);
    (void)json_object_set_new(made, "reference", json_string(c.reference.name));
    json_decref(shown);
  }
  supine_report_free(&c);
  return status;
}

supine_status supine_command_still(const supine_still *still, json_t **made, supine_error *error) {
  *made = json_object();
  supine_status status = add_tables(still, *made, error);
  if (status == SUPINE_OK || is_left_out(status)) {
    status = add_picture(still, *made, error);
  }
  return is_left_out(status) ? SUPINE_OK : status;
}
