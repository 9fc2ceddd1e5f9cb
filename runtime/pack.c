/* SPDX-License-Identifier: MIT */
/* Packing a basis into tiles, and what that costs in accuracy. */
#include <math.h>
#include <stdlib.h>
#include <sys/mman.h>

#include "compact.h"
#include "internal.h"

enum { INT16_TOP = 32767, HUGE_PAGE = 1 << 21 };

/* One tile before it is packed: coefficients [axes][K][16], direction and rest [48]. */
typedef struct source {
  float coefficients[3 * SUPINE_MODES_MAX * TILE];
  float direction[TILE_NUMBERS];
  float rest[TILE_NUMBERS];
} source;

/* Of each mode what one packed unit stands for, and its inverse. */
typedef struct units {
  float mode[SUPINE_MODES_MAX], inverse[SUPINE_MODES_MAX];
} units;

/* Numbers so small that products with them would be subnormal, and slow. */
static float flush(float value) {
  return fabsf(value) < 1e-30F ? 0 : value;
}

static void source_load(const supine_basis *basis, size_t tile, source *from) {
  const size_t modes = basis->info.mode_count;
  const size_t axes = basis->tiles.axes;
  const size_t begin = tile * TILE;
  const size_t left = basis->info.vertex_count - begin;
  const size_t present = left < TILE ? left : TILE;
  memset(from->direction, 0, sizeof from->direction);
  memset(from->rest, 0, sizeof from->rest);
  memcpy(from->rest, basis->vertices + 3 * begin, 3 * present * sizeof *from->rest);
  if (basis->direction != NULL) {
    memcpy(from->direction, basis->direction + 3 * begin, 3 * present * sizeof *from->direction);
  }
  for (size_t row = 0; row < axes * modes; ++row) {
    for (size_t v = 0; v < TILE; ++v) {
      from->coefficients[row * TILE + v] =
          v < present ? flush(basis->coefficients[(begin + v) * axes * modes + row]) : 0;
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

/* The largest coefficient of each mode. */
static void largest_coefficients(const supine_basis *basis, float *top) {
  const size_t modes = basis->info.mode_count;
  const size_t rows = basis->info.vertex_count * basis->tiles.axes;
  for (size_t k = 0; k < modes; ++k) {
    top[k] = 0;
  }
  for (size_t row = 0; row < rows; ++row) {
    for (size_t k = 0; k < modes; ++k) {
      const float size = fabsf(basis->coefficients[row * modes + k]);
      top[k] = size > top[k] ? size : top[k];
    }
  }
}

/* The bias of 24-bit floats that makes the largest fit (compact.h). */
static uint32_t choose_bias(const float *values, size_t count) {
  const uint32_t exponent = float_bits(largest(values, count)) >> 23;
  return exponent > 31 ? (exponent - 31) << 23 : 0;
}

static void choose_units(supine_basis *basis, units *u) {
  const supine_storage storage = basis->tiles.storage;
  const size_t numbers = 3 * basis->info.vertex_count;
  float top[SUPINE_MODES_MAX];
  largest_coefficients(basis, top);
  for (size_t k = 0; k < basis->info.mode_count; ++k) {
    u->mode[k] = 1;
    if (flush(top[k]) > 0 && storage == SUPINE_STORAGE_INT16) {
      u->mode[k] = top[k] / INT16_TOP;
    } else if (flush(top[k]) > 0 && storage == SUPINE_STORAGE_FLOAT16) {
      u->mode[k] = ldexpf(1, ilogbf(top[k]) - 14); /* the largest below 2^15 */
    }
    u->inverse[k] = 1 / u->mode[k];
    basis->mode_scale[k] = (double)u->mode[k];
  }
  basis->tiles.rest_bias = choose_bias(basis->vertices, numbers);
  basis->tiles.direction_bias =
      basis->direction == NULL ? 0 : choose_bias(basis->direction, numbers);
}

/* The nearest of -32767 ... 32767. */
static float to_int16(float value, float inverse) {
  const float scaled = rintf(value * inverse);
  return scaled > INT16_TOP ? INT16_TOP : scaled < -INT16_TOP ? -INT16_TOP : scaled;
}

/* Packs rows of 16 coefficients of one axis; leaves in `rows` what they now stand for. */
static void pack_coefficients(const supine_tiles *tiles, const units *u, float *rows,
                              unsigned char *at) {
  for (size_t k = 0; k < tiles->modes; ++k) {
    float *row = rows + k * TILE;
    if (tiles->storage == SUPINE_STORAGE_INT16) {
      int16_t packed[TILE];
      for (size_t v = 0; v < TILE; ++v) {
        const float q = to_int16(row[v], u->inverse[k]);
        packed[v] = (int16_t)q;
        row[v] = q * u->mode[k];
      }
      memcpy(at + k * sizeof packed, packed, sizeof packed);
    } else if (tiles->storage == SUPINE_STORAGE_FLOAT16) {
      uint16_t half[TILE];
      for (size_t v = 0; v < TILE; ++v) {
        half[v] = half_narrow(row[v] * u->inverse[k]);
        row[v] = half_widen(half[v]) * u->mode[k];
      }
      memcpy(at + k * sizeof half, half, sizeof half);
    } else {
      memcpy(at + k * TILE * sizeof *row, row, TILE * sizeof *row);
    }
  }
}

/* Packs 48 numbers; leaves there what they now stand for. */
static void pack_numbers(const supine_tiles *tiles, uint32_t bias, float *numbers,
                         unsigned char *at) {
  if (!supine_tiles_compact(tiles->storage)) {
    memcpy(at, numbers, TILE_NUMBERS * sizeof *numbers);
    return;
  }
  for (size_t j = 0; j < TILE_NUMBERS; ++j, at += 3) {
    const uint32_t word = float24_narrow(numbers[j], bias);
    at[0] = (unsigned char)(word & 0xFFU);
    at[1] = (unsigned char)(word >> 8 & 0xFFU);
    at[2] = (unsigned char)(word >> 16);
    numbers[j] = float24_widen(word, bias);
  }
}

/* Largest length of 16 vectors. */
static double longest(const float *xyz) {
  float top = 0;
  for (size_t v = 0; v < TILE; ++v) {
    const float *p = xyz + 3 * v;
    const float square = p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
    top = square > top ? square : top;
  }
  return sqrt((double)top);
}

static void raise_to(double *bound, double value) {
  *bound = value > *bound ? value : *bound;
}

/* Raises the bounds to what this tile needs, `was` before packing and `is` after. With one axis,
 * |c d - c' d'| <= |c - c'| |d| + |c'| |d - d'|; a vector's length is over its three axes. */
static void measure(supine_basis *basis, const source *was, const source *is) {
  float difference[TILE_NUMBERS];
  float length[TILE];
  float slip[TILE];
  for (size_t j = 0; j < TILE_NUMBERS; ++j) {
    difference[j] = was->rest[j] - is->rest[j];
  }
  raise_to(&basis->rest_error, longest(difference));
  raise_to(&basis->rest_size, longest(was->rest));
  for (size_t v = 0; v < TILE; ++v) {
    float d = 0;
    float e = 0;
    for (size_t j = 3 * v; j < 3 * v + 3; ++j) {
      const float apart = was->direction[j] - is->direction[j];
      d += was->direction[j] * was->direction[j];
      e += apart * apart;
    }
    length[v] = basis->tiles.axes == 3 ? 1 : sqrtf(d);
    slip[v] = sqrtf(e);
  }
  const size_t modes = basis->tiles.modes;
  for (size_t k = 0; k < modes; ++k) {
    float apart[TILE] = {0};
    float size[TILE] = {0};
    for (size_t axis = 0; axis < basis->tiles.axes; ++axis) {
      const float *c = was->coefficients + (axis * modes + k) * TILE;
      const float *packed = is->coefficients + (axis * modes + k) * TILE;
      for (size_t v = 0; v < TILE; ++v) {
        apart[v] += (c[v] - packed[v]) * (c[v] - packed[v]);
        size[v] += c[v] * c[v];
      }
    }
    float top_error = 0;
    float top_size = 0;
    for (size_t v = 0; v < TILE; ++v) {
      const float error = sqrtf(apart[v]) * length[v] + sqrtf(size[v]) * slip[v];
      const float moved = sqrtf(size[v]) * length[v];
      top_error = error > top_error ? error : top_error;
      top_size = moved > top_size ? moved : top_size;
    }
    raise_to(&basis->mode_error[k], (double)top_error);
    raise_to(&basis->mode_size[k], (double)top_size);
  }
}

static unsigned char *tiles_allocate(size_t bytes) {
  const size_t alignment = bytes >= 2 * (size_t)HUGE_PAGE ? HUGE_PAGE : 64;
  const size_t rounded = (bytes + alignment - 1) / alignment * alignment;
  unsigned char *memory = aligned_alloc(alignment, rounded);
  if (memory != NULL) {
#ifdef MADV_HUGEPAGE
    if (alignment == HUGE_PAGE) {
      (void)madvise(memory, rounded, MADV_HUGEPAGE);
    }
#endif
    memset(memory, 0, rounded);
  }
  return memory;
}

supine_status supine_basis_pack(supine_basis *basis, supine_storage storage) {
  supine_tiles *tiles = &basis->tiles;
  supine_status status = SUPINE_ERROR_MEMORY;
  const size_t count = (basis->info.vertex_count + TILE - 1) / TILE;
  source *was = malloc(sizeof *was);
  source *is = malloc(sizeof *is);
  units *u = calloc(1, sizeof *u);
  free(tiles->bytes);
  supine_tiles_layout(tiles, storage, basis->info.mode_count, basis->info.vector, count);
  tiles->bytes = tiles_allocate(count * tiles->stride + 64); /* the kernels' last load */
  if (was == NULL || is == NULL || u == NULL || tiles->bytes == NULL) {
    goto cleanup;
  }
  choose_units(basis, u);
  memset(basis->mode_error, 0, sizeof basis->mode_error);
  memset(basis->mode_size, 0, sizeof basis->mode_size);
  basis->rest_error = 0;
  basis->rest_size = 0;
  for (size_t t = 0; t < count; ++t) {
    unsigned char *tile = tiles->bytes + t * tiles->stride;
    source_load(basis, t, was);
    *is = *was;
    for (size_t axis = 0; axis < tiles->axes; ++axis) {
      pack_coefficients(tiles, u, is->coefficients + axis * tiles->modes * TILE,
                        tile + axis * tiles->axis_bytes);
    }
    if (tiles->axes == 1) {
      pack_numbers(tiles, tiles->direction_bias, is->direction, tile + tiles->direction_begin);
    }
    pack_numbers(tiles, tiles->rest_bias, is->rest, tile + tiles->rest_begin);
    measure(basis, was, is);
  }
  basis->info.storage = storage;
  basis->info.bytes_per_vertex = (double)tiles->stride / TILE;
  status = SUPINE_OK;

cleanup:
  free(was);
  free(is);
  free(u);
  return status;
}
