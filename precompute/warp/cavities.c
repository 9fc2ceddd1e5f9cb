/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find the cavities of soft tissue in an image: air that soft tissue encloses. */
#include <stdlib.h>

#include "base/arena.h"
#include "mesh/compact.h"
#include "precompute/warp/tissue.h"

/* Voxels begin <= i < end of a row that are not soft, and the run that names their component. */
typedef struct run {
  size_t begin, end;
  size_t parent;
  size_t count; /* voxels of the component, for the run that names it */
} run;

typedef struct runs {
  run *list;
  size_t count, room;
  size_t *first; /* [rows + 1] first run of each row */
} runs;

static bool is_soft(unsigned char voxel) {
  return (voxel & SUPINE_TISSUE_STAGE) == SUPINE_TISSUE_SOFT;
}

static bool add_run(runs *r, size_t begin, size_t end) {
  if (r->count == r->room) {
    run *grown = realloc(r->list, (2 * r->room + 1024) * sizeof *grown);
    if (grown == NULL) {
      return false;
    }
    r->list = grown;
    r->room = 2 * r->room + 1024;
  }
  r->list[r->count] = (run){begin, end, r->count, 0};
  ++r->count;
  return true;
}

/* Find the runs of all rows. */
static bool find_runs(const supine_image *kind, runs *r) {
  const unsigned char *voxel = kind->values;
  const size_t width = kind->size[0];
  const size_t rows = kind->size[1] * kind->size[2];
  r->first = malloc((rows + 1) * sizeof *r->first);
  if (r->first == NULL) {
    return false;
  }
  for (size_t row = 0; row < rows; ++row) {
    const unsigned char *at = voxel + row * width;
    r->first[row] = r->count;
    for (size_t i = 0; i < width; ++i) {
      const size_t begin = i;
      while (i < width && !is_soft(at[i])) {
        ++i;
      }
      if (i > begin && !add_run(r, begin, i)) {
        return false;
      }
    }
  }
  r->first[rows] = r->count;
  return true;
}

static size_t root_of(runs *r, size_t i) {
  while (r->list[i].parent != i) {
    r->list[i].parent = r->list[r->list[i].parent].parent;
    i = r->list[i].parent;
  }
  return i;
}

/* Join the runs of two rows that share a face. */
static void join_rows(runs *r, size_t row, size_t other) {
  size_t a = r->first[row];
  size_t b = r->first[other];
  while (a < r->first[row + 1] && b < r->first[other + 1]) {
    if (r->list[a].begin < r->list[b].end && r->list[b].begin < r->list[a].end) {
      r->list[root_of(r, a)].parent = root_of(r, b);
    }
    if (r->list[a].end < r->list[b].end) {
      ++a;
    } else {
      ++b;
    }
  }
}

/* Join the runs of neighbouring rows, and count the voxels of each component. */
static void join_all(const supine_image *kind, runs *r) {
  const size_t *size = kind->size;
  for (size_t row = 0; row < size[1] * size[2]; ++row) {
    if (row % size[1] > 0) {
      join_rows(r, row, row - 1);
    }
    if (row >= size[1]) {
      join_rows(r, row, row - size[1]);
    }
  }
  for (size_t i = 0; i < r->count; ++i) {
    r->list[root_of(r, i)].count += r->list[i].end - r->list[i].begin;
  }
}

/* Make the components soft that are as small as compact parts. */
static void fill_small(supine_image *kind, runs *r) {
  const double most = SUPINE_COMPACT_MOST_ML / supine_warp_tissue_voxel(kind);
  const size_t rows = kind->size[1] * kind->size[2];
  for (size_t row = 0; row < rows; ++row) {
    unsigned char *voxel = (unsigned char *)kind->values + row * kind->size[0];
    for (size_t i = r->first[row]; i < r->first[row + 1]; ++i) {
      if ((double)r->list[root_of(r, i)].count < most) {
        for (size_t k = r->list[i].begin; k < r->list[i].end; ++k) {
          voxel[k] = (unsigned char)((voxel[k] & ~(unsigned)SUPINE_TISSUE_STAGE) |
                                     SUPINE_TISSUE_SOFT);
        }
      }
    }
  }
}

supine_status supine_warp_tissue_fill(supine_image *kind, supine_error *error) {
  runs r = {.count = 0};
  const bool good = find_runs(kind, &r);
  if (good) {
    join_all(kind, &r);
    fill_small(kind, &r);
  }
  free(r.list);
  free(r.first);
  return good ? SUPINE_OK : supine_error_memory(error, "cavities of soft tissue");
}
