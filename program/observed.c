/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read observed points, and find them by name among the points that 'supine embed' made. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/csv.h"

#include "program/observed.h"
#include "program/options/command.h"

/* Find the vertex of a name that has only one. */
static supine_status find_vertex(const supine_csv *csv, const char *text,
                                 const supine_basis *inside, const supine_command_names *names,
                                 size_t *vertex, supine_error *error) {
  const size_t n = supine_basis_get_info(inside)->vertex_count;
  size_t found = 0;
  for (size_t i = 0; i < n; ++i) {
    if (strcmp(names->text[names->part[i]], text) == 0) {
      *vertex = i;
      ++found;
    }
  }
  if (found == 1) {
    return SUPINE_OK;
  }
  if (found > 1) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s, line %zu: '%s' has %zu vertices, so it is not a point: give "
                            "names of points",
                            csv->path, csv->line, text, found);
  }
  const char *nearest =
      supine_options_suggest(text, (const char *const *)names->text, names->count);
  return supine_error_set(error, SUPINE_ERROR_FORMAT,
                          "%s, line %zu: no point '%s' in the file of --points%s%s%s", csv->path,
                          csv->line, text, nearest == NULL ? "" : "; did you mean '",
                          nearest == NULL ? "" : nearest, nearest == NULL ? "" : "'?");
}

static supine_status read_rows(supine_csv *csv, const supine_basis *inside,
                               const supine_command_names *names, double noise,
                               supine_command_observed *observed, supine_error *error) {
  static const char *const axes[] = {"x", "y", "z"};
  for (bool more = true;;) {
    supine_status status = supine_csv_next(csv, &more, error);
    if (status != SUPINE_OK || !more) {
      return status;
    }
    if (observed->count == SUPINE_LOCATE_POINTS_MAX) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s, line %zu: more than %d points; leave some out", csv->path,
                              csv->line, (int)SUPINE_LOCATE_POINTS_MAX);
    }
    supine_observation *point = &observed->points[observed->count];
    point->noise = noise;
    status = find_vertex(csv, supine_csv_text(csv, 0), inside, names, &point->vertex, error);
    for (size_t i = 0; i < 3 && status == SUPINE_OK; ++i) {
      status = supine_csv_number(csv, 1 + i, axes[i], &point->position[i], error);
    }
    if (status != SUPINE_OK) {
      return status;
    }
    ++observed->count;
  }
}

supine_status supine_command_observed_load(const char *path, const supine_basis *inside,
                                           const supine_command_names *names, double noise,
                                           supine_command_observed *observed, supine_error *error) {
  static const char *const columns[] = {"name", "x", "y", "z"};
  supine_csv csv = {0};
  observed->points = calloc(SUPINE_LOCATE_POINTS_MAX, sizeof *observed->points);
  if (observed->points == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
  }
  supine_status status = supine_csv_open(path, columns, 4, 4, &csv, error);
  if (status == SUPINE_OK) {
    status = read_rows(&csv, inside, names, noise, observed, error);
  }
  if (status == SUPINE_OK && observed->count == 0) {
    status = supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: no observed point: give at least one row name,x,y,z", path);
  }
  supine_csv_close(&csv);
  return status;
}

supine_status supine_command_observed_names(const char *path, const supine_basis *inside,
                                            const supine_command_names *names, double noise,
                                            supine_stream_observed *observed, supine_error *error) {
  const size_t n = supine_basis_get_info(inside)->vertex_count;
  size_t count = 0;
  for (size_t i = 0; i < n; ++i) { /* the vertices of a name are contiguous */
    const uint32_t part = names->part[names->order[i]];
    const bool first = i == 0 || names->part[names->order[i - 1]] != part;
    const bool last = i + 1 == n || names->part[names->order[i + 1]] != part;
    if (first && last && count++ < SUPINE_LOCATE_POINTS_MAX) {
      observed->name[count - 1] = names->text[part];
      observed->last[count - 1] = (supine_observation){
          .vertex = names->order[i], .position = {(double)NAN}, .noise = noise};
    }
  }
  if (count == 0 || count > SUPINE_LOCATE_POINTS_MAX) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: %zu points: give 1 to %d", path, count,
                            (int)SUPINE_LOCATE_POINTS_MAX);
  }
  observed->inside = inside;
  observed->count = count;
  observed->space = calloc(supine_locate_space(count), sizeof *observed->space);
  return observed->space != NULL
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
}

void supine_command_observed_free(supine_command_observed *observed) {
  free(observed->points);
  *observed = (supine_command_observed){0};
}
