/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Append the content of the lungs to a glTF file, with morph targets that have the lungs' weights.
 * Points become small balls. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program/export/glb.h"

enum { BALL_VERTICES = 12, BALL_TRIANGLES = 20 };
static const double ball_radius = 4.0; /* mm: a nodule that is easy to see */

/* With more parts than this, all share one material and their names are lost. */
enum { PARTS_MAX = 256 };

/* The content, with balls in place of points. */
typedef struct inside {
  export_source source; /* the content with the vertices and coefficients below */
  supine_basis_info info;
  size_t lung_begin[SUPINE_LUNGS_MAX + 1];
  float *vertices, *normals; /* [N, 3] */
  float *coefficients;       /* [N, 3, K] */
  uint32_t *corners;         /* [M, 3], lung by lung, then part by part */
  unsigned char *point;      /* [content's N] 1 for a vertex that is in no triangle, else 0 */
  uint32_t *first;           /* [content's N] index in `vertices` of each vertex, or of its ball */
  uint32_t *order;           /* [N] 0, 1, 2 ... */
  size_t parts;
  size_t begin[SUPINE_LUNGS_MAX * PARTS_MAX + 1]; /* first corner of each lung and part */
} inside;

static const uint32_t faces[BALL_TRIANGLES][3] = {
    {0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
    {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
    {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};

/* Compute the corners of a regular icosahedron of radius 1. */
static void place_ball(double corner[BALL_VERTICES][3]) {
  const double phi = 0.5 * (1.0 + sqrt(5.0));
  const double a = 1.0 / sqrt(1.0 + phi * phi);
  const double b = phi * a;
  const double corners[BALL_VERTICES][3] = {{-a, b, 0}, {a, b, 0}, {-a, -b, 0}, {a, -b, 0},
                                            {0, -a, b}, {0, a, b}, {0, -a, -b}, {0, a, -b},
                                            {b, 0, -a}, {b, 0, a}, {-b, 0, -a}, {-b, 0, a}};
  memcpy(corner, corners, sizeof corners);
}

/* Copy the content's vertices, normals and coefficients; replace each point by a ball. */
static void place_vertices(inside *in, const export_source *content, const float *normals) {
  const size_t row = 3 * content->info->mode_count;
  double corner[BALL_VERTICES][3];
  size_t at = 0;
  place_ball(corner);
  for (size_t i = 0; i < content->info->vertex_count; ++i) {
    const float *own = normals + 3 * i;
    const bool flat = own[0] == 0.0F && own[1] == 0.0F && own[2] == 0.0F;
    for (size_t c = 0; c < (in->point[i] ? BALL_VERTICES : 1); ++c, ++at) {
      for (size_t k = 0; k < 3; ++k) {
        const double out = in->point[i] ? corner[c][k] : flat ? k == 2 : (double)own[k];
        const double away = in->point[i] ? ball_radius * out : 0;
        in->vertices[3 * at + k] = (float)((double)content->vertices[3 * i + k] + away);
        in->normals[3 * at + k] = (float)out;
      }
      memcpy(in->coefficients + at * row, content->coefficients + i * row, row * sizeof(float));
    }
  }
}

/* Give all vertices of a rigid part their mean displacement, so that the part keeps its shape.
 * Morph targets are linear and cannot rotate it. */
static void hold_rigid(inside *in, const export_source *content) {
  const size_t row = 3 * content->info->mode_count;
  const supine_tensor *rigid = supine_basis_tensor(content->basis, "rigid");
  for (size_t r = 0; rigid != NULL && r < rigid->shape[0]; ++r) {
    const uint32_t *range = (const uint32_t *)rigid->data + 2 * r;
    const size_t end =
        range[1] < content->info->vertex_count ? in->first[range[1]] : in->info.vertex_count;
    for (size_t k = 0; k < row; ++k) {
      double sum = 0.0;
      for (size_t i = range[0]; i < range[1]; ++i) {
        sum += (double)content->coefficients[i * row + k];
      }
      for (size_t i = in->first[range[0]]; i < end; ++i) {
        in->coefficients[i * row + k] = (float)(sum / (double)(range[1] - range[0]));
      }
    }
  }
}

/* Append a triangle's corners at the end, `next`, of those of its lung and part, and advance that.
 * If `corners` is NULL, only advance it, to count. */
static void add_triangle(const inside *in, const export_parts *parts, size_t vertex,
                         const uint32_t *corner, uint32_t *corners, size_t *next) {
  size_t lung = 0;
  while (in->first[vertex] >= in->lung_begin[lung + 1]) {
    ++lung;
  }
  size_t *at = &next[lung * in->parts + (in->parts == 1 ? 0 : parts->of[vertex])];
  for (size_t k = 0; k < 3; ++k, ++*at) {
    if (corners != NULL) {
      corners[*at] = corner[k];
    }
  }
}

/* Add every triangle of the meshes and the balls. */
static void visit(const inside *in, const export_source *content, const export_parts *parts,
                  uint32_t *corners, size_t *next) {
  for (size_t t = 0; t < content->info->triangle_count; ++t) {
    const uint32_t *c = content->triangles + 3 * t;
    const uint32_t corner[3] = {in->first[c[0]], in->first[c[1]], in->first[c[2]]};
    add_triangle(in, parts, c[0], corner, corners, next);
  }
  for (size_t i = 0; i < content->info->vertex_count; ++i) {
    for (size_t t = 0; in->point[i] && t < BALL_TRIANGLES; ++t) {
      const uint32_t f = in->first[i];
      const uint32_t corner[3] = {f + faces[t][0], f + faces[t][1], f + faces[t][2]};
      add_triangle(in, parts, i, corner, corners, next);
    }
  }
}

/* Sort triangles by lung and part. */
static void sort_triangles(inside *in, const export_source *content, const export_parts *parts) {
  const size_t keys = in->info.lung_count * in->parts;
  size_t next[SUPINE_LUNGS_MAX * PARTS_MAX + 1] = {0};
  visit(in, content, parts, NULL, next);
  for (size_t key = 0; key < keys; ++key) {
    in->begin[key + 1] = in->begin[key] + next[key];
    next[key] = in->begin[key];
  }
  visit(in, content, parts, in->corners, next);
}

static bool make(const export_source *content, const export_parts *parts, inside *in) {
  const size_t n = content->info->vertex_count;
  size_t points = n;
  in->point = malloc(n);
  in->first = malloc(n * sizeof *in->first);
  if (in->point == NULL || in->first == NULL) {
    return false;
  }
  memset(in->point, 1, n);
  for (size_t i = 0; i < 3 * content->info->triangle_count; ++i) {
    points -= in->point[content->triangles[i]];
    in->point[content->triangles[i]] = 0;
  }
  const size_t m = n + (BALL_VERTICES - 1) * points;
  const size_t triangles = content->info->triangle_count + BALL_TRIANGLES * points;
  in->vertices = malloc(3 * m * sizeof *in->vertices);
  in->normals = malloc(3 * m * sizeof *in->normals);
  in->coefficients = malloc(3 * m * content->info->mode_count * sizeof *in->coefficients);
  in->corners = malloc(3 * triangles * sizeof *in->corners);
  in->order = malloc(m * sizeof *in->order);
  if (m > UINT32_MAX || in->vertices == NULL || in->normals == NULL || in->coefficients == NULL ||
      in->corners == NULL || in->order == NULL) {
    return false;
  }
  for (size_t i = 0, at = 0, lung = 0; i <= n; ++i) {
    while (lung <= content->info->lung_count && content->info->lung_begin[lung] == i) {
      in->lung_begin[lung++] = at;
    }
    if (i < n) {
      in->first[i] = (uint32_t)at;
      at += in->point[i] ? BALL_VERTICES : 1;
    }
  }
  for (size_t i = 0; i < m; ++i) {
    in->order[i] = (uint32_t)i;
  }
  in->info = *content->info;
  in->info.vertex_count = m;
  in->info.lung_begin = in->lung_begin;
  in->source = *content;
  in->source.info = &in->info;
  in->source.vertices = in->vertices;
  in->source.coefficients = in->coefficients;
  in->parts = parts->count <= PARTS_MAX ? parts->count : 1;
  float *normals = malloc(3 * n * sizeof *normals);
  if (normals == NULL) {
    return false;
  }
  supine_normals(content->basis, content->vertices, normals);
  place_vertices(in, content, normals);
  free(normals);
  hold_rigid(in, content);
  sort_triangles(in, content, parts);
  return true;
}

static void add_shapes(glb *g, const inside *in, size_t *count, json_int_t *nodes, size_t *lungs) {
  static const double colours[][3] = {{0.95, 0.60, 0.10}, {0.10, 0.50, 0.80}, {0.05, 0.60, 0.35},
                                      {0.55, 0.25, 0.70}, {0.90, 0.80, 0.15}, {0.20, 0.70, 0.75}};
  json_int_t material[PARTS_MAX];
  for (size_t p = 0; p < in->parts; ++p) {
    const bool named = in->parts == g->options->parts->count;
    material[p] = supine_export_glb_material(g, named ? g->options->parts->name[p] : "inside",
                                             colours[p % (sizeof colours / sizeof *colours)], 1);
  }
  for (size_t lung = 0; lung < in->info.lung_count; ++lung) {
    const uint32_t *corners[PARTS_MAX];
    size_t corner_count[PARTS_MAX];
    for (size_t p = 0; p < in->parts; ++p) {
      const size_t *begin = in->begin + lung * in->parts + p;
      corners[p] = in->corners + begin[0];
      corner_count[p] = begin[1] - begin[0];
    }
    char name[80];
    (void)snprintf(name, sizeof name, "inside %s lung", g->source->info->lung_names[lung]);
    const glb_shape shape = {name, &in->source, lung,    in->order,    in->normals, NULL,
                             NULL, in->parts,   corners, corner_count, material};
    if (in->lung_begin[lung] < in->lung_begin[lung + 1] && g->status == SUPINE_OK) {
      lungs[*count] = lung;
      nodes[(*count)++] = supine_export_glb_add(g, &shape);
    }
  }
}

void supine_export_glb_inside(glb *g, size_t *count, json_int_t *nodes, size_t *lungs) {
  inside *in = calloc(1, sizeof *in);
  if (in != NULL && make(g->options->inside, g->options->parts, in)) {
    add_shapes(g, in, count, nodes, lungs);
  } else {
    g->status = SUPINE_ERROR_MEMORY;
  }
  if (in != NULL) {
    free(in->vertices);
    free(in->normals);
    free(in->coefficients);
    free(in->corners);
    free(in->point);
    free(in->first);
    free(in->order);
  }
  free(in);
}
