/* SPDX-License-Identifier: MIT */
/* Internal declarations of this folder. */
#ifndef SUPINE_LABELS_MASK_H
#define SUPINE_LABELS_MASK_H

#include <stdint.h>

#include "base/arena.h"

#include "mesh/image/image.h"
#include "mesh/labels/labels.h"

/** A box of voxels cut from an image or from another mask. Voxels inside an object are nonzero.
 * Around them is a margin of zeros. */
typedef struct labels_mask {
  size_t size[3];
  long from[3];      /**< indices, in that image or mask, of the first voxel of the box */
  double origin[3];  /**< centre of voxel 0, mm, LPS */
  double step[3][3]; /**< vector from a voxel to the next along each axis, mm, LPS */
  double spacing[3]; /**< distance between neighbouring voxels along each axis, mm */
  uint8_t *at;       /**< [size[2], size[1], size[0]] values of the voxels, 0 outside the object */
} labels_mask;

enum { LABELS_LEFT = 1, LABELS_RIGHT = 2, LABELS_EITHER = 3 }; /* EITHER: side not yet known */

/* ---- mask.c ---- */
size_t supine_labels_mask_count(const labels_mask *mask);
double supine_labels_voxel_ml(const labels_mask *mask);
/** Cut out the voxels with the value `value`, as voxels with the value 1, with a layer of `margin`
 * zeros around their bounding box. If there are none, mask->at is NULL. */
supine_status supine_labels_mask_extract(const labels_mask *from, uint8_t value, size_t margin,
                                         labels_mask *mask);
void supine_labels_mask_free(labels_mask *mask);
/** Convert a position in voxels to mm. */
void supine_labels_mask_place(const labels_mask *mask, const double voxel[3], double place[3]);

/* ---- convention.c: count the labels of an image, and choose the lung that each belongs to ---- */

enum {
  LABELS_MAX = 65536, /**< number of possible labels, including 0 */
  LABELS_MARGIN = 2   /**< layers of zeros around a mask, voxels */
};

/** Number, sum of indices, and bounding box of the voxels of one label. */
typedef struct labels_tally {
  uint64_t count;
  uint64_t sum[3];        /**< sum of the voxels' indices along each axis */
  size_t low[3], high[3]; /**< bounding box: first and last voxel index along each axis */
} labels_tally;

/** Check that every voxel is a label, and make it exactly one: values within 1e-3 of a whole number
 * are that number. If all values are 0 to 1 and some lie between, they are probabilities: voxels of
 * at least 0.5 become 1, the others 0.
 * @retval SUPINE_ERROR_FORMAT  a voxel holds another number */
supine_status supine_labels_settle(const char *path, supine_image *image, supine_error *error);

/** Count the voxels of each label of an image that is settled, and find their bounding boxes.
 * @param tally  [LABELS_MAX] output */
supine_status supine_labels_count(const char *path, const supine_image *image, labels_tally *tally,
                                  supine_error *error);

typedef struct labels_choice {
  char *taken; /**< [256] output: labels of each side, such as "2 left; 1 right" */
  bool named;  /**< output: whether the labels, not the position, tell which lung is the left one */
  bool guessed; /**< output: whether two labels are only assumed to be the two lungs */
  bool doubted; /**< whether the left lung does not lie mainly to the left of the right lung */
} labels_choice;

/** Choose the side of each label.
 * @param side     [LABELS_MAX] output: 0 (no lung), LABELS_LEFT, LABELS_RIGHT or LABELS_EITHER */
supine_status supine_labels_choose(const char *path, const supine_image *image,
                                   const labels_tally *tally, const supine_labels_options *options,
                                   uint8_t *side, labels_choice *choice, supine_error *error);

/** Copy the box of voxels from voxel `low` to voxel `high` of an image that supine_labels_count has
 * checked, with a margin of `margin` zeros around it. On failure, mask->at is NULL.
 * @param value  [largest label + 1] value in the mask for each label */
supine_status supine_labels_mask_cut(const supine_image *image, const size_t low[3],
                                     const size_t high[3], size_t margin, const uint8_t *value,
                                     labels_mask *mask);

/* ---- pieces.c: pieces, which are connected components of voxels that share faces ---- */

/** A run: consecutive voxels begin <= i < end of one row along x, all zero or all nonzero. */
typedef struct labels_run {
  uint32_t begin, end;
  uint32_t parent; /**< index of the first run of the connected piece to which this run belongs */
} labels_run;

typedef struct labels_piece {
  uint64_t count; /**< number of voxels */
  double sum[3];  /**< sum of the voxels' indices along each axis */
} labels_piece;

typedef struct labels_pieces {
  size_t run_count;
  size_t *row;         /**< [rows + 1] index of the first run of each row of voxels */
  labels_run *run;     /**< [run_count] runs of all rows, row by row */
  labels_piece *piece; /**< [run_count] element r is the piece whose first run is r, if any */
  size_t piece_count;
} labels_pieces;

/** Find the connected pieces of zero voxels if `zero` is true, else those of nonzero voxels. */
supine_status supine_labels_pieces_find(const labels_mask *mask, bool zero, supine_arena *arena,
                                        labels_pieces *pieces);
/** If `zero` is false, set all connected pieces of nonzero voxels except the largest to 0.
 * Otherwise fill the cavities: set all connected pieces of zero voxels to 1, except the one around
 * the object.
 * @param others  output: number of pieces changed
 * @param voxels  output: number of voxels changed */
supine_status supine_labels_keep_one(labels_mask *mask, bool zero, size_t *others, size_t *voxels);

/* ---- distance.c ---- */

/** Compute the squared distance, mm^2, from the centre of every voxel to the centre of the nearest
 * voxel that is 0 (if `zero` is true) or not 0 (if false). The mask's axes must be orthogonal.
 * @param squares  [voxels] output */
supine_status supine_labels_distance(const labels_mask *mask, bool zero, float *squares);
/** Close gaps in the mask (morphological closing): fill all voxels that no ball of this radius, mm,
 * can cover without touching the mask. The mask's margin must be wider than the radius.
 * @param added  output: number of voxels filled */
supine_status supine_labels_close(labels_mask *mask, double radius, size_t *added);

/* ---- split.c ---- */

/** Split a mask of two lungs: replace LABELS_EITHER by LABELS_LEFT or LABELS_RIGHT.
 * @param neck  output: width of the bridge cut between the lungs, mm; 0 if they did not touch */
supine_status supine_labels_split(const char *path, labels_mask *both, double *neck,
                                  supine_error *error);

/* ---- cubes.c ---- */

/** A grid of cubes, and the fraction of each cube that is inside the mask. */
typedef struct labels_cubes {
  size_t size[3];
  double origin[3]; /**< centre of cube 0, in voxel indices of the mask */
  double ratio[3];  /**< edge of a cube divided by the voxel spacing along each axis */
  float *share;     /**< [size] fraction of each cube inside the mask; 0 in the outermost layers */
} labels_cubes;

/** Average a mask over a grid of cubes with edges of `edge` mm. If `one` is true, keep only the
 * largest connected piece of cubes inside the mask, and fill its cavities.
 * @retval SUPINE_ERROR_NUMERICAL  the cubes have not settled after many rounds */
supine_status supine_labels_cubes_create(const labels_mask *mask, double edge, bool one,
                                         supine_arena *arena, labels_cubes *cubes);

/* ---- net.c ---- */

/** Make the surface of a mask as a smoothed surface net [Gibson1998] on a grid of cubes with edges
 * of `edge` mm.
 * @param one  whether to keep only the largest connected piece and fill its cavities */
supine_status supine_labels_mask_surface(const labels_mask *mask, double edge, bool one,
                                         supine_mesh *mesh);

#endif
