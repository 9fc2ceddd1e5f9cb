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
  unsigned char *kind;
  double outer; /* distance from the surface up to which aerated voxels are in the lungs, mm */
  double inner; /* depth from which on soft voxels are, too, mm */
} marking;

/* Find the kinds of RUN voxels of a row. */
SUPINE_CLONES static void mark_run(const marking *work, size_t row, size_t begin) {
  static const double air = -950.0; /* air outside the lungs is below this density, HU */
  const size_t left = work->ct->size[0] - begin;
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
    for (size_t i = 0; i < work->ct->size[0]; i += RUN) {
      mark_run(work, row, i);
    }
  }
}

/* Mark the voxels that belong to the lungs. Close to their surface, the density of a voxel decides.
 * Smoothing of the surface may leave aerated voxels outside it. Soft voxels inside it may be chest
 * wall; but the depth, which changes by at most 1 mm a mm, is interpolated with an error of at most
 * half the diagonal of a cell, and soft voxels that are deeper belong to the lungs. */
static void mark(const supine_field *field, const supine_image *ct, unsigned char *kind) {
  marking work = {.field = field, .ct = ct, .kind = kind};
  for (size_t k = 0; k < 3; ++k) {
    work.outer += supine_length(field->depth.step[k]);
  }
  work.inner = 0.5 * supine_image_cell_diagonal(&field->depth);
  supine_parallel_for(ct->size[1] * ct->size[2], 1, 0, mark_rows, &work);
}

supine_status supine_warp_tissue_find(const supine_field *field, const supine_image *ct,
                                      supine_tissue *tissue, supine_error *error) {
  const size_t count = ct->size[0] * ct->size[1] * ct->size[2];
  const unsigned char *lung = field->lung.values;
  supine_image *kind = &tissue->kind;
  *kind = *ct;
  kind->voxel = SUPINE_VOXEL_U8;
  kind->values = malloc(count);
  if (kind->values == NULL) {
    return supine_error_memory(error, "an image of %zu voxels", count);
  }
  for (size_t i = 0; i < field->lung.size[0] * field->lung.size[1] * field->lung.size[2]; ++i) {
    tissue->lungs = lung[i] >= tissue->lungs ? lung[i] + 1U : tissue->lungs;
  }
  unsigned char *voxel = kind->values;
  mark(field, ct, voxel);
  SUPINE_TRY(supine_warp_tissue_fill(kind, error));
  SUPINE_TRY(supine_warp_tissue_find_parts(tissue, error));
  for (size_t i = 0; i < count; ++i) { /* parts at the surface belong to the lungs */
    const bool part = (voxel[i] & SUPINE_TISSUE_STAGE) == SUPINE_TISSUE_PART;
    voxel[i] = (unsigned char)((voxel[i] & (SUPINE_TISSUE_LUNG | SUPINE_TISSUE_LUNG_INDEX)) |
                               (part ? SUPINE_TISSUE_LUNG : 0U));
  }
  return supine_warp_tissue_find_air(ct, tissue, error);
}
