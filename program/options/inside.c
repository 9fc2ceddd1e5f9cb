/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read the names of embedded structures ('supine embed'), and make their labels for pictures. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "program/options/basis_input.h"
#include "program/options/inside.h"

/* Sort the vertices by structure, then in input order. */
static supine_status sort_by_name(supine_command_names *names, size_t n, supine_error *error) {
  size_t *begin = names->begin = supine_arena_zeros(&names->arena, names->count + 2, sizeof *begin);
  names->order = supine_arena_take(&names->arena, n, sizeof *names->order);
  if (names->arena.failed) {
    return supine_error_memory(error, "the names of %zu vertices", n);
  }
  for (size_t i = 0; i < n; ++i) {
    ++begin[names->part[i] + 2];
  }
  for (size_t name = 0; name < names->count; ++name) {
    begin[name + 2] += begin[name + 1];
  }
  for (size_t i = 0; i < n; ++i) {
    names->order[begin[names->part[i] + 1]++] = i;
  }
  return SUPINE_OK;
}

supine_status supine_command_names_open(const supine_basis *basis, supine_command_names *names,
                                        supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  const supine_tensor *text = supine_basis_tensor(basis, "names");
  const supine_tensor *part = supine_basis_tensor(basis, "part");
  *names = (supine_command_names){0};
  if (text == NULL || part == NULL || text->dtype != SUPINE_U8 || text->rank != 1 ||
      part->dtype != SUPINE_U32 || part->rank != 1 || part->shape[0] != n) {
    return supine_error_set(
        error, SUPINE_ERROR_FORMAT,
        "the basis names no points: make one with 'supine embed BASIS POINTS.csv'");
  }
  const size_t length = text->shape[0];
  char *space = supine_arena_zeros(&names->arena, length + 1, 1);
  names->part = part->data;
  names->text = supine_arena_take(&names->arena, length + 1, sizeof *names->text);
  if (names->arena.failed) {
    return supine_error_memory(error, "the names of %zu vertices", n);
  }
  memcpy(space, text->data, length);
  names->text[names->count++] = space;
  for (size_t i = 0; i < length; ++i) {
    if (space[i] == '\n') {
      space[i] = '\0';
      names->text[names->count++] = space + i + 1;
    }
  }
  for (size_t i = 0; i < n; ++i) {
    if (names->part[i] >= names->count) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "point %zu of the basis has no name: make the file again with "
                              "'supine embed BASIS POINTS.csv'",
                              i);
    }
  }
  return sort_by_name(names, n, error);
}

void supine_command_names_close(supine_command_names *names) {
  supine_arena_free(&names->arena);
}

size_t supine_command_lung_of(const supine_basis_info *info, size_t vertex) {
  size_t lung = 0;
  while (vertex >= info->lung_begin[lung + 1]) {
    ++lung;
  }
  return lung;
}

supine_status supine_command_inside_check(const supine_basis *lungs, const supine_basis *inside,
                                          const char *path, supine_error *error) {
  const supine_basis_info *a = supine_basis_get_info(lungs);
  const supine_basis_info *b = supine_basis_get_info(inside);
  return b->vector && a->identity == b->identity
             ? SUPINE_OK
             : supine_error_set(
                   error, SUPINE_ERROR_FORMAT,
                   "%s belongs to another basis: make it again with 'supine embed' from "
                   "the given basis",
                   path);
}

supine_status supine_command_inside_open(const supine_basis *lungs, const char *path,
                                         supine_basis **inside, supine_command_names *names,
                                         supine_error *error) {
  SUPINE_TRY(supine_options_basis_open(path, SUPINE_STORAGE_AUTO, inside, error));
  SUPINE_TRY(supine_command_names_open(*inside, names, error));
  return supine_command_inside_check(lungs, *inside, path, error);
}

/* Add the marks of one structure: its vertices, and its name at their mean position. */
static void add_part(const supine_command_names *names, size_t part, const float *xyz,
                     const float *from, supine_command_marks *out) {
  const size_t *order = names->order + names->begin[part];
  const size_t count = names->begin[part + 1] - names->begin[part];
  supine_mark middle = {.xyz = {0.0F, 0.0F, 0.0F}, .point = count == 1, .label = out->label[part]};
  for (size_t i = 0; i < count; ++i) {
    const float *p = xyz + 3 * order[i];
    const float *q = from + 3 * order[i];
    const float moved = hypotf(hypotf(p[0] - q[0], p[1] - q[1]), p[2] - q[2]);
    for (size_t k = 0; k < 3; ++k) {
      middle.xyz[k] += p[k] / (float)count;
    }
    middle.value += moved / (float)count;
    if (count > 1) {
      out->mark[out->marks.count++] = (supine_mark){{p[0], p[1], p[2]}, moved, false, NULL};
    }
  }
  (void)snprintf(out->label[part], sizeof out->label[part], "%.30s moved %.1f mm",
                 names->text[part], (double)middle.value);
  if (count > 0) {
    out->mark[out->marks.count++] = middle;
  }
}

supine_status supine_command_marks_make(const supine_basis *inside,
                                        const supine_command_names *names, const supine_pose *pose,
                                        const supine_pose *from, supine_command_marks *marks,
                                        supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(inside);
  const size_t n = info->vertex_count;
  SUPINE_ARENA arena = {0};
  float *xyz = supine_arena_take(&arena, 3 * n, sizeof *xyz);
  float *before = supine_arena_take(&arena, 3 * n, sizeof *before);
  supine_command_marks_free(marks);
  marks->mark = supine_arena_take(&marks->arena, n + names->count, sizeof *marks->mark);
  marks->label = supine_arena_take(&marks->arena, names->count, sizeof *marks->label);
  if (arena.failed || marks->arena.failed) {
    return supine_error_memory(error, "%zu points", n);
  }
  (void)supine_deform(inside, pose, xyz);
  (void)supine_deform(inside, from, before);
  for (size_t part = 0; part < names->count; ++part) {
    add_part(names, part, xyz, before, marks);
  }
  marks->marks.mark = marks->mark;
  return SUPINE_OK;
}

void supine_command_marks_free(supine_command_marks *marks) {
  supine_arena_free(&marks->arena);
  *marks = (supine_command_marks){.mark = NULL};
}
