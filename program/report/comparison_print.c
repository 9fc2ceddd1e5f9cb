/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Print the comparison of postures as JSON, or as text. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/locale.h"
#include "base/number.h"
#include "program/report/comparison.h"

static json_t *statistics(const supine_distance_statistics *d) {
  return json_pack("{s:f, s:f, s:f, s:f}", "mean", d->mean, "rms", d->rms, "p95", d->p95, "max",
                   d->max);
}

static json_t *by_lung(const supine_comparison *c, const double *values) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  json_t *list = json_object();
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    (void)json_object_set_new(list, info->lung_names[lung], json_real(values[lung]));
  }
  return list;
}

supine_fact supine_report_held(const supine_comparison *c, size_t posture, size_t lung) {
  const supine_compared_posture *of = &c->posture[posture];
  return supine_basis_lung_volume(c->basis, &of->item->state, &of->pose, lung);
}

static json_t *volumes(const supine_comparison *c, size_t posture, bool as_text) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  json_t *list = json_object();
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    const supine_fact held = supine_report_held(c, posture, lung);
    (void)json_object_set_new(list, info->lung_names[lung],
                              supine_options_volume_json(&held, as_text));
  }
  return list;
}

static json_t *encode_slabs(const supine_compared_posture *p) {
  const double thickness = 1.0 / SUPINE_COMPARISON_SLABS;
  json_t *slabs = json_array();
  for (size_t s = 0; s < SUPINE_COMPARISON_SLABS; ++s) {
    (void)json_array_append_new(
        slabs, json_pack("{s:[f, f], s:f, s:f, s:f}", "height", 1.0 - thickness * (double)(s + 1),
                         1.0 - thickness * (double)s, "volume_ml", p->slab[s].volume, "gain_ml",
                         p->slab[s].gain, "expansion", supine_report_expansion(&p->slab[s])));
  }
  return slabs;
}

/* Return the targets in a posture, or the anatomy. */
static json_t *encode_targets(const supine_comparison *c, const supine_compared_posture *p,
                              bool anatomy) {
  json_t *targets = json_array();
  for (size_t k = 0; k < c->names.count; ++k) {
    if (p->targets[k].anatomy == anatomy) {
      (void)json_array_append_new(targets, supine_options_target_json(&p->targets[k]));
    }
  }
  return targets;
}

static json_t *encode_posture(const supine_comparison *c, size_t i) {
  const supine_compared_posture *p = &c->posture[i];
  return json_pack("{s:s, s:o, s:o, s:o, s:o*, s:o*, s:o*, s:o*, s:o, s:o*, s:o*, s:o*, s:o*}",
                   "name", p->item->name, "gravity",
                   supine_options_json_numbers(3, p->item->state.gravity), "displacement_mm",
                   statistics(&p->displacement), "hilum_mm",
                   supine_options_json_numbers(3, p->hilum.move), "hilum_error_mm",
                   isnan(p->hilum.expected) ? NULL : json_real(p->hilum.expected), "moved_error_mm",
                   c->has_errors ? json_real(p->moved_error) : NULL, "expected_error_mm",
                   c->has_errors ? json_real(p->expected_error) : NULL, "another_day_error_mm",
                   c->has_errors ? json_real(p->another_error) : NULL, "volume_ml",
                   volumes(c, i, false), "gain_ml", p->has_breath ? by_lung(c, p->gain) : NULL,
                   "slabs", p->has_breath ? encode_slabs(p) : NULL, "targets",
                   c->inside != NULL ? encode_targets(c, p, false) : NULL, "anatomy",
                   c->inside != NULL ? encode_targets(c, p, true) : NULL);
}

/* Append a row to the table named `heading`: `value` in the column `name`, then `columns`,
 * which the function frees. */
static void add_row(json_t *tables, const char *heading, const char *name, const char *value,
                    json_t *columns) {
  json_t *row = json_pack("{s:s}", name, value);
  (void)json_object_update_new(row, columns);
  if (json_object_get(tables, heading) == NULL) {
    (void)json_object_set_new(tables, heading, json_array());
  }
  (void)json_array_append_new(json_object_get(tables, heading), row);
}

/* Add the targets in a posture: all, or the `most` to tell of first. Return how many are left
 * out. */
static size_t add_targets(const supine_comparison *c, const supine_compared_posture *p, size_t most,
                          json_t *text) {
  size_t left_out = 0;
  for (size_t k = 0; k < c->names.count; ++k) {
    if (supine_options_targets_before(p->targets, c->names.count, k) < most) {
      add_row(text, p->targets[k].anatomy ? "anatomy" : "targets", "posture", p->label,
              supine_options_target_json(&p->targets[k]));
    } else {
      ++left_out;
    }
  }
  return left_out;
}

/* Return how many targets of a posture are printed, so that a screen of 24 lines shows some of each
 * posture. */
static size_t targets_most(const supine_comparison *c, bool all) {
  static const size_t rows = 12;
  size_t moved = 0;
  for (size_t i = 0; i < c->postures.count; ++i) {
    moved += c->posture[i].displacement.max > 0.0 ? 1 : 0;
  }
  if (all || moved == 0) {
    return SIZE_MAX;
  }
  return moved < rows ? rows / moved : 1;
}

/* Add to `text` the tables that compare the postures. */
static void add_tables(const supine_comparison *c, bool all, json_t *text) {
  char gained[64];
  (void)supine_print_text(gained, sizeof gained,
                          "volume (mL) that each lung gains in a breath of %.4g mL", c->breath);
  const size_t most = targets_most(c, all);
  size_t left_out = 0;
  for (size_t i = 0; i < c->postures.count; ++i) {
    const supine_compared_posture *p = &c->posture[i];
    json_t *moved = statistics(&p->displacement);
    if (c->has_errors) {
      (void)json_object_set_new(moved, "its error", json_real(p->moved_error));
      (void)json_object_set_new(moved, "error of positions", json_real(p->expected_error));
      (void)json_object_set_new(moved, "on another day", json_real(p->another_error));
    }
    (void)json_object_set_new(moved, "hilum x, y, z",
                              supine_options_json_numbers(3, p->hilum.move));
    if (!isnan(p->hilum.expected)) {
      (void)json_object_set_new(moved, "error of the hilum", json_real(p->hilum.expected));
    }
    add_row(text, "displacement, mm", "posture", p->label, moved);
    if (c->inside != NULL && p->displacement.max > 0.0) {
      left_out += add_targets(c, p, most, text);
    }
    add_row(text, "volume of each lung, mL", "posture", p->label, volumes(c, i, true));
    if (p->has_breath && all) {
      add_row(text, gained, "posture", p->label, by_lung(c, p->gain));
    }
  }
  if (left_out > 0) {
    char more[80];
    (void)snprintf(more, sizeof more, "%zu rows with less displacement over its error; see --all",
                   left_out);
    (void)json_object_set_new(text, "targets left out", json_string(more));
  }
  const size_t slabs = all && c->breath > 0.0 ? SUPINE_COMPARISON_SLABS : 0;
  for (size_t s = 0; s < slabs; ++s) {
    json_auto_t *values = json_object(); /* stays empty if no posture has a breath */
    char height[16];
    (void)snprintf(height, sizeof height, "%zu-%zu", 100 - 10 * (s + 1), 100 - 10 * s);
    for (size_t i = 0; i < c->postures.count; ++i) {
      if (c->posture[i].has_breath) {
        (void)json_object_set_new(
            values, c->posture[i].label,
            json_real(100.0 * supine_report_expansion(&c->posture[i].slab[s])));
      }
    }
    if (json_object_size(values) > 0) {
      add_row(text, "regional expansion by height along gravity, % of the volume before the breath",
              "height, %", height, json_incref(values));
    }
  }
}

/* Return the text in the order of what was asked for: targets, displacements, volumes. The file and
 * its surface are left out unless all is wanted. Free `root`. */
static json_t *order_text(json_t *root, bool all) {
  static const char *const first[] = {"volume", "displacement_from", "targets", "targets left out"};
  static const char *const left_out[] = {"file", "vertices", "area_mm2"};
  json_t *text = json_object();
  for (size_t i = 0; i < sizeof first / sizeof *first; ++i) {
    json_t *value = json_object_get(root, first[i]);
    if (value != NULL) {
      (void)json_object_set(text, first[i], value);
    }
  }
  if (!all) {
    for (size_t i = 0; i < sizeof left_out / sizeof *left_out; ++i) {
      (void)json_object_del(root, left_out[i]);
    }
  }
  (void)json_object_update_missing(text, root);
  json_decref(root);
  return text;
}

void supine_report_print(const supine_comparison *c, bool all) {
  char volume[160];
  supine_report_volume(c, volume, sizeof volume);
  json_t *root = json_pack("{s:i, s:o, s:s, s:s, s:I, s:f}", "schema", SUPINE_COMPARISON_SCHEMA,
                           "file", supine_options_json_text(c->path), "volume", volume,
                           "displacement_from", c->reference.name, "vertices",
                           (json_int_t)supine_basis_get_info(c->basis)->vertex_count, "area_mm2",
                           supine_compare_area(c->compare));
  if (supine_options_as_json()) {
    json_t *postures = json_array();
    for (size_t i = 0; i < c->postures.count; ++i) {
      (void)json_array_append_new(postures, encode_posture(c, i));
    }
    (void)json_object_set_new(root, "postures", postures);
  } else {
    (void)json_object_del(root, "schema");
    add_tables(c, all, root);
    if (c->has_errors) {
      (void)json_object_set_new(root, "expected error",
                                json_string(SUPINE_EXPECTED_MEANING ". " SUPINE_EXPECTED_SUPPORT));
    }
    root = order_text(root, all);
  }
  supine_options_print(root);
}
