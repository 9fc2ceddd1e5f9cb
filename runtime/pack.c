/* SPDX-License-Identifier: MIT */
/* Packing a basis into tiles, and what that costs in accuracy. */
#include <math.h>
#include <stdlib.h>

#include "runtime/internal.h"
#include "runtime/kernels/compact.h"
#include "runtime/safetensors/platform.h"
#include "sh/base/clones.h"

enum {
  FIXED_TOP = INT32_MAX / 4096 * 4096, /* what all of fixed_narrow's numbers reach */
  FLOAT_FRACTION_BITS = 23
};

/* One tile before it is packed: coefficients [axes][K][16], direction and rest [48]. */
typedef struct source {
  float coefficients[3 * SUPINE_MODES_MAX * TILE];
  float direction[TILE_NUMBERS];
  float rest[TILE_NUMBERS];
} source;

/* What one packed unit stands for. */
typedef struct units {
  double mode[SUPINE_MODES_MAX];
  double direction;
  double rest; /* a power of two */
} units;

/* Largest values so far, by place in the tile. */
typedef struct bounds {
  float mode_error[SUPINE_MODES_MAX][TILE], mode_size[SUPINE_MODES_MAX][TILE];
  float rest_error[TILE], rest_size[TILE]; /* squared */
} bounds;

typedef struct work {
  units units;
  bounds bounds;
  source was, is; /* before packing, and after */
} work;

/* Numbers so small that products with them would be subnormal, and slow. */
static float flush(float value) {
  return fabsf(value) < 1e-30F ? 0 : value;
}

/* By what a vertex's direction is divided and its coefficients multiplied, so that directions are
 * of length 1 and coefficients in mm, and one unit suits all vertices; 1 where the storage is
 * exact. */
static double direction_length(const supine_basis *basis, size_t i) {
  if (!supine_tiles_compact(basis->tiles.storage) || basis->info.direction == NULL) {
    return 1;
  }
  double square = 0;
  for (size_t axis = 0; axis < 3; ++axis) {
    const double d = (double)basis->info.direction[3 * i + axis];
    square += d * d;
  }
  return square > 0 ? sqrt(square) : 1;
}

static void source_load(const supine_basis *basis, size_t tile, source *from) {
  const size_t rows = basis->tiles.axes * basis->info.mode_count;
  const size_t begin = tile * TILE;
  const size_t left = basis->info.vertex_count - begin;
  double length[TILE];
  memset(from->direction, 0, sizeof from->direction);
  for (size_t v = 0; v < TILE; ++v) {
    const size_t i = begin + (v < left ? v : left - 1);
    length[v] = direction_length(basis, i);
    memcpy(from->rest + 3 * v, basis->info.vertices + 3 * i, 3 * sizeof *from->rest);
    if (basis->info.direction != NULL) {
      memcpy(from->direction + 3 * v, basis->info.direction + 3 * i, 3 * sizeof *from->direction);
    }
    for (size_t row = 0; row < rows; ++row) {
      from->coefficients[row * TILE + v] = basis->info.coefficients[i * rows + row];
    }
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    for (size_t v = 0; v < TILE; ++v) {
      float *component = &from->direction[3 * v + axis];
      *component = (float)((double)*component / length[v]);
    }
  }
  for (size_t row = 0; row < rows; ++row) {
    float *values = from->coefficients + row * TILE;
    for (size_t v = 0; v < TILE; ++v) {
      values[v] = flush((float)(length[v] * (double)values[v]));
    }
  }
}

static float largest(const float *values, size_t count) {
  float top = 0;
  for (size_t i = 0; i < count; ++i) {
    const float size = fabsf(values[i]);
    top = size > top ? size : top;
  }
  return top;
}

static void largest_coefficients(const supine_basis *basis, float *top) {
  const size_t modes = basis->info.mode_count;
  const size_t rows = basis->tiles.axes;
  for (size_t k = 0; k < modes; ++k) {
    top[k] = 0;
  }
  for (size_t i = 0; i < basis->info.vertex_count; ++i) {
    const double length = direction_length(basis, i);
    for (size_t row = rows * i; row < rows * (i + 1); ++row) {
      for (size_t k = 0; k < modes; ++k) {
        const float size =
            (float)(length * fabs((double)basis->info.coefficients[row * modes + k]));
        top[k] = size > top[k] ? size : top[k];
      }
    }
  }
}

/* 2^e such that `top` is about 2^31 of it, within what fixed_scale can do. */
static double fixed_unit(float top) {
  const int exponent = flush(top) > 0 ? ilogbf(top) - 30 : -130;
  return ldexp(1, exponent < 96 ? exponent : 96);
}

/* Bits of a coefficient of mode k that shares a word (compact.h); 0 where it shares none. */
static int word_bits(const supine_tiles *tiles, size_t k) {
  const size_t paired = supine_tiles_paired(tiles->storage, tiles->modes);
  if (!supine_tiles_compact(tiles->storage)) {
    return 0;
  }
  return k < paired ? 16 : (k - paired) % 3 == 2 ? 10 : 11;
}

static void choose_units(supine_basis *basis, units *u) {
  const bool compact = supine_tiles_compact(basis->tiles.storage);
  u->rest = compact ? fixed_unit(largest(basis->info.vertices, 3 * basis->info.vertex_count)) : 1;
  u->direction = compact && basis->info.direction != NULL ? 1.0 / FIXED_TOP : 1; /* of length 1 */
  basis->tiles.rest_unit = (uint32_t)ilogb(u->rest) << FLOAT_FRACTION_BITS;
  float top[SUPINE_MODES_MAX];
  largest_coefficients(basis, top);
  for (size_t k = 0; k < basis->info.mode_count; ++k) {
    const int bits = word_bits(&basis->tiles, k);
    u->mode[k] = 1;
    if (flush(top[k]) > 0 && bits > 0) { /* the largest fills the upper bits of a word */
      u->mode[k] = (double)top[k] / (0x1p31 - ldexp(1, 32 - bits));
    }
    basis->mode_scale[k] = u->mode[k] * u->direction;
  }
}

/* Packs two rows of 16 coefficients, the second of which may be missing; leaves in them what they
 * now stand for. */
static void pack_pair(const double *unit, float *first, float *second, unsigned char *at) {
  uint32_t words[TILE];
  for (size_t v = 0; v < TILE; ++v) {
    words[v] =
        pair_narrow((double)first[v] / unit[0], second != NULL ? (double)second[v] / unit[1] : 0);
    first[v] = (float)((double)pair_first(words[v]) * unit[0]);
    if (second != NULL) {
      second[v] = (float)((double)pair_second(words[v]) * unit[1]);
    }
  }
  memcpy(at, words, sizeof words);
}

/* The same for three rows: the first has the uppermost bits, as its numbers tend to be largest. */
static void pack_triple(const double *unit, float *rows, unsigned char *at) {
  uint32_t words[TILE];
  for (size_t v = 0; v < TILE; ++v) {
    float *first = rows + v;
    float *second = rows + TILE + v;
    float *third = rows + (size_t)2 * TILE + v;
    words[v] = triple_narrow((double)*first / unit[0], (double)*second / unit[1],
                             (double)*third / unit[2]);
    *first = (float)((double)triple_number(words[v], 0) * unit[0]);
    *second = (float)((double)triple_number(words[v], 1) * unit[1]);
    *third = (float)((double)triple_number(words[v], 2) * unit[2]);
  }
  memcpy(at, words, sizeof words);
}

static void pack_words(const supine_tiles *tiles, const units *u, float *rows, unsigned char *at) {
  const size_t paired = supine_tiles_paired(tiles->storage, tiles->modes);
  const size_t line = TILE * sizeof(uint32_t);
  for (size_t k = 0; k < paired; k += 2, at += line) {
    float *row = rows + k * TILE;
    pack_pair(u->mode + k, row, k + 1 < paired ? row + TILE : NULL, at);
  }
  for (size_t k = paired; k < tiles->modes; k += 3, at += line) {
    pack_triple(u->mode + k, rows + k * TILE, at);
  }
}

/* Packs rows of 16 coefficients of one axis; leaves in `rows` what they now stand for. */
static void pack_coefficients(const supine_tiles *tiles, const units *u, float *rows,
                              unsigned char *at) {
  if (supine_tiles_compact(tiles->storage)) {
    pack_words(tiles, u, rows, at);
  } else {
    memcpy(at, rows, tiles->modes * TILE * sizeof *rows);
  }
}

/* Packs 48 numbers; leaves there what they now stand for. */
static void pack_numbers(const supine_tiles *tiles, double unit, float *numbers,
                         unsigned char *at) {
  if (!supine_tiles_compact(tiles->storage)) {
    memcpy(at, numbers, TILE_NUMBERS * sizeof *numbers);
    return;
  }
  uint32_t words[2][TILE];
  for (size_t v = 0; v < TILE; ++v) {
    double three[3];
    uint32_t two[2];
    float widened[3];
    for (size_t j = 0; j < 3; ++j) {
      three[j] = (double)numbers[j * TILE + v] / unit;
    }
    fixed_narrow(three, two);
    fixed_widen(two, widened);
    for (size_t j = 0; j < 3; ++j) {
      numbers[j * TILE + v] = (float)((double)widened[j] * unit);
    }
    words[0][v] = two[0];
    words[1][v] = two[1];
  }
  memcpy(at, words, sizeof words);
}

static void raise_to(float *top, const float *values) {
  for (size_t v = 0; v < TILE; ++v) {
    top[v] = values[v] > top[v] ? values[v] : top[v];
  }
}

/* The squared lengths of 16 vectors. */
static void squares(const float *xyz, float *square) {
  for (size_t v = 0; v < TILE; ++v) {
    const float *p = xyz + 3 * v;
    square[v] = p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
  }
}

static void roots(float *values) {
#pragma GCC unroll 1 /* else it is taken apart before it is made a vector */
  for (size_t v = 0; v < TILE; ++v) {
    values[v] = sqrtf(values[v]);
  }
}

/* Raises the bounds to what this tile needs, `was` before packing and `is` after. With one axis,
 * |c d - c' d'| <= |c - c'| |d| + |c'| |d - d'|; a vector's length is over its three axes. */
static void measure(const supine_tiles *tiles, const source *was, const source *is, bounds *top) {
  float difference[TILE_NUMBERS];
  float length[TILE];
  float slip[TILE];
  float value[TILE];
  for (size_t j = 0; j < TILE_NUMBERS; ++j) {
    difference[j] = was->rest[j] - is->rest[j];
  }
  squares(difference, value);
  raise_to(top->rest_error, value);
  squares(was->rest, value);
  raise_to(top->rest_size, value);
  for (size_t j = 0; j < TILE_NUMBERS; ++j) {
    difference[j] = was->direction[j] - is->direction[j];
  }
  squares(difference, slip);
  squares(was->direction, length);
  roots(length);
  for (size_t v = 0; v < TILE && tiles->axes == 3; ++v) {
    length[v] = 1;
  }
  roots(slip);
  const size_t modes = tiles->modes;
  for (size_t k = 0; k < modes; ++k) {
    float apart[TILE] = {0};
    float size[TILE] = {0};
    for (size_t axis = 0; axis < tiles->axes; ++axis) {
      const float *c = was->coefficients + (axis * modes + k) * TILE;
      const float *packed = is->coefficients + (axis * modes + k) * TILE;
#pragma GCC unroll 1 /* likewise */
      for (size_t v = 0; v < TILE; ++v) {
        apart[v] += (c[v] - packed[v]) * (c[v] - packed[v]);
        size[v] += c[v] * c[v];
      }
    }
    roots(apart);
    roots(size);
    for (size_t v = 0; v < TILE; ++v) {
      apart[v] = apart[v] * length[v] + size[v] * slip[v];
      size[v] *= length[v];
    }
    raise_to(top->mode_error[k], apart);
    raise_to(top->mode_size[k], size);
  }
}

unsigned char *supine_tiles_allocate(size_t bytes) {
  unsigned char *memory = supine_platform_allocate(bytes);
  if (memory != NULL) {
    memset(memory, 0, bytes);
  }
  return memory;
}

SUPINE_CLONES __attribute__((flatten)) static void pack(const supine_basis *basis, work *w) {
  const supine_tiles *tiles = &basis->tiles;
  source *is = &w->is;
  for (size_t t = 0; t < tiles->count; ++t) {
    unsigned char *tile = tiles->bytes + t * tiles->stride;
    source_load(basis, t, &w->was);
    memcpy(is->coefficients, w->was.coefficients,
           tiles->axes * tiles->modes * TILE * sizeof(float));
    memcpy(is->direction, w->was.direction, sizeof is->direction);
    memcpy(is->rest, w->was.rest, sizeof is->rest);
    for (size_t axis = 0; axis < tiles->axes; ++axis) {
      pack_coefficients(tiles, &w->units, is->coefficients + axis * tiles->modes * TILE,
                        tile + axis * tiles->axis_bytes);
    }
    if (tiles->axes == 1) {
      pack_numbers(tiles, w->units.direction, is->direction, tile + tiles->direction_begin);
    }
    pack_numbers(tiles, w->units.rest, is->rest, tile + tiles->rest_begin);
    measure(tiles, &w->was, is, &w->bounds);
  }
}

supine_status supine_basis_pack(supine_basis *basis, supine_storage storage) {
  supine_tiles *tiles = &basis->tiles;
  const size_t count = (basis->info.vertex_count + TILE - 1) / TILE;
  work *w = calloc(1, sizeof *w);
  supine_platform_free(tiles->bytes);
  supine_tiles_layout(tiles, storage, basis->info.mode_count, basis->info.vector, count);
  tiles->bytes = supine_tiles_allocate(count * tiles->stride);
  if (w == NULL || tiles->bytes == NULL) {
    free(w);
    return SUPINE_ERROR_MEMORY;
  }
  choose_units(basis, &w->units);
  pack(basis, w);
  for (size_t k = 0; k < tiles->modes; ++k) {
    basis->mode_error[k] = (double)largest(w->bounds.mode_error[k], TILE);
    basis->mode_size[k] = (double)largest(w->bounds.mode_size[k], TILE);
  }
  basis->rest_error = sqrt((double)largest(w->bounds.rest_error, TILE));
  basis->rest_size = sqrt((double)largest(w->bounds.rest_size, TILE));
  basis->info.storage = storage;
  basis->info.packed = tiles->bytes;
  basis->info.bytes_per_vertex = (double)tiles->stride / TILE;
  free(w);
  return SUPINE_OK;
}
