/* SPDX-License-Identifier: MIT */
/* Read points from CSV files and 3D Slicer's markups. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "base/arena.h"
#include "base/csv.h"
#include "base/locale.h"
#include "base/quantity.h"
#include "base/text.h"

#include "mesh/io/points.h"

typedef struct reading {
  const char *path;
  const supine_mesh_load_options *options;
  supine_io_points points;
  size_t room;
  supine_error *error;
} reading;

static supine_status no_memory(const reading *r) {
  return supine_error_memory(r->error, "%zu points of %s", r->points.count, r->path);
}

/* Append a point, and the source of its line of sight or NAN. Convert both from `axes` and `unit`,
 * unless the options name others. */
static supine_status add(reading *r, const double at[3], const double from[3], const char *name,
                         supine_axes axes, double unit) {
  supine_io_points *p = &r->points;
  char number[24];
  if (p->count == r->room) {
    const size_t room = 2 * r->room + 64;
    double *more = realloc(p->at, 3 * room * sizeof *more);
    p->at = more != NULL ? more : p->at;
    double *sources = realloc(p->from, 3 * room * sizeof *sources);
    p->from = sources != NULL ? sources : p->from;
    char **names = realloc(p->names, room * sizeof *names);
    p->names = names != NULL ? names : p->names;
    if (more == NULL || sources == NULL || names == NULL) {
      return no_memory(r);
    }
    r->room = room;
  }
  (void)snprintf(number, sizeof number, "%zu", p->count + 1);
  const supine_mesh_load_options none = {.axes = SUPINE_AXES_AUTO};
  const supine_mesh_load_options *given = r->options != NULL ? r->options : &none;
  const double *const read[] = {at, from};
  double *const written[] = {p->at + 3 * p->count, p->from + 3 * p->count};
  for (size_t k = 0; k < 2; ++k) {
    memcpy(written[k], read[k], 3 * sizeof *at);
    supine_mesh_axes_apply(given->axes != SUPINE_AXES_AUTO ? given->axes : axes,
                           given->millimetres_per_unit > 0.0 ? given->millimetres_per_unit : unit,
                           written[k]);
  }
  p->names[p->count] = strdup(name != NULL && name[0] != '\0' ? name : number);
  if (p->names[p->count] == NULL) {
    return no_memory(r);
  }
  for (char *c = p->names[p->count]; *c != '\0'; ++c) { /* a name must be one line of text */
    *c = (unsigned char)*c < ' ' ? ' ' : *c;
  }
  ++p->count;
  return SUPINE_OK;
}

/* Columns of a table of points. 3D Slicer names the coordinates by its axes, and says in `defined`
 * whether a point was placed. */
static const char *const columns[] = {"x",       "y",      "z",      "l",     "p",
                                      "s",       "r",      "a",      "name",  "label",
                                      "defined", "from_x", "from_y", "from_z"};
enum { XYZ = 0, LPS = 3, RAS = 6, NAME = 8, LABEL, DEFINED, FROM, COLUMNS = FROM + 3 };

static const double nowhere[3] = {NAN, NAN, NAN};

/* Read the source of the line of sight of the point `at`: three numbers, or nothing. */
static supine_status read_source(const reading *r, supine_csv *csv, const double at[3],
                                 double from[3]) {
  size_t given = 0;
  for (size_t k = 0; k < 3; ++k) {
    const char *text = supine_csv_text(csv, FROM + k);
    given += text != NULL && text[strspn(text, " ")] != '\0';
  }
  memcpy(from, nowhere, sizeof nowhere);
  if (given == 0) {
    return SUPINE_OK;
  }
  SUPINE_REFUSE_IF(
      given != 3, r->error, SUPINE_ERROR_FORMAT,
      "%s:%zu: %zu of from_x, from_y and from_z: give all three for a line of sight, or "
      "none for a point",
      r->path, csv->line, given);
  for (size_t k = 0; k < 3; ++k) {
    SUPINE_TRY(supine_csv_number(csv, FROM + k, columns[FROM + k], &from[k], r->error));
  }
  const double length = hypot(hypot(at[0] - from[0], at[1] - from[1]), at[2] - from[2]);
  SUPINE_REFUSE_IF(
      length < 1e-6, r->error, SUPINE_ERROR_FORMAT,
      "%s:%zu: the line of sight ends where it begins: give in x,y,z another place on it "
      "than in from_x,from_y,from_z",
      r->path, csv->line);
  return SUPINE_OK;
}

/* Add the points in the rows of a table, whose coordinates are in three columns. */
static supine_status read_rows(reading *r, supine_csv *csv, const size_t column[3],
                               supine_axes axes) {
  for (bool more = true;;) {
    SUPINE_TRY(supine_csv_next(csv, &more, r->error));
    if (!more) {
      return SUPINE_OK;
    }
    const char *defined = supine_csv_text(csv, DEFINED);
    double at[3];
    double from[3];
    if (defined != NULL && strcmp(defined, "0") == 0) {
      continue; /* 3D Slicer: the point was not placed */
    }
    for (size_t k = 0; k < 3; ++k) {
      SUPINE_TRY(supine_csv_number(csv, column[k], columns[column[k]], &at[k], r->error));
    }
    SUPINE_TRY(read_source(r, csv, at, from));
    const char *name = supine_csv_text(csv, NAME);
    name = name != NULL && name[0] != '\0' ? name : supine_csv_text(csv, LABEL);
    /* the table converts to mm what names its unit; an option's unit replaces that */
    const bool given = r->options != NULL && r->options->millimetres_per_unit > 0.0;
    for (size_t k = 0; k < 3; ++k) {
      at[k] /= given ? supine_csv_scale(csv, column[k]) : 1.0;
      from[k] /= given ? supine_csv_scale(csv, FROM + k) : 1.0;
    }
    SUPINE_TRY(add(r, at, from, name, axes, 1.0));
  }
}

static supine_status read_csv(reading *r) {
  static const size_t xyz[3] = {XYZ, XYZ + 1, XYZ + 2};
  static const size_t lps[3] = {LPS, LPS + 1, LPS + 2};
  static const size_t ras[3] = {RAS, RAS + 1, LPS + 2}; /* both have the column s */
  supine_axes axes = SUPINE_AXES_LPS;
  const size_t *column = xyz;
  SUPINE_FREED_BY(supine_csv_close) supine_csv csv = {0};
  SUPINE_TRY(supine_csv_open(r->path, columns, COLUMNS, 0, &csv, r->error));
  if (supine_csv_has(&csv, LPS) && supine_csv_has(&csv, LPS + 1) && supine_csv_has(&csv, LPS + 2)) {
    column = lps;
  } else if (supine_csv_has(&csv, RAS) && supine_csv_has(&csv, RAS + 1) &&
             supine_csv_has(&csv, LPS + 2)) {
    column = ras;
    (void)supine_mesh_axes_parse("RAS", &axes);
  }
  for (size_t k = 0; k < 3; ++k) {
    SUPINE_REFUSE_IF(!supine_csv_has(&csv, column[k]), r->error, SUPINE_ERROR_FORMAT,
                     "%s:%zu: the header has no column \"%s\"; expected x,y,z,... (or l,p,s or "
                     "r,a,s of 3D Slicer)",
                     r->path, csv.line, columns[column[k]]);
  }
  return read_rows(r, &csv, column, axes);
}

/* Find the axes of a coordinate system by its name or its number in 3D Slicer. */
static bool find_system(const char *name, supine_axes *axes) {
  static const struct {
    const char *name;
    supine_axes axes;
  } systems[] = {{"RAS", SUPINE_AXES_RAS},
                 {"0", SUPINE_AXES_RAS},
                 {"LPS", SUPINE_AXES_LPS},
                 {"1", SUPINE_AXES_LPS}};
  for (size_t i = 0; i < sizeof systems / sizeof *systems; ++i) {
    if (strcmp(name, systems[i].name) == 0) {
      *axes = systems[i].axes;
      return true;
    }
  }
  return false;
}

/* Find the coordinate system and the columns in the comments of a .fcsv file of 3D Slicer. Without
 * them, both stay as they are. */
static supine_status read_comments(const reading *r, supine_axes *axes, char *header, size_t size) {
  char line[512];
  FILE *file = fopen(r->path, "rb");
  SUPINE_REFUSE_IF(file == NULL, r->error, SUPINE_ERROR_READ, "%s: cannot open: %s", r->path,
                   strerror(errno));
  bool known = true;
  while (fgets(line, sizeof line, file) != NULL) {
    char system[16];
    line[strcspn(line, "\r\n")] = '\0';
    if (sscanf(line, "# CoordinateSystem = %15s", system) == 1) {
      known = find_system(system, axes);
    }
    if (strncmp(line, "# columns = ", 12) == 0) {
      (void)snprintf(header, size, "%s", line + 12);
    }
  }
  (void)fclose(file);
  SUPINE_REFUSE_IF(!known, r->error, SUPINE_ERROR_FORMAT,
                   "%s: the coordinate system is neither LPS nor RAS: save the points in one of "
                   "these",
                   r->path);
  return SUPINE_OK;
}

static supine_status read_fcsv(reading *r) {
  static const size_t xyz[3] = {XYZ, XYZ + 1, XYZ + 2};
  char header[512] = "id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID";
  supine_axes axes = SUPINE_AXES_RAS;
  SUPINE_FREED_BY(supine_csv_close) supine_csv csv = {0};
  SUPINE_TRY(read_comments(r, &axes, header, sizeof header));
  SUPINE_TRY(supine_csv_open_bare(r->path, header, columns, COLUMNS, 3, &csv, r->error));
  return read_rows(r, &csv, xyz, axes);
}

/* Find the unit of a markup's coordinates: a text, or a coded entry, whose first member is the code
 * of the unit. Without one it is mm. Return false for any other value. */
static bool find_markup_unit(const json_t *markup, const char **name, double *millimetres) {
  const json_t *stated = json_object_get(markup, "coordinateUnits");
  const json_t *code = json_is_array(stated) ? json_array_get(stated, 0) : stated;
  *name = json_is_string(code) ? json_string_value(code) : "";
  *millimetres = 1.0;
  return stated == NULL || supine_quantity_find_unit(SUPINE_QUANTITY_LENGTH, *name, millimetres);
}

static supine_status read_markup(reading *r, const json_t *markup) {
  const char *system = json_string_value(json_object_get(markup, "coordinateSystem"));
  supine_axes axes = SUPINE_AXES_LPS;
  const char *unit = NULL;
  double scale = 1.0;
  const bool known = system == NULL || find_system(system, &axes);
  const bool measured = find_markup_unit(markup, &unit, &scale);
  SUPINE_REFUSE_IF(!known, r->error, SUPINE_ERROR_FORMAT,
                   "%s: the coordinate system \"%s\" is neither LPS nor RAS: save the points in "
                   "one of these",
                   r->path, system);
  SUPINE_REFUSE_IF(!measured, r->error, SUPINE_ERROR_FORMAT,
                   "%s: the unit \"%s\" is unknown: save the points in mm", r->path, unit);
  const json_t *list = json_object_get(markup, "controlPoints");
  for (size_t i = 0; i < json_array_size(list); ++i) {
    const json_t *point = json_array_get(list, i);
    const char *placed = json_string_value(json_object_get(point, "positionStatus"));
    const json_t *position = json_object_get(point, "position");
    double at[3] = {NAN, NAN, NAN};
    if (placed != NULL && strcmp(placed, "defined") != 0) {
      continue;
    }
    if (json_array_size(position) == 3) {
      for (size_t k = 0; k < 3; ++k) {
        const json_t *number = json_array_get(position, k);
        at[k] = json_is_number(number) ? json_number_value(number) : NAN;
      }
    }
    SUPINE_REFUSE_IF(!isfinite(at[0]) || !isfinite(at[1]) || !isfinite(at[2]), r->error,
                     SUPINE_ERROR_FORMAT,
                     "%s: control point %zu has no position of three numbers: place or delete it",
                     r->path, i + 1);
    SUPINE_TRY(
        add(r, at, nowhere, json_string_value(json_object_get(point, "label")), axes, scale));
  }
  return SUPINE_OK;
}

static supine_status read_markups(reading *r) {
  SUPINE_C_LOCALE;
  json_error_t why;
  json_auto_t *root = json_load_file(r->path, 0, &why);
  SUPINE_REFUSE_IF(root == NULL && json_error_code(&why) == json_error_invalid_utf8, r->error,
                   SUPINE_ERROR_FORMAT,
                   "%s:%d: the text is not UTF-8: save the file with the encoding UTF-8", r->path,
                   why.line);
  SUPINE_REFUSE_IF(root == NULL, r->error, why.line < 0 ? SUPINE_ERROR_READ : SUPINE_ERROR_FORMAT,
                   "%s:%d: %s", r->path, why.line < 0 ? 0 : why.line, why.text);
  const json_t *markups = json_object_get(root, "markups");
  for (size_t i = 0; i < json_array_size(markups); ++i) {
    SUPINE_TRY(read_markup(r, json_array_get(markups, i)));
  }
  return SUPINE_OK;
}

bool supine_io_points_named(const char *path) {
  return supine_text_ends_in(path, ".csv") || supine_text_ends_in(path, ".fcsv") ||
         supine_text_ends_in(path, ".json");
}

supine_status supine_io_points_read(const char *path, const supine_mesh_load_options *options,
                                    supine_io_points *points, supine_error *error) {
  reading r = {.path = path, .options = options, .error = error};
  supine_status status = SUPINE_OK;
  if (supine_text_ends_in(path, ".json")) {
    status = read_markups(&r);
  } else if (supine_text_ends_in(path, ".fcsv")) {
    status = read_fcsv(&r);
  } else {
    status = read_csv(&r);
  }
  if (status == SUPINE_OK && r.points.count == 0) {
    status = supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: no points: give at least one", path);
  }
  if (status == SUPINE_OK) {
    *points = r.points;
  } else {
    supine_io_points_free(&r.points);
  }
  return status;
}

void supine_io_points_free(supine_io_points *points) {
  for (size_t i = 0; i < points->count; ++i) {
    free(points->names[i]);
  }
  free(points->names);
  free(points->at);
  free(points->from);
  *points = (supine_io_points){0};
}
