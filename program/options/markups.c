/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write where structures are as markups of 3D Slicer. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>

#include "base/locale.h"
#include "base/number.h"
#include "base/output.h"
#include "base/text.h"

#include "program/options/basis_input.h"
#include "program/options/command.h"
#include "program/options/markups.h"

/* Versioned schema of the file, which 3D Slicer 5 reads. */
static const char schema[] = "https://raw.githubusercontent.com/slicer/slicer/master/Modules/"
                             "Loadable/Markups/Resources/Schema/markups-schema-v1.0.3.json#";

static const struct {
  const char *name;
  size_t offset; /* of the number in a supine_target */
} measures[] = {{"moved_mm", offsetof(supine_target, moved)},
                {"moved_error_mm", offsetof(supine_target, moved_error)},
                {"expected_error_mm", offsetof(supine_target, error)},
                {"another_day_error_mm", offsetof(supine_target, another_error)}};

/* Round to 0.001 mm, as the columns of CSV files are. */
static double rounded(double mm) {
  return round(1e3 * mm) / 1e3;
}

static double measure(const supine_target *target, size_t which) {
  return rounded(*(const double *)((const char *)target + measures[which].offset));
}

bool supine_options_markups_named(const char *path) {
  return supine_text_ends_in(path, ".json");
}

/* Write the displacement and the errors of a target that are known, for a reader of its list. */
static void describe(const supine_target *target, char *text, size_t size) {
  text[0] = '\0';
  for (size_t i = 0; i < sizeof measures / sizeof *measures; ++i) {
    if (!isnan(measure(target, i))) {
      supine_text_add(text, size, "%s%s %.1f", text[0] != '\0' ? ", " : "", measures[i].name,
                      measure(target, i));
    }
  }
}

static json_t *point_of(const supine_target *target, size_t number) {
  char id[24];
  char text[160];
  (void)snprintf(id, sizeof id, "%zu", number);
  describe(target, text, sizeof text);
  return json_pack("{s:s, s:o, s:s, s:[f, f, f], s:s}", "id", id, "label",
                   supine_options_json_text(target->name), "description", text, "position",
                   rounded(target->at[0]), rounded(target->at[1]), rounded(target->at[2]),
                   "positionStatus", "defined");
}

/* Return the measurement `which` of all targets, or NULL if one of them lacks it. */
static json_t *measurement_of(const supine_target *targets, size_t count, size_t which) {
  json_t *values = json_array();
  for (size_t i = 0; i < count; ++i) {
    if (isnan(measure(&targets[i], which))) {
      json_decref(values);
      return NULL;
    }
    (void)json_array_append_new(values, json_real(measure(&targets[i], which)));
  }
  return json_pack("{s:s, s:b, s:s, s:o}", "name", measures[which].name, "enabled", 1, "units",
                   "mm", "controlPointValues", values);
}

void supine_options_markups_describe(const supine_basis *basis, const char *from,
                                     char text[SUPINE_MARKUPS_DESCRIPTION]) {
  char caveats[SUPINE_CAVEATS_SIZE];
  (void)supine_basis_caveats(basis, caveats, sizeof caveats);
  (void)supine_print_text(text, SUPINE_MARKUPS_DESCRIPTION, "displacement from %s; errors: %s; %s",
                          from, SUPINE_EXPECTED_MEANING, caveats);
}

json_t *supine_options_markup(const char *name, const char *description,
                              const supine_target *targets, size_t count) {
  json_t *points = json_array();
  json_t *measurements = json_array();
  for (size_t i = 0; i < count; ++i) {
    (void)json_array_append_new(points, point_of(&targets[i], i + 1));
  }
  for (size_t i = 0; i < sizeof measures / sizeof *measures; ++i) {
    json_t *measurement = measurement_of(targets, count, i);
    if (measurement != NULL) {
      (void)json_array_append_new(measurements, measurement);
    }
  }
  return json_pack("{s:s, s:s, s:o, s:s, s:s, s:b, s:o, s:o}", "type", "Fiducial", "name", name,
                   "description", supine_options_json_text(description), "coordinateSystem", "LPS",
                   "coordinateUnits", "mm", "locked", 1, "controlPoints", points, "measurements",
                   measurements);
}

supine_status supine_options_markups_write(const char *path, json_t *lists, supine_error *error) {
  SUPINE_C_LOCALE;
  json_auto_t *root = json_pack("{s:s, s:o}", "@schema", schema, "markups", lists);
  SUPINE_FREED_BY(supine_output_abandon) supine_output output = {0};
  if (root == NULL) {
    return supine_error_memory(error, "%s", path);
  }
  SUPINE_TRY(supine_output_open(path, &output, error));
  (void)json_dumpf(root, output.file, JSON_INDENT(1) | JSON_REAL_PRECISION(9));
  (void)fputc('\n', output.file);
  return supine_output_commit(&output, error);
}
