/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read the names of embedded structures ('supine embed'), and make their labels for pictures. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/text.h"
#include "base/utf8.h"
#include "base/vec3.h"

#include "program/options/basis_input.h"
#include "program/options/inside.h"
#include "runtime/checks.h"
#include "runtime/lung.h"

/* Sort the vertices by structure, then in input order. */
static supine_status sort_by_name(supine_options_names *names, size_t n, supine_error *error) {
  size_t *begin = names->begin = supine_arena_zeros(&names->arena, names->count + 2, sizeof *begin);
  names->order = supine_arena_take(&names->arena, n, sizeof *names->order);
  SUPINE_TRY(supine_arena_check(&names->arena, error, "the names of %zu vertices", n));
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

/* Read which structures are anatomy. In files of other programs, which may lack this, all are
 * targets. */
static supine_status read_anatomy(const supine_basis *basis, supine_options_names *names,
                                  supine_error *error) {
  const supine_tensor *anatomy = supine_basis_tensor(basis, "anatomy");
  if (anatomy == NULL) {
    names->anatomy = supine_arena_zeros(&names->arena, names->count, 1);
    return supine_arena_check(&names->arena, error, "%zu structures", names->count);
  }
  SUPINE_REFUSE_IF(
      anatomy->dtype != SUPINE_U8 || anatomy->rank != 1 || anatomy->shape[0] != names->count, error,
      SUPINE_ERROR_FORMAT,
      "the tensor 'anatomy' of the basis is not a byte for each of %zu structures: make the file "
      "again with 'supine embed'",
      names->count);
  names->anatomy = anatomy->data;
  return SUPINE_OK;
}

supine_status supine_options_names_open(const supine_basis *basis, supine_options_names *names,
                                        supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  const supine_tensor *text = supine_basis_tensor(basis, "names");
  const supine_tensor *part = supine_basis_tensor(basis, "part");
  *names = (supine_options_names){0};
  SUPINE_REFUSE_IF(text == NULL || part == NULL || text->dtype != SUPINE_U8 || text->rank != 1 ||
                       part->dtype != SUPINE_U32 || part->rank != 1 || part->shape[0] != n,
                   error, SUPINE_ERROR_FORMAT,
                   "the basis names no points: make one with 'supine embed BASIS POINTS.csv'");
  const size_t length = text->shape[0];
  char *space = supine_arena_zeros(&names->arena, length + 1, 1);
  names->part = part->data;
  names->text = supine_arena_take(&names->arena, length + 1, sizeof *names->text);
  SUPINE_TRY(supine_arena_check(&names->arena, error, "the names of %zu vertices", n));
  memcpy(space, text->data, length);
  SUPINE_REFUSE_IF(strlen(space) != length || !supine_text_is_utf8(space), error,
                   SUPINE_ERROR_FORMAT,
                   "the names of the points are not UTF-8: save the points as UTF-8, and make the "
                   "basis again with 'supine embed BASIS POINTS.csv'");
  names->text[names->count++] = space;
  for (size_t i = 0; i < length; ++i) {
    if (space[i] == '\n') {
      space[i] = '\0';
      names->text[names->count++] = space + i + 1;
    }
  }
  for (size_t i = 0; i < n; ++i) {
    SUPINE_REFUSE_IF(names->part[i] >= names->count, error, SUPINE_ERROR_FORMAT,
                     "point %zu of the basis has no name: make the file again with 'supine embed "
                     "BASIS POINTS.csv'",
                     i);
  }
  SUPINE_TRY(read_anatomy(basis, names, error));
  return sort_by_name(names, n, error);
}

void supine_options_names_close(supine_options_names *names) {
  supine_arena_free(&names->arena);
}

supine_status supine_options_inside_open(const supine_basis *lungs, const char *path,
                                         supine_basis **inside, supine_options_names *names,
                                         supine_error *error) {
  SUPINE_TRY(supine_options_basis_open(path, SUPINE_STORAGE_AUTO, supine_basis_allows_folds(lungs),
                                       inside, error));
  SUPINE_TRY(supine_options_names_open(*inside, names, error));
  const supine_basis_info *info = supine_basis_get_info(*inside);
  SUPINE_REFUSE_IF(
      !(info->vector && info->identity == supine_basis_get_info(lungs)->identity), error,
      SUPINE_ERROR_FORMAT,
      "%s belongs to another basis: make it again with 'supine embed' from the given basis", path);
  return SUPINE_OK;
}

/* Return the RMS of the values of the vertices order[begin] to order[end - 1]; NAN if there are no
 * values. */
static double rms_of(const supine_options_names *names, size_t begin, size_t end,
                     const float *values) {
  double square = 0;
  if (values == NULL) {
    return (double)NAN;
  }
  for (size_t i = begin; i < end; ++i) {
    const double value = (double)values[names->order[i]];
    square += value * value / (double)(end - begin);
  }
  return sqrt(square);
}

/* Average the vertices order[begin] to order[end - 1] to a target; [N, 3] positions before and
 * after.
 */
static supine_target average(const supine_options_names *names, size_t begin, size_t end,
                             const float *after, const float *before, const supine_errors *errors) {
  const double count = (double)(end - begin);
  supine_target target = {.name = names->text[names->part[names->order[begin]]]};
  for (size_t i = begin; i < end; ++i) {
    const size_t vertex = names->order[i];
    for (size_t k = 0; k < 3; ++k) {
      const double x = (double)after[3 * vertex + k];
      target.at[k] += x / count;
      target.move[k] += (x - (double)before[3 * vertex + k]) / count;
    }
  }
  target.moved = supine_length(target.move);
  target.error = rms_of(names, begin, end, errors->position.sigma);
  target.another_error = rms_of(names, begin, end, errors->position.another);
  target.moved_error = rms_of(names, begin, end, errors->moved.sigma);
  target.anatomy = names->anatomy[names->part[names->order[begin]]] != 0;
  return target;
}

/* Compute the volume of each structure whose positions are `xyz` [N, 3]. The normals of a closed
 * surface sum to 0, and its volume is a sixth of the sum of (corner) . (normal) over its
 * triangles. */
static void find_volumes(const supine_basis_info *info, const supine_options_names *names,
                         const float *xyz, int side, supine_target *targets) {
  for (size_t part = 0; part < names->count; ++part) {
    double sum[5] = {0.0}; /* of the normals x, y, z, of their lengths, and of corner . normal */
    for (size_t t = 0; t < 3 * info->triangle_count; t += 3) {
      const uint32_t *corner = info->triangles + t;
      double x[3][3];
      double normal[3];
      if (names->part[corner[0]] != part) {
        continue;
      }
      for (size_t k = 0; k < 9; ++k) {
        x[k / 3][k % 3] = (double)xyz[3 * corner[k / 3] + k % 3];
      }
      supine_normal(x[0], x[1], x[2], normal);
      for (size_t k = 0; k < 3; ++k) {
        sum[k] += normal[k];
      }
      sum[3] += supine_length(normal);
      sum[4] += supine_dot(x[0], normal);
    }
    targets[part].volume[side] =
        supine_length(sum) < 1e-3 * sum[3] ? fabs(sum[4]) / 6000.0 : (double)NAN;
  }
}

supine_status supine_options_targets_find(const supine_basis *inside,
                                          const supine_options_names *names,
                                          const supine_pose *const pose[2],
                                          const supine_errors *errors, bool each,
                                          supine_target **targets, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(inside);
  const size_t n = info->vertex_count;
  const size_t count = each ? n : names->count;
  SUPINE_ARENA arena = {0};
  float *after = supine_arena_take(&arena, 3 * n, sizeof *after);
  float *before = supine_arena_take(&arena, 3 * n, sizeof *before);
  *targets = calloc(count, sizeof **targets);
  if (arena.failed || *targets == NULL) {
    return supine_error_memory(error, "%zu points", n);
  }
  (void)supine_deform(inside, pose[0], before);
  (void)supine_deform(inside, pose[1], after);
  for (size_t i = 0; i < count; ++i) {
    const size_t begin = each ? i : names->begin[i];
    const size_t end = each ? i + 1 : names->begin[i + 1];
    if (end > begin) {
      (*targets)[i] = average(names, begin, end, after, before, errors);
      (*targets)[i].lung = supine_basis_lung_of(info, names->order[begin]);
    } else { /* a name may have no vertices */
      (*targets)[i].name = names->text[i];
    }
  }
  if (!each && info->triangle_count > 0) {
    find_volumes(info, names, before, 0, *targets);
    find_volumes(info, names, after, 1, *targets);
  }
  return SUPINE_OK;
}

void supine_options_targets_free(supine_target **targets) {
  free(*targets);
}

const char *supine_options_target_way(const supine_target *target, size_t most, char way[96]) {
  static const char *const names[3][2] = {{"right", "left"}, {"front", "back"}, {"feet", "head"}};
  double left[3] = {fabs(target->move[0]), fabs(target->move[1]), fabs(target->move[2])};
  if (target->moved <= target->moved_error) {
    (void)supine_print_text(way, 96, "%.1f mm, within its error of %.1f", target->moved,
                            target->moved_error);
  } else {
    way[0] = '\0';
    for (size_t i = 0; i < most; ++i) {
      size_t axis = left[0] > left[1] ? 0U : 1U;
      axis = left[2] > left[axis] ? 2 : axis;
      if (left[axis] >= 0.5) {
        supine_text_add(way, 96, "%s%.0f to the %s", i > 0 ? ", " : "", left[axis],
                        names[axis][target->move[axis] > 0]);
      }
      left[axis] = 0;
    }
  }
  return way;
}

void supine_options_target_shift(supine_target *target, const double shift[3]) {
  for (size_t k = 0; k < 3; ++k) {
    target->at[k] -= shift[k];
    target->move[k] -= shift[k];
  }
  target->moved = supine_length(target->move);
}

json_t *supine_options_target_json(const supine_target *t) {
  static const char *const keys[] = {"volume_before_ml", "volume_after_ml"};
  const struct {
    const char *key;
    double value;
  } errors[] = {{"moved_error_mm", t->moved_error},
                {"expected_error_mm", t->error},
                {"another_day_error_mm", t->another_error}};
  json_t *target = json_pack("{s:s, s:[f, f, f], s:f}", "name", t->name, "move", t->move[0],
                             t->move[1], t->move[2], "mm", t->moved);
  for (size_t i = 0; i < sizeof errors / sizeof *errors; ++i) {
    (void)json_object_set_new(target, errors[i].key,
                              isnan(errors[i].value) ? json_null() : json_real(errors[i].value));
  }
  for (size_t i = 0; i < 2; ++i) {
    if (t->volume[0] != 0.0) {
      (void)json_object_set_new(target, keys[i],
                                isnan(t->volume[i]) ? json_null() : json_real(t->volume[i]));
    }
  }
  return target;
}

/* Return whether target b is to be told of before target a. */
static bool tell_before(const supine_target *b, const supine_target *a) {
  const bool known = a->moved_error > 0.0 && b->moved_error > 0.0;
  const bool farther = known ? b->moved * a->moved_error > a->moved * b->moved_error
                             : b->moved > a->moved; /* expected errors may be unknown */
  return a->anatomy != b->anatomy ? a->anatomy : farther;
}

size_t supine_options_targets_first(const supine_target *targets, size_t count) {
  size_t first = 0;
  for (size_t i = 1; i < count; ++i) {
    first = tell_before(&targets[i], &targets[first]) ? i : first;
  }
  return first;
}

size_t supine_options_targets_before(const supine_target *targets, size_t count, size_t which) {
  size_t before = 0;
  for (size_t i = 0; i < count; ++i) {
    before += tell_before(&targets[i], &targets[which]) ? 1 : 0;
  }
  return before;
}

void supine_options_targets_score(const supine_target *targets, size_t count, double *score) {
  for (size_t i = 0; i < count; ++i) {
    const supine_target *t = &targets[i];
    const double own = t->moved_error > 0.0 ? t->moved / t->moved_error : t->moved;
    score[i] = t->anatomy ? -1.0 : fmax(score[i], own);
  }
}

/* Return how many structures have a larger score than structure `part`. */
static size_t rank_of(const double *score, size_t count, size_t part) {
  size_t above = 0;
  for (size_t i = 0; i < count; ++i) {
    above += score[i] > score[part] || (i < part && score[i] == score[part]);
  }
  return above;
}

/* How a structure is shown. */
typedef struct appearance {
  size_t part; /* its index in the names */
  supine_mark_kind kind;
  size_t tint;
  bool named;
} appearance;

const char *supine_options_shown_name(const char *name, size_t letters,
                                      char shown[SUPINE_SHOWN_NAME_SIZE]) {
  char cut[SUPINE_SHOWN_NAME_SIZE - 8]; /* the rest holds the two marks of an isolated text */
  size_t size = 1;
  for (size_t i = 0; i < letters && name[size - 1] != '\0'; ++i) {
    size += supine_utf8_length(name + size - 1, strlen(name + size - 1));
  }
  (void)supine_text_shorten(name, size < sizeof cut ? size : sizeof cut, cut);
  (void)snprintf(shown, SUPINE_SHOWN_NAME_SIZE,
                 supine_render_shapes_text() ? "\342\201\250%s\342\201\251" : "%s", cut);
  return shown;
}

/* Make the label of a structure, at its middle. */
static void add_label(const appearance *look, const supine_target *t, supine_options_marks *marks) {
  supine_mark *middle = &marks->mark[marks->marks.count++];
  char label[SUPINE_SHOWN_NAME_SIZE];
  for (size_t k = 0; k < 3; ++k) {
    middle->xyz[k] = (float)t->at[k];
    middle->from[k] = (float)(t->at[k] - t->move[k]);
  }
  (void)supine_print_text(marks->label[look->part], sizeof marks->label[look->part], "%s",
                          supine_options_shown_name(t->name, 28, label));
  if (t->moved > t->moved_error && look->kind == SUPINE_MARK_TARGET) {
    supine_text_add(marks->label[look->part], sizeof marks->label[look->part], ": %.1f mm",
                    t->moved);
  }
  middle->label = marks->label[look->part];
  middle->kind = look->kind;
  middle->tint = look->tint;
  middle->moved =
      t->moved > t->moved_error || (look->kind == SUPINE_MARK_SELECTED && t->moved > 0.05);
  middle->expected = t->moved_error > 0.0 ? (float)t->moved_error : 0.0F;
}

/* Make the marks of a structure: of its vertices, and of its middle, which has the label. */
static void fill_marks(const supine_options_names *names, const appearance *look,
                       const supine_target *t, const float *after, const float *before,
                       supine_options_marks *marks) {
  static const float point_radius = 7.0F; /* radius of the ball of a single point, mm */
  static const float other_radius = 3.5F; /* of a point without a label beside it, mm */
  static const float cloud_radius = 1.5F; /* of each of several points of one name, mm */
  static const double least = 0.05;       /* smallest displacement that is shown, mm */
  const size_t begin = names->begin[look->part];
  const size_t count = names->begin[look->part + 1] - begin;
  const float single_radius = look->named ? point_radius : other_radius;
  double reach = count == 1 ? (double)single_radius : 0.0;
  for (size_t i = begin; i < begin + count; ++i) {
    const size_t vertex = names->order[i];
    supine_mark *mark = &marks->mark[vertex];
    memcpy(mark->xyz, after + 3 * vertex, sizeof mark->xyz);
    memcpy(mark->from, before + 3 * vertex, sizeof mark->from);
    const double off[3] = {(double)mark->xyz[0] - t->at[0], (double)mark->xyz[1] - t->at[1],
                           (double)mark->xyz[2] - t->at[2]};
    reach = fmax(reach, supine_length(off));
    mark->radius = count == 1 ? single_radius : cloud_radius;
    mark->kind = look->kind;
    mark->tint = look->tint;
    mark->moved = t->moved >= least;
  }
  if (count > 0 && look->named) {
    const bool shell = look->kind == SUPINE_MARK_ANATOMY; /* its name is written on it */
    marks->mark[marks->marks.count].reach = shell ? 0.0F : (float)reach;
    add_label(look, t, marks);
  }
}

/* Choose how each structure is shown, and make its marks. */
static void show_structures(const supine_options_names *names, const supine_target *targets,
                            const double *score, const float *after, const float *before,
                            supine_options_marks *marks) {
  size_t tint = 0;
  for (size_t part = 0; part < names->count; ++part) {
    const supine_target *t = &targets[part];
    const size_t rank = rank_of(score, names->count, part);
    appearance look = {.part = part, .kind = SUPINE_MARK_TARGET};
    if (t->anatomy) {
      look.kind = SUPINE_MARK_ANATOMY;
      look.tint = tint++;
    } else if (rank == 0) {
      look.kind = SUPINE_MARK_SELECTED;
    }
    look.named = t->anatomy ? look.tint < SUPINE_RENDER_TINTS : rank < SUPINE_LABELS_MAX;
    marks->unnamed += !t->anatomy && !look.named;
    fill_marks(names, &look, t, after, before, marks);
    if (rank == 0) {
      marks->selected = *t;
    }
  }
}

supine_status supine_options_marks_make(const supine_basis *inside,
                                        const supine_options_names *names,
                                        const supine_pose *const pose[2],
                                        const supine_errors *errors, const double *score,
                                        supine_options_marks *marks, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(inside);
  const size_t n = info->vertex_count;
  SUPINE_ARENA arena = {0};
  SUPINE_FREED_BY(supine_options_targets_free) supine_target *targets = NULL;
  float *xyz = supine_arena_take(&arena, 3 * n, sizeof *xyz);
  float *before = supine_arena_take(&arena, 3 * n, sizeof *before);
  supine_options_marks_free(marks);
  marks->mark = supine_arena_zeros(&marks->arena, n + names->count, sizeof *marks->mark);
  marks->label = supine_arena_zeros(&marks->arena, names->count, sizeof *marks->label);
  if (arena.failed || marks->arena.failed) {
    return supine_error_memory(error, "%zu points", n);
  }
  SUPINE_TRY(supine_options_targets_find(inside, names, pose, errors, false, &targets, error));
  (void)supine_deform(inside, pose[1], xyz);
  marks->marks = (supine_marks){n, marks->mark, info->triangle_count, info->triangles};
  (void)supine_deform(inside, pose[0], before);
  show_structures(names, targets, score, xyz, before, marks);
  for (size_t i = 0; i < 3 * info->triangle_count; ++i) {
    marks->mark[info->triangles[i]].radius = 0.0F; /* corners of meshes are not drawn as balls */
  }
  return SUPINE_OK;
}

void supine_options_marks_free(supine_options_marks *marks) {
  supine_arena_free(&marks->arena);
  *marks = (supine_options_marks){.mark = NULL};
}
