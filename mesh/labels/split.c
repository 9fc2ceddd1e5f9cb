/* SPDX-License-Identifier: MIT */
/* Split a mask of two lungs. Where they touch, erode the mask until it falls into two connected
 * pieces beside each other. Then assign each voxel to the nearer piece. */
#include <math.h>
#include <string.h>

#include "base/remedy.h"

#include "mesh/labels/mask.h"

/* Smallest accepted ratio of the smaller lung's volume to the larger lung's volume. */
static const double least_share = 0.1;
/* A bridge between touching lungs is cut if it is at most this wide, mm. */
static const double widest_neck = 40.0;

/* Find the two largest connected pieces. Return false unless they lie side by side along x, and the
 * smaller one has at least `least_share` of the volume of the larger one.
 * @param found  written: index of the first run of voxels of each piece, left piece first */
static bool find_pair(const labels_mask *mask, const labels_pieces *pieces, uint32_t found[2]) {
  uint32_t top[2] = {0, 0};
  for (uint32_t r = 1; r < pieces->run_count; ++r) {
    if (pieces->piece[r].count > pieces->piece[top[0]].count) {
      top[1] = top[0];
      top[0] = r;
    } else if (top[1] == top[0] || pieces->piece[r].count > pieces->piece[top[1]].count) {
      top[1] = r;
    }
  }
  const double counts[2] = {(double)pieces->piece[top[0]].count,
                            (double)pieces->piece[top[1]].count};
  if (top[0] == top[1] || counts[1] < least_share * counts[0]) {
    return false;
  }
  double centre[2][3];
  for (int p = 0; p < 2; ++p) {
    const labels_piece *piece = &pieces->piece[top[p]];
    const double voxel[3] = {piece->sum[0] / counts[p], piece->sum[1] / counts[p],
                             piece->sum[2] / counts[p]};
    supine_labels_mask_place(mask, voxel, centre[p]);
  }
  const double apart = centre[0][0] - centre[1][0];
  found[0] = top[apart < 0.0];
  found[1] = top[apart >= 0.0];
  return fabs(apart) > fabs(centre[0][1] - centre[1][1]) &&
         fabs(apart) > fabs(centre[0][2] - centre[1][2]);
}

/* Set `eroded` to 1 at voxels that lie deeper than `depth`, mm, in the mask, and to 0 elsewhere.
 * @param squares  squared depth of each voxel, mm^2; not read if `depth` is 0 */
static void erode(const labels_mask *both, const float *squares, double depth, uint8_t *eroded) {
  const size_t count = supine_labels_mask_count(both);
  for (size_t i = 0; i < count; ++i) {
    eroded[i] = both->at[i] != 0 && (depth == 0.0 || sqrt((double)squares[i]) > depth);
  }
}

/* Mark the voxels of two pieces as LABELS_LEFT and LABELS_RIGHT, all others as 0. */
static void mark_pair(const labels_mask *mask, const labels_pieces *pieces, const uint32_t found[2],
                      uint8_t *marks) {
  memset(marks, 0, supine_labels_mask_count(mask));
  for (size_t row = 0; row < mask->size[1] * mask->size[2]; ++row) {
    for (size_t r = pieces->row[row]; r < pieces->row[row + 1]; ++r) {
      const labels_run *run = &pieces->run[r];
      uint8_t mark = 0;
      if (run->parent == found[0]) {
        mark = LABELS_LEFT;
      } else if (run->parent == found[1]) {
        mark = LABELS_RIGHT;
      }
      memset(marks + row * mask->size[0] + run->begin, mark, run->end - run->begin);
    }
  }
}

/* Assign every voxel of the mask to the nearer of the two pieces marked in `marks`.
 * @param squares  [voxels] work space */
static supine_status share_out(labels_mask *both, uint8_t *marks, float *squares) {
  const size_t count = supine_labels_mask_count(both);
  labels_mask one = *both;
  SUPINE_ARENA arena = {0};
  float *other = supine_arena_take(&arena, count, sizeof *other);
  one.at = supine_arena_take(&arena, count, 1);
  SUPINE_TRY(supine_arena_status(&arena));
  for (uint8_t value = LABELS_LEFT; value <= LABELS_RIGHT; ++value) {
    for (size_t i = 0; i < count; ++i) {
      one.at[i] = marks[i] == value;
    }
    SUPINE_TRY(supine_labels_distance(&one, false, value == LABELS_LEFT ? squares : other));
  }
  for (size_t i = 0; i < count; ++i) {
    if (both->at[i] != 0) {
      both->at[i] = squares[i] <= other[i] ? LABELS_LEFT : LABELS_RIGHT;
    }
  }
  return SUPINE_OK;
}

supine_status supine_labels_split(const char *path, labels_mask *both, double *neck,
                                  supine_error *error) {
  const size_t count = supine_labels_mask_count(both);
  const double step = fmax(both->spacing[0], fmax(both->spacing[1], both->spacing[2]));
  SUPINE_ARENA arena = {0};
  float *squares = supine_arena_take(&arena, count, sizeof *squares);
  labels_mask eroded = *both;
  eroded.at = supine_arena_take(&arena, count, 1);
  SUPINE_TRY(supine_arena_status(&arena));
  for (double depth = 0.0; 2.0 * depth <= widest_neck; depth += step) {
    SUPINE_ARENA pass = {0};
    labels_pieces pieces;
    uint32_t found[2];
    if (depth == step) { /* first erosion: compute the depth of each voxel */
      SUPINE_TRY(supine_labels_distance(both, true, squares));
    }
    erode(both, squares, depth, eroded.at);
    SUPINE_TRY(supine_labels_pieces_find(&eroded, false, &pass, &pieces));
    if (pieces.run_count == 0 || !find_pair(both, &pieces, found)) {
      continue;
    }
    *neck = 2.0 * depth;
    mark_pair(both, &pieces, found, eroded.at);
    if (depth > 0.0 || pieces.piece_count > 2) { /* not all voxels are in the two pieces */
      supine_arena_free(&pass);
      return share_out(both, eroded.at, squares);
    }
    memcpy(both->at, eroded.at, count);
    return SUPINE_OK;
  }
  (void)supine_error_set(
      error, SUPINE_ERROR_MESH,
      "%s: cannot split the mask into two lungs: erosion leaves no two pieces beside each other",
      path);
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
      supine_remedy_such_as("labels", "left=1", "if it is one lung")};
  supine_error_advise(error, advice);
  return SUPINE_ERROR_MESH;
}
