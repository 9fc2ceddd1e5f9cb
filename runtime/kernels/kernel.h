/* SPDX-License-Identifier: MIT */
/** @file
 * The loops that evaluate tiles (16 vertices each), for SIMD vectors of LANES floats. Each
 * kernel_*.c includes this file once, and before that defines
 *
 *     KERNELS          name of its table of kernels (supine_kernels)
 *     LANES            4, 8 or 16
 *     FMA(a, b, c)     a * b + c
 *     FMA4(a, b, c)    the same for four numbers
 *     RSQRT(x)         an estimate of 1 / sqrt(x), accurate to 12 bits at least
 *     STREAM(to, v)    store a vector and bypass the caches
 *     OWN_WRITER       instead of STREAM, if kernel_*.c has its own struct `writer`
 *     OWN_INTERLEAVE   if it is defined: f(x, y, z, out), which interleaves LANES vertices */
#include "runtime/kernels/tiles.h"
#include <string.h>

#define INLINE static inline __attribute__((always_inline))

typedef float vf __attribute__((vector_size(4 * LANES)));
typedef int32_t vi __attribute__((vector_size(4 * LANES)));
typedef uint32_t vu __attribute__((vector_size(4 * LANES)));

enum {
  GROUPS = TILE / LANES,         /* SIMD vectors that hold one number per vertex of a tile */
  PIECES = TILE_NUMBERS / LANES, /* SIMD vectors that hold the 48 coordinates of a tile */
  CHAINS = GROUPS == 1 ? 2 : 1,  /* partial sums in a dot product; two hide the latency of FMA */
  KNOWN_MODES = 16               /* largest number of modes whose weights stay in registers */
};

/* One number for each of the 16 vertices of a tile. */
typedef struct row {
  vf v[GROUPS];
} row;

/* The coordinates x y z x y z ... of the 16 vertices of a tile. */
typedef struct triples {
  vf v[PIECES];
} triples;

/* EACH(F, j) is the list F(j, 0), F(j, 1), ... F(j, LANES - 1). EACH4 makes four items of it. */
#define EACH4(F, j, i) F(j, i), F(j, (i) + 1), F(j, (i) + 2), F(j, (i) + 3)
#if LANES == 4
#define EACH(F, j) EACH4(F, j, 0)
#elif LANES == 8
#define EACH(F, j) EACH4(F, j, 0), EACH4(F, j, 4)
#else
#define EACH(F, j) EACH4(F, j, 0), EACH4(F, j, 4), EACH4(F, j, 8), EACH4(F, j, 12)
#endif

/* In the 48 coordinates x y z x y z ... of a tile, lane i of SIMD vector j holds coordinate
 * AXIS(j, i) of vertex VERTEX(j, i). */
#define VERTEX(j, i) (((j)*LANES + (i)) / 3)
#define AXIS(j, i) (((j)*LANES + (i)) % 3)

INLINE vf load(const unsigned char *at) {
  vf v;
  memcpy(&v, at, sizeof v);
  return v;
}

/* Shift each word left by `shift` bits, and convert the words from signed integers to floats. */
INLINE vf integers(vu words, int shift) {
  return __builtin_convertvector((vi)(words << shift), vf);
}

INLINE vf splat(float value) {
  return value - (vf){0};
}

typedef struct weights {
  const float *at;
  vf v[KNOWN_MODES];
} weights;

INLINE vf weight(const weights *w, size_t k, bool known) {
  return known ? w->v[k] : splat(w->at[k]);
}

/* Properties of the stored modes for which the compiler makes a separate loop over vertices. A loop
 * made for a constant number of modes writes positions, never displacements. */
typedef struct form {
  supine_storage storage;
  size_t modes; /* number of modes if it is a compile-time constant, else 0 */
  bool vector;
} form;

/* Add the coefficients of one mode, times its weight w, to the sums of the vertices of a tile. The
 * coefficients are floats or, if `compact`, words that integers() converts. */
INLINE void add_mode(row *sum, vf w, const unsigned char *at, int shift, bool compact) {
  for (size_t q = 0; q < GROUPS; ++q, at += sizeof(vf)) {
    sum->v[q] = FMA(w, compact ? integers((vu)load(at), shift) : load(at), sum->v[q]);
  }
}

/* For each vertex of a tile, return the sum over all modes of weight times coefficient. */
INLINE row dot(const supine_tiles *tiles, const unsigned char *at, const weights *w, form f) {
  const bool compact = supine_tiles_compact(f.storage);
  const bool known = f.modes > 0;
  const size_t paired = supine_tiles_paired(tiles->storage, tiles->modes);
  row sum[CHAINS];
  row *even = &sum[0];
  row *odd = &sum[CHAINS - 1];
  for (size_t q = 0; q < CHAINS * GROUPS; ++q) {
    sum[q / GROUPS].v[q % GROUPS] = splat(-0.0F); /* -0 + x is x for every x, even for -0 */
  }
  for (size_t k = 0; k < paired / 2; ++k, at += compact ? 64 : 128) {
    add_mode(even, weight(w, 2 * k, known), at, 16, compact);
    add_mode(odd, weight(w, 2 * k + 1, known), compact ? at : at + 64, 0, compact);
  }
  if (paired % 2 != 0) {
    add_mode(even, weight(w, paired - 1, known), at, 16, compact);
    at += 64;
  }
  for (size_t k = paired; k < tiles->modes; k += 3, at += 64) {
    add_mode(odd, weight(w, k, known), at, 0, true);
    add_mode(even, weight(w, k + 1, known), at, 11, true);
    add_mode(odd, weight(w, k + 2, known), at, 22, true);
  }
  if (CHAINS == 2) {
    for (size_t q = 0; q < GROUPS; ++q) {
      even->v[q] += odd->v[q];
    }
  }
  return *even;
}

/* Load the 48 coordinates of the directions or reference positions of a tile, as numbers of
 * quantisation steps. */
INLINE triples numbers(const unsigned char *at, bool compact) {
  triples n;
  if (compact) {
    for (size_t q = 0; q < GROUPS; ++q, at += sizeof(vf)) {
      const vu first = (vu)load(at);
      const vu second = (vu)load(at + 64);
      n.v[q] = integers(first, 0);
      n.v[GROUPS + q] = integers(second, 0);
      n.v[2 * GROUPS + q] = integers(first << 21 | (second << 10 & 0x1FFC00), 0);
    }
  } else {
    for (size_t j = 0; j < PIECES; ++j) {
      n.v[j] = load(at + sizeof(vf) * j);
    }
  }
  return n;
}

INLINE triples reference_positions(const supine_tiles *tiles, const unsigned char *tile,
                                   bool compact) {
  triples p = numbers(tile + tiles->reference_begin, compact);
  if (compact) {
    for (size_t j = 0; j < PIECES; ++j) {
      p.v[j] = (vf)((vu)p.v[j] + tiles->reference_unit);
    }
  }
  return p;
}

/* Interleave the coordinates of 16 vertices as x y z x y z ... */
INLINE triples interleave(const row *x, const row *y, const row *z) {
#ifdef OWN_INTERLEAVE
  triples t;
  for (size_t q = 0; q < GROUPS; ++q) {
    OWN_INTERLEAVE(x->v[q], y->v[q], z->v[q], t.v + 3 * q);
  }
  return t;
#else
#define FROM_XY(j, i) (VERTEX(j, i) + (AXIS(j, i) == 1 ? LANES : 0))
#define FROM_Z(j, i) (AXIS(j, i) == 2 ? VERTEX(j, i) + LANES : (i))
#define PIECE(j)                                                                                   \
  __builtin_shufflevector(__builtin_shufflevector(x->v[q], y->v[q], EACH(FROM_XY, j)), z->v[q],    \
                          EACH(FROM_Z, j))
  triples t;
  for (size_t q = 0; q < GROUPS; ++q) {
    t.v[3 * q] = PIECE(0);
    t.v[3 * q + 1] = PIECE(1);
    t.v[3 * q + 2] = PIECE(2);
  }
  return t;
#undef PIECE
#undef FROM_Z
#undef FROM_XY
#endif
}

/* Repeat the value of each vertex three times, for x, y and z. */
INLINE triples spread(const row *a) {
  triples t;
  for (size_t q = 0; q < GROUPS; ++q) {
    t.v[3 * q] = __builtin_shufflevector(a->v[q], a->v[q], EACH(VERTEX, 0));
    t.v[3 * q + 1] = __builtin_shufflevector(a->v[q], a->v[q], EACH(VERTEX, 1));
    t.v[3 * q + 2] = __builtin_shufflevector(a->v[q], a->v[q], EACH(VERTEX, 2));
  }
  return t;
}

#ifndef OWN_WRITER
/* An array that is written from beginning to end. If `stream` is true, stores bypass the caches. */
typedef struct writer {
  float *to;
  bool stream;
} writer;

INLINE writer writer_open(const supine_target *target) {
  return (writer){target->xyz, target->stream};
}

INLINE void writer_put(writer *w, vf v) {
  if (w->stream) {
    STREAM(w->to, v);
  } else {
    memcpy(w->to, &v, sizeof v);
  }
  w->to += LANES;
}

INLINE void writer_close(const writer *w) {
  (void)w;
}
#endif

INLINE void put_tile(writer *out, const triples *t) {
  for (size_t j = 0; j < PIECES; ++j) {
    writer_put(out, t->v[j]);
  }
}

INLINE triples deform_tile(const supine_tiles *tiles, const unsigned char *tile, const weights *w,
                           const vf *gain, bool add_reference, form f) {
  const bool compact = supine_tiles_compact(f.storage);
  const row x = dot(tiles, tile, w, f);
  triples amount;
  triples factor = {{{0}}};
  if (f.vector) {
    const row y = dot(tiles, tile + tiles->axis_bytes, w, f);
    const row z = dot(tiles, tile + 2 * tiles->axis_bytes, w, f);
    amount = interleave(&x, &y, &z);
  } else {
    amount = spread(&x);
    factor = numbers(tile + tiles->direction_begin, compact);
  }
  const triples reference =
      add_reference ? reference_positions(tiles, tile, compact) : (triples){{{0}}};
  for (size_t j = 0; j < PIECES; ++j) {
    factor.v[j] = f.vector ? gain[j % 3] : factor.v[j] * gain[j % 3];
    amount.v[j] =
        add_reference ? FMA(amount.v[j], factor.v[j], reference.v[j]) : amount.v[j] * factor.v[j];
  }
  return amount;
}

INLINE void deform_tiles(const supine_tiles *any, const float *scales, size_t first, size_t count,
                         const supine_target *target, form f) {
  const bool add_reference = f.modes > 0 || target->add_reference;
  supine_tiles tiles = *any;
  if (f.modes > 0) {
    supine_tiles_layout(&tiles, f.storage, f.modes, f.vector, any->count);
  }
  const unsigned char *tile = tiles.bytes + first * tiles.stride;
  const float *g = scales + tiles.modes;
#define GAIN(j, i) g[AXIS(j, i)]
  const vf gain[3] = {{EACH(GAIN, 0)}, {EACH(GAIN, 1)}, {EACH(GAIN, 2)}};
#undef GAIN
  writer out = writer_open(target);
  weights w = {.at = scales};
  for (size_t k = 0; k < KNOWN_MODES; ++k) {
    w.v[k] = splat(k < f.modes ? scales[k] : 0);
  }
  for (size_t t = 0; t < count; ++t, tile += tiles.stride) {
    supine_prefetch_tile(tile, tiles.stride, target->prefetch);
    const triples xyz = deform_tile(&tiles, tile, &w, gain, add_reference, f);
    put_tile(&out, &xyz);
  }
  writer_close(&out);
}

INLINE void deform_kind(const supine_tiles *tiles, const float *scales, size_t first, size_t count,
                        const supine_target *target, supine_storage storage, size_t modes) {
  if (tiles->axes == 3) {
    deform_tiles(tiles, scales, first, count, target, (form){storage, modes, true});
  } else {
    deform_tiles(tiles, scales, first, count, target, (form){storage, modes, false});
  }
}

/* Evaluate tiles by the loop for their number format. `modes` is the number of modes if it is a
 * compile-time constant, otherwise 0. With 0, the loop for INT16 takes the layout from `tiles`, and
 * therefore also evaluates MIXED. */
INLINE void deform_storage(const supine_tiles *tiles, const float *scales, size_t first,
                           size_t count, const supine_target *target, size_t modes) {
  if (tiles->storage == SUPINE_STORAGE_EXACT) {
    deform_kind(tiles, scales, first, count, target, SUPINE_STORAGE_EXACT, modes);
  } else if (modes > 0 && tiles->storage == SUPINE_STORAGE_MIXED) {
    deform_kind(tiles, scales, first, count, target, SUPINE_STORAGE_MIXED, modes);
  } else {
    deform_kind(tiles, scales, first, count, target, SUPINE_STORAGE_INT16, modes);
  }
}

static void deform(const supine_tiles *tiles, const float *scales, size_t first, size_t count,
                   const supine_target *target) {
  const bool registers = LANES == 16 && target->add_reference;
  if (registers && tiles->modes == 4) { /* a basis has 4 modes by default */
    deform_storage(tiles, scales, first, count, target, 4);
  } else if (registers && tiles->modes == KNOWN_MODES) {
    deform_storage(tiles, scales, first, count, target, KNOWN_MODES);
  } else {
    deform_storage(tiles, scales, first, count, target, 0);
  }
}

/* Compute one coordinate of the unnormalised normals of LANES vertices. */
INLINE vf dot_normal(const unsigned char *at, const float *w, size_t words) {
  vf sum[3] = {{0}, {0}, {0}};
  for (size_t j = 0; j < words; ++j, at += 64) {
    const vu word = (vu)load(at);
    sum[0] = FMA(splat(w[j]), integers(word, 0), sum[0]);
    sum[1] = FMA(splat(w[words + j]), integers(word, 13), sum[1]);
    sum[2] = FMA(splat(w[2 * words + j]), integers(word, 23), sum[2]);
  }
  return sum[0] + sum[1] + sum[2];
}

INLINE void light_words(const supine_tiles *tiles, const float *w, size_t first, size_t count,
                        const supine_target *target, size_t words) {
  const size_t axis_bytes = 64 * words;
  const unsigned char *tile = tiles->bytes + first * 3 * axis_bytes;
  writer out = writer_open(target);
  for (size_t t = 0; t < count; ++t, tile += 3 * axis_bytes) {
    row n[3];
    supine_prefetch_tile(tile, 3 * axis_bytes, target->prefetch);
    for (size_t q = 0; q < GROUPS; ++q) {
      vf v[3];
      for (size_t axis = 0; axis < 3; ++axis) {
        v[axis] = dot_normal(tile + axis * axis_bytes + q * sizeof(vf), w, words);
      }
      /* Add FLT_MIN so that a zero vector does not become NaN. One Newton step doubles the number
       * of correct bits of the estimated 1 / sqrt(square). */
      const vf square = FMA(v[0], v[0], FMA(v[1], v[1], v[2] * v[2])) + 0x1p-126F;
      const vf guess = RSQRT(square);
      const vf error = FMA(-(square * guess), guess, splat(1));
      const vf inverse = FMA(guess * error, splat(0.5F), guess);
      for (size_t axis = 0; axis < 3; ++axis) {
        n[axis].v[q] = v[axis] * inverse;
      }
    }
    const triples xyz = interleave(&n[0], &n[1], &n[2]);
    put_tile(&out, &xyz);
  }
  writer_close(&out);
}

static void light(const supine_tiles *tiles, const float *w, size_t first, size_t count,
                  const supine_target *target) {
  const size_t words = supine_tiles_normal_words(tiles->modes);
  if (LANES > 4 && words == 2) {
    light_words(tiles, w, first, count, target, 2);
  } else if (LANES > 4 && words == 3) {
    light_words(tiles, w, first, count, target, 3);
  } else {
    light_words(tiles, w, first, count, target, words);
  }
}

/* Four numbers of a vertex or of a cluster. */
typedef float quad __attribute__((vector_size(16)));
typedef int32_t quad_int __attribute__((vector_size(16)));

INLINE quad load_quad(const void *at) {
  quad v;
  memcpy(&v, at, sizeof v);
  return v;
}

#define REPEAT(v, i) __builtin_shufflevector(v, v, i, i, i, i)

/* Evaluate x = b + A p + a_0 Q_0 + a_1 Q_1 for one vertex, as x y z and an unused number. Without
 * the reference, subtract p. */
INLINE quad cluster_vertex(const unsigned char *vertex, const float *frame, bool add_reference) {
  const quad p = load_quad(vertex);
  const quad_int words = (quad_int)p;
  const quad first = __builtin_convertvector((words << 16) >> 16, quad);
  const quad second = __builtin_convertvector(words >> 16, quad);
  quad x = add_reference ? load_quad(frame) : load_quad(frame) - p;
  x = FMA4(REPEAT(p, 0), load_quad(frame + 4), x);
  x = FMA4(REPEAT(p, 1), load_quad(frame + 8), x);
  x = FMA4(REPEAT(p, 2), load_quad(frame + 12), x);
  x = FMA4(REPEAT(first, 3), load_quad(frame + 16), x);
  x = FMA4(REPEAT(second, 3), load_quad(frame + 20), x);
  return x;
}

/* Pack the coordinates of four vertices into three vectors x y z x, y z x y, z x y z. */
INLINE void pack_quads(const quad x[4], quad packed[3]) {
  packed[0] = __builtin_shufflevector(x[0], x[1], 0, 1, 2, 4);
  packed[1] = __builtin_shufflevector(x[1], x[2], 1, 2, 4, 5);
  packed[2] = __builtin_shufflevector(x[2], x[3], 2, 4, 5, 6);
}

#if LANES == 4
#define JOIN(at) ((at)[0])
#elif LANES == 8
#define JOIN(at) __builtin_shufflevector((at)[0], (at)[1], 0, 1, 2, 3, 4, 5, 6, 7)
#else
#define JOIN_TWO(a, b) __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7)
#define JOIN(at)                                                                                   \
  __builtin_shufflevector(JOIN_TWO((at)[0], (at)[1]), JOIN_TWO((at)[2], (at)[3]), 0, 1, 2, 3, 4,   \
                          5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
#endif

INLINE void cluster_tiles(const supine_tiles *tiles, const float *frames, size_t first,
                          size_t count, const supine_target *target, bool add_reference) {
  const unsigned char *tile = tiles->bytes + first * tiles->stride;
  writer out = writer_open(target);
  for (size_t t = 0; t < count; ++t, tile += tiles->stride) {
    uint16_t cluster[TILE];
    quad packed[TILE_NUMBERS / 4];
    memcpy(cluster, tile + tiles->reference_begin, sizeof cluster);
    supine_prefetch_tile(tile, tiles->stride, target->prefetch);
    for (size_t four = 0; four < TILE / 4; ++four) {
      quad x[4];
      for (size_t v = 0; v < 4; ++v) {
        x[v] = cluster_vertex(tile + (4 * four + v) * sizeof(quad),
                              frames + (size_t)SUPINE_CLUSTER_FRAME * cluster[4 * four + v],
                              add_reference);
      }
      pack_quads(x, packed + 3 * four);
    }
    for (size_t j = 0; j < TILE_NUMBERS / 4; j += LANES / 4) {
      writer_put(&out, JOIN(packed + j));
    }
  }
  writer_close(&out);
}

static void cluster(const supine_tiles *tiles, const float *frames, size_t first, size_t count,
                    const supine_target *target) {
  if (target->add_reference) {
    cluster_tiles(tiles, frames, first, count, target, true);
  } else {
    cluster_tiles(tiles, frames, first, count, target, false);
  }
}

const supine_kernels KERNELS = {deform, light, cluster};
