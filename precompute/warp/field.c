/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the displacement field on the grid of a basis, and let it fall to 0 outside the lungs. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "base/arena.h"
#include "base/vec3.h"

#include "precompute/warp/fade.h"
#include "runtime/lung.h"

const double supine_warp_aerated = -300.0;

void supine_warp_find_cell(const supine_image *image, const double point[3],
                           supine_warp_cell *cell) {
  double voxel[3];
  supine_image_locate(image, point, voxel);
  for (size_t a = 0; a < 3; ++a) {
    const double last = (double)image->size[a] - 1.0;
    const double at = fmin(fmax(voxel[a], 0.0), last);
    const double corner = fmin(floor(at), fmax(last - 1.0, 0.0));
    cell->corner[a] = (size_t)corner;
    cell->share[a] = at - corner;
  }
}

/* Inlined, so that the loops over a constant number of channels are unrolled. */
static inline __attribute__((always_inline)) void interpolate(const supine_image *image,
                                                              size_t channels,
                                                              const supine_warp_cell *cell,
                                                              double *values, double (*slope)[3]) {
  const float *numbers = image->values;
  for (size_t c = 0; c < channels; ++c) {
    values[c] = 0.0;
    if (slope != NULL) {
      slope[c][0] = slope[c][1] = slope[c][2] = 0.0;
    }
  }
  for (size_t corner = 0; corner < 8; ++corner) {
    double weight[3];
    size_t at[3];
    for (size_t a = 0; a < 3; ++a) {
      const size_t up = corner >> a & 1U;
      weight[a] = up ? cell->share[a] : 1.0 - cell->share[a];
      at[a] = cell->corner[a] + up;
      /* On an axis of one voxel, the upper corner is outside the image, and its weight is 0. */
      at[a] -= at[a] == image->size[a];
    }
    const size_t voxel = at[0] + image->size[0] * (at[1] + image->size[1] * at[2]);
    for (size_t c = 0; c < channels; ++c) {
      const double value = (double)numbers[channels * voxel + c];
      values[c] += weight[0] * weight[1] * weight[2] * value;
      if (slope != NULL) {
        for (size_t k = 0; k < 3; ++k) {
          const double sign = corner >> k & 1U ? 1.0 : -1.0;
          slope[c][k] += sign * weight[(k + 1) % 3] * weight[(k + 2) % 3] * value;
        }
      }
    }
  }
}

void supine_warp_interpolate(const supine_image *image, const supine_warp_cell *cell,
                             double *values, double (*slope)[3]) {
  if (image->channels == 3) {
    interpolate(image, 3, cell, values, slope);
  } else {
    interpolate(image, image->channels, cell, values, slope);
  }
}

/* Read and check the grid in a basis: its shape, the node of each vertex, and the depth of each. */
static supine_status read_grid(const supine_basis *basis, supine_image *nodes,
                               const uint32_t **part, const float **depth, supine_error *error) {
  const size_t n = supine_basis_get_info(basis)->vertex_count;
  const supine_tensor *grid = supine_basis_tensor(basis, "grid");
  const supine_tensor *size = supine_basis_tensor(basis, "grid_size");
  const supine_tensor *of = supine_basis_tensor(basis, "part");
  const supine_tensor *deep = supine_basis_tensor(basis, "depth");
  SUPINE_REFUSE_IF(
      grid == NULL || size == NULL || of == NULL || deep == NULL, error, SUPINE_ERROR_FORMAT,
      "the basis holds no grid: embed an image, or a grid with a spacing such as 8 mm, "
      "in the basis of the lungs");
  bool valid = grid->dtype == SUPINE_F64 && grid->rank == 2 && grid->shape[0] == 4 &&
               grid->shape[1] == 3 && size->dtype == SUPINE_U32 && size->rank == 1 &&
               size->shape[0] == 3 && of->dtype == SUPINE_U32 && of->rank == 1 &&
               of->shape[0] == n && deep->dtype == SUPINE_F32 && deep->rank == 1 &&
               deep->shape[0] == n;
  double count = 1.0;
  for (size_t k = 0; k < 3 && valid; ++k) {
    nodes->size[k] = ((const uint32_t *)size->data)[k];
    count *= (double)nodes->size[k];
    valid = nodes->size[k] >= 2;
  }
  valid = valid && count < 2147483648.0;
  for (size_t i = 0; i < 12 && valid; ++i) {
    const double value = ((const double *)grid->data)[i];
    if (i < 3) {
      nodes->origin[i] = value;
    } else {
      nodes->step[i / 3 - 1][i % 3] = value;
    }
    valid = isfinite(value);
  }
  for (size_t i = 0; i < n && valid; ++i) {
    valid = ((const uint32_t *)of->data)[i] < count;
  }
  double axes[3] = {0.0, 0.0, 0.0};
  if (valid) {
    /* The result is finite only if the axes of the grid are linearly independent. */
    supine_image_locate(nodes, axes, axes);
  }
  SUPINE_REFUSE_IF(!valid || !isfinite(axes[0] + axes[1] + axes[2]), error, SUPINE_ERROR_FORMAT,
                   "the grid in the basis is malformed: embed a grid again");
  *part = of->data;
  *depth = deep->data;
  return SUPINE_OK;
}

supine_status supine_warp_create(const supine_basis *basis, const supine_pose *pose,
                                 const float *deviation, supine_field *field, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t n = info->vertex_count;
  supine_field made = {.nodes = {.voxel = SUPINE_VOXEL_F32, .channels = 3}};
  const uint32_t *part = NULL;
  const float *depth = NULL;
  SUPINE_TRY(read_grid(basis, &made.nodes, &part, &depth, error));
  const size_t count = supine_image_count(&made.nodes);
  SUPINE_ARENA arena = {0};
  float *moved = supine_arena_take(&arena, 3 * n, sizeof *moved);
  unsigned char *known = supine_arena_zeros(&arena, count, 1);
  float *u = calloc(3 * count, sizeof *u);
  float *below = malloc(count * sizeof *below);
  unsigned char *lung = calloc(count, 1);
  made.nodes.values = u;
  made.depth = made.nodes;
  made.depth.channels = 1;
  made.depth.values = below;
  made.lung = made.depth;
  made.lung.voxel = SUPINE_VOXEL_U8;
  made.lung.values = lung;
  if (arena.failed || u == NULL || below == NULL || lung == NULL) {
    supine_warp_free(&made);
    return supine_error_memory(error, "a field of %zu nodes", count);
  }
  (void)supine_displace_range(basis, pose, 0, n, moved);
  if (deviation != NULL) {
    for (size_t i = 0; i < 3 * n; ++i) {
      moved[i] += deviation[i];
    }
  }
  for (size_t i = 0; i < count; ++i) {
    below[i] = -INFINITY;
  }
  /* The field gives displacements from the scan, but info->vertices are at full inflation. */
  for (size_t i = 0; i < n; ++i) {
    double node[3];
    supine_image_place(&made.nodes, part[i], node);
    for (size_t k = 0; k < 3; ++k) {
      u[3 * (size_t)part[i] + k] =
          (float)((double)info->vertices[3 * i + k] - node[k] + (double)moved[3 * i + k]);
    }
    known[part[i]] = 1;
    lung[part[i]] = (unsigned char)supine_basis_lung_of(info, i);
    below[part[i]] = depth[i];
  }
  supine_warp_fade_out(&made, known);
  *field = made;
  return SUPINE_OK;
}

void supine_warp_free(supine_field *field) {
  supine_image_free(&field->nodes);
  supine_image_free(&field->depth);
  supine_image_free(&field->lung);
  *field = (supine_field){0};
}

void supine_warp_at(const supine_field *field, const double point[3], double u[3]) {
  supine_warp_cell cell;
  supine_warp_find_cell(&field->nodes, point, &cell);
  supine_warp_interpolate(&field->nodes, &cell, u, NULL);
}

double supine_warp_stretch(const supine_image *nodes, const supine_warp_cell *cell) {
  double u[3];
  double slope[3][3];
  double edge[3][3];
  supine_warp_interpolate(nodes, cell, u, slope);
  for (size_t k = 0; k < 9; ++k) {
    edge[k / 3][k % 3] = nodes->step[k / 3][k % 3] + slope[k % 3][k / 3];
  }
  return supine_triple(edge[0], edge[1], edge[2]) /
         supine_triple(nodes->step[0], nodes->step[1], nodes->step[2]);
}

void supine_warp_folded(const supine_field *field, double share[2]) {
  const size_t *size = field->nodes.size;
  size_t inside = 0;
  size_t folded[2] = {0, 0};
  for (size_t i = 0; i < size[0] * size[1] * size[2]; ++i) {
    const supine_warp_cell cell = {{i % size[0], i / size[0] % size[1], i / size[0] / size[1]},
                                   {0.5, 0.5, 0.5}};
    if (cell.corner[0] + 1 < size[0] && cell.corner[1] + 1 < size[1] &&
        cell.corner[2] + 1 < size[2]) {
      const bool lung = ((const float *)field->depth.values)[i] > 0.0F;
      inside += lung ? 1 : 0;
      folded[lung ? 0 : 1] += supine_warp_stretch(&field->nodes, &cell) > 0.0 ? 0 : 1;
    }
  }
  for (size_t k = 0; k < 2; ++k) {
    share[k] = (double)folded[k] / fmax((double)inside, 1.0);
  }
}
