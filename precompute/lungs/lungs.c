/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The lungs of one model: join, tell left from right, group, measure. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/lungs/lungs.h"
#include "precompute/lungs/sound.h"

/* A component of fewer vertices than this share follows its side and does not make a lung. */
static const double significant_share = 0.05;

/* Where and how large one connected component is. */
typedef struct component {
  size_t count;
  double sum_x, minimum_x, maximum_x;
} component;

/* A surface of the input and where its vertices lie on average, to join from left to right. */
typedef struct placed_mesh {
  const supine_mesh *mesh;
  double mean_x;
} placed_mesh;

static int compare_placed(const void *a, const void *b) {
  const placed_mesh *first = a;
  const placed_mesh *second = b;
  return (first->mean_x < second->mean_x) - (first->mean_x > second->mean_x);
}

static placed_mesh place(const supine_mesh *mesh) {
  double sum = 0.0;
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    sum += mesh->vertices[3 * i];
  }
  return (placed_mesh){mesh, mesh->vertex_count == 0 ? 0.0 : sum / (double)mesh->vertex_count};
}

static supine_status join(const supine_mesh *meshes, size_t count, supine_mesh *joined,
                          supine_error *error) {
  size_t vertices = 0;
  size_t triangles = 0;
  for (size_t m = 0; m < count; ++m) {
    vertices += meshes[m].vertex_count;
    triangles += meshes[m].triangle_count;
  }
  if (count == 0 || triangles == 0 || vertices == 0) {
    return supine_error_set(error, SUPINE_ERROR_MESH, "the model has no triangles");
  }
  if (vertices > UINT32_MAX) {
    return supine_error_set(error, SUPINE_ERROR_MESH,
                            "%zu vertices are more than 32-bit indices reach", vertices);
  }
  placed_mesh *placed = malloc(count * sizeof *placed);
  joined->vertices = malloc(3 * vertices * sizeof *joined->vertices);
  joined->triangles = malloc(3 * triangles * sizeof *joined->triangles);
  if (placed == NULL || joined->vertices == NULL || joined->triangles == NULL) {
    free(placed);
    supine_mesh_free(joined);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", vertices);
  }
  for (size_t m = 0; m < count; ++m) {
    placed[m] = place(&meshes[m]);
  }
  qsort(placed, count, sizeof *placed, compare_placed);
  for (size_t m = 0; m < count; ++m) {
    const supine_mesh *mesh = placed[m].mesh;
    uint32_t *out = joined->triangles + 3 * joined->triangle_count;
    for (size_t i = 0; i < 3 * mesh->triangle_count; ++i) {
      out[i] = (uint32_t)(mesh->triangles[i] + joined->vertex_count);
    }
    memcpy(joined->vertices + 3 * joined->vertex_count, mesh->vertices,
           3 * mesh->vertex_count * sizeof *mesh->vertices);
    joined->vertex_count += mesh->vertex_count;
    joined->triangle_count += mesh->triangle_count;
  }
  free(placed);
  return SUPINE_OK;
}

static component *measure_components(const supine_mesh *mesh, const supine_topology *topology) {
  component *parts = malloc(topology->component_count * sizeof *parts);
  if (parts == NULL) {
    return NULL;
  }
  for (size_t c = 0; c < topology->component_count; ++c) {
    parts[c] = (component){0, 0.0, INFINITY, -INFINITY};
  }
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    component *part = &parts[topology->component[i]];
    const double x = mesh->vertices[3 * i];
    ++part->count;
    part->sum_x += x;
    part->minimum_x = fmin(part->minimum_x, x);
    part->maximum_x = fmax(part->maximum_x, x);
  }
  return parts;
}

static bool part_is_left(const component *part, double x) {
  return part->sum_x > x * (double)part->count;
}

/* Whether the significant components fall into two groups, left and right of x, that overlap by
 * less than half the width of the narrower. */
static bool two_sided(const component *parts, size_t count, size_t vertices, double x) {
  double left[2] = {INFINITY, -INFINITY};
  double right[2] = {INFINITY, -INFINITY};
  for (size_t c = 0; c < count; ++c) {
    if ((double)parts[c].count >= significant_share * (double)vertices) {
      double *range = part_is_left(&parts[c], x) ? left : right;
      range[0] = fmin(range[0], parts[c].minimum_x);
      range[1] = fmax(range[1], parts[c].maximum_x);
    }
  }
  const double narrower = fmin(left[1] - left[0], right[1] - right[0]);
  return narrower > 0.0 && right[1] - left[0] < 0.5 * narrower;
}

/* Counts the lungs' vertices and triangles, left first; true where they stand in that order
 * already. */
static bool grouped(supine_lungs *lungs, const component *parts) {
  const supine_mesh *mesh = &lungs->mesh;
  const uint32_t *part_of = lungs->topology.component;
  size_t left_vertices = 0;
  size_t left_triangles = 0;
  bool in_order = true;
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    if (part_is_left(&parts[part_of[i]], lungs->midline)) {
      in_order = in_order && left_vertices == i;
      ++left_vertices;
    }
  }
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    if (part_is_left(&parts[part_of[mesh->triangles[3 * t]]], lungs->midline)) {
      in_order = in_order && left_triangles == t;
      ++left_triangles;
    }
  }
  const bool both = left_vertices > 0 && left_vertices < mesh->vertex_count;
  lungs->lung_count = both ? 2 : 1;
  lungs->side[0] = left_vertices > 0 ? 1 : -1;
  lungs->side[1] = -1;
  lungs->lung_begin[1] = both ? left_vertices : mesh->vertex_count;
  lungs->lung_begin[2] = mesh->vertex_count;
  lungs->triangle_begin[1] = both ? left_triangles : mesh->triangle_count;
  lungs->triangle_begin[2] = mesh->triangle_count;
  return in_order;
}

/* Sorts vertices and triangles by lung, keeping their order within each, and finds the edges anew.
 */
static supine_status group(supine_lungs *lungs, const component *parts, supine_error *error) {
  supine_mesh *mesh = &lungs->mesh;
  const size_t n = mesh->vertex_count;
  const uint32_t *part_of = lungs->topology.component;
  supine_mesh sorted = {.vertex_count = n, .triangle_count = mesh->triangle_count};
  uint32_t *position = calloc(n + 1, sizeof *position);
  sorted.vertices = malloc(3 * n * sizeof *sorted.vertices);
  sorted.triangles = malloc(3 * mesh->triangle_count * sizeof *sorted.triangles);
  if (position == NULL || sorted.vertices == NULL || sorted.triangles == NULL) {
    free(position);
    supine_mesh_free(&sorted);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory to group %zu vertices", n);
  }
  size_t next[2] = {0, lungs->lung_begin[1]};
  for (size_t i = 0; i < n; ++i) {
    const bool left = part_is_left(&parts[part_of[i]], lungs->midline);
    position[i] = (uint32_t)next[left ? 0 : 1]++;
    memcpy(sorted.vertices + 3 * (size_t)position[i], mesh->vertices + 3 * i, 3 * sizeof(double));
  }
  size_t next_triangle[2] = {0, lungs->triangle_begin[1]};
  for (size_t t = 0; t < mesh->triangle_count; ++t) {
    const uint32_t *corner = mesh->triangles + 3 * t;
    const bool left = part_is_left(&parts[part_of[corner[0]]], lungs->midline);
    uint32_t *out = sorted.triangles + 3 * next_triangle[left ? 0 : 1]++;
    for (size_t k = 0; k < 3; ++k) {
      out[k] = position[corner[k]];
    }
  }
  free(position);
  supine_mesh_free(mesh);
  *mesh = sorted;
  supine_mesh_topology_free(&lungs->topology);
  const supine_status status = supine_mesh_topology_create(mesh, &lungs->topology);
  return status == SUPINE_OK ? status : supine_error_set(error, status, "no memory for edges");
}

/* Over 60 lines: joining, parting, checking and measuring, each of which may end it. */
supine_status supine_lungs_create(const supine_mesh *meshes, size_t count, const double *midline,
                                  supine_lungs *lungs, supine_error *error) {
  component *parts = NULL;
  supine_lungs made = {0};
  supine_status status = SUPINE_OK;
  if (midline != NULL && !isfinite(*midline)) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "the midline must be finite");
  }
  status = supine_lungs_check_surfaces(meshes, count, error);
  if (status == SUPINE_OK) {
    status = join(meshes, count, &made.mesh, error);
  }
  if (status != SUPINE_OK) {
    return status;
  }
  supine_mesh_box(&made.mesh, made.minimum, made.maximum);
  for (int k = 0; k < 3; ++k) {
    if (!(made.maximum[k] > made.minimum[k])) {
      status = supine_error_set(error, SUPINE_ERROR_MESH,
                                "the surface has no extent along %c: a lung has three dimensions",
                                "xyz"[k]);
      goto cleanup;
    }
  }
  status = supine_mesh_topology_create(&made.mesh, &made.topology);
  if (status != SUPINE_OK) {
    (void)supine_error_set(error, status, "no memory for the edges of %zu triangles",
                           made.mesh.triangle_count);
    goto cleanup;
  }
  parts = measure_components(&made.mesh, &made.topology);
  if (parts == NULL) {
    status = supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu components",
                              made.topology.component_count);
    goto cleanup;
  }
  const double centre = 0.5 * (made.minimum[0] + made.maximum[0]);
  const bool sides =
      two_sided(parts, made.topology.component_count, made.mesh.vertex_count, centre);
  if (midline != NULL) {
    made.midline = *midline;
  } else if (sides) {
    made.midline = centre;
  } else {
    made.midline =
        fabs(made.minimum[0]) < fabs(made.maximum[0]) ? made.minimum[0] : made.maximum[0];
  }
  if (!grouped(&made, parts)) {
    status = group(&made, parts, error);
    if (status != SUPINE_OK) {
      goto cleanup;
    }
  }
  status = midline == NULL ? SUPINE_OK : supine_lungs_check_midline(&made, sides, error);
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  supine_lungs_face_outwards(&made);
  *lungs = made;
  made = (supine_lungs){0};
cleanup:
  free(parts);
  supine_lungs_free(&made);
  return status;
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
