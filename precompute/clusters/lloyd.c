/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Find clusters of vertices that move alike, by Lloyd's iteration over the surface. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/parallel.h"
#include "precompute/clusters/clusters.h"
#include "precompute/clusters/cut.h"
#include "precompute/clusters/subspace.h"
#include "runtime/cluster_row.h"

enum { ITERATIONS = 12 };

/* Stop iterating when fewer than 1 of this many vertices change their cluster. */
enum { SETTLED = 1000 };

typedef struct lloyd {
  const supine_clustered *surface;
  size_t count;              /* number of clusters */
  uint16_t *cluster;         /* [vertices] cluster of each vertex */
  uint16_t *next;            /* [vertices] cluster after this iteration */
  size_t *begin;             /* [count + 1] first member of each cluster in `members` */
  uint32_t *members;         /* [vertices] vertices, grouped by cluster */
  size_t *ring_begin;        /* [vertices + 1] first neighbour of each vertex in `ring` */
  uint32_t *ring;            /* vertices that share a triangle, each twice on a closed surface */
  supine_subspace *subspace; /* [count] */
  supine_status *status;     /* [count] result of each fit */
} lloyd;

/* List for each vertex the other corners of its triangles. */
static void find_rings(lloyd *l) {
  const supine_clustered *s = l->surface;
  for (size_t c = 0; c < 3 * s->triangle_count; ++c) {
    l->ring_begin[s->triangles[c] + 1] += 2;
  }
  for (size_t i = 0; i < s->vertex_count; ++i) {
    l->ring_begin[i + 1] += l->ring_begin[i];
  }
  for (size_t c = 0; c < 3 * s->triangle_count; ++c) {
    const uint32_t *triangle = s->triangles + c / 3 * 3;
    const uint32_t vertex = s->triangles[c];
    l->ring[l->ring_begin[vertex]++] = triangle[(c + 1) % 3];
    l->ring[l->ring_begin[vertex]++] = triangle[(c + 2) % 3];
  }
  for (size_t i = s->vertex_count; i > 0; --i) { /* each begin has moved to the end of its ring */
    l->ring_begin[i] = l->ring_begin[i - 1];
  }
  l->ring_begin[0] = 0;
}

/* Group the vertices by cluster, and drop empty clusters. */
static void group_members(lloyd *l) {
  const size_t n = l->surface->vertex_count;
  memset(l->begin, 0, (l->count + 1) * sizeof *l->begin);
  for (size_t i = 0; i < n; ++i) {
    ++l->begin[l->cluster[i]];
  }
  size_t used = 0;
  for (size_t c = 0; c < l->count; ++c) { /* replace its size by its new number */
    const size_t size = l->begin[c];
    l->begin[c] = used;
    used += size > 0;
  }
  for (size_t i = 0; i < n; ++i) {
    l->cluster[i] = (uint16_t)l->begin[l->cluster[i]];
  }
  l->count = used;
  memset(l->begin, 0, (l->count + 1) * sizeof *l->begin);
  for (size_t i = 0; i < n; ++i) {
    ++l->begin[l->cluster[i] + 1];
  }
  for (size_t c = 0; c < l->count; ++c) {
    l->begin[c + 1] += l->begin[c];
  }
  for (size_t i = 0; i < n; ++i) {
    l->members[l->begin[l->cluster[i]]++] = (uint32_t)i;
  }
  for (size_t c = l->count; c > 0; --c) { /* each begin has moved to the end of its cluster */
    l->begin[c] = l->begin[c - 1];
  }
  l->begin[0] = 0;
}

static void fit_range(void *context, size_t begin, size_t end, size_t thread) {
  lloyd *l = context;
  (void)thread;
  for (size_t c = begin; c < end; ++c) {
    l->status[c] = supine_clusters_subspace_fit(l->surface, l->members + l->begin[c],
                                                l->begin[c + 1] - l->begin[c], &l->subspace[c]);
  }
}

static supine_status fit_all(lloyd *l) {
  supine_parallel_for(l->count, 4, 0, fit_range, l);
  for (size_t c = 0; c < l->count; ++c) {
    SUPINE_TRY(l->status[c]);
  }
  return SUPINE_OK;
}

/* Return the cluster that errs least at vertex i: its own, or one of a neighbour. */
static uint16_t best_cluster(const lloyd *l, size_t i) {
  float left[SUPINE_CLUSTER_ROW_MAX];
  double scalars[SUPINE_CLUSTER_SCALARS];
  const uint16_t own = l->cluster[i];
  uint16_t best = own;
  uint16_t tried = own;
  double least = -1.0;
  for (size_t r = l->ring_begin[i]; r < l->ring_begin[i + 1]; ++r) {
    const uint16_t other = l->cluster[l->ring[r]];
    if (other == own || other == tried) {
      continue;
    }
    if (least < 0.0) {
      least = supine_clusters_subspace_leave(l->surface, &l->subspace[own], i, scalars, left);
    }
    const double error =
        supine_clusters_subspace_leave(l->surface, &l->subspace[other], i, scalars, left);
    tried = other;
    if (error < least) {
      least = error;
      best = other;
    }
  }
  return best;
}

static void assign_range(void *context, size_t begin, size_t end, size_t thread) {
  lloyd *l = context;
  (void)thread;
  for (size_t i = begin; i < end; ++i) {
    l->next[i] = best_cluster(l, i);
  }
}

/* Move each vertex to its best cluster. Return how many moved. */
static size_t assign_all(lloyd *l) {
  size_t moved = 0;
  supine_parallel_for(l->surface->vertex_count, 256, 0, assign_range, l);
  for (size_t i = 0; i < l->surface->vertex_count; ++i) {
    moved += l->next[i] != l->cluster[i];
  }
  memcpy(l->cluster, l->next, l->surface->vertex_count * sizeof *l->cluster);
  return moved;
}

static supine_status iterate(lloyd *l) {
  size_t moved = l->surface->vertex_count;
  for (size_t k = 0; k < ITERATIONS && moved > l->surface->vertex_count / SETTLED; ++k) {
    SUPINE_TRY(fit_all(l));
    moved = assign_all(l);
    group_members(l);
  }
  return fit_all(l);
}

/* Write the vectors of a cluster in the order of the file, about the origin, with patterns that
 * count steps of the 16-bit scalars. */
static void write_vectors(const supine_subspace *subspace, size_t modes, const double step[2],
                          float *vectors) {
  for (size_t k = 0; k < modes; ++k, vectors += SUPINE_CLUSTER_NUMBERS) {
    for (size_t axis = 0; axis < 3; ++axis) {
      const size_t at = axis * modes + k;
      double mean = (double)subspace->linear[0][at];
      for (size_t j = 0; j < 3; ++j) {
        vectors[SUPINE_CLUSTER_SLOPE + 3 * axis + j] = subspace->linear[1 + j][at];
        mean -= (double)subspace->linear[1 + j][at] * subspace->centre[j];
      }
      vectors[SUPINE_CLUSTER_MEAN + axis] = (float)mean;
      for (size_t p = 0; p < SUPINE_CLUSTER_SCALARS; ++p) {
        vectors[SUPINE_CLUSTER_PATTERN + 3 * p + axis] =
            (float)((double)subspace->pattern[p][at] * step[p]);
      }
    }
  }
}

/* Quantise the scalars of each vertex, and write the vectors of each cluster. */
static void quantise(const lloyd *l, double *scalars, supine_clusters *made) {
  static const double steps = 32767.0;
  float left[SUPINE_CLUSTER_ROW_MAX];
  for (size_t c = 0; c < l->count; ++c) {
    double step[SUPINE_CLUSTER_SCALARS] = {0.0, 0.0};
    for (size_t m = l->begin[c]; m < l->begin[c + 1]; ++m) {
      double *a = scalars + SUPINE_CLUSTER_SCALARS * (size_t)l->members[m];
      (void)supine_clusters_subspace_leave(l->surface, &l->subspace[c], l->members[m], a, left);
      step[0] = fmax(step[0], fabs(a[0]) / steps);
      step[1] = fmax(step[1], fabs(a[1]) / steps);
    }
    for (size_t m = l->begin[c]; m < l->begin[c + 1]; ++m) {
      const size_t i = l->members[m];
      for (size_t p = 0; p < SUPINE_CLUSTER_SCALARS; ++p) {
        const double a = scalars[SUPINE_CLUSTER_SCALARS * i + p];
        made->scalars[SUPINE_CLUSTER_SCALARS * i + p] =
            step[p] > 0.0 ? (int16_t)lround(a / step[p]) : 0;
      }
    }
    write_vectors(&l->subspace[c], l->surface->mode_count, step,
                  made->vectors + c * l->surface->mode_count * SUPINE_CLUSTER_NUMBERS);
  }
}

/* Compute (1) for vertex i at p, row [3, mode_count]. */
static void expand(const supine_clusters *clusters, const float *p, size_t i, float *row) {
  const size_t modes = clusters->mode_count;
  supine_cluster_row(clusters->vectors + clusters->cluster[i] * modes * SUPINE_CLUSTER_NUMBERS,
                     modes, p, clusters->scalars + SUPINE_CLUSTER_SCALARS * i, row);
}

void supine_clusters_expand(const supine_clusters *clusters, const float *vertices,
                            float *coefficients) {
  for (size_t i = 0; i < clusters->vertex_count; ++i) {
    expand(clusters, vertices + 3 * i, i, coefficients + 3 * clusters->mode_count * i);
  }
}

/* Compute the error of the coefficients of vertex i, row [3, mode_count]. */
static void find_error(const supine_clustered *surface, const supine_clusters *clusters, size_t i,
                       float *row) {
  const size_t width = 3 * surface->mode_count;
  expand(clusters, surface->vertices + 3 * i, i, row);
  for (size_t k = 0; k < width; ++k) {
    row[k] -= surface->coefficients[i * width + k];
  }
}

static double square_sum(const float *row, const float *other, size_t width) {
  double sum = 0.0;
  for (size_t k = 0; k < width; ++k) {
    const double x = (double)row[k] - (other != NULL ? (double)other[k] : 0.0);
    sum += x * x;
  }
  return sum;
}

/* Measure the errors of what is stored. */
static void measure(const supine_clustered *surface, supine_clusters *made) {
  const size_t width = 3 * surface->mode_count;
  float row[2][SUPINE_CLUSTER_ROW_MAX];
  double sum = 0.0;
  double largest = 0.0;
  for (size_t i = 0; i < surface->vertex_count; ++i) {
    find_error(surface, made, i, row[0]);
    const double square = square_sum(row[0], NULL, width);
    sum += square;
    largest = fmax(largest, square);
  }
  double jumps = 0.0;
  double lengths = 0.0;
  size_t seams = 0;
  for (size_t e = 0; e < 3 * surface->triangle_count; ++e) {
    const size_t i = surface->triangles[e];
    const size_t j = surface->triangles[e % 3 == 2 ? e - 2 : e + 1];
    lengths += sqrt(square_sum(surface->vertices + 3 * i, surface->vertices + 3 * j, 3));
    if (made->cluster[i] != made->cluster[j]) {
      find_error(surface, made, i, row[0]);
      find_error(surface, made, j, row[1]);
      jumps += square_sum(row[0], row[1], width);
      ++seams;
    }
  }
  const double mean_length = lengths / (3.0 * (double)surface->triangle_count);
  made->rms = surface->weight_rms * sqrt(sum / (double)surface->vertex_count);
  made->largest = surface->weight_rms * sqrt(largest);
  made->seam = seams == 0 ? 0.0 : surface->weight_rms * sqrt(jumps / (double)seams) / mean_length;
}

static supine_status allocate(const supine_clustered *surface, size_t count, supine_arena *arena,
                              lloyd *l, supine_error *error) {
  const size_t n = surface->vertex_count;
  *l = (lloyd){.surface = surface, .count = count};
  l->cluster = supine_arena_take(arena, n, sizeof *l->cluster);
  l->next = supine_arena_take(arena, n, sizeof *l->next);
  l->begin = supine_arena_take(arena, count + 1, sizeof *l->begin);
  l->members = supine_arena_take(arena, n, sizeof *l->members);
  l->ring_begin = supine_arena_zeros(arena, n + 1, sizeof *l->ring_begin);
  l->ring = supine_arena_take(arena, 6 * surface->triangle_count, sizeof *l->ring);
  l->subspace = supine_arena_take(arena, count, sizeof *l->subspace);
  l->status = supine_arena_take(arena, count, sizeof *l->status);
  return supine_arena_check(arena, error, "clusters of %zu vertices", n);
}

supine_status supine_clusters_find(const supine_clustered *surface, size_t count,
                                   supine_clusters *clusters, supine_error *error) {
  const size_t n = surface->vertex_count;
  SUPINE_ARENA arena = {0};
  SUPINE_FREED_BY(supine_clusters_free) supine_clusters made = {.vertex_count = n};
  lloyd l;
  *clusters = (supine_clusters){0};
  SUPINE_REFUSE_IF(count < surface->part_count || count > SUPINE_CLUSTERS_MAX, error,
                   SUPINE_ERROR_ARGUMENT, "%zu clusters: give %zu to %d", count,
                   surface->part_count, SUPINE_CLUSTERS_MAX);
  SUPINE_TRY(allocate(surface, count + surface->part_count, &arena, &l, error));
  double *scalars = supine_arena_take(&arena, SUPINE_CLUSTER_SCALARS * n, sizeof *scalars);
  SUPINE_TRY(supine_arena_check(&arena, error, "clusters of %zu vertices", n));
  find_rings(&l);
  l.count = supine_clusters_cut(surface, count, l.members, l.cluster);
  group_members(&l);
  const supine_status status = iterate(&l);
  SUPINE_REFUSE_IF(status != SUPINE_OK, error, status,
                   "clusters: a coefficient is not finite, or memory is short");
  made.count = l.count;
  made.mode_count = surface->mode_count;
  made.cluster = malloc(n * sizeof *made.cluster);
  made.scalars = malloc(SUPINE_CLUSTER_SCALARS * n * sizeof *made.scalars);
  made.vectors =
      malloc(l.count * surface->mode_count * SUPINE_CLUSTER_NUMBERS * sizeof *made.vectors);
  if (made.cluster == NULL || made.scalars == NULL || made.vectors == NULL) {
    return supine_error_memory(error, "%zu clusters", l.count);
  }
  memcpy(made.cluster, l.cluster, n * sizeof *made.cluster);
  quantise(&l, scalars, &made);
  measure(surface, &made);
  *clusters = made;
  made = (supine_clusters){0};
  return SUPINE_OK;
}

supine_status supine_clusters_choose(const supine_clustered *surface,
                                     const supine_cluster_limits *limits, supine_clusters *clusters,
                                     supine_error *error) {
  enum { FEWEST = 16 };
  const size_t most = surface->vertex_count / limits->vertices;
  *clusters = (supine_clusters){0};
  for (size_t count = FEWEST; count <= most && count <= SUPINE_CLUSTERS_MAX; count *= 2) {
    SUPINE_TRY(supine_clusters_find(surface, count, clusters, error));
    if (clusters->rms <= limits->rms && clusters->seam <= limits->seam) {
      return SUPINE_OK;
    }
    supine_clusters_free(clusters);
  }
  return SUPINE_OK;
}
