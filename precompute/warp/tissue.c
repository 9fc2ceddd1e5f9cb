/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the voxels of a CT that belong to the lungs, and the soft tissue among them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/clones.h"
#include "base/parallel.h"
#include "base/vec3.h"

#include "precompute/warp/run.h"
#include "precompute/warp/tissue.h"

typedef struct marking {
  const supine_field *field;
  const supine_image *ct;
  const supine_warp_span *span;
  unsigned char *kind;
  double outer; /* distance from the surface up to which aerated voxels are in the lungs, mm */
  double inner; /* depth from which on soft voxels are, too, mm */
} marking;

/* Find the kinds of RUN voxels of a row, and store those before `end`. */
SUPINE_CLONES static void mark_run(const marking *work, size_t row, size_t begin, size_t end) {
  static const double air = -950.0; /* air outside the lungs is below this density, HU */
  const size_t left = end - begin;
  const size_t first = row * work->ct->size[0] + begin;
  double depth[RUN];
  double lung[RUN];
  double value[RUN] = {0.0};
  size_t index[RUN];
  unsigned char kind[RUN];
  cells in;
  for (size_t i = 0; i < RUN; ++i) {
    index[i] = i;
  }
  find_nodes(work->ct, row, begin, &work->field->depth, &in);
  interpolate(&work->field->depth, &in, depth);
  take_nearest(&work->field->lung, in, lung);
  supine_image_gather(work->ct, first, index, left < RUN ? left : RUN, value);
  for (size_t i = 0; i < RUN; ++i) {
    const bool aerated = value[i] < supine_warp_aerated;
    const bool near = depth[i] > -work->outer && aerated && (depth[i] > 0.0 || value[i] > air);
    kind[i] = (unsigned char)((unsigned)lung[i] |
                              (depth[i] > work->inner || near ? SUPINE_TISSUE_LUNG : 0U) |
                              (!aerated && depth[i] > 0.0 ? SUPINE_TISSUE_SOFT : 0U));
  }
  memcpy(work->kind + first, kind, left < RUN ? left : RUN);
}

static void mark_rows(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const marking *work = context;
  for (size_t row = begin; row < end; ++row) {
    for (size_t i = work->span[row].begin; i < work->span[row].end; i += RUN) {
      mark_run(work, row, i, work->span[row].end);
    }
  }
}

/* Add the voxels of a cell around a node to the spans of their rows.
 * @param voxel  place of the node in voxels of the image
 * @param reach  largest distance of a corner from it along each axis, voxels */
static void add_node(const supine_image *ct, const double voxel[3], const double reach[3],
                     supine_warp_span *span) {
  size_t low[3];
  size_t high[3];
  for (size_t a = 0; a < 3; ++a) {
    const double last = (double)ct->size[a] - 1.0;
    low[a] = (size_t)fmin(fmax(floor(voxel[a] - reach[a]), 0.0), last);
    high[a] = (size_t)fmin(fmax(ceil(voxel[a] + reach[a]), 0.0), last);
  }
  for (size_t k = low[2]; k <= high[2]; ++k) {
    for (size_t j = low[1]; j <= high[1]; ++j) {
      supine_warp_span *row = &span[j + ct->size[1] * k];
      const bool empty = row->begin == row->end;
      row->begin = empty || low[0] < row->begin ? low[0] : row->begin;
      row->end = high[0] + 1 > row->end ? high[0] + 1 : row->end;
    }
  }
}

/* Find where the voxels of each row are that may be less than `outer` outside the lungs: in the
 * cells around the nodes that are. */
static void find_spans(const supine_image *depth, double outer, const supine_image *ct,
                       supine_warp_span *span) {
  supine_image steps = *ct;
  double reach[3] = {1.0, 1.0, 1.0}; /* a voxel more, so that neighbours are within, too */
  double voxel[3];
  memset(steps.origin, 0, sizeof steps.origin);
  for (size_t k = 0; k < 3; ++k) {
    supine_image_locate(&steps, depth->step[k], voxel);
    for (size_t a = 0; a < 3; ++a) {
      reach[a] += fabs(voxel[a]);
    }
  }
  for (size_t i = 0; i < supine_image_count(depth); ++i) {
    if ((double)((const float *)depth->values)[i] > -outer) {
      double at[3];
      supine_image_place(depth, i, at);
      supine_image_locate(ct, at, voxel);
      add_node(ct, voxel, reach, span);
    }
  }
}

/* Mark the voxels that belong to the lungs. Close to their surface, the density of a voxel decides.
 * Smoothing of the surface may leave aerated voxels outside it. Soft voxels inside it may be chest
 * wall; but the depth, which changes by at most 1 mm a mm, is interpolated with an error of at most
 * half the diagonal of a cell, and soft voxels that are deeper belong to the lungs. */
static void mark(const supine_field *field, const supine_image *ct, supine_tissue *tissue) {
  marking work = {.field = field, .ct = ct, .span = tissue->span, .kind = tissue->kind.values};
  for (size_t k = 0; k < 3; ++k) {
    work.outer += supine_length(field->depth.step[k]);
  }
  work.inner = 0.5 * supine_image_cell_diagonal(&field->depth);
  find_spans(&field->depth, work.outer, ct, tissue->span);
  supine_parallel_for(ct->size[1] * ct->size[2], 1, 0, mark_rows, &work);
}

/* Keep only which lung the voxels belong to. Parts at the surface belong to the lungs. */
SUPINE_CLONES static void settle(supine_tissue *tissue) {
  const size_t *size = tissue->kind.size;
  for (size_t row = 0; row < size[1] * size[2]; ++row) {
    unsigned char *voxel = (unsigned char *)tissue->kind.values + size[0] * row;
    for (size_t i = tissue->span[row].begin; i < tissue->span[row].end; ++i) {
      const bool part = (voxel[i] & SUPINE_TISSUE_STAGE) == SUPINE_TISSUE_PART;
      const bool lung = part || (voxel[i] & SUPINE_TISSUE_LUNG) != 0;
      const unsigned index = voxel[i] & SUPINE_TISSUE_LUNG_INDEX;
      voxel[i] = (unsigned char)(lung ? SUPINE_TISSUE_LUNG | index : 0U);
    }
  }
}

/* Mark the voxels whose cells have corners of two kinds. */
SUPINE_CLONES static void mark_borders(supine_tissue *tissue) {
  const size_t *size = tissue->kind.size;
  const size_t next[3] = {size[0] > 1, size[1] > 1 ? size[0] : 0,
                          size[2] > 1 ? size[0] * size[1] : 0};
  for (size_t row = 0; row < size[1] * size[2]; ++row) {
    unsigned char *voxel = (unsigned char *)tissue->kind.values + size[0] * row;
    const unsigned char *above = voxel + next[2];
    const size_t end = tissue->span[row].end - (tissue->span[row].end == size[0] ? next[0] : 0);
    const bool last = (next[1] > 0 && row % size[1] + 1 == size[1]) ||
                      (next[2] > 0 && row / size[1] + 1 == size[2]);
    if (last) { /* no cell begins here */
      continue;
    }
    for (size_t i = tissue->span[row].begin; i < end; ++i) {
      const size_t j = i + next[0];
      const unsigned other = (voxel[i] ^ voxel[j]) | (voxel[i] ^ voxel[i + next[1]]) |
                             (voxel[i] ^ voxel[j + next[1]]) | (voxel[i] ^ above[i]) |
                             (voxel[i] ^ above[j]) | (voxel[i] ^ above[i + next[1]]) |
                             (voxel[i] ^ above[j + next[1]]);
      voxel[i] = (unsigned char)(voxel[i] | (other != 0 ? SUPINE_TISSUE_BORDER : 0));
    }
  }
}

supine_status supine_warp_tissue_find(const supine_field *field, const supine_image *ct,
                                      supine_tissue *tissue, supine_error *error) {
  const size_t rows = ct->size[1] * ct->size[2];
  const unsigned char *lung = field->lung.values;
  tissue->kind = *ct;
  tissue->kind.voxel = SUPINE_VOXEL_U8;
  tissue->kind.values = calloc(ct->size[0] * rows, 1);
  tissue->span = calloc(rows, sizeof *tissue->span);
  if (tissue->kind.values == NULL || tissue->span == NULL) {
    return supine_error_memory(error, "an image of %zu voxels", ct->size[0] * rows);
  }
  for (size_t i = 0; i < supine_image_count(&field->lung); ++i) {
    tissue->lungs = lung[i] >= tissue->lungs ? lung[i] + 1U : tissue->lungs;
  }
  mark(field, ct, tissue);
  SUPINE_TRY(supine_warp_tissue_fill(tissue, error));
  SUPINE_TRY(supine_warp_tissue_find_parts(tissue, error));
  settle(tissue);
  SUPINE_TRY(supine_warp_tissue_find_air(ct, tissue, error));
  mark_borders(tissue);
  return SUPINE_OK;
}
