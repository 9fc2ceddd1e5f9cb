/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measuring in turns, so that what disturbs the machine disturbs all entries alike. */
#include <math.h>
#include <string.h>

#include "evaluation.h"
#include "sh/base/clock.h"
#include "sh/base/denormals.h"

void supine_bench_measure(supine_bench_entry *entries, size_t count, size_t repeats) {
  const unsigned saved = supine_denormals_flush();
  for (size_t i = 0; i < count; ++i) {
    entries[i].row.ns_per_vertex = INFINITY;
  }
  for (size_t turn = 0; turn < repeats; ++turn) {
    for (size_t i = 0; i < count; ++i) {
      supine_bench_entry *e = &entries[(i + turn) % count];
      e->run(e->context); /* as the frame before leaves the caches */
      const double begin = supine_clock_seconds();
      e->run(e->context);
      const double rounds = e->rounds == 0 ? 1 : (double)e->rounds;
      const double each = 1e9 * (supine_clock_seconds() - begin) / rounds / (double)e->row.vertices;
      e->row.ns_per_vertex = fmin(e->row.ns_per_vertex, each);
    }
  }
  supine_denormals_restore(saved);
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
