/* SPDX-License-Identifier: MIT */
/* Average a mask over a grid of cubes. A cube is inside if at least half of it is in the mask. Fill
 * more cubes until no two cubes inside, and no two outside, meet only in an edge or a corner. The
 * surface between cubes inside and outside is then a manifold [Latecki1995]. */
#include <math.h>

#include "mesh/labels/mask.h"

/* LAYERS: layers of empty cubes around the bounding box of the mask. ROUNDS_MAX: most rounds of
 * mending. */
enum { LAYERS = 2, ROUNDS_MAX = 1000 };

/* Average `in` [outer, n, inner] along its middle axis, over intervals of `ratio` voxels, into
 * `out` [outer, m, inner]. Intervals shorter than a voxel are widened to one voxel, so that the
 * averages interpolate linearly between voxel centres. */
static void average(const float *in, size_t outer, size_t n, size_t inner, size_t m, double ratio,
                    float *out) {
  const double width = fmax(1.0, ratio);
  for (size_t o = 0; o < outer; ++o) {
    for (size_t t = 0; t < m; ++t) {
      const double middle = ratio * ((double)t - LAYERS + 0.5) - 0.5;
      const double from = middle - 0.5 * width;
      const double to = middle + 0.5 * width;
      float *line = out + (o * m + t) * inner;
      for (size_t x = 0; x < inner; ++x) {
        line[x] = 0.0F;
      }
      const double first = fmax(0.0, floor(from + 0.5));
      for (double i = first; i - 0.5 < to && i < (double)n; ++i) {
        const double overlap = (fmin(to, i + 0.5) - fmax(from, i - 0.5)) / width;
        const float *source = in + (o * n + (size_t)i) * inner;
        for (size_t x = 0; x < inner && overlap > 0.0; ++x) {
          line[x] += (float)overlap * source[x];
        }
      }
    }
  }
}

/* Average the mask [rows, n] along its rows, like average() does, into `out` [rows, m]. */
static void average_rows(const labels_mask *mask, size_t m, double ratio, float *out) {
  const size_t n = mask->size[0];
  const double width = fmax(1.0, ratio);
  for (size_t row = 0; row < mask->size[1] * mask->size[2]; ++row) {
    const uint8_t *at = mask->at + row * n;
    for (size_t t = 0; t < m; ++t) {
      const double middle = ratio * ((double)t - LAYERS + 0.5) - 0.5;
      const double from = middle - 0.5 * width;
      const double to = middle + 0.5 * width;
      double sum = 0.0;
      for (double i = fmax(0.0, floor(from + 0.5)); i - 0.5 < to && i < (double)n; ++i) {
        sum += at[(size_t)i] != 0 ? fmin(to, i + 0.5) - fmax(from, i - 0.5) : 0.0;
      }
      out[row * m + t] = (float)(sum / width);
    }
  }
}

/* a cube is inside if at least this fraction of it is in the mask */
static const float half = 0.5F;
/* The fraction of a cube in the mask is rounded to a multiple of 1 / levels, so that all processors
 * give the same result. */
static const float levels = 65536.0F;

/* If exactly two of the four cubes around an edge are inside, and they touch only in this edge,
 * fill the fuller of the other two. Return whether a cube was filled. */
static bool mend_edge(float *share, const size_t at[4]) {
  const bool in[4] = {share[at[0]] >= half, share[at[1]] >= half, share[at[2]] >= half,
                      share[at[3]] >= half};
  if (in[0] != in[2] || in[1] != in[3] || in[0] == in[1]) {
    return false;
  }
  const size_t a = at[in[0] ? 1 : 0];
  const size_t b = at[in[0] ? 3 : 2];
  share[share[a] >= share[b] ? a : b] = half;
  return true;
}

/* If exactly two of the eight cubes around a corner are inside, and they touch only in this corner,
 * fill two cubes that connect them. If exactly two are outside and touch only in this corner, fill
 * one of them. Return whether a cube was filled. */
static bool mend_corner(float *share, const size_t at[8]) {
  unsigned inside = 0;
  for (unsigned c = 0; c < 8; ++c) {
    inside |= share[at[c]] >= half ? 1U << c : 0U;
  }
  for (unsigned c = 0; c < 4; ++c) {
    const unsigned opposite = 7 - c;
    const unsigned both = (1U << c) | (1U << opposite);
    if (inside == both) {
      share[at[c ^ 1U]] = half;
      share[at[c ^ 3U]] = half;
      return true;
    }
    if ((inside ^ 0xFFU) == both) {
      share[at[c]] = half;
      return true;
    }
  }
  return false;
}

/* Apply mend_edge and mend_corner everywhere. Return whether a cube was filled. */
static bool mend(const size_t size[3], float *share) {
  const size_t stride[3] = {1, size[0], size[0] * size[1]};
  bool mended = false;
  for (size_t k = 0; k + 1 < size[2]; ++k) {
    for (size_t j = 0; j + 1 < size[1]; ++j) {
      for (size_t i = 0; i + 1 < size[0]; ++i) {
        const size_t cell = i + stride[1] * j + stride[2] * k;
        size_t corner[8];
        size_t in = 0;
        for (size_t c = 0; c < 8; ++c) {
          corner[c] = cell + (c & 1U) + (c >> 1U & 1U) * stride[1] + (c >> 2U) * stride[2];
          in += share[corner[c]] >= half;
        }
        if (in < 2 || in > 6) {
          continue;
        }
        for (size_t a = 0; a < 3; ++a) {
          const size_t b = (a + 1) % 3;
          const size_t c = (a + 2) % 3;
          for (size_t side = 0; side < 2; ++side) {
            const size_t from = cell + side * stride[a];
            const size_t around[4] = {from, from + stride[b], from + stride[b] + stride[c],
                                      from + stride[c]};
            mended = mend_edge(share, around) || mended;
          }
        }
        mended = mend_corner(share, corner) || mended;
      }
    }
  }
  return mended;
}

/* Keep only the largest connected piece of cubes inside the mask, and fill its cavities. */
static supine_status one_piece(labels_cubes *cubes) {
  labels_mask inside = {.size = {cubes->size[0], cubes->size[1], cubes->size[2]}};
  const size_t count = supine_labels_mask_count(&inside);
  size_t pieces = 0;
  size_t changed = 0;
  SUPINE_ARENA arena = {0};
  inside.at = supine_arena_take(&arena, count, 1);
  SUPINE_TRY(supine_arena_status(&arena));
  for (size_t i = 0; i < count; ++i) {
    inside.at[i] = cubes->share[i] >= half;
  }
  SUPINE_TRY(supine_labels_keep_one(&inside, false, &pieces, &changed));
  SUPINE_TRY(supine_labels_keep_one(&inside, true, &pieces, &changed));
  for (size_t i = 0; i < count; ++i) {
    const bool is = cubes->share[i] >= half;
    cubes->share[i] = is == (inside.at[i] != 0) ? cubes->share[i] : is ? 0.0F : half;
  }
  return SUPINE_OK;
}

static supine_status average_cubes(const labels_mask *mask, labels_cubes *cubes) {
  const size_t *n = mask->size;
  const size_t *m = cubes->size;
  SUPINE_ARENA arena = {0};
  float *rows = supine_arena_take(&arena, m[0] * n[1] * n[2], sizeof *rows);
  float *planes = supine_arena_take(&arena, m[0] * m[1] * n[2], sizeof *planes);
  SUPINE_TRY(supine_arena_status(&arena));
  average_rows(mask, m[0], cubes->ratio[0], rows);
  average(rows, n[2], n[1], m[0], m[1], cubes->ratio[1], planes);
  average(planes, 1, n[2], m[0] * m[1], m[2], cubes->ratio[2], cubes->share);
  for (size_t i = 0; i < m[0] * m[1] * m[2]; ++i) {
    cubes->share[i] = rintf(levels * cubes->share[i]) / levels;
  }
  return SUPINE_OK;
}

supine_status supine_labels_cubes_create(const labels_mask *mask, double edge, bool one,
                                         supine_arena *arena, labels_cubes *cubes) {
  for (int a = 0; a < 3; ++a) {
    cubes->ratio[a] = edge / mask->spacing[a];
    cubes->size[a] = (size_t)ceil((double)mask->size[a] / cubes->ratio[a]) + (size_t)2 * LAYERS;
    cubes->origin[a] = cubes->ratio[a] * (0.5 - LAYERS) - 0.5;
  }
  cubes->share =
      supine_arena_take(arena, cubes->size[0] * cubes->size[1] * cubes->size[2], sizeof(float));
  SUPINE_TRY(supine_arena_status(arena));
  SUPINE_TRY(average_cubes(mask, cubes));
  for (int round = 0; round < ROUNDS_MAX; ++round) {
    if (one) {
      SUPINE_TRY(one_piece(cubes));
    }
    if (!mend(cubes->size, cubes->share)) {
      return SUPINE_OK;
    }
  }
  return SUPINE_ERROR_NUMERICAL;
}
