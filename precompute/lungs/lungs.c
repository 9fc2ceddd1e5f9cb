/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Join surfaces into lungs, find left and right, check and measure them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/vec3.h"

#include "precompute/lungs/lungs.h"

/* A component with less than this share of the vertices does not count as a lung. */
static const double significant_share = 0.05;
/* Two surfaces are the same lung if the faces of their bounding boxes differ in position by at most
 * this share of the longest side. Two meshes of one lung differ by thousandths. */
static const double same_box_share = 0.01;
/* A surface is refused if its longest side is less than this share of another surface's longest
 * side. The lobes and lungs of one chest differ by less than a factor of ten. */
static const double least_side_share = 0.05;
/* Largest extent of a lung beyond the midline, divided by its extent on its own side. The midline
 * is refused if the ratio is larger. Lungs do reach across the midline behind the breastbone. */
static const double most_beyond_share = 0.5;

static supine_status join(const supine_mesh *meshes, size_t count, supine_mesh *joined,
                          supine_error *error) {
  size_t vertices = 0;
  size_t triangles = 0;
  for (size_t m = 0; m < count; ++m) {
    vertices += meshes[m].vertex_count;
    triangles += meshes[m].triangle_count;
  }
  SUPINE_REFUSE_IF(count == 0 || triangles == 0 || vertices == 0, error, SUPINE_ERROR_MESH,
                   "the surface has no triangles: give a closed surface");
  SUPINE_REFUSE_IF(vertices > UINT32_MAX, error, SUPINE_ERROR_MESH,
                   "%zu vertices are more than 32-bit indices reach: give a coarser mesh",
                   vertices);
  if (supine_mesh_allocate(vertices, triangles, joined) != SUPINE_OK) {
    return supine_error_memory(error, "%zu vertices", vertices);
  }
  joined->vertex_count = joined->triangle_count = 0;
  for (size_t m = 0; m < count; ++m) {
    const supine_mesh *mesh = &meshes[m];
    uint32_t *out = joined->triangles + 3 * joined->triangle_count;
    for (size_t i = 0; i < 3 * mesh->triangle_count; ++i) {
      out[i] = (uint32_t)(mesh->triangles[i] + joined->vertex_count);
    }
    memcpy(joined->vertices + 3 * joined->vertex_count, mesh->vertices,
           3 * mesh->vertex_count * sizeof *mesh->vertices);
    joined->vertex_count += mesh->vertex_count;
    joined->triangle_count += mesh->triangle_count;
  }
  return SUPINE_OK;
}

double supine_lungs_sides(const supine_mesh *mesh, const supine_topology *topology, int axis,
                          double middle, supine_arena *arena, uint8_t *above) {
  typedef struct component {
    double count, sum, low, high;
  } component;
  double range[2][2] = {{INFINITY, -INFINITY}, {INFINITY, -INFINITY}};
  component *parts = supine_arena_zeros(arena, topology->component_count, sizeof *parts);
  if (arena->failed) {
    return INFINITY;
  }
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    component *part = &parts[topology->component[i]];
    const double x = mesh->vertices[3 * i + (size_t)axis];
    part->low = part->count == 0.0 ? x : fmin(part->low, x);
    part->high = part->count == 0.0 ? x : fmax(part->high, x);
    part->sum += x;
    part->count += 1.0;
  }
  for (size_t c = 0; c < topology->component_count; ++c) {
    above[c] = parts[c].sum > middle * parts[c].count;
    if (parts[c].count >= significant_share * (double)mesh->vertex_count) {
      double *of = range[above[c]];
      of[0] = fmin(of[0], parts[c].low);
      of[1] = fmax(of[1], parts[c].high);
    }
  }
  const double narrower = fmin(range[0][1] - range[0][0], range[1][1] - range[1][0]);
  return narrower > 0.0 ? (range[0][1] - range[1][0]) / narrower : INFINITY;
}

/* Group vertices and triangles by lung, left first, keeping their order within each.
 * @param left  [components] whether a component lies left of the midline */
static supine_status group(supine_lungs *lungs, const uint8_t *left, supine_error *error) {
  supine_mesh *mesh = &lungs->mesh;
  const size_t n = mesh->vertex_count;
  const size_t triangles = mesh->triangle_count;
  const uint32_t *part_of = lungs->topology.component;
  supine_mesh sorted;
  SUPINE_ARENA arena = {0};
  uint32_t *position = supine_arena_take(&arena, n, sizeof *position);
  size_t next[2] = {0, 0};
  size_t next_triangle[2] = {0, 0};
  bool in_order = true;
  if (arena.failed || supine_mesh_allocate(n, triangles, &sorted) != SUPINE_OK) {
    return supine_error_memory(error, "%zu vertices", n);
  }
  for (size_t i = 0; i < n; ++i) {
    next[1] += left[part_of[i]];
  }
  for (size_t t = 0; t < triangles; ++t) {
    next_triangle[1] += left[part_of[mesh->triangles[3 * t]]];
  }
  const bool both = next[1] > 0 && next[1] < n;
  lungs->lung_count = both ? 2 : 1;
  lungs->side[0] = next[1] > 0 ? 1 : -1;
  lungs->side[1] = -1;
  lungs->lung_begin[1] = both ? next[1] : n;
  lungs->lung_begin[2] = n;
  lungs->triangle_begin[1] = both ? next_triangle[1] : triangles;
  lungs->triangle_begin[2] = triangles;
  for (size_t i = 0; i < n; ++i) {
    position[i] = (uint32_t)next[left[part_of[i]] == 0]++;
    in_order = in_order && position[i] == i;
    memcpy(sorted.vertices + 3 * (size_t)position[i], mesh->vertices + 3 * i, 3 * sizeof(double));
  }
  for (size_t t = 0; t < triangles; ++t) {
    const uint32_t *corner = mesh->triangles + 3 * t;
    uint32_t *out = sorted.triangles + 3 * next_triangle[left[part_of[corner[0]]] == 0]++;
    for (size_t k = 0; k < 3; ++k) {
      out[k] = position[corner[k]];
    }
  }
  supine_arena_free(&arena);
  supine_mesh_free(mesh);
  *mesh = sorted;
  if (!in_order) {
    supine_mesh_topology_free(&lungs->topology);
    if (supine_mesh_topology_create(mesh, &lungs->topology) != SUPINE_OK) {
      return supine_error_memory(error, "the edges of %zu triangles", triangles);
    }
  }
  return SUPINE_OK;
}

/* Refuse a lung given twice, even at two resolutions, and a surface tiny compared with another. */
static supine_status check_surfaces(const supine_mesh *meshes, size_t count, supine_error *error) {
  for (size_t m = 1; m < count; ++m) {
    for (size_t i = 0; i < m; ++i) {
      double box[2][2][3];
      double apart = 0.0;
      const double side[2] = {supine_mesh_box(&meshes[i], box[0][0], box[0][1]),
                              supine_mesh_box(&meshes[m], box[1][0], box[1][1])};
      for (size_t k = 0; k < 6; ++k) {
        apart = fmax(apart, fabs(box[0][k / 3][k % 3] - box[1][k / 3][k % 3]));
      }
      SUPINE_REFUSE_IF(apart <= same_box_share * fmax(side[0], side[1]), error, SUPINE_ERROR_MESH,
                       "surfaces %zu and %zu have the same bounding box: give each lung once",
                       i + 1, m + 1);
      const bool first = side[0] < side[1];
      SUPINE_REFUSE_IF(side[!first] < least_side_share * side[first], error, SUPINE_ERROR_MESH,
                       "surface %zu is %.3g mm long beside another of %.3g mm: it is incomplete, "
                       "in other units, or no lung; correct it or leave it out",
                       first ? i + 1 : m + 1, side[!first], side[first]);
    }
  }
  return SUPINE_OK;
}

/* Refuse a given midline that runs through a lung, or leaves both lungs on one side.
 * @param two_sided  whether the surfaces are two lungs */
static supine_status check_midline(const supine_lungs *lungs, bool two_sided, supine_error *error) {
  SUPINE_REFUSE_IF(two_sided && lungs->lung_count < 2, error, SUPINE_ERROR_MESH,
                   "the midline x = %g mm leaves both lungs on its %s side: give one near %g",
                   lungs->midline, supine_lungs_name(lungs, 0),
                   0.5 * (lungs->minimum[0] + lungs->maximum[0]));
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    const bool left = lungs->side[lung] > 0;
    const double ends[2] = {lungs->midline - lungs->low[lung][0],
                            lungs->high[lung][0] - lungs->midline};
    SUPINE_REFUSE_IF(ends[!left] > most_beyond_share * ends[left], error, SUPINE_ERROR_MESH,
                     "the midline x = %g mm runs through the %s lung, which reaches %.3g mm beyond "
                     "it; give one between the lungs, or none",
                     lungs->midline, supine_lungs_name(lungs, lung), ends[!left]);
  }
  return SUPINE_OK;
}

void supine_lungs_measure_volumes(supine_lungs *lungs) {
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    const supine_mesh part = supine_lungs_part(lungs, lung);
    lungs->volume[lung] = 1e-3 * supine_mesh_volume(&part);
  }
}

void supine_lungs_measure(supine_lungs *lungs) {
  supine_lungs_measure_volumes(lungs);
  supine_box_begin(lungs->minimum, lungs->maximum);
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    const size_t begin = lungs->lung_begin[lung];
    const supine_mesh own = {lungs->lung_begin[lung + 1] - begin, lungs->mesh.vertices + 3 * begin,
                             0, NULL};
    supine_mesh_box(&own, lungs->low[lung], lungs->high[lung]);
    supine_box_add(lungs->low[lung], lungs->minimum, lungs->maximum);
    supine_box_add(lungs->high[lung], lungs->minimum, lungs->maximum);
  }
}

static void face_outwards(supine_lungs *lungs) {
  for (size_t lung = 0; lung < lungs->lung_count; ++lung) {
    const supine_mesh part = supine_lungs_part(lungs, lung);
    lungs->reversed[lung] = lungs->volume[lung] < 0.0;
    lungs->volume[lung] = fabs(lungs->volume[lung]);
    if (lungs->reversed[lung]) {
      supine_mesh_reverse(&part);
    }
  }
}

/* Find the topology and the bounding box of the lungs, the midline, and the side of each lung. */
static supine_status measure(supine_lungs *lungs, const double *midline, supine_error *error) {
  supine_mesh_box(&lungs->mesh, lungs->minimum, lungs->maximum);
  const double low = lungs->minimum[0];
  const double high = lungs->maximum[0];
  for (int k = 0; k < 3; ++k) {
    SUPINE_REFUSE_IF(!(lungs->maximum[k] > lungs->minimum[k]), error, SUPINE_ERROR_MESH,
                     "the surface has no extent along %c: give a closed surface", "xyz"[k]);
  }
  const supine_status status = supine_mesh_topology_create(&lungs->mesh, &lungs->topology);
  SUPINE_REFUSE_IF(status != SUPINE_OK, error, status, "no memory for the edges of %zu triangles",
                   lungs->mesh.triangle_count);
  SUPINE_ARENA arena = {0};
  uint8_t *left = supine_arena_take(&arena, lungs->topology.component_count, 1);
  const double overlap =
      supine_lungs_sides(&lungs->mesh, &lungs->topology, 0, 0.5 * (low + high), &arena, left);
  if (midline != NULL) {
    lungs->midline = *midline;
  } else if (overlap < SUPINE_LUNGS_MOST_OVERLAP) {
    lungs->midline = 0.5 * (low + high);
  } else { /* one lung: its side that is nearer to x = 0 */
    lungs->midline = fabs(low) < fabs(high) ? low : high;
  }
  (void)supine_lungs_sides(&lungs->mesh, &lungs->topology, 0, lungs->midline, &arena, left);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu components", lungs->topology.component_count));
  SUPINE_TRY(group(lungs, left, error));
  supine_lungs_measure(lungs);
  return midline != NULL ? check_midline(lungs, overlap < SUPINE_LUNGS_MOST_OVERLAP, error)
                         : SUPINE_OK;
}

supine_status supine_lungs_create(const supine_mesh *meshes, size_t count, const double *midline,
                                  supine_lungs *lungs, supine_error *error) {
  SUPINE_FREED_BY(supine_lungs_free) supine_lungs made = {0};
  SUPINE_REFUSE_IF(midline != NULL && !isfinite(*midline), error, SUPINE_ERROR_ARGUMENT,
                   "the midline must be a finite x in mm, not %g", *midline);
  SUPINE_TRY(check_surfaces(meshes, count, error));
  SUPINE_TRY(join(meshes, count, &made.mesh, error));
  SUPINE_TRY(measure(&made, midline, error));
  face_outwards(&made);
  *lungs = made;
  made = (supine_lungs){0};
  return SUPINE_OK;
}

void supine_lungs_free(supine_lungs *lungs) {
  supine_mesh_free(&lungs->mesh);
  supine_mesh_topology_free(&lungs->topology);
  free(lungs->scanned);
  *lungs = (supine_lungs){0};
}

static double unit_clamp(double value) {
  return fmin(fmax(value, 0.0), 1.0);
}

void supine_lungs_box_coordinates(const supine_lungs *lungs, size_t vertex, double box[3]) {
  const double *p = lungs->mesh.vertices + 3 * vertex;
  const size_t lung = lungs->lung_count == 2 && vertex >= lungs->lung_begin[1];
  const double outer = lungs->side[lung] > 0 ? lungs->maximum[0] : lungs->minimum[0];
  const double width = outer - lungs->midline;
  box[0] = width != 0.0 ? unit_clamp((p[0] - lungs->midline) / width) : 0.0;
  box[1] = unit_clamp((lungs->maximum[1] - p[1]) / (lungs->maximum[1] - lungs->minimum[1]));
  box[2] = unit_clamp((lungs->maximum[2] - p[2]) / (lungs->maximum[2] - lungs->minimum[2]));
}
