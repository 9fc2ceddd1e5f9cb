/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The names of what is inside. */
#include <stdlib.h>
#include <string.h>

#include "program/names.h"

/* Sort vertices by name, stably (a counting sort). */
static bool sort_by_name(supine_command_names *names, size_t n) {
  size_t *next = calloc(names->count + 1, sizeof *next);
  names->order = malloc(n * sizeof *names->order);
  if (next == NULL || names->order == NULL) {
    free(next);
    return false;
  }
  for (size_t i = 0; i < n; ++i) {
    ++next[names->part[i] + 1];
  }
  for (size_t name = 0; name < names->count; ++name) {
    next[name + 1] += next[name];
  }
  for (size_t i = 0; i < n; ++i) {
    names->order[next[names->part[i]]++] = i;
  }
  free(next);
  return true;
}

supine_status supine_command_names_open(const supine_basis *basis, supine_command_names *names,
                                        supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  const supine_tensor *text = supine_basis_tensor(basis, "names");
  const supine_tensor *part = supine_basis_tensor(basis, "part");
  *names = (supine_command_names){0};
  if (text == NULL || part == NULL || text->dtype != SUPINE_U8 || text->rank != 1 ||
      part->dtype != SUPINE_U32 || part->rank != 1 || part->shape[0] != n) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "the basis names no points: make one with 'supine embed BASIS "
                            "POINTS.csv'");
  }
  const size_t length = text->shape[0];
  names->part = part->data;
  names->space = malloc(length + 1);
  names->text = malloc((length + 1) * sizeof *names->text);
  if (names->space == NULL || names->text == NULL) {
    supine_command_names_close(names);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu names", n);
  }
  memcpy(names->space, text->data, length);
  names->space[length] = '\0';
  names->text[names->count++] = names->space;
  for (size_t i = 0; i < length; ++i) {
    if (names->space[i] == '\n') {
      names->space[i] = '\0';
      names->text[names->count++] = names->space + i + 1;
    }
  }
  for (size_t i = 0; i < n; ++i) {
    if (names->part[i] >= names->count) {
      supine_command_names_close(names);
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "point %zu of the basis has no name: make it again "
                              "with 'supine embed BASIS POINTS.csv'",
                              i);
    }
  }
  if (!sort_by_name(names, n)) {
    supine_command_names_close(names);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu names", n);
  }
  return SUPINE_OK;
}

void supine_command_names_close(supine_command_names *names) {
  free(names->space);
  free(names->text);
  free(names->order);
  *names = (supine_command_names){0};
}

size_t supine_command_lung_of(const supine_basis_info *info, size_t vertex) {
  size_t lung = 0;
  while (vertex >= info->lung_begin[lung + 1]) {
    ++lung;
  }
  return lung;
}
