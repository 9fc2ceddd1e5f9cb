/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Extract the surface of each lung from a basis, and find the lung that contains a point. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/quantity.h"
#include "base/vec3.h"

#include "precompute/inside/shells.h"
#include "precompute/lungs/disease.h"

static double mean_edge(const supine_inside_shell *shell) {
  double sum = 0.0;
  for (size_t i = 0; i < 3 * shell->triangle_count; ++i) {
    const size_t next = i % 3 == 2 ? i - 2 : i + 1;
    const double *a = shell->vertices + 3 * (size_t)shell->triangles[i];
    const double *b = shell->vertices + 3 * (size_t)shell->triangles[next];
    sum += supine_distance(b, a);
  }
  return sum / (double)(3 * shell->triangle_count);
}

/* Extract one lung's surface.
 * @param scanned  [vertices, 3] positions of the basis's vertices in the scan, mm */
static supine_status create_shell(const supine_basis_info *info, const float *scanned, size_t lung,
                                  supine_inside_shell *shell, supine_error *error) {
  const size_t begin = info->lung_begin[lung];
  const size_t end = info->lung_begin[lung + 1];
  shell->begin = begin;
  shell->vertex_count = end - begin;
  shell->vertices = malloc(3 * shell->vertex_count * sizeof *shell->vertices);
  shell->triangles = malloc(3 * (info->triangle_count + 1) * sizeof *shell->triangles);
  if (shell->vertices == NULL || shell->triangles == NULL) {
    return supine_error_memory(error, "the surface of %zu vertices", shell->vertex_count);
  }
  for (size_t i = 0; i < 3 * shell->vertex_count; ++i) {
    shell->vertices[i] = (double)scanned[3 * begin + i];
  }
  for (size_t t = 0; t < info->triangle_count; ++t) {
    const uint32_t *corner = info->triangles + 3 * t;
    size_t here = 0;
    for (size_t k = 0; k < 3; ++k) {
      here += corner[k] >= begin && corner[k] < end;
      shell->triangles[3 * shell->triangle_count + k] = corner[k] - (uint32_t)begin;
    }
    SUPINE_REFUSE_IF(
        here != 0 && here != 3, error, SUPINE_ERROR_MESH,
        "a triangle of the basis joins two lungs: make a new basis from separate lungs");
    shell->triangle_count += here == 3;
  }
  SUPINE_REFUSE_IF(shell->triangle_count == 0, error, SUPINE_ERROR_MESH,
                   "lung %s has no triangles: give a basis of a surface", info->lung_names[lung]);
  shell->edge = mean_edge(shell);
  return supine_lungs_surface_create(shell->vertices, shell->triangle_count, shell->triangles, true,
                                     &shell->surface, error);
}

supine_status supine_inside_shells_create(const supine_basis *basis, supine_inside_shells *shells,
                                          supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  *shells = (supine_inside_shells){.basis = basis, .count = info->lung_count};
  SUPINE_REFUSE_IF(supine_basis_metadata(basis, "content") != NULL, error, SUPINE_ERROR_FORMAT,
                   "the basis already holds %s inside lungs: give the basis of the lungs' surface",
                   supine_basis_metadata(basis, "content"));
  SUPINE_ARENA arena = {0};
  float *scanned = supine_arena_take(&arena, 3 * info->vertex_count, sizeof *scanned);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", info->vertex_count));
  const supine_status posed = supine_basis_scan_pose(basis, &shells->scan, error);
  SUPINE_REFUSE_IF(
      posed == SUPINE_ERROR_NUMERICAL, error, posed,
      "the basis cannot reach the scan's volume: make it again, and state how full the "
      "lungs were in the scan");
  SUPINE_TRY(posed);
  (void)supine_deform(basis, &shells->scan, scanned);
  for (size_t lung = 0; lung < shells->count; ++lung) {
    SUPINE_TRY(create_shell(info, scanned, lung, &shells->shell[lung], error));
  }
  return SUPINE_OK;
}

void supine_inside_shells_free(supine_inside_shells *shells) {
  for (size_t lung = 0; lung < shells->count; ++lung) {
    supine_inside_shell *shell = &shells->shell[lung];
    free(shell->vertices);
    free(shell->triangles);
    supine_lungs_surface_destroy(shell->surface);
  }
  *shells = (supine_inside_shells){0};
}

/* Return the largest distance of the positions `xyz` from those in the scan. */
static double farthest(const supine_inside_shells *shells, const float *xyz) {
  double square = 0.0;
  for (size_t lung = 0; lung < shells->count; ++lung) {
    const supine_inside_shell *shell = &shells->shell[lung];
    const float *moved = xyz + 3 * shell->begin;
    for (size_t i = 0; i < shell->vertex_count; ++i) {
      const double now[3] = {(double)moved[3 * i], (double)moved[3 * i + 1],
                             (double)moved[3 * i + 2]};
      double by[3];
      supine_subtract(now, shell->vertices + 3 * i, by);
      square = fmax(square, supine_dot(by, by));
    }
  }
  return sqrt(square);
}

supine_status supine_inside_shells_reach(const supine_inside_shells *shells, double *largest,
                                         supine_error *error) {
  enum { POSTURES = 24 };
  static const supine_volume_kind volumes[] = {SUPINE_VOLUME_REST, SUPINE_VOLUME_FULL,
                                               SUPINE_VOLUME_DEFAULT};
  const supine_basis_info *info = supine_basis_get_info(shells->basis);
  SUPINE_ARENA arena = {0};
  float *xyz = supine_arena_take(&arena, 3 * info->vertex_count, sizeof *xyz);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", info->vertex_count));
  *largest = 0.0;
  for (int posture = 0; posture < POSTURES; ++posture) {
    for (size_t v = 0; v < sizeof volumes / sizeof *volumes; ++v) {
      supine_state state = {.volume = {.kind = volumes[v]}};
      supine_pose pose;
      supine_spiral(posture, POSTURES, 0.0, state.gravity);
      /* a basis may lack a volume, or not reach it in a posture */
      if (supine_basis_pose(shells->basis, &state, &pose, NULL) == SUPINE_OK) {
        (void)supine_deform(shells->basis, &pose, xyz);
        *largest = fmax(*largest, farthest(shells, xyz));
      }
    }
  }
  return SUPINE_OK;
}

/* Find the displacement of a vertex by each mode at weight and gain 1: row [3, modes], mm. */
static void move_vertex(const supine_basis *basis, size_t vertex, double *row) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t modes = info->mode_count;
  if (info->vector) {
    float vectors[3 * SUPINE_MODES_MAX];
    (void)supine_basis_coefficients(basis, vertex, vertex + 1, vectors);
    for (size_t i = 0; i < 3 * modes; ++i) {
      row[i] = (double)vectors[i];
    }
    return;
  }
  for (size_t i = 0; i < 3 * modes; ++i) {
    row[i] = (double)info->direction[3 * vertex + i / modes] *
             (double)info->coefficients[vertex * modes + i % modes];
  }
}

void supine_inside_shell_displacement(const supine_inside_shells *shells, size_t lung,
                                      double *displacement) {
  const supine_basis_info *info = supine_basis_get_info(shells->basis);
  const supine_inside_shell *shell = &shells->shell[lung];
  for (size_t i = 0; i < shell->vertex_count; ++i) {
    move_vertex(shells->basis, shell->begin + i, displacement + 3 * i * info->mode_count);
  }
}

/* Replace walk->place[lung], an old point's position relative to the surface, by that of a new
 * point. Subtract the distance between the two points from the old point's distance to the surface:
 * this is a lower bound of the new distance. If the bound exceeds `far`, keep the position of the
 * old point, because both points are then on the same side of the surface. */
static void step_to(const supine_inside_shells *shells, const double point[3], size_t lung,
                    double far, supine_inside_walk *walk) {
  supine_inside_place *place = &walk->place[lung];
  if (walk->known[lung]) {
    const double *from = place->point;
    const double moved = supine_distance(point, from);
    if (fabs(place->depth) - moved > far) {
      return;
    }
  }
  *place = supine_lungs_surface_find(shells->shell[lung].surface, point,
                                     walk->known[lung] ? place : NULL);
  walk->known[lung] = true;
}

size_t supine_inside_shells_find(const supine_inside_shells *shells, const double point[3],
                                 double far, supine_inside_walk *walk) {
  step_to(shells, point, walk->lung, far, walk); /* try the lung of the last point first */
  size_t best = walk->lung;
  for (size_t lung = 0; lung < shells->count && walk->place[best].depth <= 0.0; ++lung) {
    if (lung != walk->lung) {
      step_to(shells, point, lung, far, walk);
      best = walk->place[lung].depth > walk->place[best].depth ? lung : best;
    }
  }
  walk->lung = best;
  return best;
}

/* Count the points inside the lungs, every `step` of them, once converted. */
static size_t count_inside(const supine_inside_shells *shells, const double *points, size_t count,
                           size_t step, supine_axes axes, double scale) {
  size_t inside = 0;
  for (size_t i = 0; i < count; i += step) {
    supine_inside_walk walk = {0};
    double point[3];
    memcpy(point, points + 3 * i, sizeof point);
    supine_mesh_axes_apply(axes, scale, point);
    const size_t lung = supine_inside_shells_find(shells, point, INFINITY, &walk);
    inside += walk.place[lung].depth >= 0.0 ? 1 : 0;
  }
  return inside;
}

void supine_inside_shells_reading(const supine_inside_shells *shells,
                                  const supine_mesh_load_options *load, const double *points,
                                  size_t count, supine_inside_reading *reading) {
  enum { MOST = 999 };
  static const char *const units[] = {"mm", "cm", "m"};
  static const char *const frames[] = {"LPS", "RAS", "RPS", "LAS", "LPI"};
  const double unit = load->millimetres_per_unit > 0.0 ? load->millimetres_per_unit : 1.0;
  const size_t step = (count + MOST - 1) / MOST;
  *reading = (supine_inside_reading){.tested = (count + step - 1) / step};
  reading->as_read = count_inside(shells, points, count, step, SUPINE_AXES_LPS, 1.0);
  reading->inside = reading->as_read;
  for (size_t i = 0; i < 15 && 10 * reading->as_read < 9 * reading->tested; ++i) {
    double millimetres = 1.0;
    supine_axes axes;
    char letters[4];
    (void)supine_quantity_find_unit(SUPINE_QUANTITY_LENGTH, units[i / 5], &millimetres);
    (void)supine_mesh_axes_parse(frames[i % 5], &axes);
    const size_t inside = count_inside(shells, points, count, step, axes, millimetres / unit);
    if (inside > reading->inside &&
        3 * (reading->tested - inside) < reading->tested - reading->as_read) {
      reading->inside = inside;
      supine_mesh_axes_letters(supine_mesh_axes_after(load->axes, axes), letters);
      (void)strcpy(reading->unit, millimetres != unit ? units[i / 5] : "");
      (void)strcpy(reading->axes, i % 5 > 0 ? letters : "");
    }
  }
}

/* Mark the vertices of a surface that belong to the hilum of their lung in the scan.
 * @param x       [N, 3] positions in the scan, mm
 * @param marked  [N] written */
static void mark_hila(const supine_basis_info *info, const float *x, bool *marked) {
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    double low[3] = {INFINITY, INFINITY, INFINITY};
    double high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 3 * info->lung_begin[lung]; i < 3 * info->lung_begin[lung + 1]; ++i) {
      low[i % 3] = fmin(low[i % 3], (double)x[i]);
      high[i % 3] = fmax(high[i % 3], (double)x[i]);
    }
    for (size_t i = info->lung_begin[lung]; i < info->lung_begin[lung + 1]; ++i) {
      const double p[3] = {(double)x[3 * i], (double)x[3 * i + 1], (double)x[3 * i + 2]};
      marked[i] = supine_lungs_is_hilar(p, low, high, info->lung_names[lung][0] == 'l');
    }
  }
}

/* Compute the mean displacement of the marked vertices of each lung by each mode. Return whether
 * each lung has such vertices. */
static bool average_marked(const supine_basis *basis, const bool *marked, double *mean) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t columns = 3 * info->mode_count;
  double row[3 * SUPINE_MODES_MAX];
  bool found = true;
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    double count = 0.0;
    for (size_t i = info->lung_begin[lung]; i < info->lung_begin[lung + 1]; ++i) {
      if (marked[i]) {
        count += 1.0;
        move_vertex(basis, i, row);
        for (size_t k = 0; k < columns; ++k) {
          mean[lung * columns + k] += row[k];
        }
      }
    }
    for (size_t k = 0; k < columns; ++k) {
      mean[lung * columns + k] /= fmax(1.0, count);
    }
    found = found && count > 0.0;
  }
  return found;
}

supine_status supine_inside_hilum(const supine_basis *basis, double *mean, bool *known,
                                  supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const supine_tensor *stored = supine_basis_tensor(basis, "lungs_hilum");
  const size_t columns = 3 * info->mode_count;
  memset(mean, 0, info->lung_count * columns * sizeof *mean);
  if (stored != NULL && stored->dtype == SUPINE_F64 && stored->rank == 3 &&
      stored->shape[0] == info->lung_count && stored->shape[1] * stored->shape[2] == columns) {
    memcpy(mean, stored->data, info->lung_count * columns * sizeof *mean);
    *known = true;
    return SUPINE_OK;
  }
  *known = false;
  SUPINE_ARENA arena = {0};
  supine_pose scan;
  float *x = supine_arena_take(&arena, 3 * info->vertex_count, sizeof *x);
  bool *marked = supine_arena_take(&arena, info->vertex_count, sizeof *marked);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", info->vertex_count));
  if (supine_basis_metadata(basis, "content") == NULL &&
      supine_basis_scan_pose(basis, &scan, NULL) == SUPINE_OK &&
      supine_deform(basis, &scan, x) == SUPINE_OK) {
    mark_hila(info, x, marked);
    *known = average_marked(basis, marked, mean);
  }
  return SUPINE_OK;
}
