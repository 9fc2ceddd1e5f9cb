/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compare the speed of the run-time library with OpenBLAS and with plain loops. All run in turn in
 * one process.
 *
 *     OPENBLAS_CORETYPE=SAPPHIRERAPIDS bench_runtime [VERTICES | clusters:VERTICES | BASIS]...
 *
 * VERTICES is the number of vertices of a random basis with 16 modes, and 6 modes for normals;
 * clusters:VERTICES is one with 16 modes of vectors, stored as 128 clusters whose vertices are
 * scattered over the order of the file. A BASIS has its own modes: the default ones are 4. Clusters
 * are compared with the same vectors stored as modes. Print the processor, and the fastest of nine
 * runs, by processor time (by time of day for two threads). OpenBLAS 0.3.21 does not recognise
 * newer processors. Therefore, OPENBLAS_CORETYPE must name a processor that it supports. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <supine/runtime.h>

#include "base/arena.h"
#include "base/clock.h"
#include "base/parallel.h"
#include "runtime/safetensors/safetensors_file.h"
#include "tests/helpers/runtime_fixture.h"
#include "tests/helpers/test.h"

enum { TILE = 16, ENTRIES_MAX = 64, REPEATS = 9, ENOUGH = 2000000, CLUSTERS = 128 };

void openblas_set_num_threads(int threads);

typedef struct bench {
  const supine_basis_info *info; /* of a basis that stores modes */
  size_t rows; /* coefficients of a vertex for each mode: 3 of vectors, else 1 along a direction */
  supine_basis *storage[SUPINE_STORAGE_COUNT]; /* the basis for each way of storing coefficients;
                                                  AUTO, the default one, only of vectors */
  supine_basis *clusters;                      /* the basis as it stores clusters, or NULL */
  supine_basis *simd[SUPINE_SIMD_COUNT];       /* NULL if the processor lacks the instruction set */
  supine_pose pose;
  float weights[SUPINE_MODES_MAX]; /* [modes] weights of the modes, times the displacement factor */
  float *xyz, *normals;            /* [N, 3] positions, mm, and normals */
  float *amount;   /* [N, rows] displacement along the unit vector in the basis, or vector, mm */
  float *columns;  /* [modes, N, rows] displacement of each vertex by each mode of weight 1, mm */
  int16_t *counts; /* [modes, N, rows] `columns` as multiples of a step for each mode */
  float units[SUPINE_MODES_MAX]; /* [modes] quantisation step, mm, times the weight of the mode */
} bench;

typedef struct entry {
  const char *what, *how;
  supine_range_function *range;
  bench *work;
  const supine_basis *basis;
  size_t threads;
  double bytes;   /* bytes read and written per vertex */
  double seconds; /* shortest time for all vertices so far, s */
} entry;

static void run_deform(void *context, size_t begin, size_t end, size_t thread) {
  const entry *e = context;
  (void)thread;
  supine_deform_range(e->basis, &e->work->pose, begin, end, e->work->xyz + 3 * begin);
}

static void run_normals(void *context, size_t begin, size_t end, size_t thread) {
  const entry *e = context;
  (void)thread;
  (void)supine_deform_lit_range(e->basis, &e->work->pose, begin, end, NULL,
                                e->work->normals + 3 * begin);
}

static void run_lit(void *context, size_t begin, size_t end, size_t thread) {
  const entry *e = context;
  (void)thread;
  (void)supine_deform_lit_range(e->basis, &e->work->pose, begin, end, e->work->xyz + 3 * begin,
                                e->work->normals + 3 * begin);
}

/* Compute all normals from the triangles in one thread, because supine_normals takes no range. */
static void run_exact_normals(void *context, size_t begin, size_t end, size_t thread) {
  const entry *e = context;
  (void)begin, (void)end, (void)thread;
  supine_normals(e->basis, e->work->xyz, e->work->normals);
}

static void displace(const bench *work, size_t begin, size_t end) {
  const supine_basis_info *m = work->info;
  for (size_t i = begin; i < end; ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      const float u =
          m->vector ? work->amount[3 * i + axis] : work->amount[i] * m->direction[3 * i + axis];
      work->xyz[3 * i + axis] = m->vertices[3 * i + axis] + u;
    }
  }
}

static void run_sgemv(void *context, size_t begin, size_t end, size_t thread) {
  const entry *e = context;
  const int modes = (int)e->work->info->mode_count;
  const size_t rows = e->work->rows;
  (void)thread;
  cblas_sgemv(CblasRowMajor, CblasNoTrans, (int)(rows * (end - begin)), modes, 1.0F,
              e->work->info->coefficients + rows * begin * (size_t)modes, modes, e->work->weights,
              1, 0.0F, e->work->amount + rows * begin, 1);
  displace(e->work, begin, end);
}

/* Sum the coefficients of one row. The loop over 16 modes has a constant length, so that the
 * compiler unrolls it. */
static inline float sum_row(const float *restrict w, const float *restrict c, size_t modes) {
  float amount = 0;
  if (modes == 16) {
    for (size_t k = 0; k < 16; ++k) {
      amount += w[k] * c[k];
    }
  } else {
    for (size_t k = 0; k < modes; ++k) {
      amount += w[k] * c[k];
    }
  }
  return amount;
}

/* Compute positions by one plain loop, compiled with -march=native. */
static void run_plain(void *context, size_t begin, size_t end, size_t thread) {
  const bench *work = ((const entry *)context)->work;
  const supine_basis_info *m = work->info;
  const float *restrict w = work->weights;
  float *restrict xyz = work->xyz;
  (void)thread;
  for (size_t i = begin; i < end; ++i) {
    const float *c = m->coefficients + i * work->rows * m->mode_count;
    if (m->vector) {
      for (size_t axis = 0; axis < 3; ++axis) {
        xyz[3 * i + axis] =
            m->vertices[3 * i + axis] + sum_row(w, c + axis * m->mode_count, m->mode_count);
      }
    } else {
      const float amount = sum_row(w, c, m->mode_count);
      for (size_t axis = 0; axis < 3; ++axis) {
        xyz[3 * i + axis] = m->vertices[3 * i + axis] + amount * m->direction[3 * i + axis];
      }
    }
  }
}

/* Compute positions from clusters by plain loops: first the 18 numbers of each cluster, then the
 * vertices. */
static void run_plain_clusters(void *context, size_t begin, size_t end, size_t thread) {
  const bench *work = ((const entry *)context)->work;
  const supine_basis_info *m = supine_basis_get_info(work->clusters);
  float frames[SUPINE_CLUSTERS_MAX][SUPINE_CLUSTER_NUMBERS] = {{0}};
  float *restrict xyz = work->xyz;
  (void)thread;
  for (size_t row = 0; row < m->cluster_count * m->mode_count; ++row) {
    const float *vector = m->cluster_vectors + row * SUPINE_CLUSTER_NUMBERS;
    float *frame = frames[row / m->mode_count];
    for (size_t i = 0; i < SUPINE_CLUSTER_NUMBERS; ++i) {
      frame[i] += work->weights[row % m->mode_count] * vector[i];
    }
  }
  for (size_t i = begin; i < end; ++i) {
    const float *f = frames[m->cluster[i]];
    const float *p = m->vertices + 3 * i;
    const float first = m->cluster_scalars[2 * i];
    const float second = m->cluster_scalars[2 * i + 1];
    for (size_t axis = 0; axis < 3; ++axis) {
      const float *slope = f + 3 + 3 * axis;
      xyz[3 * i + axis] = p[axis] + f[axis] + slope[0] * p[0] + slope[1] * p[1] + slope[2] * p[2] +
                          first * f[12 + axis] + second * f[15 + axis];
    }
  }
}

/* Compute displacements by sgemv from a matrix whose columns are the modes, then positions. */
static void run_sgemv_columns(void *context, size_t begin, size_t end, size_t thread) {
  const entry *e = context;
  const bench *work = e->work;
  (void)thread;
  cblas_sgemv(CblasColMajor, CblasNoTrans, (int)(work->rows * (end - begin)),
              (int)work->info->mode_count, 1.0F, work->columns + work->rows * begin,
              (int)(work->rows * work->info->vertex_count), work->weights, 1, 0.0F,
              work->amount + work->rows * begin, 1);
  displace(work, begin, end);
}

enum { BLOCK = 16384 }; /* number of vertices whose displacements fit in the second-level cache */

/* Add the displacements by mode k to the numbers begin <= i < end of work->amount. */
typedef void add_mode(const bench *work, size_t k, size_t begin, size_t end);

static void add_column(const bench *work, size_t k, size_t begin, size_t end) {
  const float *restrict c = work->columns + k * work->rows * work->info->vertex_count;
  float *restrict amount = work->amount;
  const float w = work->weights[k];
  for (size_t i = begin; i < end; ++i) {
    amount[i] += w * c[i];
  }
}

static void add_counts(const bench *work, size_t k, size_t begin, size_t end) {
  const int16_t *restrict c = work->counts + k * work->rows * work->info->vertex_count;
  float *restrict amount = work->amount;
  const float w = work->units[k];
  for (size_t i = begin; i < end; ++i) {
    amount[i] += w * (float)c[i];
  }
}

/* Compute positions in blocks of vertices. In each block, add one mode after the other. */
static void run_blocks(const bench *work, add_mode *add, size_t begin, size_t end) {
  for (size_t at = begin; at < end; at += BLOCK) {
    const size_t last = end - at < BLOCK ? end : at + BLOCK;
    memset(work->amount + work->rows * at, 0, work->rows * (last - at) * sizeof *work->amount);
    for (size_t k = 0; k < work->info->mode_count; ++k) {
      add(work, k, work->rows * at, work->rows * last);
    }
    displace(work, at, last);
  }
}

static void run_planar(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  run_blocks(((const entry *)context)->work, add_column, begin, end);
}

static void run_planar_int16(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  run_blocks(((const entry *)context)->work, add_counts, begin, end);
}

/* Store the coefficients of each mode contiguously, as float32 and as 16-bit integers. */
static void make_columns(bench *work) {
  const size_t n = work->rows * work->info->vertex_count;
  const size_t modes = work->info->mode_count;
  work->columns = fixture_allocate(n * modes, sizeof *work->columns);
  work->counts = fixture_allocate(n * modes, sizeof *work->counts);
  for (size_t k = 0; k < modes; ++k) {
    float largest = 0;
    for (size_t i = 0; i < n; ++i) {
      work->columns[k * n + i] = work->info->coefficients[i * modes + k];
      largest = fmaxf(largest, fabsf(work->columns[k * n + i]));
    }
    const float unit = largest > 0 ? largest / INT16_MAX : 1;
    for (size_t i = 0; i < n; ++i) {
      work->counts[k * n + i] = (int16_t)lrintf(work->columns[k * n + i] / unit);
    }
    work->units[k] = work->weights[k] * unit;
  }
}

#if defined(__x86_64__)
/* Load and store as many bytes as supine_deform, but compute nothing. */
__attribute__((target("avx512f"))) static void run_traffic(void *context, size_t begin, size_t end,
                                                           size_t thread) {
  const entry *e = context;
  const supine_basis_info *info = supine_basis_get_info(e->basis);
  const size_t stride = (size_t)(info->bytes_per_vertex * TILE);
  const unsigned char *tile = (const unsigned char *)info->packed + begin / TILE * stride;
  float *xyz = e->work->xyz + 3 * begin;
  (void)thread;
  for (size_t t = begin / TILE; t < end / TILE; ++t, tile += stride, xyz += 3 * TILE) {
    __m512i sum = _mm512_setzero_si512();
    for (size_t line = 0; line < stride; line += 64) {
      sum = _mm512_xor_si512(sum, _mm512_loadu_si512(tile + line));
    }
    for (size_t j = 0; j < 3; ++j) {
      _mm512_stream_si512((void *)(xyz + 16 * j), sum);
    }
  }
  _mm_sfence();
}
#endif

static entry entry_of(bench *work, const char *what, const char *how, supine_range_function *range,
                      const supine_basis *basis, size_t threads) {
  const double bytes = supine_basis_get_info(basis)->bytes_per_vertex + 12.0;
  return (entry){what, how, range, work, basis, threads, bytes, INFINITY};
}

/* List the library itself, and its loads and stores, with a number of threads. */
static size_t add_library(bench *work, size_t threads, entry *entries) {
  static const char *const storages[] = {"auto", "exact", "int16", "mixed"};
  const supine_basis *usual = work->storage[SUPINE_STORAGE_INT16];
  const double packed = supine_basis_get_info(usual)->bytes_per_vertex;
  const double normals = 12.0 + 12.0 * (double)((work->info->normal_count + 2) / 3);
  size_t count = 0;
  for (size_t s = SUPINE_STORAGE_AUTO; s < SUPINE_STORAGE_COUNT; ++s) {
    if (work->storage[s] != NULL) {
      entries[count++] =
          entry_of(work, "supine", storages[s], run_deform, work->storage[s], threads);
    }
  }
  if (work->clusters != NULL) {
    entries[count++] = entry_of(work, "supine", "clusters", run_deform, work->clusters, threads);
  }
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f")) {
    entries[count++] = entry_of(work, "traffic", "int16", run_traffic, usual, threads);
  }
#endif
  if (work->info->normal_count > 0) {
    entries[count++] =
        (entry){"normals", "int16", run_normals, work, usual, threads, normals, INFINITY};
    entries[count++] =
        (entry){"lit", "int16", run_lit, work, usual, threads, normals + packed + 12.0, INFINITY};
  }
  return count;
}

/* List simple code that computes the same. */
static size_t add_rivals(bench *work, entry *entries) {
  const supine_basis_info *info = work->info;
  const supine_basis *usual = work->storage[SUPINE_STORAGE_INT16];
  const double numbers = (double)(work->rows * info->mode_count);
  const double fixed = work->rows == 3 ? 24.0 : 36.0; /* positions in and out, and directions */
  const double plain = 4.0 * numbers + fixed;
  const double sums = 8.0 * (double)work->rows; /* written and read */
  size_t count = 0;
  entries[count++] =
      (entry){"sgemv_displace", "float32", run_sgemv, work, usual, 1, plain + sums, INFINITY};
  entries[count++] = (entry){"sgemv_columns", "float32", run_sgemv_columns, work,
                             usual,           1,         plain + sums,      INFINITY};
  entries[count++] = (entry){"plain_native", "float32", run_plain, work, usual, 1, plain, INFINITY};
  entries[count++] = (entry){"planar", "float32", run_planar, work, usual, 1, plain, INFINITY};
  entries[count++] =
      (entry){"planar", "int16", run_planar_int16, work, usual, 1, 2.0 * numbers + fixed, INFINITY};
  if (work->clusters != NULL) {
    entries[count++] =
        (entry){"plain_clusters", "float32", run_plain_clusters, work, usual, 1, 30.0, INFINITY};
  }
  return count;
}

static size_t add_entries(bench *work, entry *entries) {
  const supine_basis_info *info = work->info;
  const supine_basis *usual = work->storage[SUPINE_STORAGE_INT16];
  size_t count = 0;
  for (size_t threads = 1; threads <= 2; ++threads) {
    count += add_library(work, threads, entries + count);
  }
  for (size_t s = SUPINE_SIMD_PORTABLE; s < SUPINE_SIMD_COUNT; ++s) {
    static const char *const codes[SUPINE_SIMD_COUNT] = {"auto", "portable", "avx2", "avx512"};
    if (work->simd[s] != NULL) {
      entries[count++] = entry_of(work, "supine", codes[s], run_deform, work->simd[s], 1);
    }
  }
  count += add_rivals(work, entries + count);
  if (info->normal_count > 0) {
    const double triangles = (double)info->triangle_count / (double)info->vertex_count;
    entries[count++] = (entry){"exact_normals", "float32", run_exact_normals,       work,
                               usual,           1,         12.0 * triangles + 24.0, INFINITY};
  }
  return count;
}

/* Return the processor time of this program, s. For several threads return the time of day. */
static double seconds(size_t threads) {
  struct timespec used;
  (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
  return threads > 1 ? supine_clock_seconds() : (double)used.tv_sec + 1e-9 * (double)used.tv_nsec;
}

/* Measure all entries REPEATS times. Each time, begin with another entry. */
static void measure(entry *entries, size_t count, size_t vertices) {
  const size_t rounds = 1 + ENOUGH / vertices;
  for (size_t turn = 0; turn < REPEATS; ++turn) {
    for (size_t i = 0; i < count; ++i) {
      entry *e = &entries[(i + turn) % count];
      supine_parallel_for(vertices, 64, e->threads, e->range, e);
      const double begin = seconds(e->threads);
      for (size_t r = 0; r < rounds; ++r) {
        supine_parallel_for(vertices, 64, e->threads, e->range, e);
      }
      e->seconds = fmin(e->seconds, (seconds(e->threads) - begin) / (double)rounds);
    }
  }
}

static double find(const entry *entries, size_t count, const char *what, const char *how,
                   size_t threads) {
  for (size_t i = 0; i < count; ++i) {
    if (strcmp(entries[i].what, what) == 0 && strcmp(entries[i].how, how) == 0 &&
        entries[i].threads == threads) {
      return entries[i].seconds;
    }
  }
  return NAN;
}

/* Print how much faster clusters are than the same vectors stored as modes, and than the fastest
 * simple code for these. */
static void print_clusters(const entry *entries, size_t count, size_t modes) {
  static const char *const storages[] = {"auto", "exact", "int16", "mixed"};
  const double own = find(entries, count, "supine", "clusters", 1);
  const entry *best = NULL;
  for (size_t i = 0; i < count; ++i) {
    const bool simple = entries[i].range == run_sgemv || entries[i].range == run_sgemv_columns ||
                        entries[i].range == run_plain || entries[i].range == run_planar ||
                        entries[i].range == run_planar_int16;
    if (simple && (best == NULL || entries[i].seconds < best->seconds)) {
      best = &entries[i];
    }
  }
  const supine_basis *usual = entries[0].work->storage[SUPINE_STORAGE_AUTO];
  (void)printf("supine clusters, 1 thread, compared with:\n"
               "  supine auto, %zu modes of vectors as stored by default (%s): %.2f times as fast\n"
               "  %s %s, the fastest simple code for them: %.2f times as fast\n"
               "  plain_clusters float32: %.2f times as fast\n",
               modes, storages[supine_basis_get_info(usual)->storage],
               find(entries, count, "supine", "auto", 1) / own, best->what, best->how,
               best->seconds / own, find(entries, count, "plain_clusters", "float32", 1) / own);
}

/* Print how much faster something is, unless one of the two was not measured. */
static void print_times(const char *what, double times) {
  if (isfinite(times)) {
    (void)printf("%s: %.2f times as fast\n", what, times);
  }
}

static void print(const entry *entries, size_t count, size_t vertices) {
  (void)printf("%-15s %-10s %7s %9s %6s %8s\n", "what", "how", "threads", "ns/vertex", "bytes",
               "GB/s");
  for (size_t i = 0; i < count; ++i) {
    const entry *e = &entries[i];
    const double ns = 1e9 * e->seconds / (double)vertices;
    (void)printf("%-15s %-10s %7zu %9.3f %6.1f %8.2f\n", e->what, e->how, e->threads, ns, e->bytes,
                 e->bytes / ns);
  }
  const double own = find(entries, count, "supine", "int16", 1);
  const double exact32 = find(entries, count, "supine", "exact", 1);
  (void)printf("supine int16, 1 thread, compared with:\n");
  print_times("  sgemv_displace float32",
              find(entries, count, "sgemv_displace", "float32", 1) / own);
  print_times("  sgemv_columns float32", find(entries, count, "sgemv_columns", "float32", 1) / own);
  print_times("  plain_native float32", find(entries, count, "plain_native", "float32", 1) / own);
  print_times("  planar int16", find(entries, count, "planar", "int16", 1) / own);
  print_times("supine exact compared with planar float32",
              find(entries, count, "planar", "float32", 1) / exact32);
  print_times("supine int16, 1 thread, compared with traffic int16",
              find(entries, count, "traffic", "int16", 1) / own);
  print_times("supine int16, 2 threads compared with 1 thread",
              own / find(entries, count, "supine", "int16", 2));
  const double exact = find(entries, count, "exact_normals", "float32", 1);
  if (isfinite(exact)) {
    (void)printf(
        "normals from modes: %.2f times as fast as exact normals; positions and normals from modes "
        "take %.2f times as long as positions and exact normals\n",
        exact / find(entries, count, "normals", "int16", 1),
        find(entries, count, "lit", "int16", 1) / (own + exact));
  }
}

/* Check that all measured loops compute the same positions. */
static bool check_same(bench *work, entry *entries, size_t count) {
  const size_t n = work->info->vertex_count;
  float *expected = fixture_allocate(3 * n, sizeof *expected);
  entry plain = {.work = work};
  run_plain(&plain, 0, n, 0);
  memcpy(expected, work->xyz, 3 * n * sizeof *expected);
  bool same = true;
  for (size_t i = 0; i < count; ++i) {
    if (entries[i].range == run_deform || entries[i].range == run_sgemv ||
        entries[i].range == run_sgemv_columns || entries[i].range == run_planar ||
        entries[i].range == run_planar_int16 || entries[i].range == run_plain_clusters) {
      double apart = 0.0;
      double moved = 0.0;
      entries[i].range(&entries[i], 0, n, 0);
      for (size_t k = 0; k < 3 * n; ++k) {
        apart = fmax(apart, fabs((double)work->xyz[k] - (double)expected[k]));
        moved = fmax(moved, fabs((double)expected[k] - (double)work->info->vertices[k]));
      }
      if (apart > 1e-3 * moved) {
        (void)fprintf(stderr, "positions by %s %s and by the plain loop differ by %g mm\n",
                      entries[i].what, entries[i].how, apart);
        same = false;
      }
    }
  }
  free(expected);
  return same;
}

/* Return a basis file with the coefficients of an open basis of clusters, and without its clusters.
 * @param size  written, bytes */
static unsigned char *expand_clusters(const supine_basis *basis, const void *bytes, size_t length,
                                      size_t *size) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t rows = 3 * info->vertex_count;
  SUPINE_ARENA arena = {0};
  float *coefficients = supine_arena_take(&arena, rows * info->mode_count, sizeof *coefficients);
  supine_safetensors *file = NULL;
  char *made = NULL;
  if (coefficients == NULL ||
      supine_safetensors_open_memory(bytes, length, "clusters", &file, NULL) != SUPINE_OK) {
    return NULL;
  }
  supine_tensor *list = supine_arena_take(&arena, file->tensor_count + 1, sizeof *list);
  size_t metadata_count = 0;
  const supine_metadata *metadata = supine_safetensors_all_metadata(file, &metadata_count);
  supine_metadata *kept = supine_arena_take(&arena, metadata_count, sizeof *kept);
  FILE *out = open_memstream(&made, size);
  if (list != NULL && kept != NULL && out != NULL) {
    size_t count = 0;
    size_t lines = 0;
    (void)supine_basis_coefficients(basis, 0, info->vertex_count, coefficients);
    for (size_t i = 0; i < file->tensor_count; ++i) {
      if (strncmp(file->tensors[i].name, "cluster", 7) != 0) {
        list[count++] = file->tensors[i];
      }
    }
    list[count++] = (supine_tensor){
        "coefficients", SUPINE_F32, 3, {info->vertex_count, 3, info->mode_count}, coefficients};
    for (size_t i = 0; i < metadata_count; ++i) {
      if (strcmp(metadata[i].key, "checksum") != 0) {
        kept[lines++] = metadata[i];
      }
    }
    supine_safetensors_print(out, list, count, kept, lines);
  }
  if (out != NULL) {
    (void)fclose(out);
  }
  supine_safetensors_close(file);
  return (unsigned char *)made;
}

/* Open the basis in every storage and with every instruction set. */
static bool open_all(bench *work, const void *bytes, size_t size, supine_error *error) {
  supine_basis_options options = {.size = sizeof options};
  for (int s = SUPINE_STORAGE_AUTO; s < SUPINE_STORAGE_COUNT; ++s) {
    options.storage = (supine_storage)s;
    options.without_normals = s != SUPINE_STORAGE_INT16;
    if (supine_basis_open_memory_with(bytes, size, &options, &work->storage[s], error) !=
        SUPINE_OK) {
      return false;
    }
    if (s == SUPINE_STORAGE_AUTO && !supine_basis_get_info(work->storage[s])->vector) {
      supine_basis_close(work->storage[s]);
      work->storage[s] = NULL;
    }
  }
  options = (supine_basis_options){
      .size = sizeof options, .storage = SUPINE_STORAGE_INT16, .without_normals = true};
  for (int s = SUPINE_SIMD_PORTABLE; s < SUPINE_SIMD_COUNT; ++s) {
    options.simd = (supine_simd)s;
    (void)supine_basis_open_memory_with(bytes, size, &options, &work->simd[s], NULL);
  }
  work->info = supine_basis_get_info(work->storage[SUPINE_STORAGE_INT16]);
  work->rows = work->info->vector ? 3 : 1;
  return true;
}

/* Make a random basis, or read a file. */
static unsigned char *load(const char *what, size_t *size) {
  static const char prefix[] = "clusters:";
  const bool clusters = strncmp(what, prefix, strlen(prefix)) == 0;
  const size_t vertices = strtoul(clusters ? what + strlen(prefix) : what, NULL, 10);
  if (vertices == 0) {
    return test_read(what, size);
  }
  fixture *made = fixture_create(vertices, 16, 3, 2, clusters, false, 5.0, 31);
  if (clusters) {
    fixture_add_clusters(made, CLUSTERS, 5.0, 33);
  } else {
    fixture_add_normals(made, 6, 32);
  }
  unsigned char *bytes = fixture_bytes(made, size);
  fixture_destroy(made);
  return bytes;
}

/* Find the weights of a pose, the same for all lungs. */
static void find_pose(bench *work) {
  const supine_state state = {.gravity = {0.6, 0.8, 0.0}};
  const supine_basis *basis = work->storage[SUPINE_STORAGE_INT16];
  const size_t modes = work->info->mode_count;
  if (work->info->order > 0) {
    (void)supine_basis_pose(basis, &state, &work->pose, NULL);
    for (size_t k = modes; k < work->info->lung_count * modes; ++k) {
      work->pose.weights[k] = work->pose.weights[k % modes];
    }
  } else {
    (void)supine_basis_weights(basis, state.gravity, work->pose.weights);
  }
  work->pose.basis = 0; /* for the basis of clusters, too */
  for (size_t i = 0; i < 3 * SUPINE_LUNGS_MAX; ++i) {
    work->pose.gains[i / 3][i % 3] = 0.7;
  }
  for (size_t k = 0; k < modes; ++k) {
    work->weights[k] = (float)(0.7 * work->pose.weights[k]);
  }
}

/* Measure all ways to compute the positions, and print them. Return whether they agree. */
static bool compare(const char *what, bench *work) {
  entry entries[ENTRIES_MAX];
  const size_t n = work->info->vertex_count;
  find_pose(work);
  work->xyz = aligned_alloc(64, (12 * n + 127) / 64 * 64);
  work->normals = fixture_allocate(3 * n, sizeof *work->normals);
  work->amount = fixture_allocate(work->rows * n, sizeof *work->amount);
  make_columns(work);
  const size_t count = add_entries(work, entries);
  if (work->xyz == NULL || !check_same(work, entries, count)) {
    return false;
  }
  (void)printf("%s: %zu vertices, %zu modes%s", what, n, work->info->mode_count,
               work->info->vector ? " of vectors" : "");
  if (work->clusters != NULL) {
    (void)printf(", %zu clusters", supine_basis_get_info(work->clusters)->cluster_count);
  }
  (void)puts("");
  measure(entries, count, n);
  print(entries, count, n);
  if (work->clusters != NULL) {
    print_clusters(entries, count, work->info->mode_count);
  }
  return true;
}

static void close_all(bench *work) {
  for (size_t s = 0; s < SUPINE_STORAGE_COUNT; ++s) {
    supine_basis_close(work->storage[s]);
  }
  for (size_t s = 0; s < SUPINE_SIMD_COUNT; ++s) {
    supine_basis_close(work->simd[s]);
  }
  supine_basis_close(work->clusters);
  free(work->xyz);
  free(work->normals);
  free(work->amount);
  free(work->columns);
  free(work->counts);
}

static bool run(const char *what) {
  bench work = {.info = NULL};
  supine_error error = {0};
  size_t size = 0;
  size_t expanded_size = 0;
  unsigned char *bytes = load(what, &size);
  unsigned char *expanded = NULL;
  supine_basis *basis = NULL;
  bool good = supine_basis_open_memory(bytes, size, &basis, &error) == SUPINE_OK;
  if (good && supine_basis_get_info(basis)->cluster_count > 0) {
    work.clusters = basis;
    expanded = expand_clusters(basis, bytes, size, &expanded_size);
    good = expanded != NULL && open_all(&work, expanded, expanded_size, &error);
  } else {
    supine_basis_close(basis);
    good = good && open_all(&work, bytes, size, &error);
  }
  if (good) {
    good = compare(what, &work);
  } else {
    (void)fprintf(stderr, "%s: %s\n", what, error.message);
  }
  close_all(&work);
  free(expanded);
  free(bytes);
  return good;
}

/* Print what Linux says of the processor. */
static void print_processor(void) {
  static const char *const keys[] = {"model name\t", "cpu family\t", "model\t"};
  char line[256];
  size_t next = 0;
  FILE *file = fopen("/proc/cpuinfo", "r");
  while (file != NULL && next < 3 && fgets(line, sizeof line, file) != NULL) {
    for (size_t k = 0; k < 3; ++k) {
      if (strncmp(line, keys[k], strlen(keys[k])) == 0) {
        (void)printf("%s", line);
        ++next;
      }
    }
  }
  if (file != NULL) {
    (void)fclose(file);
  }
}

int main(int argc, char **argv) {
  static const char *const usual[] = {"1000000", "16000000"};
  bool good = true;
  openblas_set_num_threads(1);
  print_processor();
  for (int i = 0; i < (argc > 1 ? argc - 1 : 2); ++i) {
    good = run(argc > 1 ? argv[i + 1] : usual[i]) && good;
  }
  return good ? 0 : 1;
}
