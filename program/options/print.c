/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Print a JSON value as JSON, or as text in lines and tables. */
#include <math.h>
#include <stdarg.h>
#include <string.h>

#include <jansson.h>

#include "base/csv.h"
#include "base/locale.h"
#include "base/number.h"
#include "base/text.h"
#include "base/utf8.h"

#include "program/options/command.h"

enum { TEXT_MAX = 4096, COLUMNS_MAX = 16, LABEL_WIDTH = 36, LIST_MAX = 9 };
static const double zero = 1e-12; /* smaller absolute values are printed as 0 */

/* What a number means. It decides how many digits are printed. */
typedef enum quantity {
  QUANTITY_OTHER,
  QUANTITY_DISTANCE,  /* in mm */
  QUANTITY_COORDINATE /* of a displacement, in mm */
} quantity;

/* Find what numbers mean by their label. In a table with the given heading, labels of columns may
 * leave out the unit. */
static quantity quantity_of(const char *heading, const char *label) {
  if (!supine_text_ends_in(label, ", mm") && !supine_text_ends_in(heading, ", mm")) {
    return QUANTITY_OTHER;
  }
  return strstr(label, "x, y, z") != NULL || strstr(label, "translation") != NULL
             ? QUANTITY_COORDINATE
             : QUANTITY_DISTANCE;
}

/* Append a number to `text`. Numbers have four significant digits. Those in mm have at most three
 * decimals. */
static void add_real(double real, quantity kind, char text[TEXT_MAX]) {
  const double size = fabs(real);
  if (size < zero) {
    supine_text_add(text, TEXT_MAX, "0");
  } else if (kind == QUANTITY_DISTANCE && size < 1.0) {
    supine_text_add(text, TEXT_MAX, "%s", supine_text_distance(real).text);
  } else if (kind == QUANTITY_COORDINATE && size < SUPINE_TEXT_DISTANCE_LEAST) {
    supine_text_add(text, TEXT_MAX, "0");
  } else if (kind == QUANTITY_COORDINATE && size < 1.0) {
    supine_text_add(text, TEXT_MAX, "%.3f", real);
  } else if (real == floor(real)) {
    supine_text_add(text, TEXT_MAX, "%.0f", real);
  } else {
    supine_text_add(text, TEXT_MAX, size < 1000.0 ? "%.4g" : "%.1f", real);
  }
}

/* Format a value, or the first LIST_MAX values of a list, as one line. Escape control characters of
 * texts, which may come from files. NULL is a value that is missing. */
static void write_text(const json_t *value, quantity kind, char text[TEXT_MAX]) {
  size_t i;
  const json_t *item;
  text[0] = '\0';
  switch (value == NULL ? JSON_NULL : json_typeof(value)) {
  case JSON_ARRAY:
    json_array_foreach(value, i, item) {
      char one[TEXT_MAX];
      if (i == LIST_MAX) {
        supine_text_add(text, TEXT_MAX, ", ... (%zu in all; --json prints them)",
                        json_array_size(value));
        break;
      }
      write_text(item, kind, one);
      supine_text_add(text, TEXT_MAX, "%s%s", i > 0 ? ", " : "", one);
    }
    break;
  case JSON_STRING:
    supine_utf8_escape(json_string_value(value), "", text, TEXT_MAX);
    break;
  case JSON_INTEGER:
    supine_text_add(text, TEXT_MAX, "%" JSON_INTEGER_FORMAT, json_integer_value(value));
    break;
  case JSON_REAL:
    add_real(json_real_value(value), kind, text);
    break;
  case JSON_TRUE:
    supine_text_add(text, TEXT_MAX, "yes");
    break;
  case JSON_FALSE:
    supine_text_add(text, TEXT_MAX, "no");
    break;
  default:
    supine_text_add(text, TEXT_MAX, "-");
  }
}

/* Return whether a value is an object or a list of objects. */
static bool has_objects(const json_t *value) {
  return json_is_object(value) || json_is_object(json_array_get(value, 0));
}

/* Return whether a value is an object of which every member fits on one line. */
static bool is_row(json_t *object) {
  const char *name;
  json_t *member;
  json_object_foreach(object, name, member) {
    if (has_objects(member)) {
      return false;
    }
  }
  return json_is_object(object);
}

/* Labels of JSON members. `parent` is the key of the enclosing object, or NULL for any object. */
static const struct {
  const char *parent, *key, *label;
} labels[] = {{NULL, "additions", "additions per vertex"},
              {NULL, "affine", "affine map"},
              {NULL, "baseline", "baseline (0 % explained)"},
              {NULL, "band", "highest harmonic band"},
              {NULL, "band_95_percent_holds", "points within the 95 % band, %"},
              {NULL, "blocks", "blocks of 40 mm"},
              {"force", "box", "cx, cy, cz"},
              {NULL, "clusters", "clusters of vertices that move alike"},
              {NULL, "clusters_rms_mm", "error of the clusters, RMS, mm"},
              {NULL, "clusters_seam_percent", "change of the error at their seams, RMS, %"},
              {NULL, "computed_from", "computed from"},
              {NULL, "confidence", "confidence level"},
              {NULL, "constants_percent", "error of constants, at most, %"},
              {NULL, "control", "control parameters c1 to c5"},
              {NULL, "control_interval", "  confidence interval, +-"},
              {NULL, "corrected", "law and kriging"},
              {NULL, "depth_deviation_mm", "  along the lines of sight, standard deviation, mm"},
              {NULL, "determined", "posture determined by the points"},
              {NULL, "deviation_without_points_ml", "  without the points, mL"},
              {"error", "directions", "held-out directions"},
              {NULL, "energy_per_band", "displacement by band, share"},
              {NULL, "error", "compression error"},
              {"error", "volume_ml", "errors in mm at volume, mL"},
              {NULL, "error_harmonics", "error by highest band, share"},
              {NULL, "error_in_fuller_scan", "error in the fuller / in the emptier scan"},
              {NULL, "error_modes", "error by number of modes, share"},
              {NULL, "expected_constant_mm", "expected error^2 / displacement, mm"},
              {NULL, "expected_error", "expected error of a position"},
              {NULL, "expected_error_terms", "terms of the expected error"},
              {NULL, "expected_largest_mm", "expected error, largest, mm"},
              {NULL, "expected_rms_mm", "expected error, RMS, mm"},
              {NULL, "expected_share_held_out", "variance left at held-out points"},
              {NULL, "facts", "assumed and given"},
              {NULL, "fitted_rms_mm", "residual at the fitted points, RMS, mm"},
              {NULL, "fitted_without_and_with_mm", "fitted: uniform, by region, mm"},
              {NULL, "from_scale", "scale at the start of motion"},
              {NULL, "full_expected", "full inflation by size"},
              {NULL, "gain_from", "source of the gain"},
              {NULL, "gravity", "gravity (to left, back, head)"},
              {NULL, "has_volume", "encloses a volume"},
              {NULL, "held_out_rms_mm", "residual at held-out points, RMS, mm"},
              {NULL, "held_out_without_and_with_mm", "held-out: uniform, by region, mm"},
              {NULL, "kind", "kind of the modes"},
              {NULL, "left_rms", "RMS residual / force at the centre"},
              {NULL, "residual_rms_mm", "residual, RMS, mm"},
              {NULL, "left_rms_mm", "residual, RMS, mm"},
              {NULL, "left_without_gain_mm", "residual without the gain, RMS, mm"},
              {NULL, "linearity", "linearity of displacement with volume"},
              {NULL, "lung_count", "number of lungs"},
              {NULL, "matched_share", "share of the vertices matched"},
              {NULL, "max", "largest"},
              {NULL, "max_mm", "largest, mm"},
              {NULL, "between_percent", "RMS between the runs, % of RMS displacement"},
              {NULL, "between_mm", "RMS between the runs, mm"},
              {NULL, "gap_percent", "largest RMS in a gap between the directions, %"},
              {NULL, "gap_mm", "largest RMS in a gap between the directions, mm"},
              {NULL, "max_percent", "largest, % of RMS displacement"},
              {NULL, "midline_mm", "x of the midline, mm"},
              {NULL, "mm", "length, mm"},
              {NULL, "move", "displacement x, y, z, mm"},
              {NULL, "multiplications", "multiplications per vertex"},
              {NULL, "nearest_rms", "  distance at this scale, RMS, mm"},
              {NULL, "nearest_scale", "scale nearest to the surface"},
              {NULL, "none", "no motion"},
              {NULL, "of", "measured on"},
              {NULL, "off_percent", "largest deviation, %"},
              {NULL, "outliers", "outliers, left out"},
              {NULL, "p95", "95 %"},
              {NULL, "p95_mm", "95 %, mm"},
              {NULL, "p95_percent", "95 %, % of RMS displacement"},
              {NULL, "paper", "Santhanam 2008 found"},
              {NULL, "pressure_cmH2O", "pressure, from and to, cmH2O"},
              {NULL, "reach_mm", "reach of a force, mm"},
              {NULL, "rest_part", "errors in mm at (0: full, 1: rest)"},
              {NULL, "resting_shares", "volume at rest, share of full"},
              {NULL, "rms", "RMS"},
              {NULL, "rms_after_mm", "distance after the fit, RMS, mm"},
              {NULL, "rms_before_mm", "distance before the fit, RMS, mm"},
              {NULL, "rms_mL", "residual, RMS, mL"},
              {NULL, "rms_mm", "RMS, mm"},
              {"error", "rms_percent", "RMS, % of RMS displacement"},
              {NULL, "rms_percent", "residual, % of range of volumes"},
              {"states", "scale", "scale of the displacement"},
              {NULL, "scanned", "state in the scan"},
              {NULL, "spread_rms", "RMS deviation / force at centre"},
              {NULL, "standard_errors", "standard errors of c1 to c9"},
              {"linearity", "states", "states"},
              {NULL, "states", "state"},
              {NULL, "surface_mm", "distance of surfaces, at most, mm"},
              {NULL, "turned_over_percent", "triangles turned over, %"},
              {NULL, "turning_rms_percent", "RMS, % of what depends on gravity"},
              {NULL, "unseen_regions", "regions not determined"},
              {"states", "landmarks", "distance between landmarks"},
              {"states", "surface", "distance between surfaces"},
              {"states", "volume_ml", "volume above the start, mL"},
              {NULL, "volume_after_ml", "volume after, mL"},
              {NULL, "volume_before_ml", "volume before, mL"},
              {NULL, "volume_deviation_ml", "volume, standard deviation, mL"},
              {NULL, "volume_interval_mL", "  confidence interval, +- mL"},
              {NULL, "volume_mL", "volume, from and to, mL"}};

/* Write the label of the member `key` of the object `parent`. If `labels` has none, derive it from
 * the key: "height_above_mm" becomes "height above, mm". */
static void write_label(const char *parent, const char *key, char text[TEXT_MAX]) {
  static const char *const units[][2] = {{"_mm", ", mm"},   {"_mm2", ", mm2"},
                                         {"_ml", ", mL"},   {"_percent", ", %"},
                                         {"_rad", ", rad"}, {"_degrees", ", degrees"}};
  for (size_t i = 0; i < sizeof labels / sizeof *labels; ++i) {
    if (strcmp(labels[i].key, key) == 0 &&
        (labels[i].parent == NULL || strcmp(labels[i].parent, parent) == 0)) {
      (void)snprintf(text, TEXT_MAX, "%s", labels[i].label);
      return;
    }
  }
  size_t length = strlen(key);
  const char *unit = "";
  for (size_t i = 0; i < sizeof units / sizeof *units; ++i) {
    if (supine_text_ends_in(key, units[i][0])) {
      unit = units[i][1];
      length -= strlen(units[i][0]);
    }
  }
  char plain[TEXT_MAX];
  (void)snprintf(plain, sizeof plain, "%.*s%s", (int)length, key, unit);
  supine_utf8_escape(plain, "", text, TEXT_MAX);
  for (char *at = text; (at = strchr(at, '_')) != NULL;) {
    *at = ' ';
  }
}

/* Return an object with the columns of a table: each key of any row, in the order of appearance,
 * with the value true if its column has only numbers, which are aligned right. */
static json_t *find_columns(const json_t *rows) {
  json_t *columns = json_object();
  size_t i;
  json_t *row;
  const char *name;
  json_t *member;
  json_array_foreach(rows, i, row) {
    json_object_foreach(row, name, member) {
      const bool numbers = json_is_number(member) || json_is_null(member);
      const json_t *before = json_object_get(columns, name);
      (void)json_object_set_new(columns, name,
                                json_boolean(numbers && (before == NULL || json_is_true(before))));
    }
  }
  return columns;
}

/* Print a list of objects as a table; `heading` stands above it. A row may lack the values of some
 * columns. */
static void print_table(const char *heading, const json_t *rows) {
  json_auto_t *columns = find_columns(rows);
  size_t width[COLUMNS_MAX] = {0};
  char text[TEXT_MAX];
  char label[TEXT_MAX];
  for (int pass = 0; pass < 2; ++pass) { /* first measure the columns, then print */
    for (size_t i = 0; i <= json_array_size(rows); ++i) {
      const char *name;
      json_t *numbers;
      size_t column = 0;
      json_object_foreach(columns, name, numbers) {
        write_label("", name, label);
        if (i > 0) {
          write_text(json_object_get(json_array_get(rows, i - 1), name),
                     quantity_of(heading, label), text);
        }
        const char *cell = i == 0 ? label : text;
        const size_t length = strlen(cell);
        if (pass == 0) {
          width[column] = length > width[column] ? length : width[column];
        } else {
          const bool last = column + 1 == json_object_size(columns);
          int side = last ? 0 : -1;
          if (json_is_true(numbers)) {
            side = 1; /* align numbers right */
          }
          (void)printf("  %*s", side * (int)width[column], cell);
        }
        column += column + 1 < COLUMNS_MAX;
      }
      (void)fputs(pass == 0 ? "" : "\n", stdout);
    }
  }
}

static void print_object(const char *parent, json_t *object, int indent);

/* Print a list of flat objects as a table, other objects one by one, other values in one line. */
static void print_member(const char *parent, const char *name, json_t *value, int indent) {
  char text[TEXT_MAX];
  char heading[TEXT_MAX];
  size_t i;
  json_t *item;
  write_label(parent, name, heading);
  if (json_is_array(value) && json_is_string(json_array_get(value, 0))) {
    json_array_foreach(value, i, item) {
      print_member(parent, name, item, indent);
    }
  } else if (!has_objects(value)) {
    write_text(value, quantity_of("", heading), text);
    if (text[0] != '\0') {
      (void)printf("%*s%-*s %s\n", indent, "", LABEL_WIDTH - indent, heading, text);
    }
  } else if (is_row(json_array_get(value, 0))) {
    (void)printf("%*s%s\n", indent, "", heading);
    print_table(heading, value);
  } else if (json_is_array(value)) {
    json_array_foreach(value, i, item) {
      (void)printf("%s %zu\n", heading, i + 1);
      print_object(name, item, indent + 2);
    }
  } else {
    (void)printf("%*s%s\n", indent, "", heading);
    print_object(name, value, indent + 2);
  }
}

/* Print the members of the object with the key `parent`. If each member is an object that fits in a
 * row, print all members as one table, with a label for each row. */
static void print_object(const char *parent, json_t *object, int indent) {
  const char *name;
  json_t *member;
  json_t *rows = json_array();
  char label[TEXT_MAX];
  json_object_foreach(object, name, member) {
    if (is_row(member)) {
      write_label(parent, name, label);
      json_t *row = json_pack("{s:s}", "", label);
      (void)json_object_update(row, member);
      (void)json_array_append_new(rows, row);
    }
  }
  if (json_array_size(rows) > 1 && json_array_size(rows) == json_object_size(object)) {
    print_table("", rows);
  } else {
    json_object_foreach(object, name, member) {
      print_member(parent, name, member, indent);
    }
  }
  json_decref(rows);
}

json_t *supine_options_json_text(const char *text) {
  char printable[TEXT_MAX] = "";
  supine_text_add(printable, sizeof printable, "%s", text);
  return json_string(supine_text_make_utf8(printable));
}

json_t *supine_options_json_number(double number) {
  return isfinite(number) ? json_real(number) : json_null();
}

json_t *supine_options_json_numbers(size_t count, const double *numbers) {
  json_t *list = json_array();
  for (size_t i = 0; i < count; ++i) {
    (void)json_array_append_new(list, supine_options_json_number(numbers[i]));
  }
  return list;
}

void supine_options_print(json_t *value) {
  SUPINE_C_LOCALE;
  if (supine_options_as_json()) {
    (void)json_dumpf(value, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    (void)putchar('\n');
  } else if (json_is_array(value)) {
    print_table("", value);
  } else {
    print_object("", value, 0);
  }
  json_decref(value);
}

void supine_options_print_rows(json_t *rows, int digits) {
  if (supine_options_as_json()) {
    supine_options_print(rows);
    return;
  }
  size_t i;
  json_t *row;
  const char *name;
  json_t *member;
  supine_csv_row line = {.file = stdout};
  json_object_foreach(json_array_get(rows, 0), name, member) {
    supine_csv_add_text(&line, name);
  }
  supine_csv_end_row(&line);
  json_array_foreach(rows, i, row) {
    json_object_foreach(row, name, member) {
      if (json_is_number(member)) {
        supine_csv_add(&line, "%.*g", digits, json_number_value(member));
      } else {
        supine_csv_add_text(&line, "");
      }
    }
    supine_csv_end_row(&line);
  }
  json_decref(rows);
}

static json_t *results; /* list of objects to print at the end of the command, as JSON */

void supine_options_line(const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  if (!supine_options_as_json()) {
    (void)supine_print_list(stdout, format, arguments);
  }
  va_end(arguments);
}

void supine_options_next_result(void) {
  if (!supine_options_as_json()) {
    return;
  }
  if (results == NULL) {
    results = json_array();
  }
  (void)json_array_append_new(results, json_object());
}

void supine_options_add(json_t *members) {
  if (results == NULL) {
    supine_options_next_result();
  }
  json_t *last = json_array_get(results, json_array_size(results) - 1);
  (void)json_object_update(last, members);
  json_decref(members);
}

void supine_options_print_results(bool succeeded) {
  if (succeeded && results != NULL && supine_options_as_json()) {
    const bool single = json_array_size(results) == 1;
    supine_options_print(json_incref(single ? json_array_get(results, 0) : results));
  }
  json_decref(results);
  results = NULL;
}
