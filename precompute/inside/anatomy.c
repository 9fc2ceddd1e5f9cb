/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Decide which embedded parts are anatomy, and which are targets. */
#include <math.h>

#include "base/arena.h"
#include "base/vec3.h"

#include "precompute/inside/anatomy.h"

/* Share of a lung above which a part is anatomy. A ball of 70 mm, where tumours are of the largest
 * class (T4 in TNM, 8th edition), has 0.04 to 0.12 of lungs of 1.5 to 4.2 L. The spheres as long as
 * the ten lobes of two people (COVID-19 CT) have 0.65 to 3, and airways and vessels are longer. */
static const double least_share = 0.2;

/* The extent of a part, and integrals over its triangles. */
typedef struct part_shape {
  double low[3], high[3]; /* corners of its box, mm */
  double normal[3];       /* sum of the triangles' normals; 0 if the surface is closed */
  double area;            /* sum of the lengths of the normals */
  double volume;          /* six times the enclosed volume, mm^3 */
} part_shape;

static void add_triangle(const supine_inside_content *content, const uint32_t *corner,
                         part_shape *part) {
  const double *at = content->points + 3 * (size_t)corner[0];
  double normal[3];
  supine_normal(at, content->points + 3 * (size_t)corner[1],
                content->points + 3 * (size_t)corner[2], normal);
  for (size_t k = 0; k < 3; ++k) {
    part->normal[k] += normal[k];
  }
  part->area += supine_length(normal);
  part->volume += supine_dot(at, normal);
}

/* Return whether a part is anatomy, beside lungs of a mean volume, mm^3. */
static bool is_anatomy(const part_shape *part, double lung) {
  /* Normals of a closed surface sum to 0; a hole leaves its share of the area. */
  static const double open_share = 1e-3;
  const double pi = acos(-1.0);
  double longest = 0.0;
  for (size_t k = 0; k < 3; ++k) {
    longest = fmax(longest, part->high[k] - part->low[k]);
  }
  if (part->area > 0.0 && supine_length(part->normal) > open_share * part->area) {
    return true;
  }
  const double sphere = pi / 6.0 * longest * longest * longest;
  const double enclosed = fabs(part->volume) / 6.0;
  return lung > 0.0 && fmax(sphere, enclosed) > least_share * lung;
}

/* Return the mean volume of the lungs in the scan, mm^3; 0 if a surface is open. */
static double mean_lung(const supine_inside_shells *shells) {
  double sum = 0.0;
  for (size_t lung = 0; lung < shells->count; ++lung) {
    const supine_inside_shell *shell = &shells->shell[lung];
    const supine_mesh mesh = {.vertex_count = shell->vertex_count,
                              .vertices = shell->vertices,
                              .triangle_count = shell->triangle_count,
                              .triangles = shell->triangles};
    sum += supine_mesh_volume(&mesh) / (double)shells->count;
  }
  return supine_basis_get_info(shells->basis)->has_volume ? sum : 0.0;
}

supine_status supine_inside_anatomy(const supine_inside_shells *shells,
                                    const supine_inside_content *content, unsigned char *anatomy,
                                    supine_error *error) {
  if (content->part_count == 0) { /* nodes of a grid */
    return SUPINE_OK;
  }
  SUPINE_ARENA arena = {0};
  part_shape *parts = supine_arena_zeros(&arena, content->part_count, sizeof *parts);
  SUPINE_TRY(supine_arena_check(&arena, error, "the sizes of %zu parts", content->part_count));
  for (size_t i = 0; i < content->part_count; ++i) {
    supine_box_begin(parts[i].low, parts[i].high);
  }
  for (size_t i = 0; i < content->count; ++i) {
    part_shape *part = &parts[content->part[i]];
    supine_box_add(content->points + 3 * i, part->low, part->high);
  }
  for (size_t t = 0; t < content->triangle_count; ++t) {
    const uint32_t *corner = content->triangles + 3 * t;
    add_triangle(content, corner, &parts[content->part[corner[0]]]);
  }
  const double lung = mean_lung(shells);
  for (size_t i = 0; i < content->part_count; ++i) {
    anatomy[i] = is_anatomy(&parts[i], lung);
  }
  return SUPINE_OK;
}
