/* SPDX-License-Identifier: MIT */
/* Evaluating tiles in C alone, in loops of 16 that a compiler turns into what vectors it has. */
#include "runtime/kernels/compact.h"
#include "runtime/kernels/tiles.h"

/* 16 coefficients of mode k as floats, in the units they are packed in. */
static inline void widen_mode(const supine_tiles *tiles, const unsigned char *at, size_t k,
                              float *restrict c) {
  const supine_storage storage = tiles->storage;
  if (supine_tiles_compact(storage)) {
    const size_t paired = supine_tiles_paired(storage, tiles->modes);
    uint32_t words[TILE];
    memcpy(words, at + supine_tiles_words_begin(paired, k), sizeof words);
    if (k >= paired) {
      for (size_t v = 0; v < TILE; ++v) {
        c[v] = triple_number(words[v], (k - paired) % 3);
      }
    } else {
      for (size_t v = 0; v < TILE; ++v) {
        c[v] = k % 2 == 0 ? pair_first(words[v]) : pair_second(words[v]);
      }
    }
  } else {
    memcpy(c, at + k * TILE * sizeof *c, TILE * sizeof *c);
  }
}

/* sum over k of w_k c_vk of 16 vertices. */
static void dot(const supine_tiles *tiles, const unsigned char *at, const float *w, float *sum) {
  float total[TILE] = {0};
  for (size_t k = 0; k < tiles->modes; ++k) {
    float c[TILE];
    widen_mode(tiles, at, k, c);
    for (size_t v = 0; v < TILE; ++v) {
      total[v] += w[k] * c[v];
    }
  }
  memcpy(sum, total, sizeof total);
}

/* 48 numbers; compact ones in the unit they are packed in. */
static void widen_numbers(const unsigned char *at, bool compact, float *numbers) {
  if (!compact) {
    memcpy(numbers, at, TILE_NUMBERS * sizeof *numbers);
    return;
  }
  uint32_t words[2][TILE];
  memcpy(words, at, sizeof words);
  for (size_t v = 0; v < TILE; ++v) {
    float three[3];
    fixed_widen((const uint32_t[2]){words[0][v], words[1][v]}, three);
    numbers[v] = three[0];
    numbers[TILE + v] = three[1];
    numbers[2 * TILE + v] = three[2];
  }
}

static void widen_rest(const supine_tiles *tiles, const unsigned char *tile, float *p) {
  const bool compact = supine_tiles_compact(tiles->storage);
  widen_numbers(tile + tiles->rest_begin, compact, p);
  for (size_t j = 0; j < TILE_NUMBERS && compact; ++j) {
    p[j] = fixed_scale(p[j], tiles->rest_unit);
  }
}

/* x y z of 16 vertices, each over its length. */
static void normalise(float v[3][TILE]) {
  for (size_t i = 0; i < TILE; ++i) {
    const float square = v[0][i] * v[0][i] + v[1][i] * v[1][i] + v[2][i] * v[2][i];
    const float inverse = square > 0 ? 1 / sqrtf(square) : 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      v[axis][i] *= inverse;
    }
  }
}

static void deform_tile(const supine_tiles *tiles, const unsigned char *tile, const float *w,
                        bool rest, float *xyz) {
  const float *gain = w + tiles->modes;
  float amount[3][TILE] = {{0}};
  float p[TILE_NUMBERS] = {0};
  for (size_t axis = 0; axis < tiles->axes; ++axis) {
    dot(tiles, tile + axis * tiles->axis_bytes, w, amount[axis]);
  }
  if (rest) {
    widen_rest(tiles, tile, p);
  }
  if (tiles->axes == 3) {
    for (size_t v = 0; v < TILE; ++v) {
      for (size_t axis = 0; axis < 3; ++axis) {
        xyz[3 * v + axis] = p[3 * v + axis] + gain[axis] * amount[axis][v];
      }
    }
  } else {
    float d[TILE_NUMBERS];
    widen_numbers(tile + tiles->direction_begin, supine_tiles_compact(tiles->storage), d);
    for (size_t v = 0; v < TILE; ++v) {
      for (size_t axis = 0; axis < 3; ++axis) {
        xyz[3 * v + axis] = p[3 * v + axis] + amount[0][v] * (gain[axis] * d[3 * v + axis]);
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

static void light(const supine_tiles *tiles, const float *weights, size_t first, size_t count,
                  const supine_target *target) {
  const size_t words = supine_tiles_normal_words(tiles->modes);
  for (size_t t = 0; t < count; ++t) {
    const unsigned char *tile = tiles->bytes + (first + t) * tiles->stride;
    float n[3][TILE] = {{0}};
    for (size_t axis = 0; axis < 3; ++axis) {
      for (size_t k = 0; k < 3 * words; ++k) {
        uint32_t word[TILE];
        memcpy(word, tile + axis * tiles->axis_bytes + k % words * sizeof word, sizeof word);
        for (size_t v = 0; v < TILE; ++v) {
          n[axis][v] += weights[k] * normal_number(word[v], k / words);
        }
      }
    }
    normalise(n);
    for (size_t i = 0; i < TILE_NUMBERS; ++i) {
      target->x[t * TILE_NUMBERS + i] = n[i % 3][i / 3];
    }
  }
}

static void widen(const supine_tiles *tiles, size_t first, size_t count, supine_tiles *to) {
  for (size_t t = 0; t < count; ++t) {
    const unsigned char *tile = tiles->bytes + (first + t) * tiles->stride;
    unsigned char *wide = to->bytes + t * to->stride;
    for (size_t axis = 0; axis < tiles->axes; ++axis) {
      float *c = (float *)(void *)(wide + axis * to->axis_bytes);
      for (size_t k = 0; k < tiles->modes; ++k) {
        widen_mode(tiles, tile + axis * tiles->axis_bytes, k, c + k * TILE);
      }
    }
    if (tiles->axes == 1) {
      widen_numbers(tile + tiles->direction_begin, supine_tiles_compact(tiles->storage),
                    (float *)(void *)(wide + to->direction_begin));
    }
    widen_rest(tiles, tile, (float *)(void *)(wide + to->rest_begin));
  }
}

const supine_kernels supine_kernels_portable = {deform, light, widen};
