/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute and print how far, and in which direction, embedded structures move between postures. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "sh/base/output.h"
#include "sh/base/vec3.h"

#include "program/compare_content.h"
#include "program/inside.h"
#include "program/options/basis_input.h"

/* Displacements of all names in all postures. */
typedef struct comparison {
  const supine_posture_list *postures;
  supine_command_names names;
  double *moves;  /* [postures, names, 3] mm from the reference surface */
  double *errors; /* [postures, postures, names] expected, mm RMS; 0 where they are not known */
} comparison;

/* Compute the mean displacement of each name's vertices in one state. */
static supine_status find_moves(const supine_basis *basis, const supine_state *state,
                                const supine_command_names *names, float *step, double *moves,
                                supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  supine_pose pose;
  const supine_status status = supine_basis_pose(basis, state, &pose, error);
  if (status != SUPINE_OK) {
    return status;
  }
  supine_displace_range(basis, &pose, 0, info->vertex_count, step);
  for (size_t begin = 0; begin < info->vertex_count;) { /* a name's vertices follow each other */
    const size_t name = names->part[names->order[begin]];
    double sum[3] = {0.0, 0.0, 0.0};
    size_t end = begin;
    for (; end < info->vertex_count && names->part[names->order[end]] == name; ++end) {
      for (size_t k = 0; k < 3; ++k) {
        sum[k] += (double)step[3 * names->order[end] + k];
      }
    }
    for (size_t k = 0; k < 3; ++k) {
      moves[3 * name + k] = sum[k] / (double)(end - begin);
    }
    begin = end;
  }
  return SUPINE_OK;
}

/* Compute the root mean square of the expected errors of each name's vertices. */
static supine_status find_errors(const supine_basis *basis, const supine_state *to,
                                 const supine_state *from, const supine_command_names *names,
                                 double *errors, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  supine_expected expected = {0};
  const supine_status status = supine_options_expected_find(basis, to, from, &expected, error);
  for (size_t begin = 0; expected.sigma != NULL && begin < info->vertex_count;) {
    const size_t name = names->part[names->order[begin]];
    double sum = 0.0;
    size_t end = begin;
    for (; end < info->vertex_count && names->part[names->order[end]] == name; ++end) {
      sum += pow((double)expected.sigma[names->order[end]], 2.0);
    }
    errors[name] = sqrt(sum / (double)(end - begin));
    begin = end;
  }
  supine_options_expected_free(&expected);
  return status;
}

static double error_of(const comparison *c, size_t from, size_t to, size_t name) {
  return c->errors[(from * c->postures->count + to) * c->names.count + name];
}

/* Compute the displacement from posture `from` to posture `to` and return its length. */
static double move_between(const comparison *c, size_t from, size_t to, size_t name,
                           double move[3]) {
  for (size_t k = 0; k < 3; ++k) {
    move[k] = c->moves[3 * (to * c->names.count + name) + k] -
              c->moves[3 * (from * c->names.count + name) + k];
  }
  return supine_length(move);
}

static void print_table(const comparison *c, size_t from, size_t to) {
  static const char *const ways[3][2] = {{"right", "left"}, {"front", "back"}, {"feet", "head"}};
  (void)printf("%s to %s:\n", supine_options_posture_label(c->postures->item[from].name),
               supine_options_posture_label(c->postures->item[to].name));
  for (size_t name = 0; name < c->names.count; ++name) {
    double move[3];
    const double length = move_between(c, from, to, name, move);
    (void)printf("  %-16s moved %5.1f mm", c->names.text[name], length);
    if (error_of(c, from, to, name) > 0.0) {
      (void)printf(" (expected error %.1f)", error_of(c, from, to, name));
    }
    (void)putchar(':');
    for (int k = 0; k < 3; ++k) {
      (void)printf("%s %4.1f to the %s", k > 0 ? "," : "", fabs(move[k]), ways[k][move[k] > 0.0]);
    }
    (void)putchar('\n');
  }
}

static void write_csv(const comparison *c, size_t from, size_t to, FILE *file) {
  for (size_t name = 0; name < c->names.count; ++name) {
    double move[3];
    const double length = move_between(c, from, to, name, move);
    (void)fprintf(file, "%s,%s,%s,%.3f,%.3f,%.3f,%.3f,%.3f\n", c->postures->item[from].name,
                  c->postures->item[to].name, c->names.text[name], move[0], move[1], move[2],
                  length, error_of(c, from, to, name));
  }
}

static bool add_json(const comparison *c, size_t from, size_t to, json_t *list) {
  for (size_t name = 0; name < c->names.count; ++name) {
    double move[3];
    const double length = move_between(c, from, to, name, move);
    if (json_array_append_new(
            list, json_pack("{s:s, s:s, s:s, s:[f,f,f], s:f, s:f}", "from",
                            c->postures->item[from].name, "to", c->postures->item[to].name, "name",
                            c->names.text[name], "move", move[0], move[1], move[2], "mm", length,
                            "expected_error_mm", error_of(c, from, to, name))) != 0) {
      return false;
    }
  }
  return true;
}

/* Write the displacements between every two postures to `csv`; else add them to `list`; else print
 * a table. */
static supine_status write_pairs(const comparison *c, json_t *list, FILE *csv) {
  if (csv != NULL) {
    (void)fputs("from,to,name,dx,dy,dz,moved_mm,expected_error_mm\n", csv);
  }
  for (size_t from = 0; from < c->postures->count; ++from) {
    for (size_t to = from + 1; to < c->postures->count; ++to) {
      if (csv != NULL) {
        write_csv(c, from, to, csv);
      } else if (list == NULL) {
        print_table(c, from, to);
      } else if (!add_json(c, from, to, list)) {
        return SUPINE_ERROR_MEMORY;
      }
    }
  }
  return SUPINE_OK;
}

static supine_status write_all(const comparison *c, bool json, const char *csv,
                               supine_error *error) {
  supine_output output = {0};
  json_t *list = json ? json_array() : NULL;
  supine_status status = json && list == NULL ? SUPINE_ERROR_MEMORY : write_pairs(c, list, NULL);
  if (!json) {
    (void)puts("Expected error: " SUPINE_EXPECTED_MEANING ".\n" SUPINE_EXPECTED_SUPPORT);
  }
  if (status == SUPINE_OK && json) {
    status = json_dumpf(list, stdout, JSON_INDENT(2)) == 0 ? SUPINE_OK : SUPINE_ERROR_WRITE;
    (void)putchar('\n');
  }
  json_decref(list);
  if (status != SUPINE_OK) {
    return supine_error_set(error, status, "cannot print JSON");
  }
  if (csv != NULL) {
    status = supine_output_open(csv, &output, error);
    if (status == SUPINE_OK) {
      (void)write_pairs(c, NULL, output.file);
      status = supine_output_commit(&output, error);
    }
  }
  return status;
}

supine_status supine_command_compare_content(const supine_basis *basis,
                                             const supine_posture_list *postures,
                                             const supine_state *volume, bool json, const char *csv,
                                             supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  comparison c = {.postures = postures};
  supine_status status = supine_command_names_open(basis, &c.names, error);
  if (status != SUPINE_OK) {
    return status;
  }
  float *step = malloc(3 * n * sizeof *step);
  c.moves = calloc(3 * postures->count * c.names.count, sizeof *c.moves);
  c.errors = calloc(postures->count * postures->count * c.names.count, sizeof *c.errors);
  if (step == NULL || c.moves == NULL || c.errors == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu points", n);
  }
  for (size_t i = 0; i < postures->count && status == SUPINE_OK; ++i) {
    supine_state state = *volume;
    memcpy(state.gravity, postures->item[i].gravity, sizeof state.gravity);
    status = find_moves(basis, &state, &c.names, step, c.moves + 3 * i * c.names.count, error);
    for (size_t j = i + 1; j < postures->count && status == SUPINE_OK; ++j) {
      supine_state other = *volume;
      memcpy(other.gravity, postures->item[j].gravity, sizeof other.gravity);
      status = find_errors(basis, &other, &state, &c.names,
                           c.errors + (i * postures->count + j) * c.names.count, error);
    }
  }
  if (status == SUPINE_OK) {
    status = write_all(&c, json, csv, error);
  }
  free(step);
  free(c.moves);
  free(c.errors);
  supine_command_names_close(&c.names);
  return status;
}
