/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measuring in turns, so that what disturbs the machine disturbs all entries alike. */
#include <math.h>
#include <string.h>
#include <time.h>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <supine/bench.h>

static double seconds(void) {
  struct timespec now;
  (void)clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void supine_bench_measure(supine_bench_entry *entries, size_t count, size_t repeats) {
#if defined(__x86_64__)
  const unsigned control = _mm_getcsr();
  _mm_setcsr(control | 0x8040U); /* subnormals are zero, going in and out */
#endif
  for (size_t i = 0; i < count; ++i) {
    entries[i].row.ns_per_vertex = INFINITY;
  }
  for (size_t turn = 0; turn < repeats; ++turn) {
    for (size_t i = 0; i < count; ++i) {
      supine_bench_entry *e = &entries[(i + turn) % count];
      e->run(e->context); /* as the frame before leaves the caches */
      const double begin = seconds();
      e->run(e->context);
      const double rounds = e->rounds == 0 ? 1 : (double)e->rounds;
      const double each = 1e9 * (seconds() - begin) / rounds / (double)e->row.vertices;
      e->row.ns_per_vertex = fmin(e->row.ns_per_vertex, each);
    }
  }
#if defined(__x86_64__)
  _mm_setcsr(control);
#endif
  for (size_t i = 0; i < count; ++i) {
    supine_bench_row *row = &entries[i].row;
    row->gb_per_second = row->bytes_per_vertex / row->ns_per_vertex;
  }
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = 0; j < count; ++j) {
      const supine_bench_row *triad = &entries[j].row;
      if (strcmp(triad->what, "triad") == 0 && triad->threads == entries[i].row.threads &&
          triad->vertices == entries[i].row.vertices) {
        entries[i].row.triad_share = entries[i].row.gb_per_second / triad->gb_per_second;
      }
    }
  }
}
