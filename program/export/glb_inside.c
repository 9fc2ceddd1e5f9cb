/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What is inside the lungs, in the same glTF file: a mesh of the same targets. Points become small
 * balls, which move with them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program/export/glb.h"

enum { BALL_VERTICES = 12, BALL_TRIANGLES = 20 };
static const double ball_radius = 4.0; /* mm: a nodule that is easy to see */

/* Beyond this many parts they share one material, and so lose their names. */
enum { PARTS_MAX = 256 };

/* An icosahedron: corners at (0, +-1, +-phi) and so on, outwards. */
static void ball(double corner[BALL_VERTICES][3], uint32_t triangle[BALL_TRIANGLES][3]) {
  static const uint32_t faces[BALL_TRIANGLES][3] = {
      {0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
      {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
      {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  const double phi = 0.5 * (1.0 + sqrt(5.0));
  const double length = sqrt(1.0 + phi * phi);
  const double a = 1.0 / length;
  const double b = phi / length;
  const double corners[BALL_VERTICES][3] = {{-a, b, 0}, {a, b, 0}, {-a, -b, 0}, {a, -b, 0},
                                            {0, -a, b}, {0, a, b}, {0, -a, -b}, {0, a, -b},
                                            {b, 0, -a}, {b, 0, a}, {-b, 0, -a}, {-b, 0, a}};
  memcpy(corner, corners, sizeof corners);
  memcpy(triangle, faces, sizeof faces);
}

/* Vertices that no triangle has are points. */
static size_t mark_points(const export_source *content, unsigned char *point) {
  const size_t n = content->info->vertex_count;
  size_t count = 0;
  memset(point, 1, n);
  for (size_t i = 0; i < 3 * content->info->triangle_count; ++i) {
    point[content->triangles[i]] = 0;
  }
  for (size_t i = 0; i < n; ++i) {
    count += point[i];
  }
  return count;
}

/* The content's vertices, and a ball's in place of each point; `from` is whose motion each has. */
static void place_vertices(glb_inside *inside, const export_source *content,
                           const unsigned char *point, double corner[BALL_VERTICES][3],
                           uint32_t *first) {
  const size_t row = 3 * content->info->mode_count;
  size_t at = 0;
  for (size_t i = 0; i < content->info->vertex_count; ++i) {
    first[i] = (uint32_t)at;
    for (size_t c = 0; c < (point[i] ? BALL_VERTICES : 1); ++c, ++at) {
      for (size_t k = 0; k < 3; ++k) {
        const double out = point[i] ? corner[c][k] : 0.0;
        inside->vertices[3 * at + k] =
            (float)((double)content->vertices[3 * i + k] + ball_radius * out);
        inside->normals[3 * at + k] = (float)out;
      }
      memcpy(inside->coefficients + at * row, content->coefficients + i * row, row * sizeof(float));
    }
  }
}

/* Rigid parts keep their size: all their vertices have the mean motion. Morph targets, which add
 * up, cannot turn them. */
static void hold_rigid(glb_inside *inside, const export_source *content, const uint32_t *first) {
  const size_t row = 3 * content->info->mode_count;
  const supine_tensor *rigid = supine_basis_tensor(content->basis, "rigid");
  for (size_t r = 0; rigid != NULL && r < rigid->shape[0]; ++r) {
    const uint32_t *range = (const uint32_t *)rigid->data + 2 * r;
    const size_t end =
        range[1] < content->info->vertex_count ? first[range[1]] : inside->info.vertex_count;
    for (size_t k = 0; k < row; ++k) {
      double sum = 0.0;
      for (size_t i = range[0]; i < range[1]; ++i) {
        sum += (double)content->coefficients[i * row + k];
      }
      for (size_t i = first[range[0]]; i < end; ++i) {
        inside->coefficients[i * row + k] = (float)(sum / (double)(range[1] - range[0]));
      }
    }
  }
}

/* Triangles part by part. */
static void group_parts(glb_inside *inside, const export_source *content, const export_parts *parts,
                        const unsigned char *point, const uint32_t *first,
                        uint32_t triangle[BALL_TRIANGLES][3]) {
  size_t at = 0;
  for (size_t p = 0; p < inside->part_count; ++p) {
    inside->part_begin[p] = at;
    for (size_t t = 0; t < content->info->triangle_count; ++t) {
      const uint32_t *corner = content->triangles + 3 * t;
      for (size_t k = 0; k < 3 && (inside->part_count == 1 || parts->of[corner[0]] == p); ++k) {
        inside->corners[at++] = first[corner[k]];
      }
    }
    for (size_t i = 0; i < content->info->vertex_count; ++i) {
      if (point[i] && (inside->part_count == 1 || parts->of[i] == p)) {
        for (size_t t = 0; t < BALL_TRIANGLES; ++t) {
          for (size_t k = 0; k < 3; ++k) {
            inside->corners[at++] = first[i] + triangle[t][k];
          }
        }
      }
    }
  }
  inside->part_begin[inside->part_count] = at;
}

/* Normals of meshes; balls have theirs. false: no memory. */
static bool find_normals(glb_inside *inside, const export_source *content,
                         const unsigned char *point, const uint32_t *first) {
  const size_t n = content->info->vertex_count;
  float *normals = malloc(3 * n * sizeof *normals);
  if (normals == NULL) {
    return false;
  }
  supine_normals(content->basis, content->vertices, normals);
  for (size_t i = 0; i < n; ++i) {
    float *to = inside->normals + 3 * (size_t)first[i];
    const float *from = normals + 3 * i;
    if (!point[i]) {
      memcpy(to, from, 3 * sizeof *to);
      if (from[0] == 0.0F && from[1] == 0.0F && from[2] == 0.0F) {
        to[2] = 1.0F; /* unit, as glTF wants */
      }
    }
  }
  free(normals);
  return true;
}

supine_status supine_export_glb_inside_make(const export_source *content, const export_parts *parts,
                                            glb_inside *inside, supine_error *error) {
  const size_t n = content->info->vertex_count;
  double corner[BALL_VERTICES][3];
  uint32_t triangle[BALL_TRIANGLES][3];
  unsigned char *point = malloc(n);
  uint32_t *first = malloc(n * sizeof *first);
  supine_status status = SUPINE_ERROR_MEMORY;
  if (point == NULL || first == NULL) {
    goto cleanup;
  }
  const size_t points = mark_points(content, point);
  const size_t triangles = content->info->triangle_count + BALL_TRIANGLES * points;
  inside->info = *content->info;
  inside->info.vertex_count = n + (BALL_VERTICES - 1) * points;
  inside->info.triangle_count = triangles;
  inside->part_count = parts->count <= PARTS_MAX ? parts->count : 1;
  inside->parts = parts;
  const size_t m = inside->info.vertex_count;
  inside->vertices = malloc(3 * m * sizeof *inside->vertices);
  inside->normals = malloc(3 * m * sizeof *inside->normals);
  inside->coefficients = malloc(3 * m * inside->info.mode_count * sizeof *inside->coefficients);
  inside->corners = malloc(3 * triangles * sizeof *inside->corners);
  inside->part_begin = malloc((inside->part_count + 1) * sizeof *inside->part_begin);
  inside->xyz = malloc(3 * m * sizeof *inside->xyz);
  if (m < UINT32_MAX && inside->vertices != NULL && inside->normals != NULL &&
      inside->coefficients != NULL && inside->corners != NULL && inside->part_begin != NULL &&
      inside->xyz != NULL) {
    ball(corner, triangle);
    place_vertices(inside, content, point, corner, first);
    hold_rigid(inside, content, first);
    group_parts(inside, content, parts, point, first, triangle);
    inside->source = *content;
    inside->source.info = &inside->info;
    inside->source.vertices = inside->vertices;
    inside->source.coefficients = inside->coefficients;
    status = find_normals(inside, content, point, first) ? SUPINE_OK : SUPINE_ERROR_MEMORY;
  }
cleanup:
  free(point);
  free(first);
  return status == SUPINE_OK
             ? status
             : supine_error_set(error, status, "no memory for what is inside (%zu vertices)", n);
}

void supine_export_glb_inside_free(glb_inside *inside) {
  free(inside->vertices);
  free(inside->normals);
  free(inside->coefficients);
  free(inside->corners);
  free(inside->part_begin);
  free(inside->xyz);
}

json_t *supine_export_glb_inside_plan(glb_inside *inside, const export_targets *targets,
                                      json_int_t material, glb_plan *plan) {
  const size_t n = inside->info.vertex_count;
  double low[3];
  double high[3];
  const json_int_t indices = (json_int_t)json_array_size(plan->accessors);
  for (size_t p = 0; p < inside->part_count; ++p) {
    (void)supine_export_glb_plan_add(plan, GLTF_UINT, "SCALAR",
                                     inside->part_begin[p + 1] - inside->part_begin[p],
                                     GLTF_INDICES, 1, NULL, NULL);
  }
  supine_export_targets_base(&inside->source, targets, inside->xyz);
  supine_export_glb_bounds(inside->xyz, n, false, low, high);
  const json_int_t base = (json_int_t)supine_export_glb_plan_add(plan, GLTF_FLOAT, "VEC3", n,
                                                                 GLTF_VERTICES, 3, low, high);
  (void)supine_export_glb_plan_add(plan, GLTF_FLOAT, "VEC3", n, GLTF_VERTICES, 3, NULL, NULL);
  json_t *list = json_array();
  for (size_t j = 0; j < targets->count; ++j) {
    supine_export_targets_fill(&inside->source, targets, j, inside->xyz);
    supine_export_glb_bounds(inside->xyz, n, false, low, high);
    (void)json_array_append_new(
        list, json_pack("{s:I}", "POSITION",
                        (json_int_t)supine_export_glb_plan_add(plan, GLTF_FLOAT, "VEC3", n,
                                                               GLTF_VERTICES, 3, low, high)));
  }
  json_t *primitives = json_array();
  json_t *names = json_array();
  for (size_t p = 0; p < inside->part_count; ++p) {
    (void)json_array_append_new(
        primitives, json_pack("{s:{s:I, s:I}, s:I, s:I, s:O}", "attributes", "POSITION", base,
                              "NORMAL", base + 1, "indices", indices + (json_int_t)p, "material",
                              material + (json_int_t)p, "targets", list));
    (void)json_array_append_new(names, json_string(inside->part_count == inside->parts->count
                                                       ? inside->parts->name[p]
                                                       : "inside"));
  }
  json_decref(list);
  return json_pack("{s:s, s:o, s:{s:o}}", "name", "inside", "primitives", primitives, "extras",
                   "parts", names);
}

json_t *supine_export_glb_inside_materials(const glb_inside *inside) {
  static const double colours[][3] = {{0.95, 0.60, 0.10}, {0.10, 0.50, 0.80}, {0.05, 0.60, 0.35},
                                      {0.55, 0.25, 0.70}, {0.90, 0.80, 0.15}, {0.20, 0.70, 0.75}};
  json_t *list = json_array();
  for (size_t p = 0; p < inside->part_count; ++p) {
    const double *c = colours[p % (sizeof colours / sizeof *colours)];
    const bool named = inside->part_count == inside->parts->count;
    (void)json_array_append_new(list, json_pack("{s:s, s:{s:[f,f,f,f], s:f, s:f}, s:b}", "name",
                                                named ? inside->parts->name[p] : "inside",
                                                "pbrMetallicRoughness", "baseColorFactor", c[0],
                                                c[1], c[2], 1.0, "metallicFactor", 0.0,
                                                "roughnessFactor", 0.5, "doubleSided", 1));
  }
  return list;
}

void supine_export_glb_inside_write(glb_inside *inside, const export_targets *targets, FILE *file) {
  const size_t n = inside->info.vertex_count;
  (void)fwrite(inside->corners, sizeof *inside->corners, inside->part_begin[inside->part_count],
               file);
  supine_export_targets_base(&inside->source, targets, inside->xyz);
  (void)fwrite(inside->xyz, 3 * sizeof *inside->xyz, n, file);
  (void)fwrite(inside->normals, 3 * sizeof *inside->normals, n, file);
  for (size_t j = 0; j < targets->count; ++j) {
    supine_export_targets_fill(&inside->source, targets, j, inside->xyz);
    (void)fwrite(inside->xyz, 3 * sizeof *inside->xyz, n, file);
  }
}
