/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What several parts of the HTML report are made of. */
#include <math.h>

#include "sh/base/vec3.h"
#include <supine/posture.h>

#include "program/report/comparison_parts.h"

json_t *supine_report_parts(const supine_comparison *c, json_t *rows) {
  const size_t count = c->postures.count;
  const size_t parts = (count + SUPINE_REPORT_COLUMNS - 1) / SUPINE_REPORT_COLUMNS;
  json_t *list = json_array();
  for (size_t p = 0; p < parts; ++p) {
    const size_t begin = p * count / parts; /* parts of nearly equal size */
    const size_t end = (p + 1) * count / parts;
    json_t *columns = json_array();
    json_t *part = json_array();
    size_t i;
    json_t *row;
    for (size_t j = begin; j < end; ++j) {
      (void)json_array_append_new(
          columns, json_string(supine_options_posture_label(c->postures.item[j].name)));
    }
    json_array_foreach(rows, i, row) {
      json_t *copy = json_copy(row);
      json_t *cells = json_array();
      for (size_t j = begin; j < end; ++j) {
        (void)json_array_append(cells, json_array_get(json_object_get(row, "cells"), j));
      }
      (void)json_object_set_new(copy, "cells", cells);
      (void)json_array_append_new(part, copy);
    }
    (void)json_array_append_new(list, json_pack("{s:o, s:o, s:I, s:o}", "columns", columns, "rows",
                                                part, "count", (json_int_t)(end - begin), "part",
                                                json_sprintf("part %zu of %zu", p + 1, parts)));
  }
  json_decref(rows);
  return list;
}

json_t *supine_report_direction(const double g[3]) {
  const char *name = "";
  double nearest = -2.0;
  for (size_t i = 0; i < supine_posture_count(); ++i) {
    double named[3];
    (void)supine_posture_gravity(supine_posture_name(i), named);
    const double cosine = supine_dot(named, g);
    if (cosine > nearest + 1e-9) { /* among equal ones the first: names precede DICOM codes */
      nearest = cosine;
      name = supine_posture_name(i);
    }
  }
  const double degrees = acos(fmin(1.0, nearest)) * 180.0 / acos(-1.0);
  if (degrees < 0.5) {
    return json_string(name);
  }
  return json_sprintf("%.0f° from %s (%.2f:%.2f:%.2f)", degrees, name, g[0] + 0.0, g[1] + 0.0,
                      g[2] + 0.0);
}
