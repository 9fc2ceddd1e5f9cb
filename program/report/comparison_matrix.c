/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Build the tables of the report that have a row for each structure inside the lungs and a column
 * for each posture, for matrix.html. */
#include <math.h>

#include "base/locale.h"
#include "base/text.h"
#include "program/report/comparison.h"

enum { POSTURES_MAX = 4 }; /* columns of a table, besides the names */

/* Return the cell of a target: its displacement and error, and its directions below. */
static json_t *target_cell(const supine_target *t) {
  SUPINE_C_LOCALE;
  const bool told = isnan(t->moved_error) || t->moved > t->moved_error;
  char way[96];
  json_t *size = isnan(t->moved_error) ? json_sprintf("%.1f", t->moved)
                                       : json_sprintf("%.1f \u00b1 %.1f", t->moved, t->moved_error);
  json_t *words = told ? json_string(supine_options_target_way(t, 2, way))
                       : json_sprintf("within its error of %.1f", t->moved_error);
  return json_pack("{s:o, s:o, s:b}", "size", size, "words", words, "untold", (int)!told);
}

/* Return the cell of a lobe or another large structure: the change of its volume if it is closed,
 * and its displacement. */
static json_t *anatomy_cell(const supine_target *t) {
  SUPINE_C_LOCALE;
  if (!(t->volume[0] > 0.0) || isnan(t->volume[1])) {
    return target_cell(t);
  }
  const double gain = t->volume[1] - t->volume[0];
  json_t *cell = target_cell(t);
  json_t *moves = json_sprintf("moves %s", json_string_value(json_object_get(cell, "size")));
  (void)json_object_set_new(cell, "size",
                            json_sprintf("%s mL (%s %%)", supine_text_change(gain).text,
                                         supine_text_change(100.0 * gain / t->volume[0]).text));
  (void)json_object_set_new(cell, "words", moves);
  (void)json_object_set_new(cell, "untold", json_false());
  return cell;
}

/* Return the row of structure `k`, with a cell for each of the `count` postures in `shown`. */
static json_t *make_row(const supine_comparison *c, size_t k, const size_t *shown, size_t count) {
  json_t *cells = json_array();
  for (size_t i = 0; i < count; ++i) {
    const supine_target *t = &c->posture[shown[i]].targets[k];
    (void)json_array_append_new(cells, t->anatomy ? anatomy_cell(t) : target_cell(t));
  }
  return json_pack("{s:s, s:o}", "name", c->names.text[k], "cells", cells);
}

/* Return the table of the `count` postures in `shown`; NULL if it has no rows. */
static json_t *make_table(const supine_comparison *c, bool anatomy, const size_t *shown,
                          size_t count) {
  json_t *heads = json_array();
  json_t *rows = json_array();
  for (size_t i = 0; i < count; ++i) {
    (void)json_array_append_new(heads, supine_report_line(c, shown[i]));
  }
  for (size_t k = 0; k < c->names.count; ++k) {
    if (c->posture[shown[0]].targets[k].anatomy == anatomy) {
      (void)json_array_append_new(rows, make_row(c, k, shown, count));
    }
  }
  json_t *table =
      json_array_size(rows) == 0 ? NULL : json_pack("{s:O, s:O}", "heads", heads, "rows", rows);
  json_decref(heads);
  json_decref(rows);
  return table;
}

/* Find the number of columns of a table: tables have about as many each, and none has more than
 * POSTURES_MAX. */
static size_t find_columns(const supine_comparison *c) {
  size_t count = 0;
  for (size_t i = 0; i < c->postures.count; ++i) {
    count += !supine_report_is_reference(c, i);
  }
  const size_t tables = (count + POSTURES_MAX - 1) / POSTURES_MAX;
  return tables == 0 ? 0 : (count + tables - 1) / tables;
}

json_t *supine_report_matrix(const supine_comparison *c, bool anatomy) {
  SUPINE_C_LOCALE;
  json_t *tables = json_array();
  size_t shown[POSTURES_MAX];
  size_t count = 0;
  const size_t columns = find_columns(c);
  for (size_t i = 0; i < c->postures.count; ++i) {
    if (!supine_report_is_reference(c, i)) {
      shown[count++] = i;
    }
    if (count > 0 && (count == columns || i + 1 == c->postures.count)) {
      json_t *table = make_table(c, anatomy, shown, count);
      if (table != NULL) {
        (void)json_array_append_new(tables, table);
      }
      count = 0;
    }
  }
  if (json_array_size(tables) == 0) {
    json_decref(tables);
    return NULL;
  }
  return json_pack("{s:o}", "tables", tables);
}
