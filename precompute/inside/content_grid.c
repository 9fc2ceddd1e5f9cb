/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make a grid of nodes inside the lungs and just outside them. */
#include <math.h>
#include <stdlib.h>

#include "base/arena.h"
#include "base/parallel.h"
#include "base/vec3.h"

#include "precompute/inside/content.h"

static const double nodes_max = 2147483648.0;

/* Find the bounding box of the lungs in voxel coordinates of `grid`. */
static void cover(const supine_inside_shells *shells, const supine_image *grid, double low[3],
                  double high[3]) {
  supine_box_begin(low, high);
  for (size_t lung = 0; lung < shells->count; ++lung) {
    const supine_inside_shell *shell = &shells->shell[lung];
    for (size_t i = 0; i < shell->vertex_count; ++i) {
      double node[3];
      supine_image_locate(grid, shell->vertices + 3 * i, node);
      supine_box_add(node, low, high);
    }
  }
}

/* Return the share of the vertices of the lungs that lie outside an image. */
static double find_unseen(const supine_inside_shells *shells, const supine_image *image) {
  size_t count = 0;
  size_t unseen = 0;
  for (size_t lung = 0; lung < shells->count; ++lung) {
    const supine_inside_shell *shell = &shells->shell[lung];
    count += shell->vertex_count;
    for (size_t i = 0; i < shell->vertex_count; ++i) {
      double voxel[3];
      bool seen = true;
      supine_image_locate(image, shell->vertices + 3 * i, voxel);
      for (size_t k = 0; k < 3; ++k) {
        seen = seen && voxel[k] >= -1.0 && voxel[k] <= (double)image->size[k];
      }
      unseen += seen ? 0 : 1;
    }
  }
  return (double)unseen / (double)count;
}

/* Make the axes of an image right-angled: keep the first, the plane of the first two, and the
 * distance between slices. DICOM and ITK have no other grids; a CT with a tilted gantry has. */
static void make_right_angled(supine_image *image) {
  static const double rounding = 1e-5; /* of cosines, if the file stores float32 */
  double normal[3];
  double largest = 0.0;
  for (size_t a = 0; a < 3; ++a) {
    const double *s = image->step[a];
    const double *t = image->step[(a + 1) % 3];
    const double cosine = supine_dot(s, t) / supine_length(s) / supine_length(t);
    largest = fmax(largest, fabs(cosine));
  }
  if (largest < rounding) {
    return;
  }
  const double plane = supine_image_plane_distance(image, 2);
  supine_cross(image->step[0], image->step[1], normal);
  const double side = supine_dot(normal, image->step[2]) < 0.0 ? -1.0 : 1.0;
  const double along =
      supine_dot(image->step[0], image->step[1]) / supine_dot(image->step[0], image->step[0]);
  for (size_t k = 0; k < 3; ++k) {
    image->step[1][k] -= along * image->step[0][k];
    image->step[2][k] = side * plane * normal[k] / supine_length(normal);
  }
}

/* Make the grid that covers the lungs. Its nodes are voxels of `like`, at about the given spacing,
 * and continue beyond its border; if `like` is NULL, the axes of the grid are x, y and z. Its axes
 * are right-handed and at right angles. */
static supine_status make_grid(const supine_inside_shells *shells, const supine_image *like,
                               double spacing, double margin, supine_image *grid,
                               supine_error *error) {
  static const supine_image plain = {.step = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}};
  supine_image from = like != NULL ? *like : plain;
  double low[3];
  double high[3];
  double first[3];
  double every[3];
  double nodes = 1.0;
  double reach = margin; /* distance from the lungs to the border of the grid */
  cover(shells, &from, low, high);
  for (int k = 0; k < 3; ++k) {
    SUPINE_REFUSE_IF(
        like != NULL && (high[k] < 0.0 || low[k] > (double)from.size[k] - 1.0), error,
        SUPINE_ERROR_MESH,
        "the image does not show the lungs: check its axes and the axes of the meshes");
  }
  make_right_angled(&from);
  cover(shells, &from, low, high);
  for (int k = 0; k < 3; ++k) {
    const double edge = supine_length(from.step[k]);
    every[k] = like != NULL ? fmax(1.0, rint(spacing / edge)) : spacing;
    reach += every[k] * edge;
  }
  for (int k = 0; k < 3; ++k) {
    const double voxels = reach / supine_image_plane_distance(&from, (size_t)k);
    first[k] = floor((low[k] - voxels) / every[k]);
    const double count = ceil((high[k] + voxels) / every[k]) - first[k] + 1.0;
    nodes *= count;
    grid->size[k] = (size_t)fmin(count, nodes_max);
    for (int a = 0; a < 3; ++a) {
      grid->step[k][a] = every[k] * from.step[k][a];
    }
  }
  SUPINE_REFUSE_IF(!(nodes < nodes_max), error, SUPINE_ERROR_ARGUMENT,
                   "a grid of %g mm has %.3g nodes; give a larger spacing", spacing, nodes);
  for (int a = 0; a < 3; ++a) {
    grid->origin[a] = from.origin[a] + first[0] * grid->step[0][a] + first[1] * grid->step[1][a] +
                      first[2] * grid->step[2][a];
  }
  if (supine_image_is_left_handed(grid)) {
    supine_image_reverse(grid, 0);
  }
  return SUPINE_OK;
}

typedef struct search {
  const supine_inside_shells *shells;
  const supine_image *grid;
  double limit; /* largest distance of a node from the lungs, mm; farther nodes are dropped */
  unsigned char *keep; /* [nodes] 2: inside a lung; 1: outside, but within `limit`; 0: dropped */
} search;

static void search_rows(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const search *work = context;
  const size_t *size = work->grid->size;
  for (size_t row = begin; row < end; ++row) {
    supine_inside_walk walk = {0};
    for (size_t i = 0; i < size[0]; ++i) {
      double point[3];
      supine_image_place(work->grid, row * size[0] + i, point);
      const size_t lung = supine_inside_shells_find(work->shells, point, work->limit, &walk);
      const double depth = walk.place[lung].depth;
      unsigned char keep = 0;
      if (depth > 0.0) {
        keep = 2;
      } else if (depth > -work->limit) {
        keep = 1;
      }
      work->keep[row * size[0] + i] = keep;
    }
  }
}

static supine_status take_nodes(const supine_image *grid, const unsigned char *keep,
                                supine_inside_content *content, supine_error *error) {
  const size_t nodes = supine_image_count(grid);
  size_t count = 0;
  size_t inside = 0;
  for (size_t i = 0; i < nodes; ++i) {
    count += keep[i] != 0;
    inside += keep[i] == 2;
  }
  SUPINE_REFUSE_IF(inside == 0, error, SUPINE_ERROR_MESH,
                   "no node of the grid is inside a lung: give a smaller spacing, or an image that "
                   "shows the lungs");
  content->points = malloc(3 * count * sizeof *content->points);
  content->part = malloc(count * sizeof *content->part);
  if (content->points == NULL || content->part == NULL) {
    return supine_error_memory(error, "%zu nodes", count);
  }
  content->grid = *grid;
  for (size_t i = 0; i < nodes; ++i) {
    if (keep[i] != 0) {
      supine_image_place(grid, i, content->points + 3 * content->count);
      content->part[content->count++] = (uint32_t)i;
    }
  }
  return SUPINE_OK;
}

supine_status supine_inside_content_grid(const supine_inside_shells *shells,
                                         const supine_image *like, double spacing, double margin,
                                         supine_inside_content *content, supine_error *error) {
  supine_image grid = {0};
  SUPINE_REFUSE_IF(!(spacing > 0.0) || !isfinite(spacing), error, SUPINE_ERROR_ARGUMENT,
                   "the grid's spacing is %g mm: give one above 0", spacing);
  SUPINE_TRY(make_grid(shells, like, spacing, margin, &grid, error));
  content->unseen = like != NULL ? find_unseen(shells, like) : 0.0;
  const double diagonal = supine_image_cell_diagonal(&grid);
  const size_t nodes = supine_image_count(&grid);
  SUPINE_ARENA arena = {0};
  search work = {shells, &grid, diagonal, supine_arena_take(&arena, nodes, 1)};
  SUPINE_TRY(supine_arena_check(&arena, error, "a grid of %zu nodes", nodes));
  supine_parallel_for(grid.size[1] * grid.size[2], 1, 0, search_rows, &work);
  return take_nodes(&grid, work.keep, content, error);
}
