/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A comparison as one HTML file that needs nothing else: what fills report.html. */
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <supine/version.h>

#include "sh/base/text.h"

#include "program/export/template.h"
#include "program/options/basis_input.h"
#include "program/report/comparison_parts.h"

extern const supine_asset
    supine_report_assets[]; /* the .html and .css files, put in by the build */

static void set_statistics(json_t *row, const supine_distance_statistics *d) {
  (void)json_object_set_new(row, "mean", json_sprintf("%.2f", d->mean));
  (void)json_object_set_new(row, "rms", json_sprintf("%.2f", d->rms));
  (void)json_object_set_new(row, "p95", json_sprintf("%.2f", d->p95));
  (void)json_object_set_new(row, "max", json_sprintf("%.2f", d->max));
}

static json_t *named(const supine_comparison *c, size_t posture) {
  return json_pack("{s:s, s:s}", "name",
                   supine_options_posture_label(c->postures.item[posture].name), "line",
                   supine_report_line(posture));
}

static json_t *lungs(const supine_comparison *c) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  json_t *list = json_array();
  for (size_t lung = 0; info->has_volume && lung < info->lung_count; ++lung) {
    (void)json_array_append_new(list, json_string(info->lung_names[lung]));
  }
  return list;
}

static double largest_pair(const supine_comparison *c) {
  double largest = 0.0;
  for (size_t i = 0; i < c->postures.count * c->postures.count; ++i) {
    largest = fmax(largest, c->pair[i].rms);
  }
  return largest;
}

static json_t *matrix(const supine_comparison *c) {
  const size_t count = c->postures.count;
  const double largest = largest_pair(c);
  json_t *rows = json_array();
  for (size_t i = 0; i < count; ++i) {
    json_t *cells = json_array();
    for (size_t j = 0; j < count; ++j) {
      const double rms = c->pair[i * count + j].rms;
      const double t = largest > 0.0 ? rms / largest : 0.0;
      (void)json_array_append_new(
          cells, i == j ? json_object()
                        : json_pack("{s:o, s:s, s:o}", "hex",
                                    supine_report_hex(SUPINE_COLOURS_DIFFERENCE, t), "ink",
                                    supine_report_ink(SUPINE_COLOURS_DIFFERENCE, t), "between",
                                    json_sprintf("%.2f", rms)));
    }
    (void)json_array_append_new(
        rows, json_pack("{s:s, s:o}", "name",
                        supine_options_posture_label(c->postures.item[i].name), "cells", cells));
  }
  return supine_report_parts(c, rows);
}

/* Find the two postures that differ most. */
static json_t *matrix_title(const supine_comparison *c) {
  const size_t count = c->postures.count;
  size_t most = 0;
  for (size_t i = 0; i < count * count; ++i) {
    most = c->pair[i].rms > c->pair[most].rms ? i : most;
  }
  return json_sprintf("Of these, %s and %s differ most: %.1f mm RMS",
                      supine_options_posture_label(c->postures.item[most / count].name),
                      supine_options_posture_label(c->postures.item[most % count].name),
                      c->pair[most].rms);
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
      (void)json_array_append_new(cells, json_sprintf("%+.1f of %.0f", slab->gain, slab->volume));
    }
    (void)json_array_append_new(
        rows,
        json_pack("{s:o, s:o}", "name",
                  json_sprintf("%zu to %zu", 100 - 10 * (s + 1), 100 - 10 * s), "cells", cells));
  }
  return json_pack("{s:o, s:o}", "profiles", supine_report_profiles(c), "parts",
                   supine_report_parts(c, rows));
}

/* Format a share in %; what rounds to nothing is 0. */
static json_t *percent(double share) {
  return fabs(100.0 * share) < 0.005 ? json_string("0 %") : json_sprintf("%.2f %%", 100.0 * share);
}

/* Today, or what SOURCE_DATE_EPOCH says, so that a report can be made again byte for byte. */
static json_t *date(void) {
  const char *epoch = getenv("SOURCE_DATE_EPOCH");
  const time_t now = epoch != NULL ? (time_t)strtoll(epoch, NULL, 10) : time(NULL);
  struct tm day;
  char text[16] = "";
  if (gmtime_r(&now, &day) != NULL) {
    (void)strftime(text, sizeof text, "%Y-%m-%d", &day);
  }
  return json_string(text);
}

static void add_fact(json_t *list, const char *name, json_t *value) {
  (void)json_array_append_new(list, json_pack("{s:s, s:o}", "name", name, "value", value));
}

/* The command that makes this report again, cut where it is longer than `size`. */
static void write_command(const supine_comparison *c, const char *file, char *command,
                          size_t size) {
  FILE *to = fmemopen(command, size, "w");
  if (to == NULL) {
    return;
  }
  char state[160];
  (void)supine_state_print(&c->state, state, sizeof state);
  (void)fprintf(to, "supine compare %s ", file);
  if (c->rms > 0.0) {
    (void)fprintf(to, "--rms %.9g", c->rms);
  } else if (strchr(state, ':') != NULL) { /* after the posture, supine */
    (void)fprintf(to, "--volume %s", strchr(state, ':') + 1);
  }
  if (c->from.given) {
    (void)supine_state_print(&c->from.state, state, sizeof state);
    (void)fprintf(to, " --from %s", state);
  }
  (void)fprintf(to, "%s --breath %.9g --postures ", c->allow_folds ? " --allow-folds" : "",
                c->breath);
  for (size_t i = 0; i < c->postures.count; ++i) {
    (void)fprintf(to, "%s%s", i > 0 ? "," : "", c->postures.item[i].name);
  }
  (void)fclose(to);
  command[size - 1] = '\0';
}

/* Return the command and the metadata of the basis. */
static json_t *provenance(const supine_comparison *c, json_t *file) {
  json_t *list = json_array();
  char command[2048] = "";
  write_command(c, json_string_value(file), command, sizeof command);
  size_t count = 0;
  const supine_metadata *metadata = supine_basis_all_metadata(c->basis, &count);
  add_fact(list, "command", json_string(command));
  add_fact(list, "program", json_string("supine " SUPINE_VERSION));
  add_fact(list, "date", date());
  add_fact(list, "basis", json_incref(file));
  for (size_t i = 0; i < count; ++i) {
    json_t *value = json_string(metadata[i].value);
    if (value != NULL) { /* it is UTF-8 */
      add_fact(list, metadata[i].key, value);
    }
  }
  return list;
}

/* Make the facts of the page's head and foot. */
static json_t *facts(const supine_comparison *c) {
  const supine_extremes *e = &c->extremes;
  const char *slash = strrchr(c->path, '/');
  char name[PATH_MAX] = "";
  supine_text_add(name, sizeof name, "%s", slash != NULL ? slash + 1 : c->path);
  json_t *file = json_string(supine_text_make_utf8(name));
  char volume[160];
  supine_report_volume(c, volume, sizeof volume);
  json_t *list = provenance(c, file);
  return json_pack(
      "{s:o, s:o, s:o, s:o, s:s, s:I, s:o, s:s, s:I, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}",
      "file", file, "provenance", list, "date", date(), "count",
      json_sprintf("%zu posture%s", c->postures.count, c->postures.count == 1 ? "" : "s"), "volume",
      volume, "vertices", (json_int_t)supine_basis_get_info(c->basis)->vertex_count, "area",
      json_sprintf("%.0f", supine_compare_area(c->compare) / 100.0), "version", SUPINE_VERSION,
      "directions", (json_int_t)e->directions, "most_a", supine_report_direction(e->pair[0]),
      "most_b", supine_report_direction(e->pair[1]), "most_rms", json_sprintf("%.2f", e->pair_rms),
      "farthest", supine_report_direction(e->farthest), "farthest_rms",
      json_sprintf("%.2f", e->farthest_rms), "constant", percent(c->constant), "odd",
      percent(c->odd), "even", percent(c->even));
}

supine_status supine_report_html(const supine_comparison *c, FILE *file, supine_error *error) {
  json_t *data = facts(c);
  (void)json_object_set_new(data, "postures", supine_report_postures(c));
  (void)json_object_set_new(data, "findings", supine_report_findings(c));
  (void)json_object_set_new(data, "lungs", lungs(c));
  (void)json_object_set_new(data, "surface", json_string(c->reference.name));
  (void)json_object_set_new(data, "map", supine_report_map(c));
  (void)json_object_set_new(data, "map_bar",
                            supine_report_bar(SUPINE_COLOURS_DIFFERENCE, c->extremes.farthest_rms,
                                              false, "RMS distance from supine, mm"));
  if (c->postures.count > 1) {
    (void)json_object_set_new(
        data, "matrix",
        json_pack("{s:o, s:o, s:o, s:o}", "title", matrix_title(c), "parts", matrix(c), "pairs",
                  pairs(c), "between_bar",
                  supine_report_bar(SUPINE_COLOURS_DIFFERENCE, largest_pair(c), false,
                                    "RMS distance, mm")));
  }
  if (supine_basis_get_info(c->basis)->has_volume) {
    (void)json_object_set_new(data, "slabs", slabs(c));
  }
  json_t *pictures = supine_report_pictures(c, error);
  if (pictures != NULL) {
    (void)json_object_set_new(data, "pictures", pictures);
  } else if (error->status == SUPINE_ERROR_MEMORY) {
    json_decref(data);
    return error->status;
  } else {
    (void)json_object_set_new(data, "trouble", json_string(error->message));
  }
  const supine_template report = {.assets = supine_report_assets, .data = data};
  supine_template_fill(&report, "report.html", file);
  json_decref(data);
  return SUPINE_OK;
}
