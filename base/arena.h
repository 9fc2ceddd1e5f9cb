/* SPDX-License-Identifier: MIT */
/** @file
 * Memory that is freed together, and early returns. A function that needs temporary arrays declares
 * an arena, which is freed at each return:
 *
 *     SUPINE_ARENA arena = {0};
 *     double *a = supine_arena_take(&arena, n, sizeof *a);
 *     double *b = supine_arena_zeros(&arena, n, sizeof *b);
 *     SUPINE_TRY(supine_arena_check(&arena, error, "the surface"));
 *     SUPINE_TRY(first_step(a, error));
 *     return second_step(a, b, error);
 */
#ifndef SUPINE_ARENA_H
#define SUPINE_ARENA_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include <supine/status.h>

typedef struct supine_arena {
  struct supine_arena_block *last; /**< list of all blocks, newest first */
  bool failed;                     /**< whether an allocation has failed */
} supine_arena;

/** Begin the declaration of a variable that is freed when its scope ends: by a function that takes
 * its address, such as supine_mesh_free. */
#define SUPINE_FREED_BY(function) __attribute__((cleanup(function)))

/** Close a file that was opened for reading; for SUPINE_FREED_BY. */
static inline void supine_file_close(FILE **file) {
  if (*file != NULL) {
    (void)fclose(*file);
  }
}

/** Declare an arena that is freed when its scope ends. */
#define SUPINE_ARENA SUPINE_FREED_BY(supine_arena_free) supine_arena

/** Return the status of a call from the calling function, unless it is SUPINE_OK. */
#define SUPINE_TRY(call)                                                                           \
  do {                                                                                             \
    const supine_status supine_try = (call);                                                       \
    if (supine_try != SUPINE_OK) {                                                                 \
      return supine_try;                                                                           \
    }                                                                                              \
  } while (0)

/** Refuse an input: if `condition` holds, set the error as supine_error_set does, and return its
 * status from the calling function. The format and its arguments follow the status; they are
 * evaluated only then. */
#define SUPINE_REFUSE_IF(condition, error, ...)                                                    \
  do {                                                                                             \
    if (condition) {                                                                               \
      return supine_error_set(error, __VA_ARGS__);                                                 \
    }                                                                                              \
  } while (0)

/** Allocate an array, aligned for any type; valid until the arena is freed.
 * @return NULL if memory is short or count x size overflows; arena->failed is then true. An array
 *   of 0 bytes is not NULL */
void *supine_arena_take(supine_arena *arena, size_t count, size_t size);

/** As supine_arena_take, with all bytes 0. */
void *supine_arena_zeros(supine_arena *arena, size_t count, size_t size);

/** Free all arrays of an arena, which can then be used again. */
void supine_arena_free(supine_arena *arena);

/** Return SUPINE_ERROR_MEMORY if an allocation from the arena has failed, otherwise SUPINE_OK. */
static inline supine_status supine_arena_status(const supine_arena *arena) {
  return arena->failed ? SUPINE_ERROR_MEMORY : SUPINE_OK;
}

/** As supine_arena_status, and set the error like supine_error_memory. */
supine_status supine_arena_check(const supine_arena *arena, supine_error *error, const char *what,
                                 ...) SUPINE_PRINTF(3, 4);

/** Set the error "out of memory: WHAT".
 * @param what  what the memory was for, such as "20000 vertices"; printf format
 * @return SUPINE_ERROR_MEMORY */
supine_status supine_error_memory(supine_error *error, const char *what, ...) SUPINE_PRINTF(2, 3);

#endif
