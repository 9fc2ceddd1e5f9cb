/* SPDX-License-Identifier: MIT */
#ifndef SUPINE_RUNTIME_KERNELS_INSTANCES_H
#define SUPINE_RUNTIME_KERNELS_INSTANCES_H
/* One instance of a vector kernel's loops for each encoding, known to the compiler. Included by
 * such a kernel after its deform_kind, light_words, widen_coefficients, numbers, rest_positions
 * and store. */

INLINE void deform_storage(const supine_tiles *tiles, const float *weights, size_t first,
                           size_t count, const supine_target *target, supine_storage storage) {
  if (tiles->axes == 3) {
    deform_kind(tiles, weights, first, count, target, storage, true);
  } else {
    deform_kind(tiles, weights, first, count, target, storage, false);
  }
}

static void deform(const supine_tiles *tiles, const float *weights, size_t first, size_t count,
                   const supine_target *target) {
  switch (tiles->storage) {
  case SUPINE_STORAGE_EXACT:
    deform_storage(tiles, weights, first, count, target, SUPINE_STORAGE_EXACT);
    break;
  case SUPINE_STORAGE_MIXED:
    deform_storage(tiles, weights, first, count, target, SUPINE_STORAGE_MIXED);
    break;
  default:
    deform_storage(tiles, weights, first, count, target, SUPINE_STORAGE_INT16);
    break;
  }
}

/* The usual numbers of words. */
static void light(const supine_tiles *tiles, const float *weights, size_t first, size_t count,
                  const supine_target *target) {
  const size_t words = supine_tiles_normal_words(tiles->modes);
  switch (words) {
  case 2:
    light_words(tiles, weights, first, count, target, 2);
    break;
  case 3:
    light_words(tiles, weights, first, count, target, 3);
    break;
  case 4:
    light_words(tiles, weights, first, count, target, 4);
    break;
  default:
    light_words(tiles, weights, first, count, target, words);
    break;
  }
}

static void widen_axis(const supine_tiles *tiles, const unsigned char *from, float *to) {
  switch (tiles->storage) {
  case SUPINE_STORAGE_INT16:
    widen_coefficients(from, tiles->modes, SUPINE_STORAGE_INT16, to);
    break;
  case SUPINE_STORAGE_MIXED:
    widen_coefficients(from, tiles->modes, SUPINE_STORAGE_MIXED, to);
    break;
  default:
    widen_coefficients(from, tiles->modes, SUPINE_STORAGE_EXACT, to);
    break;
  }
}

static void widen(const supine_tiles *tiles, size_t first, size_t count, supine_tiles *to) {
  const bool compact = supine_tiles_compact(tiles->storage);
  for (size_t t = 0; t < count; ++t) {
    const unsigned char *tile = tiles->bytes + (first + t) * tiles->stride;
    unsigned char *wide = to->bytes + t * to->stride;
    for (size_t axis = 0; axis < tiles->axes; ++axis) {
      widen_axis(tiles, tile + axis * tiles->axis_bytes,
                 (float *)(void *)(wide + axis * to->axis_bytes));
    }
    if (tiles->axes == 1) {
      store(numbers(tile + tiles->direction_begin, compact),
            (float *)(void *)(wide + to->direction_begin));
    }
    store(rest_positions(tiles, tile, compact), (float *)(void *)(wide + to->rest_begin));
  }
}

#endif
