/* SPDX-License-Identifier: MIT */
/* Find connected pieces of voxels that share faces, by joining runs of consecutive voxels in rows
 * along x. */
#include <string.h>

#include "mesh/labels/mask.h"

static uint32_t root(labels_run *run, uint32_t i) {
  while (run[i].parent != i) {
    run[i].parent = run[run[i].parent].parent;
    i = run[i].parent;
  }
  return i;
}

/* Unite the connected pieces of two runs. The earlier root becomes the root of both. */
static void unite(labels_run *run, uint32_t a, uint32_t b) {
  a = root(run, a);
  b = root(run, b);
  run[a > b ? a : b].parent = a > b ? b : a;
}

/* Unite the connected pieces of two neighbouring rows, which have the runs [a, a_end) and
 * [b, b_end), wherever two runs overlap. */
static void unite_rows(labels_run *run, size_t a, size_t a_end, size_t b, size_t b_end) {
  while (a < a_end && b < b_end) {
    if (run[a].begin < run[b].end && run[b].begin < run[a].end) {
      unite(run, (uint32_t)a, (uint32_t)b);
    }
    if (run[a].end < run[b].end) {
      ++a;
    } else {
      ++b;
    }
  }
}

/* Find the runs of consecutive zero or nonzero voxels in a row, and return their number. If `run`
 * is NULL, only count them. */
static size_t runs_of_row(const uint8_t *at, size_t size, bool zero, labels_run *run) {
  size_t count = 0;
  for (size_t i = 0; i < size;) {
    const size_t begin = i;
    const bool wanted = (at[i] == 0) == zero;
    while (i < size && ((at[i] == 0) == zero) == wanted) {
      ++i;
    }
    if (wanted) {
      if (run != NULL) {
        run[count] = (labels_run){(uint32_t)begin, (uint32_t)i, 0};
      }
      ++count;
    }
  }
  return count;
}

/* Set the connected piece of every run of voxels. Count the voxels of every piece, and sum their
 * indices along each axis. */
static void measure(const labels_mask *mask, labels_pieces *pieces) {
  for (size_t row = 0; row < mask->size[1] * mask->size[2]; ++row) {
    for (size_t r = pieces->row[row]; r < pieces->row[row + 1]; ++r) {
      labels_run *run = &pieces->run[r];
      run->parent = root(pieces->run, (uint32_t)r);
      labels_piece *piece = &pieces->piece[run->parent];
      const double length = run->end - run->begin;
      pieces->piece_count += piece->count == 0;
      piece->count += run->end - run->begin;
      piece->sum[0] += length * 0.5 * (run->begin + run->end - 1.0);
      piece->sum[1] += length * (double)(row % mask->size[1]);
      piece->sum[2] += length * (double)(row / mask->size[1]);
    }
  }
}

supine_status supine_labels_pieces_find(const labels_mask *mask, bool zero, supine_arena *arena,
                                        labels_pieces *pieces) {
  const size_t rows = mask->size[1] * mask->size[2];
  size_t *first = supine_arena_zeros(arena, rows + 1, sizeof *first);
  if (first == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t row = 0; row < rows; ++row) {
    first[row + 1] =
        first[row] + runs_of_row(mask->at + row * mask->size[0], mask->size[0], zero, NULL);
  }
  const size_t count = first[rows];
  labels_run *run = supine_arena_take(arena, count, sizeof *run);
  *pieces = (labels_pieces){.row = first,
                            .run = run,
                            .run_count = count,
                            .piece = supine_arena_zeros(arena, count + 1, sizeof *pieces->piece)};
  if (arena->failed || count >= UINT32_MAX) {
    return SUPINE_ERROR_MEMORY;
  }
  for (size_t row = 0; row < rows; ++row) {
    (void)runs_of_row(mask->at + row * mask->size[0], mask->size[0], zero, run + first[row]);
    for (size_t r = first[row]; r < first[row + 1]; ++r) {
      run[r].parent = (uint32_t)r;
    }
    if (row % mask->size[1] > 0) {
      unite_rows(run, first[row - 1], first[row], first[row], first[row + 1]);
    }
    if (row >= mask->size[1]) {
      const size_t below = row - mask->size[1];
      unite_rows(run, first[below], first[below + 1], first[row], first[row + 1]);
    }
  }
  measure(mask, pieces);
  return SUPINE_OK;
}

supine_status supine_labels_keep_one(labels_mask *mask, bool zero, size_t *others, size_t *voxels) {
  SUPINE_ARENA arena = {0};
  labels_pieces pieces;
  SUPINE_TRY(supine_labels_pieces_find(mask, zero, &arena, &pieces));
  /* first run of the piece to keep: run 0 for voxels of value 0, as it is in the outer margin */
  uint32_t kept = 0;
  if (!zero) {
    for (size_t r = 1; r < pieces.run_count; ++r) {
      kept = pieces.piece[r].count > pieces.piece[kept].count ? (uint32_t)r : kept;
    }
  }
  *others = pieces.piece_count > 0 ? pieces.piece_count - 1 : 0;
  *voxels = 0;
  for (size_t row = 0; row < mask->size[1] * mask->size[2]; ++row) {
    for (size_t r = pieces.row[row]; r < pieces.row[row + 1]; ++r) {
      const labels_run *run = &pieces.run[r];
      if (run->parent != kept) {
        memset(mask->at + row * mask->size[0] + run->begin, zero, run->end - run->begin);
        *voxels += run->end - run->begin;
      }
    }
  }
  return SUPINE_OK;
}
