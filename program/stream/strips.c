/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Make strips greedily: from the first unused triangle, the longest of its three strips. */
#include <stdlib.h>
#include <string.h>

#include "program/stream/message.h"
#include "program/stream/strips.h"

static const uint32_t none = 0xFFFFFFFFu;

/* Largest number of edges examined at a vertex. Scanned lungs have fewer; at a vertex with more, a
 * strip may end early, so that time stays proportional to the number of triangles. */
enum { LOOKS = 64 };

/* Edge 3 t + k leaves corner k of triangle t, towards the next. */
typedef struct walk {
  const uint32_t *corner; /* [3 M] */
  uint32_t *first, *next; /* [N], [3 M]: the edges that leave a vertex, as a list */
  unsigned char *used;    /* [M] */
  uint32_t *strip, *best; /* [M] the first edge of each triangle of a strip */
} walk;

static uint32_t after(uint32_t edge) {
  return edge % 3 == 2 ? edge - 2 : edge + 1;
}

/* Return an edge from one vertex to another of an unused triangle; `none` where there is none. */
static uint32_t edge_between(const walk *w, uint32_t from, uint32_t to) {
  uint32_t edge = w->first[from];
  for (int i = 0; i < LOOKS && edge != none; ++i, edge = w->next[edge]) {
    if (w->used[edge / 3] == 0 && w->corner[after(edge)] == to) {
      return edge;
    }
  }
  return none;
}

/* Build the strip that begins with an edge: for each of its triangles the edge shared with the
 * previous one. Return the number of triangles, which remain marked as used. */
static size_t grow(walk *w, uint32_t edge) {
  size_t count = 0;
  uint32_t last = w->corner[after(edge)];
  while (edge != none) {
    w->strip[count++] = edge;
    w->used[edge / 3] = 1;
    const uint32_t before = last;
    last = w->corner[after(after(edge))];
    /* Every second triangle of a strip has the opposite orientation. */
    edge = count % 2 == 0 ? edge_between(w, before, last) : edge_between(w, last, before);
  }
  return count;
}

/* Find the longest strip that begins with a triangle, in w->best; return its length. */
static size_t longest(walk *w, uint32_t triangle) {
  size_t most = 0;
  for (uint32_t k = 0; k < 3; ++k) {
    const size_t count = grow(w, 3 * triangle + k);
    for (size_t i = 0; i < count; ++i) {
      w->used[w->strip[i] / 3] = 0;
    }
    if (count > most) {
      uint32_t *shorter = w->best;
      w->best = w->strip;
      w->strip = shorter;
      most = count;
    }
  }
  for (size_t i = 0; i < most; ++i) {
    w->used[w->best[i] / 3] = 1;
  }
  return most;
}

/* Write the strip in w->best: its length, two corners, and for each triangle the corner opposite
 * its edge. */
static void put_strip(const walk *w, size_t count, supine_stream_strips *strips) {
  unsigned char *at = strips->bytes + strips->size;
  supine_stream_put32(at, (uint32_t)count + 2);
  supine_stream_put32(at + 4, w->corner[w->best[0]]);
  supine_stream_put32(at + 8, w->corner[after(w->best[0])]);
  for (size_t i = 0; i < count; ++i) {
    supine_stream_put32(at + 12 + 4 * i, w->corner[after(after(w->best[i]))]);
  }
  strips->size += 12 + 4 * count;
  ++strips->count;
}

supine_status supine_stream_strips_make(const uint32_t *triangles, size_t count, size_t vertices,
                                        supine_stream_strips *strips) {
  supine_status status = SUPINE_ERROR_MEMORY;
  walk w = {.corner = triangles,
            .first = malloc(vertices * sizeof *w.first + 1),
            .next = malloc(3 * count * sizeof *w.next + 1),
            .used = calloc(count + 1, 1),
            .strip = malloc(count * sizeof *w.strip + 1),
            .best = malloc(count * sizeof *w.best + 1)};
  /* Space for one strip per triangle, 16 bytes each, the longest result. */
  *strips = (supine_stream_strips){.bytes = malloc(16 * count + 1)};
  if (w.first == NULL || w.next == NULL || w.used == NULL || w.strip == NULL || w.best == NULL ||
      strips->bytes == NULL) {
    free(strips->bytes);
    strips->bytes = NULL;
    goto cleanup;
  }
  memset(w.first, 0xFF, vertices * sizeof *w.first);
  for (size_t edge = 3 * count; edge-- > 0;) {
    w.next[edge] = w.first[triangles[edge]];
    w.first[triangles[edge]] = (uint32_t)edge;
  }
  for (size_t t = 0; t < count; ++t) {
    if (w.used[t] == 0) {
      put_strip(&w, longest(&w, (uint32_t)t), strips);
    }
  }
  unsigned char *fitted = realloc(strips->bytes, strips->size + 1);
  strips->bytes = fitted != NULL ? fitted : strips->bytes;
  status = SUPINE_OK;
cleanup:
  free(w.first);
  free(w.next);
  free(w.used);
  free(w.strip);
  free(w.best);
  return status;
}
