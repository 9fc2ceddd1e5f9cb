/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Make a basis from the surfaces or the label map of lungs, as the program `supine precompute`
 * does. <supine/runtime.h> opens the basis and deforms the lungs.
 *
 *     static const char *const paths[] = {"left.ply", "right.ply"};
 *     static const char *const options[] = {"--law", "deep", "--resting", "supine=0.48"};
 *     const supine_precompute_input input = {.path_count = 2, .paths = paths,
 *                                            .option_count = 4, .options = options};
 *     supine_precompute_result result;
 *     supine_status status = supine_precompute_basis(&input, &result, &error);
 *     if (status == SUPINE_OK) {
 *       status = supine_basis_open_memory(result.bytes, result.size, &basis, &error);
 *     }
 *     supine_precompute_result_free(&result);
 *
 * Stability: growing. A minor version may change functions and structs without a replacement;
 * CHANGELOG.md says how to move over. */
#ifndef SUPINE_PUBLIC_PRECOMPUTE_H
#define SUPINE_PUBLIC_PRECOMPUTE_H

#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** A closed surface of one lung or of both, in the axes and unit of the options: LPS and mm. */
typedef struct supine_precompute_surface {
  size_t vertex_count;
  const double *vertices; /**< [vertex_count, 3] */
  size_t triangle_count;
  const uint32_t *triangles; /**< [triangle_count, 3] */
} supine_precompute_surface;

/** Lungs, as files or as arrays, and options. */
typedef struct supine_precompute_input {
  const char *const *paths; /**< [path_count] surfaces, or label maps */
  size_t path_count;
  const supine_precompute_surface *surfaces; /**< [surface_count], if there are no files */
  size_t surface_count;
  const char *const *options; /**< [option_count] words as in `supine precompute --help-all` */
  size_t option_count;
  const char *output; /**< path of the basis file; NULL to return its bytes */
  /** Receives the fraction of the work done, 0 to 1, and returns other than 0 to stop; or NULL. */
  int (*progress)(void *context, double fraction);
  void *context;
} supine_precompute_input;

typedef struct supine_precompute_result {
  const void *bytes;   /**< content of the basis file; NULL if it was written to a path */
  size_t size;         /**< number of bytes */
  char report[2048];   /**< text that the program prints: size of the basis, errors, assumptions */
  char assumed[800];   /**< axes, unit, law, state of the scan and volumes; "; " separates them */
  char findings[4096]; /**< warnings and notes about the input, one per line; also on failure */
} supine_precompute_result;

/** Make a basis. It uses all processors, or as many as the environment variable SUPINE_THREADS
 * says. Not thread-safe: it uses getopt_long(), the error handler of GSL and the number of threads
 * of OpenBLAS.
 * @param result  written, also on failure; release it with supine_precompute_result_free
 * @return SUPINE_ERROR_INTERRUPTED if `progress` stopped the work */
SUPINE_API supine_status supine_precompute_basis(const supine_precompute_input *input,
                                                 supine_precompute_result *result,
                                                 supine_error *error);

SUPINE_API void supine_precompute_result_free(supine_precompute_result *result);

#ifdef __cplusplus
}
#endif
#endif
