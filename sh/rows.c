/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Rows of results into the caller's memory.
 *
 * A plain store first reads the line that it overwrites. Where the output is larger than the caches
 * that read is pure loss, and streaming stores, which go past the caches, save a third of a whole
 * transform's time. */
#include <stdint.h>
#include <string.h>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include "sh/internal.h"

enum { LINE = 64 / sizeof(double) }; /* doubles in a cache line: written whole or not streamed */

#ifdef __SSE2__
static void stream(size_t fields, const double *row, double *out) {
  const size_t skew = ((uintptr_t)out / sizeof *out) % LINE;
  const size_t head = skew == 0 ? 0 : LINE - skew;
  size_t f = head < fields ? head : fields;
  for (size_t i = 0; i < f; ++i) {
    out[i] = row[i];
  }
  for (; f + LINE <= fields; f += LINE) {
    for (size_t i = f; i < f + LINE; i += 2) {
      _mm_stream_pd(out + i, _mm_loadu_pd(row + i));
    }
  }
  for (; f < fields; ++f) {
    out[f] = row[f];
  }
}

void supine_sh_rows_finish(void) {
  _mm_sfence();
}
#else
static void stream(size_t fields, const double *row, double *out) {
  memcpy(out, row, fields * sizeof *out);
}

void supine_sh_rows_finish(void) {
}
#endif

SUPINE_CLONES
static void add(size_t fields, const double *restrict row, double *restrict out) {
  for (size_t f = 0; f < fields; ++f) {
    out[f] += row[f];
  }
}

void supine_sh_row_write(size_t fields, supine_sh_mode mode, const double *row, double *out) {
  if (mode == SUPINE_SH_ADD) {
    add(fields, row, out);
  } else if (mode == SUPINE_SH_STREAM) {
    stream(fields, row, out);
  } else {
    memcpy(out, row, fields * sizeof *out);
  }
}

supine_sh_mode supine_sh_row_mode(size_t rows, size_t fields) {
  const size_t large = ((size_t)4 << 20) / sizeof(double);
  return fields > large / rows ? SUPINE_SH_STREAM : SUPINE_SH_SET;
}
