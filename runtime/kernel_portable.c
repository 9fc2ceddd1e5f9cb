/* SPDX-License-Identifier: MIT */
/* Evaluating tiles in C alone, in loops of 16 that a compiler turns into what vectors it has. */
#include "compact.h"
#include "tiles.h"

/* Adds w c_v of one mode to the sums of 16 vertices. */
static inline void add_mode(supine_storage storage, const unsigned char *at, float w,
                            float *restrict sum) {
  if (storage == SUPINE_STORAGE_INT16) {
    int16_t c[TILE];
    memcpy(c, at, sizeof c);
    for (size_t v = 0; v < TILE; ++v) {
      sum[v] += w * (float)c[v];
    }
  } else if (storage == SUPINE_STORAGE_FLOAT16) {
    uint16_t c[TILE];
    memcpy(c, at, sizeof c);
    for (size_t v = 0; v < TILE; ++v) {
      sum[v] += w * half_widen(c[v]);
    }
  } else {
    float c[TILE];
    memcpy(c, at, sizeof c);
    for (size_t v = 0; v < TILE; ++v) {
      sum[v] += w * c[v];
    }
  }
}

/* sum over k of w_k c_vk of 16 vertices. */
static void dot(const supine_tiles *tiles, const unsigned char *at, const float *w, float *sum) {
  const size_t step = tiles->axis_bytes / tiles->modes;
  float total[TILE] = {0};
  for (size_t k = 0; k < tiles->modes; ++k) {
    add_mode(tiles->storage, at + k * step, w[k], total);
  }
  memcpy(sum, total, sizeof total);
}

/* 48 numbers. */
static void widen_numbers(const unsigned char *at, bool compact, uint32_t bias, float *numbers) {
  if (!compact) {
    memcpy(numbers, at, TILE_NUMBERS * sizeof *numbers);
    return;
  }
  for (size_t j = 0; j < TILE_NUMBERS; ++j) {
    uint32_t word = 0; /* and a byte of the next, or of the padding behind the last */
    memcpy(&word, at + 3 * j, sizeof word);
    numbers[j] = float24_widen(word, bias);
  }
}

static void deform_tile(const supine_tiles *tiles, const unsigned char *tile, const float *w,
                        bool rest, float *xyz) {
  const bool compact = supine_tiles_compact(tiles->storage);
  float amount[3][TILE] = {{0}};
  float p[TILE_NUMBERS] = {0};
  for (size_t axis = 0; axis < tiles->axes; ++axis) {
    dot(tiles, tile + axis * tiles->axis_bytes, w, amount[axis]);
  }
  if (rest) {
    widen_numbers(tile + tiles->rest_begin, compact, tiles->rest_bias, p);
  }
  if (tiles->axes == 3) {
    for (size_t v = 0; v < TILE; ++v) {
      for (size_t axis = 0; axis < 3; ++axis) {
        xyz[3 * v + axis] = p[3 * v + axis] + amount[axis][v];
      }
    }
  } else {
    float d[TILE_NUMBERS];
    widen_numbers(tile + tiles->direction_begin, compact, tiles->direction_bias, d);
    for (size_t v = 0; v < TILE; ++v) {
      for (size_t axis = 0; axis < 3; ++axis) {
        xyz[3 * v + axis] = p[3 * v + axis] + amount[0][v] * d[3 * v + axis];
      }
    }
  }
}

static void deform(const supine_tiles *tiles, const float *weights, size_t first, size_t count,
                   const supine_target *target) {
  for (size_t t = 0; t < count; ++t) {
    const unsigned char *tile = tiles->bytes + (first + t) * tiles->stride;
    if (target->y == NULL) {
      deform_tile(tiles, tile, weights, target->rest, target->x + t * TILE_NUMBERS);
    } else {
      float xyz[TILE_NUMBERS];
      deform_tile(tiles, tile, weights, target->rest, xyz);
      for (size_t v = 0; v < TILE; ++v) {
        target->x[t * TILE + v] = xyz[3 * v];
        target->y[t * TILE + v] = xyz[3 * v + 1];
        target->z[t * TILE + v] = xyz[3 * v + 2];
      }
    }
  }
}

/* 16 coefficients of each mode as floats, in the units they are packed in. */
static void widen_coefficients(const supine_tiles *tiles, const unsigned char *at, float *c) {
  for (size_t k = 0; k < tiles->modes; ++k, c += TILE) {
    if (tiles->storage == SUPINE_STORAGE_INT16) {
      int16_t packed[TILE];
      memcpy(packed, at + k * sizeof packed, sizeof packed);
      for (size_t v = 0; v < TILE; ++v) {
        c[v] = packed[v];
      }
    } else if (tiles->storage == SUPINE_STORAGE_FLOAT16) {
      uint16_t half[TILE];
      memcpy(half, at + k * sizeof half, sizeof half);
      for (size_t v = 0; v < TILE; ++v) {
        c[v] = half_widen(half[v]);
      }
    } else {
      memcpy(c, at + k * TILE * sizeof *c, TILE * sizeof *c);
    }
  }
}

static void widen(const supine_tiles *tiles, size_t first, size_t count, supine_tiles *to) {
  const bool compact = supine_tiles_compact(tiles->storage);
  for (size_t t = 0; t < count; ++t) {
    const unsigned char *tile = tiles->bytes + (first + t) * tiles->stride;
    unsigned char *wide = to->bytes + t * to->stride;
    for (size_t axis = 0; axis < tiles->axes; ++axis) {
      widen_coefficients(tiles, tile + axis * tiles->axis_bytes,
                         (float *)(void *)(wide + axis * to->axis_bytes));
    }
    if (tiles->axes == 1) {
      widen_numbers(tile + tiles->direction_begin, compact, tiles->direction_bias,
                    (float *)(void *)(wide + to->direction_begin));
    }
    widen_numbers(tile + tiles->rest_begin, compact, tiles->rest_bias,
                  (float *)(void *)(wide + to->rest_begin));
  }
}

const supine_kernels supine_kernels_portable = {deform, widen};
