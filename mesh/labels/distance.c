/* SPDX-License-Identifier: MIT */
/* Compute the exact squared distance from every voxel to the nearest voxel of a set, axis by axis
 * [Felzenszwalb2012]. Along the first axis, count voxels. Along each other axis, take the minimum
 * over y of (x - y)^2 + f(y), where f is the result so far: a lower envelope of parabolas. */
#include <math.h>

#include "base/parallel.h"
#include "mesh/labels/mask.h"

static const float far_away = 1e30F; /* stands for an infinite squared distance, mm^2 */

typedef struct sweep {
  const labels_mask *mask;
  bool zero; /* whether to find distances to zero voxels instead of nonzero voxels */
  float *squares;
  int axis;
  size_t length; /* larger of the mask's size[1] and size[2] */
  double *space; /* [threads, 3, length + 2] work space of each thread */
} sweep;

static void along_rows(void *context, size_t begin, size_t end, size_t thread) {
  const sweep *s = context;
  const size_t size = s->mask->size[0];
  const float step = (float)s->mask->spacing[0];
  (void)thread;
  for (size_t row = begin; row < end; ++row) {
    const uint8_t *at = s->mask->at + row * size;
    float *out = s->squares + row * size;
    float last = INFINITY;
    for (size_t i = 0; i < size; ++i) {
      last = (at[i] == 0) == s->zero ? 0.0F : last + step;
      out[i] = last;
    }
    last = INFINITY;
    for (size_t i = size; i-- > 0;) {
      last = (at[i] == 0) == s->zero ? 0.0F : last + step;
      const float nearest = last < out[i] ? last : out[i];
      out[i] = isinf(nearest) ? far_away : nearest * nearest;
    }
  }
}

/* Replace the n values f(x), which are `stride` apart in `line`, by the minimum over y of (x - y)^2
 * + f(y), the lower envelope of parabolas with their lowest points at (y, f(y)). Work space: v
 * holds the index y of each parabola in the envelope; z the x from which that parabola is lowest,
 * mm; f the old values. */
static void envelope(float *line, size_t n, size_t stride, double step, double *v, double *z,
                     double *f) {
  size_t last = 0;
  v[0] = 0.0;
  z[0] = -INFINITY;
  z[1] = INFINITY;
  for (size_t q = 0; q < n; ++q) {
    f[q] = (double)line[q * stride];
  }
  for (size_t q = 1; q < n; ++q) {
    const double x = (double)q * step;
    double meet = 0.0;
    for (;; --last) {
      const double other = v[last] * step;
      meet = (f[q] + x * x - f[(size_t)v[last]] - other * other) / (2.0 * (x - other));
      if (meet > z[last]) {
        break;
      }
    }
    ++last;
    v[last] = (double)q;
    z[last] = meet;
    z[last + 1] = INFINITY;
  }
  last = 0;
  for (size_t q = 0; q < n; ++q) {
    const double x = (double)q * step;
    while (z[last + 1] < x) {
      ++last;
    }
    const double apart = x - v[last] * step;
    line[q * stride] = (float)(apart * apart + f[(size_t)v[last]]);
  }
}

static void along_lines(void *context, size_t begin, size_t end, size_t thread) {
  const sweep *s = context;
  const size_t *size = s->mask->size;
  double *space = s->space + thread * 3 * (s->length + 2);
  const size_t stride = s->axis == 1 ? size[0] : size[0] * size[1];
  for (size_t line = begin; line < end; ++line) {
    const size_t first = s->axis == 1 ? line / size[0] * size[0] * size[1] + line % size[0] : line;
    envelope(s->squares + first, size[s->axis], stride, s->mask->spacing[s->axis], space,
             space + s->length + 2, space + 2 * (s->length + 2));
  }
}

supine_status supine_labels_distance(const labels_mask *mask, bool zero, float *squares) {
  enum { GRAIN = 256 };
  const size_t *size = mask->size;
  const size_t threads = supine_thread_count();
  SUPINE_ARENA arena = {0};
  sweep s = {.mask = mask, .zero = zero, .squares = squares};
  s.length = size[1] > size[2] ? size[1] : size[2];
  s.space = supine_arena_take(&arena, threads * 3 * (s.length + 2), sizeof *s.space);
  SUPINE_TRY(supine_arena_status(&arena));
  supine_parallel_for(size[1] * size[2], GRAIN, threads, along_rows, &s);
  s.axis = 1;
  supine_parallel_for(size[0] * size[2], GRAIN, threads, along_lines, &s);
  s.axis = 2;
  supine_parallel_for(size[0] * size[1], GRAIN, threads, along_lines, &s);
  return SUPINE_OK;
}

supine_status supine_labels_close(labels_mask *mask, double radius, size_t *added) {
  const size_t count = supine_labels_mask_count(mask);
  const float reach = (float)(radius * radius);
  SUPINE_ARENA arena = {0};
  float *squares = supine_arena_take(&arena, count, sizeof *squares);
  *added = 0;
  SUPINE_TRY(supine_arena_status(&arena));
  SUPINE_TRY(supine_labels_distance(mask, false, squares));
  /* set voxels outside the mask, but within `radius` of it, to 2 */
  for (size_t i = 0; i < count; ++i) {
    if (mask->at[i] != 0) {
      mask->at[i] = 1;
    } else if (squares[i] <= reach) {
      mask->at[i] = 2;
    }
  }
  SUPINE_TRY(supine_labels_distance(mask, true, squares));
  for (size_t i = 0; i < count; ++i) {
    const bool stays = mask->at[i] == 1 || (mask->at[i] == 2 && squares[i] > reach);
    *added += stays && mask->at[i] == 2;
    mask->at[i] = stays;
  }
  return SUPINE_OK;
}
