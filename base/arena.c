/* SPDX-License-Identifier: MIT */
/* Allocate memory that is freed together. */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include "base/arena.h"
#include "base/number.h"

typedef struct supine_arena_block {
  struct supine_arena_block *before;
  max_align_t data[]; /* keeps the array behind this header aligned for any type */
} block;

static void *take(supine_arena *arena, size_t count, size_t size, bool zeros) {
  block *made = NULL;
  if (size == 0 || count <= (SIZE_MAX - sizeof *made) / size) {
    const size_t bytes = sizeof *made + count * size;
    made = zeros ? calloc(1, bytes) : malloc(bytes);
  }
  if (made == NULL) {
    arena->failed = true;
    return NULL;
  }
  made->before = arena->last;
  arena->last = made;
  return made->data;
}

void *supine_arena_take(supine_arena *arena, size_t count, size_t size) {
  return take(arena, count, size, false);
}

void *supine_arena_zeros(supine_arena *arena, size_t count, size_t size) {
  return take(arena, count, size, true);
}

void supine_arena_free(supine_arena *arena) {
  while (arena->last != NULL) {
    block *before = arena->last->before;
    free(arena->last);
    arena->last = before;
  }
  arena->failed = false;
}

static supine_status set_error(supine_error *error, const char *what, va_list arguments) {
  char text[256];
  (void)supine_print_text_list(text, sizeof text, what, arguments);
  return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory: %s", text);
}

supine_status supine_arena_check(const supine_arena *arena, supine_error *error, const char *what,
                                 ...) {
  va_list arguments;
  va_start(arguments, what);
  const supine_status status = arena->failed ? set_error(error, what, arguments) : SUPINE_OK;
  va_end(arguments);
  return status;
}

supine_status supine_error_memory(supine_error *error, const char *what, ...) {
  va_list arguments;
  va_start(arguments, what);
  const supine_status status = set_error(error, what, arguments);
  va_end(arguments);
  return status;
}
