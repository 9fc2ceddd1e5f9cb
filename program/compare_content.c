/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute and print how far, and in which direction, embedded structures move between postures. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "sh/base/vec3.h"

#include "program/compare_content.h"
#include "program/inside.h"
#include "program/options/basis_input.h"

/* Displacements of all names in all postures. */
typedef struct comparison {
  const supine_basis *basis;
  const supine_posture_list *postures;
  supine_command_names names;
  float *step;    /* [N, 3] displacement of each vertex in one posture */
  double *moves;  /* [postures, names, 3] mm from the reference surface */
  double *errors; /* [names] expected errors between two postures, mm RMS; 0: unknown */
} comparison;

/* Average `width` numbers of each vertex over the vertices of each name. */
static void average(const comparison *c, size_t width, const float *values, double *mean) {
  const supine_command_names *names = &c->names;
  const size_t n = supine_basis_get_info(c->basis)->vertex_count;
  for (size_t begin = 0; begin < n;) { /* in this order a name's vertices follow each other */
    const size_t name = names->part[names->order[begin]];
    size_t end = begin;
    while (end < n && names->part[names->order[end]] == name) {
      ++end;
    }
    for (size_t k = 0; k < width; ++k) {
      double sum = 0.0;
      for (size_t i = begin; i < end; ++i) {
        sum += (double)values[width * names->order[i] + k];
      }
      mean[width * name + k] = sum / (double)(end - begin);
    }
    begin = end;
  }
}

/* Compute the mean displacement of each name's vertices in posture i. */
static supine_status find_moves(const comparison *c, const supine_state *state, size_t i,
                                supine_error *error) {
  supine_pose pose;
  const supine_status status = supine_basis_pose(c->basis, state, &pose, error);
  if (status == SUPINE_OK) {
    supine_displace_range(c->basis, &pose, 0, supine_basis_get_info(c->basis)->vertex_count,
                          c->step);
    average(c, 3, c->step, c->moves + 3 * i * c->names.count);
  }
  return status;
}

/* Compute the root mean square of the expected errors of each name's vertices. */
static supine_status find_errors(const comparison *c, const supine_state *to,
                                 const supine_state *from, supine_error *error) {
  const size_t n = supine_basis_get_info(c->basis)->vertex_count;
  supine_expected expected = {0};
  const supine_status status = supine_options_expected_find(c->basis, to, from, &expected, error);
  for (size_t i = 0; i < n && expected.sigma != NULL; ++i) {
    expected.sigma[i] *= expected.sigma[i];
  }
  if (expected.sigma != NULL) {
    average(c, 1, expected.sigma, c->errors);
  }
  supine_options_expected_free(&expected);
  return status;
}

/* Add the displacements from one posture to another to a list. */
static void add_pair(const comparison *c, size_t from, size_t to, json_t *list) {
  for (size_t name = 0; name < c->names.count; ++name) {
    const char *const text[] = {c->postures->item[from].name, c->postures->item[to].name,
                                c->names.text[name]};
    const double *before = c->moves + 3 * (from * c->names.count + name);
    const double *after = c->moves + 3 * (to * c->names.count + name);
    const double move[3] = {after[0] - before[0], after[1] - before[1], after[2] - before[2]};
    const double length = supine_length(move);
    const double sigma = sqrt(c->errors[name]);
    (void)json_array_append_new(list,
                                json_pack("{s:s, s:s, s:s, s:[f,f,f], s:f, s:f}", "from", text[0],
                                          "to", text[1], "name", text[2], "move", move[0], move[1],
                                          move[2], "mm", length, "expected_error_mm", sigma));
  }
}

/* Compute the displacements between every two postures. */
static supine_status find_pairs(const comparison *c, const supine_state *volume, json_t *list,
                                supine_error *error) {
  supine_state state[SUPINE_POSTURE_LIST_MAX];
  supine_status status = SUPINE_OK;
  for (size_t i = 0; i < c->postures->count && status == SUPINE_OK; ++i) {
    state[i] = *volume;
    memcpy(state[i].gravity, c->postures->item[i].gravity, sizeof state[i].gravity);
    status = find_moves(c, &state[i], i, error);
  }
  for (size_t i = 0; i < c->postures->count; ++i) {
    for (size_t j = i + 1; j < c->postures->count && status == SUPINE_OK; ++j) {
      status = find_errors(c, &state[j], &state[i], error);
      add_pair(c, i, j, list);
    }
  }
  return status;
}

supine_status supine_command_compare_content(const supine_basis *basis,
                                             const supine_posture_list *postures,
                                             const supine_state *volume, bool json,
                                             supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  comparison c = {.basis = basis, .postures = postures};
  json_t *list = json_array();
  supine_status status = supine_command_names_open(basis, &c.names, error);
  if (status == SUPINE_OK) {
    c.step = malloc(3 * n * sizeof *c.step);
    c.moves = calloc(3 * postures->count * c.names.count, sizeof *c.moves);
    c.errors = calloc(c.names.count, sizeof *c.errors);
    if (c.step == NULL || c.moves == NULL || c.errors == NULL) {
      status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu points", n);
    }
  }
  if (status == SUPINE_OK) {
    status = find_pairs(&c, volume, list, error);
  }
  if (status == SUPINE_OK) {
    supine_options_print(json_incref(list), json);
  }
  json_decref(list);
  free(c.step);
  free(c.moves);
  free(c.errors);
  supine_command_names_close(&c.names);
  return status;
}
