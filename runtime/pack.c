/* SPDX-License-Identifier: MIT */
/* Pack a basis into tiles of 16 vertices, and bound the quantisation errors. */
#include <math.h>
#include <string.h>

#include "base/clones.h"
#include "runtime/internal.h"
#include "runtime/kernels/compact.h"
#include "runtime/safetensors/safetensors_file.h"

enum {
  FIXED_TOP = INT32_MAX / 4096 * 4096, /* integer that means 1; fixed_narrow() does not clip it */
  FLOAT_FRACTION_BITS = 23
};

/* Data of 16 vertices before packing. Coefficients are [axes, modes, 16], the others [16, 3]. */
typedef struct source {
  float coefficients[3 * SUPINE_MODES_MAX * TILE];
  float direction[TILE_NUMBERS];
  float reference[TILE_NUMBERS];
} source;

/* Quantisation steps and errors, and the vertices being packed. */
typedef struct work {
  double mode[SUPINE_MODES_MAX]; /* quantisation step of the coefficients of each mode, mm */
  double direction;              /* quantisation step of the unit vectors of displacement */
  double reference;              /* quantisation step of reference positions, mm, a power of two */
  float direction_square; /* largest squared quantisation error of a unit vector of displacement */
  float reference_square; /* largest squared quantisation error of a reference position, mm^2 */
  source source;
} work;

/* Replace a number by 0 if products with it could be subnormal numbers, which are slow. */
static float flush(float value) {
  return fabsf(value) < 1e-30F ? 0 : value;
}

/* Return the length of the vector along which vertex i moves, mm, or 1 if the vector is 0 or the
 * basis has none. Compact storages divide the vector by this length and multiply the coefficients
 * by it, so that one quantisation step suits all vertices. */
static double direction_length(const supine_basis *basis, size_t i) {
  double square = 0;
  if (basis->info.direction != NULL) {
    for (size_t axis = 0; axis < 3; ++axis) {
      const double d = (double)basis->info.direction[3 * i + axis];
      square += d * d;
    }
  }
  return square > 0 ? sqrt(square) : 1;
}

static void source_load(const supine_basis *basis, size_t tile, source *from) {
  const bool compact = supine_tiles_compact(basis->tiles.storage);
  const size_t rows = basis->tiles.axes * basis->info.mode_count;
  const size_t begin = tile * TILE;
  const size_t left = basis->info.vertex_count - begin;
  double length[TILE];
  memset(from->direction, 0, sizeof from->direction);
  for (size_t v = 0; v < TILE; ++v) {
    const size_t i = begin + (v < left ? v : left - 1);
    length[v] = compact ? direction_length(basis, i) : 1;
    memcpy(from->reference + 3 * v, basis->info.vertices + 3 * i, 3 * sizeof *from->reference);
    if (basis->info.direction != NULL) {
      memcpy(from->direction + 3 * v, basis->info.direction + 3 * i, 3 * sizeof *from->direction);
    }
    for (size_t row = 0; row < rows; ++row) {
      from->coefficients[row * TILE + v] = basis->info.coefficients[i * rows + row];
    }
  }
  for (size_t j = 0; j < TILE_NUMBERS; ++j) {
    from->direction[j] = (float)((double)from->direction[j] / length[j / 3]);
  }
  for (size_t j = 0; j < rows * TILE; ++j) {
    from->coefficients[j] = flush((float)(length[j % TILE] * (double)from->coefficients[j]));
  }
}

/* For each mode, find the largest product of |coefficient| and direction_length(), mm. */
static void largest_coefficients(const supine_basis *basis, float *top) {
  const size_t modes = basis->info.mode_count;
  const size_t rows = basis->tiles.axes;
  memset(top, 0, modes * sizeof *top);
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

/* Return a quantisation step for numbers up to `top`: the power of two u for which top / u is from
 * 2^30 to 2^31. Limit u so that products with u are normal floats. */
static double reference_step(float top) {
  const int exponent = flush(top) > 0 ? ilogbf(top) - 30 : -130;
  return ldexp(1, exponent < 96 ? exponent : 96);
}

/* Return the number of bits of a packed coefficient of mode k (compact.h). */
static int word_bits(const supine_tiles *tiles, size_t k) {
  const size_t paired = supine_tiles_paired(tiles->storage, tiles->modes);
  if (k < paired) {
    return 16;
  }
  return (k - paired) % 3 == 2 ? 10 : 11;
}

/* Choose the quantisation steps. Bound the displacement and the error of each mode. The error is
 * half of the lowest bit, plus the rounding when a packed word is converted to a float. */
static void choose_steps(supine_basis *basis, work *w) {
  const bool compact = supine_tiles_compact(basis->tiles.storage);
  const double axes = sqrt((double)basis->tiles.axes); /* length of the vector (1, 1, 1) or (1) */
  float top[SUPINE_MODES_MAX];
  float farthest = 0;
  for (size_t i = 0; i < 6 * basis->info.lung_count; ++i) {
    farthest = fmaxf(farthest, fabsf(basis->info.bounds[i]));
  }
  largest_coefficients(basis, top);
  basis->reference_size = sqrt(3) * (double)farthest;
  w->reference = compact ? reference_step(farthest) : 1;
  /* Coordinates are at most 1, as each direction was divided by its length. */
  w->direction = compact && basis->info.direction != NULL ? 1.0 / FIXED_TOP : 1;
  basis->tiles.reference_unit = (uint32_t)ilogb(w->reference) << FLOAT_FRACTION_BITS;
  for (size_t k = 0; k < basis->info.mode_count; ++k) {
    const int bits = word_bits(&basis->tiles, k);
    w->mode[k] = 1;
    if (flush(top[k]) > 0 && compact) { /* the largest coefficient becomes the largest integer */
      w->mode[k] = (double)top[k] / (0x1p31 - ldexp(1, 32 - bits));
    }
    basis->mode_scale[k] = w->mode[k] * w->direction;
    basis->mode_size[k] = axes * (double)top[k];
    basis->mode_error[k] = compact ? axes * w->mode[k] * (ldexp(1, 31 - bits) + 128) : 0;
  }
}

/* Pack the coefficients of 16 vertices on one axis, `rows` [modes, 16]. A word holds three modes,
 * the first of them in the uppermost bits. */
static void pack_coefficients(const supine_tiles *tiles, const double *unit, const float *rows,
                              unsigned char *at) {
  const size_t paired = supine_tiles_paired(tiles->storage, tiles->modes);
  uint32_t words[TILE];
  if (!supine_tiles_compact(tiles->storage)) {
    memcpy(at, rows, tiles->modes * TILE * sizeof *rows);
    return;
  }
  for (size_t k = 0; k < tiles->modes; at += sizeof words) {
    const float *first = rows + k * TILE;
    const float *second = first + TILE;
    const float *third = second + TILE;
    const double *u = unit + k;
    size_t step = 3; /* number of modes in the words */
    if (k < paired) {
      for (size_t v = 0; v < TILE; ++v) {
        words[v] =
            pair_narrow((double)first[v] / u[0], k + 1 < paired ? (double)second[v] / u[1] : 0);
      }
      step = k + 1 < paired ? 2 : 1;
    } else {
      for (size_t v = 0; v < TILE; ++v) {
        words[v] = triple_narrow((double)first[v] / u[0], (double)second[v] / u[1],
                                 (double)third[v] / u[2]);
      }
    }
    memcpy(at, words, sizeof words);
    k += step;
  }
}

/* Pack the coordinates of 16 directions or positions, in quantisation steps of `unit`. Raise
 * *square to the largest squared quantisation error of these vectors, if that is larger. */
static void pack_numbers(const supine_tiles *tiles, double unit, const float *numbers,
                         unsigned char *at, float *square) {
  float error[TILE_NUMBERS];
  uint32_t words[2][TILE];
  if (!supine_tiles_compact(tiles->storage)) {
    memcpy(at, numbers, TILE_NUMBERS * sizeof *numbers);
    return;
  }
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
      error[j * TILE + v] = numbers[j * TILE + v] - (float)((double)widened[j] * unit);
    }
    words[0][v] = two[0];
    words[1][v] = two[1];
  }
  memcpy(at, words, sizeof words);
  for (const float *e = error; e < error + TILE_NUMBERS; e += 3) {
    *square = fmaxf(*square, e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
  }
}

SUPINE_CLONES __attribute__((flatten)) static void pack(const supine_basis *basis, work *w) {
  const supine_tiles *tiles = &basis->tiles;
  source *from = &w->source;
  for (size_t t = 0; t < tiles->count; ++t) {
    unsigned char *tile = tiles->bytes + t * tiles->stride;
    source_load(basis, t, from);
    for (size_t axis = 0; axis < tiles->axes; ++axis) {
      pack_coefficients(tiles, w->mode, from->coefficients + axis * tiles->modes * TILE,
                        tile + axis * tiles->axis_bytes);
    }
    if (tiles->axes == 1) {
      pack_numbers(tiles, w->direction, from->direction, tile + tiles->direction_begin,
                   &w->direction_square);
    }
    pack_numbers(tiles, w->reference, from->reference, tile + tiles->reference_begin,
                 &w->reference_square);
  }
}

supine_status supine_basis_pack(supine_basis *basis, supine_storage storage) {
  supine_tiles *tiles = &basis->tiles;
  work *w = supine_safetensors_allocate(basis->file, sizeof *w);
  supine_safetensors_release(basis->file, tiles->bytes);
  supine_tiles_layout(tiles, storage, basis->info.mode_count, basis->info.vector,
                      (basis->info.vertex_count + TILE - 1) / TILE);
  tiles->bytes = supine_safetensors_allocate(basis->file, tiles->count * tiles->stride);
  if (w == NULL || tiles->bytes == NULL) {
    supine_safetensors_release(basis->file, w);
    return SUPINE_ERROR_MEMORY;
  }
  memset(w, 0, sizeof *w);
  choose_steps(basis, w);
  pack(basis, w);
  for (size_t k = 0; k < tiles->modes; ++k) {
    basis->mode_error[k] += basis->mode_size[k] * sqrt((double)w->direction_square);
  }
  basis->reference_error = sqrt((double)w->reference_square);
  basis->info.storage = storage;
  basis->info.packed = tiles->bytes;
  basis->info.bytes_per_vertex = (double)tiles->stride / TILE;
  supine_safetensors_release(basis->file, w);
  return SUPINE_OK;
}
