/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Measure the evaluator against the memory it reads and a plain loop. Not part of the run-time
 * library. */
#ifndef SUPINE_TESTS_EVALUATION_H
#define SUPINE_TESTS_EVALUATION_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/runtime.h>

/** One measurement: the fastest of several runs. */
typedef struct supine_bench_row {
  const char *what;    /**< "supine", "plain_loop", "copy", "triad", ... */
  const char *storage; /**< "int16", ...; "" where there is none */
  const char *code;    /**< "avx512", ...; "" where it is the compiler's */
  size_t vertices;
  size_t modes;
  size_t threads;
  double ns_per_vertex;    /**< of one orientation */
  double bytes_per_vertex; /**< that it must move, reads and writes */
  double gb_per_second;
  double triad_share;     /**< gb_per_second over that of the triad of as many threads */
  double multiplications; /**< a vertex, counted from the code; 0 where that says nothing */
  double additions;
} supine_bench_row;

/** What takes part in a run: `run(context)` does the work of `vertices`, `rounds` times. */
typedef struct supine_bench_entry {
  supine_bench_row row;
  size_t rounds; /**< 0: once */
  void (*run)(void *context);
  void *context;
} supine_bench_entry;

/** Runs every entry in turn, `repeats` times over, each time beginning with another, subnormals
 * flushed, and fills in the rows' times, rates and shares from the fastest run of each. */
void supine_bench_measure(supine_bench_entry *entries, size_t count, size_t repeats);

/** A made basis of any size as a file in memory, for want of a file: the fields and triangles of
 * `basis` over and over, or random fields of `modes` modes, and no triangles, where it is NULL. The
 * arrays point into the bytes; free the bytes after the bases that were opened on them. */
typedef struct supine_bench_image {
  unsigned char *bytes;
  size_t size;
  size_t vertices, modes, triangle_count, normal_count;
  float *coefficients; /**< [N, K] */
  float *direction;    /**< [N, 3] */
  float *rest;         /**< [N, 3] */
  uint32_t *triangles; /**< [M, 3] */
  int16_t *normals;    /**< [N, 3, Q] */
} supine_bench_image;

/** @retval SUPINE_ERROR_MEMORY
 * @retval SUPINE_ERROR_UNSUPPORTED  the basis has a vector field */
supine_status supine_bench_image_create(size_t vertices, size_t modes, const supine_basis *basis,
                                        supine_bench_image *image, supine_error *error);
void supine_bench_image_destroy(supine_bench_image *image);

/** What to measure; zeros are the defaults. */
typedef struct supine_bench_options {
  const size_t *vertices; /**< sizes; NULL: 10,000, 100,000 and 1,000,000 */
  size_t vertices_count;
  size_t threads;           /**< measure 1 and this many; 0: 1 and 2 */
  size_t repeats;           /**< 0: 9 */
  const supine_basis *like; /**< fields to repeat, or NULL */
  bool lit;                 /**< normals and what they are held against alone, of 16-bit storage */
} supine_bench_options;

/** Takes each row as it is measured. */
typedef void supine_bench_report(void *context, const supine_bench_row *row);

/** Adds entries of the caller's own to those of one size: at most `room`; returns how many. */
typedef size_t supine_bench_peers(void *context, const supine_bench_image *image, float *xyz,
                                  supine_bench_entry *entries, size_t room);

/** Measures "supine" (every storage; separate arrays; a frozen step; a batch of 64), "traffic"
 * (the evaluator's loads and stores without its arithmetic), "plain_loop", "copy", "triad" and
 * "arithmetic" (what threads gain where memory plays no part) at each size; where the basis has
 * normals, those alone ("normals"), with positions ("lit") and exactly from the triangles
 * ("supine_normals"), too.
 * `peers` may be NULL.
 * @retval SUPINE_ERROR_MEMORY
 * @retval SUPINE_ERROR_ARGUMENT  no vertices, or more than 256 threads */
supine_status supine_bench_run(const supine_bench_options *options, supine_bench_peers *peers,
                               supine_bench_report *report, void *context, supine_error *error);

/** "int16", "avx512", ... */
const char *supine_bench_storage_name(supine_storage storage);
const char *supine_bench_code_name(supine_simd simd);

#endif
