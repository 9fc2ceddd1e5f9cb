/* SPDX-License-Identifier: MIT */
/* What the files of this folder share; no other folder sees it. */
#ifndef SUPINE_LABELS_MASK_H
#define SUPINE_LABELS_MASK_H

#include <stdint.h>

#include "mesh/image/image.h"
#include "mesh/labels/labels.h"

/** Voxels with a margin of 0 around what is not. */
typedef struct labels_mask {
  size_t size[3];
  double origin[3];  /**< centre of voxel 0, mm, LPS */
  double step[3][3]; /**< mm, LPS */
  double spacing[3]; /**< the steps' lengths, mm */
  uint8_t *at;       /**< [size[2], size[1], size[0]] */
} labels_mask;

enum { LABELS_LEFT = 1, LABELS_RIGHT = 2, LABELS_EITHER = 3 }; /* values of a mask of both lungs */

/* ---- mask.c ---- */
size_t supine_labels_mask_count(const labels_mask *mask);
double supine_labels_voxel_ml(const labels_mask *mask);
/** A new mask of the voxels of one value, as 1, with `margin` voxels around them; empty (at NULL)
 * where there is none. @retval SUPINE_ERROR_MEMORY */
supine_status supine_labels_mask_extract(const labels_mask *from, uint8_t value, size_t margin,
                                         labels_mask *mask);
/** Where a voxel of `mask` is in `other`, of the same frame: its offset, in voxels. */
void supine_labels_mask_offset(const labels_mask *mask, const labels_mask *other, long offset[3]);
void supine_labels_mask_free(labels_mask *mask);
/** A position in voxels as mm. */
void supine_labels_mask_place(const labels_mask *mask, const double voxel[3], double place[3]);

/* ---- count.c, convention.c: which label is whose ---- */

enum { LABELS_MAX = 65536, LABELS_MARGIN = 2 };

/** The voxels of one label. */
typedef struct labels_tally {
  uint64_t count;
  uint64_t sum[3]; /**< of their indices */
  uint32_t low[3], high[3];
} labels_tally;

/** Labels [count] of one row of an image; false where a voxel is none, `bad` then what it is. */
bool supine_labels_row(const supine_image *image, size_t row, uint16_t *labels, double *bad);
/** @param tally  [LABELS_MAX], written */
supine_status supine_labels_count(const char *path, const supine_image *image, labels_tally *tally,
                                  supine_error *error);
typedef struct labels_choice {
  char *taken;  /**< [256] "labels 1 right, 2 left", written */
  bool doubted; /**< the header does not put the lungs beside each other, left on the left */
} labels_choice;

/** @param side  [LABELS_MAX], written: 0, LABELS_LEFT, ... */
supine_status supine_labels_choose(const char *path, const supine_image *image,
                                   const labels_tally *tally, const char *wanted, uint8_t *side,
                                   labels_choice *choice, supine_error *error);

/** The box of voxels low to high of an image that was counted, with LABELS_MARGIN around it; at
 * NULL and SUPINE_ERROR_MEMORY where there is no memory.
 * @param value  [LABELS_MAX] of each label in the mask */
supine_status supine_labels_mask_cut(const supine_image *image, const size_t low[3],
                                     const size_t high[3], const uint8_t *value, labels_mask *mask);

/* ---- pieces.c: pieces of equal voxels that share faces ---- */

typedef struct labels_run {
  uint32_t begin, end, parent;
} labels_run;

typedef struct labels_piece {
  uint64_t count;
  double sum[3]; /**< of indices */
} labels_piece;

typedef struct labels_pieces {
  size_t run_count;
  size_t *row;         /**< [rows + 1] first run of each row of voxels */
  labels_run *run;     /**< parent: of a finished one, its piece's first run */
  labels_piece *piece; /**< [run_count] of each piece's first run; others are 0 */
  size_t piece_count;
} labels_pieces;

/** The pieces of voxels that are 0, or of those that are not. */
supine_status supine_labels_pieces_find(const labels_mask *mask, bool zero, labels_pieces *pieces);
void supine_labels_pieces_free(labels_pieces *pieces);
/** Keeps the largest piece, and fills what the outside does not reach. Voxels dropped, filled. */
supine_status supine_labels_keep_largest(labels_mask *mask, size_t *islands, size_t *dropped);
supine_status supine_labels_fill_cavities(labels_mask *mask, size_t *cavities, size_t *filled);

/* ---- distance.c ---- */

/** Squared distances, mm^2, from every voxel's centre to the nearest of a value (`zero`: of 0;
 * else of any other than 0). The steps count as if they were at right angles.
 * @param squares  [size], written */
supine_status supine_labels_distance(const labels_mask *mask, bool zero, float *squares);
/** Closes: all that a ball of this radius, mm, cannot reach from outside. The margin must be
 * wider. */
supine_status supine_labels_close(labels_mask *mask, double radius, size_t *added);

/* ---- part.c ---- */

/** Makes LABELS_EITHER left or right.
 * @param neck  mm, written: how wide the widest neck was that was cut, 0: there was none
 * @retval SUPINE_ERROR_MESH  it is one lung, or cannot be told to be two */
supine_status supine_labels_part(const char *path, labels_mask *both, double *neck,
                                 supine_error *error);

/* ---- cubes.c ---- */

/** How much of each cube is lung. */
typedef struct labels_cubes {
  size_t size[3];
  double origin[3]; /**< centre of cube 0, in voxels of the mask */
  double ratio[3];  /**< voxels a cube */
  float *share;     /**< [size], 0 to 1; a layer of 0 around it all */
} labels_cubes;

/** @param one  keeps the largest piece, without cavities */
supine_status supine_labels_cubes_create(const labels_mask *mask, double edge, bool one,
                                         labels_cubes *cubes);
void supine_labels_cubes_free(labels_cubes *cubes);

/* ---- net.c, relax.c ---- */

#define LABELS_NONE UINT32_MAX

/** A surface net: a vertex in each cell between eight cubes that are not all inside or out. */
typedef struct labels_net {
  size_t count;
  uint32_t (*cell)[3];      /**< of each vertex, its lowest cube */
  double (*at)[3];          /**< within it, 0 to 1 along each axis */
  uint32_t (*neighbour)[6]; /**< through its faces: -x, +x, -y, ...; or LABELS_NONE */
  size_t quad_count;
  uint32_t (*quad)[4]; /**< outwards where the map's axes are right-handed */
} labels_net;

supine_status supine_labels_net_create(const labels_cubes *cubes, labels_net *net);
void supine_labels_net_free(labels_net *net);
/** Smooths; every vertex stays in its cell. */
supine_status supine_labels_net_relax(labels_net *net);
/** Takes back vertices that are farther than `limit` mm from the mask's surface, as far as where
 * they were `before`. Returns the farthest, mm. */
double supine_labels_net_hold(labels_net *net, const double (*before)[3], const labels_cubes *cubes,
                              const labels_mask *mask, double limit);
/** Triangles, in mm. */
supine_status supine_labels_net_mesh(const labels_net *net, const labels_cubes *cubes,
                                     const labels_mask *mask, supine_mesh *mesh);

/* ---- surface.c ---- */

/** The net of a mask's cubes, of `one` piece or of all, smoothed and held to it within `held` mm,
 * which is half a voxel; the farthest vertex is so many mm from it. */
supine_status supine_labels_mask_surface(const labels_mask *mask, double edge, bool one,
                                         double *held, double *farthest, supine_mesh *mesh);

/* ---- anatomy.c ---- */

/** "i to the left, j to the back, k to the head" */
void supine_labels_axes(const double step[3][3], char *text, size_t size);

#endif
