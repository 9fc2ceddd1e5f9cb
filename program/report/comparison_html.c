/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Print a comparison as one self-contained HTML file by filling report.html. */
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <supine/version.h>

#include "base/locale.h"
#include "base/text.h"
#include "program/options/basis_input.h"
#include "program/options/command.h"
#include "program/report/comparison.h"
#include "program/view/export/template.h"

extern const supine_asset supine_report_assets[]; /* the .html and .css files of program/report */

static json_t *lungs(const supine_comparison *c) {
  const supine_basis_info *info = supine_basis_get_info(c->basis);
  json_t *list = json_array();
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    (void)json_array_append_new(list, json_string(info->lung_names[lung]));
  }
  return list;
}

/* Return today's date, or the date of SOURCE_DATE_EPOCH, which makes reports reproducible. */
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

/* Return the value of {{provenance}}: the command, the program, the basis, what it assumes and was
 * given, and its metadata. */
static json_t *provenance(const supine_comparison *c, json_t *file, json_t *today) {
  static const char *const keys[][2] = {{"made_by", "basis made by"},
                                        {"patient", "patient"},
                                        {"error_rms_percent", "compression error, RMS, %"},
                                        {"attribution", "attribution"},
                                        {"checksum", "checksum"}};
  json_t *list = json_array();
  add_fact(list, "command", json_string(c->made_by));
  add_fact(list, "program",
           json_sprintf("supine " SUPINE_VERSION ", %s", json_string_value(today)));
  add_fact(list, "basis", json_incref(file));
  json_t *facts = supine_options_facts(c->basis, true);
  (void)json_array_extend(list, facts);
  json_decref(facts);
  for (size_t i = 0; i < sizeof keys / sizeof *keys; ++i) {
    const char *value = supine_basis_metadata(c->basis, keys[i][0]);
    if (value != NULL) {
      add_fact(list, keys[i][1], json_string(value));
    }
  }
  return list;
}

/* Return a matrix with the heading of its first column; NULL if it has no rows. */
static json_t *matrix(const supine_comparison *c, bool anatomy, const char *label) {
  json_t *made = c->inside != NULL ? supine_report_matrix(c, anatomy) : NULL;
  if (made != NULL) {
    (void)json_object_set_new(made, "label", json_string(label));
  }
  return made;
}

/* Draw the outlines through targets, with the names and colours of those drawn; NULL if there are
 * none. */
static supine_status draw_traces(const supine_comparison *c, json_t **made, supine_error *error) {
  *made = NULL;
  if (c->inside != NULL) {
    SUPINE_TRY(supine_report_target_outlines(c, made, error));
  }
  if (*made != NULL) {
    const json_t *first = json_array_get(json_object_get(*made, "traced"), 0);
    const json_t *chart = json_array_get(json_object_get(first, "outlines"), 0);
    (void)json_object_set(*made, "drawn", json_object_get(chart, "lines"));
  }
  return SUPINE_OK;
}

/* Draw the outlines in slices, with the names and colours of those drawn; NULL for a single
 * posture. */
static supine_status draw_slices(const supine_comparison *c, json_t **made, supine_error *error) {
  json_t *outlines;
  *made = NULL;
  if (c->postures.count > 1) {
    SUPINE_TRY(supine_report_outlines(c, &outlines, error));
    *made = json_pack("{s:o, s:O}", "outlines", outlines, "drawn",
                      json_object_get(json_array_get(outlines, 0), "lines"));
  }
  return SUPINE_OK;
}

/* Return the values of the tags of report.html but {{pictures}} and {{trouble}}.
 * @param traced  outlines through targets; NULL if there are none
 * @param sliced  outlines in slices; NULL if they are not shown */
static json_t *values(const supine_comparison *c, json_t *traced, json_t *sliced) {
  SUPINE_C_LOCALE;
  char title[256];
  char volume[160];
  char caveats[SUPINE_CAVEATS_SIZE];
  (void)supine_basis_caveats(c->basis, caveats, sizeof caveats);
  supine_options_basis_title(c->path, title, sizeof title);
  json_t *file = json_string(title);
  if (c->title != NULL) {
    (void)snprintf(title, sizeof title, "%.*s", (int)sizeof title - 1, c->title);
    (void)supine_text_make_utf8(title);
  }
  json_t *heading = json_string(title);
  supine_report_volume(c, volume, sizeof volume);
  json_t *today = date();
  return json_pack(
      "{s:o, s:o, s:o, s:o, s:o, s:s, s:I, s:o, s:s, s:o, s:o, s:o, s:o, s:s, s:o*, s:o*, s:o*, "
      "s:s*, s:s, s:o*, s:o*}",
      "provenance", provenance(c, file, today), "file", file, "title", heading, "date", today,
      "count", json_sprintf("%zu posture%s", c->postures.count, c->postures.count == 1 ? "" : "s"),
      "volume", volume, "vertices", (json_int_t)supine_basis_get_info(c->basis)->vertex_count,
      "area", json_sprintf("%.0f", supine_compare_area(c->compare) / 100.0), "version",
      SUPINE_VERSION, "postures", supine_report_postures(c), "findings", supine_report_findings(c),
      "lungs", lungs(c), "footnotes", supine_report_footnotes(c), "reference", c->reference.name,
      "targets", matrix(c, false, "target, mm"), "traces", traced, "lobes",
      matrix(c, true, "structure"), "meaning",
      c->has_errors ? SUPINE_EXPECTED_MEANING ". " SUPINE_EXPECTED_SUPPORT : NULL, "caveats",
      caveats, "outlined", sliced, "ventilation",
      c->breath > 0.0 ? json_pack("{s:o}", "profile", supine_report_profile(c)) : NULL);
}

supine_status supine_report_html(const supine_comparison *c, FILE *file, supine_error *error) {
  json_t *traced;
  json_t *sliced = NULL;
  SUPINE_TRY(draw_traces(c, &traced, error));
  if (traced == NULL) {
    SUPINE_TRY(draw_slices(c, &sliced, error));
  }
  json_auto_t *data = values(c, traced, sliced);
  json_t *pictures = supine_report_pictures(c, error);
  if (pictures == NULL && error->status == SUPINE_ERROR_MEMORY) {
    return error->status;
  }
  if (pictures == NULL) {
    (void)json_object_set_new(data, "trouble", json_string(supine_options_explain(error).text));
  } else {
    (void)json_object_set_new(data, "pictures", pictures);
  }
  supine_export_template_fill(supine_report_assets, data, "report.html", file);
  return SUPINE_OK;
}
