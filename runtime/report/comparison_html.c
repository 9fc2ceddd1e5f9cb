/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A comparison as one HTML file that needs nothing else: what fills page/report.html. */
#include <math.h>
#include <string.h>

#include <supine/version.h>

#include "runtime/options/basis_input.h"
#include "runtime/report/comparison_parts.h"
#include "runtime/template/template.h"

extern const supine_asset supine_report_assets[]; /* page/, put in by the build */

static void set_statistics(json_t *row, const supine_distance_statistics *d) {
  (void)json_object_set_new(row, "mean", json_sprintf("%.2f", d->mean));
  (void)json_object_set_new(row, "rms", json_sprintf("%.2f", d->rms));
  (void)json_object_set_new(row, "p95", json_sprintf("%.2f", d->p95));
  (void)json_object_set_new(row, "max", json_sprintf("%.2f", d->max));
}

static json_t *named(const supine_comparison *c, size_t posture) {
  return json_pack("{s:s, s:s}", "name", c->postures.item[posture].name, "line",
                   supine_report_line(posture));
}

static json_t *postures(const supine_comparison *c) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  json_t *list = json_array();
  for (size_t i = 0; i < c->postures.count; ++i) {
    const double *g = c->postures.item[i].gravity;
    json_t *row = named(c, i);
    json_t *gains = json_array();
    for (size_t lung = 0; info->has_volume && lung < info->lung_count; ++lung) {
      (void)json_array_append_new(gains, json_sprintf("%+.1f", c->posture[i].volume[lung]));
    }
    (void)json_object_set_new(row, "gravity",
                              json_sprintf("%.3g, %.3g, %.3g", g[0] + 0.0, g[1] + 0.0, g[2] + 0.0));
    (void)json_object_set_new(row, "gains", gains);
    set_statistics(row, &c->posture[i].displacement);
    (void)json_array_append_new(list, row);
  }
  return list;
}

static json_t *lungs(const supine_comparison *c) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  json_t *list = json_array();
  for (size_t lung = 0; info->has_volume && lung < info->lung_count; ++lung) {
    char name[32];
    supine_options_basis_lung_name(c->basis, lung, name, sizeof name);
    (void)json_array_append_new(list, json_string(name));
  }
  return list;
}

/* RMS distances between postures, coloured. */
static json_t *matrix(const supine_comparison *c) {
  const size_t count = c->postures.count;
  double largest = 0.0;
  json_t *rows = json_array();
  for (size_t i = 0; i < count * count; ++i) {
    largest = fmax(largest, c->pair[i].rms);
  }
  for (size_t i = 0; i < count; ++i) {
    json_t *cells = json_array();
    for (size_t j = 0; j < count; ++j) {
      const double rms = c->pair[i * count + j].rms;
      const double t = largest > 0.0 ? rms / largest : 0.0;
      (void)json_array_append_new(
          cells, i == j ? json_object()
                        : json_pack("{s:o, s:s, s:o}", "hex", supine_report_hex(t), "ink",
                                    supine_report_ink(t), "between", json_sprintf("%.2f", rms)));
    }
    (void)json_array_append_new(
        rows, json_pack("{s:s, s:o}", "name", c->postures.item[i].name, "cells", cells));
  }
  return rows;
}

static json_t *pairs(const supine_comparison *c) {
  const size_t count = c->postures.count;
  json_t *list = json_array();
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = i + 1; j < count; ++j) {
      json_t *row = json_pack("{s:[o, o]}", "two", named(c, i), named(c, j));
      set_statistics(row, &c->pair[i * count + j]);
      (void)json_array_append_new(list, row);
    }
  }
  return list;
}

static json_t *slabs(const supine_comparison *c) {
  json_t *rows = json_array();
  for (size_t s = 0; s < SUPINE_COMPARISON_SLABS; ++s) {
    json_t *cells = json_array();
    for (size_t i = 0; i < c->postures.count; ++i) {
      const supine_slab *slab = &c->posture[i].slab[s];
      (void)json_array_append_new(cells,
                                  json_sprintf("%+.1f of %.0f mL", slab->gain, slab->volume));
    }
    (void)json_array_append_new(
        rows,
        json_pack("{s:o, s:o}", "height",
                  json_sprintf("%zu to %zu", 100 - 10 * (s + 1), 100 - 10 * s), "cells", cells));
  }
  return json_pack("{s:o, s:o}", "profiles", supine_report_profiles(c), "rows", rows);
}

static json_t *direction(const double g[3]) {
  return json_sprintf("%.3f, %.3f, %.3f", g[0], g[1], g[2]);
}

/* The head's facts and the foot's. */
static json_t *facts(const supine_comparison *c) {
  const supine_extremes *e = &c->extremes;
  const char *slash = strrchr(c->path, '/');
  json_t *file = json_string(slash != NULL ? slash + 1 : c->path);
  char inflation[64];
  supine_report_inflation(c, inflation, sizeof inflation);
  return json_pack(
      "{s:o, s:o, s:s, s:I, s:o, s:s, s:I, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "file",
      file != NULL ? file : json_string("a basis"), "count",
      json_sprintf("%zu posture%s", c->postures.count, c->postures.count == 1 ? "" : "s"),
      "inflation", inflation, "vertices", (json_int_t)supine_basis_get_info(c->basis)->vertex_count,
      "area", json_sprintf("%.0f", supine_compare_area(c->compare) / 100.0), "version",
      SUPINE_VERSION, "directions", (json_int_t)e->directions, "most_a", direction(e->pair[0]),
      "most_b", direction(e->pair[1]), "most_rms", json_sprintf("%.2f", e->pair_rms), "farthest",
      direction(e->farthest), "farthest_rms", json_sprintf("%.2f", e->farthest_rms), "largest",
      json_sprintf("%.1f", e->farthest_rms), "constant", json_sprintf("%.2f", 100.0 * c->constant),
      "odd", json_sprintf("%.2f", 100.0 * c->odd), "even", json_sprintf("%.2f", 100.0 * c->even));
}

void supine_report_html(const supine_comparison *c, FILE *file) {
  supine_error error;
  json_t *data = facts(c);
  json_t *pictures = supine_report_pictures(c, &error);
  (void)json_object_set_new(data, "postures", postures(c));
  (void)json_object_set_new(data, "lungs", lungs(c));
  (void)json_object_set_new(data, "map", supine_report_map(c));
  if (pictures != NULL) {
    (void)json_object_set_new(data, "pictures", pictures);
  } else {
    (void)json_object_set_new(data, "trouble", json_string(error.message));
  }
  if (c->postures.count > 1) {
    (void)json_object_set_new(data, "matrix",
                              json_pack("{s:o, s:o}", "rows", matrix(c), "pairs", pairs(c)));
  }
  if (supine_basis_get_info(c->basis)->has_volume) {
    (void)json_object_set_new(data, "slabs", slabs(c));
  }
  const supine_template report = {.assets = supine_report_assets, .data = data};
  supine_template_fill(&report, "report.html", file);
  json_decref(data);
}
