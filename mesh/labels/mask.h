/* SPDX-License-Identifier: MIT */
/* Internal declarations of this folder. */
#ifndef SUPINE_LABELS_MASK_H
#define SUPINE_LABELS_MASK_H

#include <stdint.h>

#include "mesh/io/image.h"
#include "mesh/labels/labels.h"

/** A box of voxels with a margin of zeros around the nonzero ones. */
typedef struct labels_mask {
  size_t size[3];
  long from[3];      /**< [axis] index of voxel 0 in the image or mask that the box was cut from */
  double origin[3];  /**< centre of voxel 0, mm, LPS */
  double step[3][3]; /**< vector from a voxel to the next along each axis, mm, LPS */
  double spacing[3]; /**< lengths of the steps, mm */
  uint8_t *at;       /**< [size[2], size[1], size[0]] values */
} labels_mask;

enum { LABELS_LEFT = 1, LABELS_RIGHT = 2, LABELS_EITHER = 3 }; /* EITHER: side not yet known */

/* ---- mask.c ---- */
size_t supine_labels_mask_count(const labels_mask *mask);
double supine_labels_voxel_ml(const labels_mask *mask);
/** Extract the voxels of one value, as 1, with a margin of `margin` zeros around them. If there are
 * none, mask->at is NULL.
 * @retval SUPINE_ERROR_MEMORY */
supine_status supine_labels_mask_extract(const labels_mask *from, uint8_t value, size_t margin,
                                         labels_mask *mask);
void supine_labels_mask_free(labels_mask *mask);
/** Convert a position in voxels to mm. */
void supine_labels_mask_place(const labels_mask *mask, const double voxel[3], double place[3]);

/* ---- labels of an image, and the side of each (convention.c) ---- */

enum { LABELS_MAX = 65536, LABELS_MARGIN = 2 };

/** Number, sums of indices, and box of the voxels of one label. */
typedef struct labels_tally {
  uint64_t count;
  uint64_t sum[3];          /**< sum of the voxels' indices along each axis */
  uint32_t low[3], high[3]; /**< first and last index along each axis */
} labels_tally;

/** Count the voxels of each label and find their boxes.
 * @param tally  [LABELS_MAX] output
 * @retval SUPINE_ERROR_FORMAT  a voxel is not a label
 * @retval SUPINE_ERROR_MESH    every voxel is 0 */
supine_status supine_labels_count(const char *path, const supine_image *image, labels_tally *tally,
                                  supine_error *error);

typedef struct labels_choice {
  char *taken;  /**< [256] output, as in supine_labels_report */
  bool doubted; /**< whether the left lung does not lie left of the right lung */
} labels_choice;

/** Choose the side of each label as `wanted`, the field `labels` of supine_labels_options, says.
 * @param side     [LABELS_MAX] output: 0, LABELS_LEFT, LABELS_RIGHT or LABELS_EITHER */
supine_status supine_labels_choose(const char *path, const supine_image *image,
                                   const labels_tally *tally, const char *wanted, uint8_t *side,
                                   labels_choice *choice, supine_error *error);

/** Copy the box from voxel `low` to voxel `high` of an image that supine_labels_count has checked,
 * with a margin of `margin` zeros around it. On SUPINE_ERROR_MEMORY, mask->at is NULL.
 * @param value  [largest label + 1] value in the mask for each label */
supine_status supine_labels_mask_cut(const supine_image *image, const size_t low[3],
                                     const size_t high[3], size_t margin, const uint8_t *value,
                                     labels_mask *mask);

/* ---- pieces.c: pieces of equal voxels that share faces ---- */

/** A run of equal voxels in a row: begin <= i < end. */
typedef struct labels_run {
  uint32_t begin, end;
  uint32_t parent; /**< index of the first run of the same piece */
} labels_run;

typedef struct labels_piece {
  uint64_t count; /**< number of voxels */
  double sum[3];  /**< sum of the voxels' indices along each axis */
} labels_piece;

typedef struct labels_pieces {
  size_t run_count;
  size_t *row;         /**< [rows + 1] index of the first run of each row of voxels */
  labels_run *run;     /**< [run_count] runs of all rows, in order */
  labels_piece *piece; /**< [run_count] pieces, at the index of each piece's first run */
  size_t piece_count;
} labels_pieces;

/** Find the pieces of zero voxels if `zero` is true, otherwise the pieces of nonzero voxels. */
supine_status supine_labels_pieces_find(const labels_mask *mask, bool zero, labels_pieces *pieces);
void supine_labels_pieces_free(labels_pieces *pieces);
/** If `zero` is false, set all pieces of nonzero voxels except the largest to 0. Otherwise fill the
 * cavities: set all pieces of zero voxels except the outer one to 1.
 * @param others  output: number of pieces changed
 * @param voxels  output: number of voxels changed */
supine_status supine_labels_keep_one(labels_mask *mask, bool zero, size_t *others, size_t *voxels);

/* ---- distance.c ---- */

/** Compute the squared distance, mm^2, from the centre of every voxel to the centre of the nearest
 * zero voxel or, if `zero` is false, nonzero voxel. The steps must be orthogonal.
 * @param squares  [size] output */
supine_status supine_labels_distance(const labels_mask *mask, bool zero, float *squares);
/** Close the mask: fill all voxels that no ball of this radius, mm, can reach without entering the
 * mask. The mask's margin must be wider than the radius.
 * @param added  output: number of voxels filled */
supine_status supine_labels_close(labels_mask *mask, double radius, size_t *added);

/* ---- split.c ---- */

/** Replace LABELS_EITHER by LABELS_LEFT or LABELS_RIGHT.
 * @param neck  output: width of the bridge cut between the lungs, mm; 0 if they did not touch
 * @retval SUPINE_ERROR_MESH  one lung, or two that cannot be separated */
supine_status supine_labels_split(const char *path, labels_mask *both, double *neck,
                                  supine_error *error);

/* ---- cubes.c ---- */

/** Cubes, with the share of each that is inside the mask. */
typedef struct labels_cubes {
  size_t size[3];
  double origin[3]; /**< centre of cube 0, in voxels of the mask */
  double ratio[3];  /**< edge of a cube along each axis, in voxels */
  float *share;     /**< [size] 0 to 1; 0 in the outermost layers */
} labels_cubes;

/** Average a mask over cubes with edges of `edge` mm.
 * @param one  whether to keep only the largest piece and fill its cavities */
supine_status supine_labels_cubes_create(const labels_mask *mask, double edge, bool one,
                                         labels_cubes *cubes);
void supine_labels_cubes_free(labels_cubes *cubes);

/* ---- net.c ---- */

/** Make the surface of a mask: a surface net on cubes with edges of `edge` mm, smoothed.
 * @param one  whether to keep only the largest piece and fill its cavities */
supine_status supine_labels_mask_surface(const labels_mask *mask, double edge, bool one,
                                         supine_mesh *mesh);

#endif
