/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compare the speed of the run-time library with OpenBLAS and with plain loops. All run in turn in
 * one process.
 *
 *     OPENBLAS_CORETYPE=SAPPHIRERAPIDS bench_runtime [VERTICES | BASIS]...
 *
 * VERTICES is the number of vertices of a random basis with 16 modes, and 6 modes for normals.
 * A BASIS has its own modes: the default ones are 4. Print the fastest of nine runs, by processor
 * time (by time of day for two threads). OpenBLAS 0.3.21 does not recognise newer processors.
 * Therefore, OPENBLAS_CORETYPE must name a processor that it supports. */
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

#include "base/clock.h"
#include "base/parallel.h"
#include "tests/helpers/runtime_fixture.h"
#include "tests/helpers/test.h"

enum { TILE = 16, ENTRIES_MAX = 64, REPEATS = 9, ENOUGH = 2000000 };

void openblas_set_num_threads(int threads);

typedef struct bench {
  const supine_basis_info *info;
  supine_basis *storage[SUPINE_STORAGE_COUNT]; /* the basis for each way of storing coefficients */
  supine_basis *simd[SUPINE_SIMD_COUNT];       /* NULL if the processor lacks the instruction set */
  supine_pose pose;
  float weights[SUPINE_MODES_MAX]; /* [modes] weights of the modes, times the displacement factor */
  float *xyz, *normals;            /* [N, 3] positions, mm, and normals */
  float *amount;   /* [N] displacement of each vertex along its unit vector in the basis, mm */
  float *columns;  /* [modes, N] displacement of each vertex by each mode of weight 1, mm */
  int16_t *counts; /* [modes, N] `columns` as multiples of a quantisation step for each mode */
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
      work->xyz[3 * i + axis] =
          m->vertices[3 * i + axis] + work->amount[i] * m->direction[3 * i + axis];
    }
  }
}

static void run_sgemv(void *context, size_t begin, size_t end, size_t thread) {
  const entry *e = context;
  const int modes = (int)e->work->info->mode_count;
  (void)thread;
  cblas_sgemv(CblasRowMajor, CblasNoTrans, (int)(end - begin), modes, 1.0F,
              e->work->info->coefficients + begin * (size_t)modes, modes, e->work->weights, 1, 0.0F,
              e->work->amount + begin, 1);
  displace(e->work, begin, end);
}

/* Compute positions by one plain loop, compiled with -march=native. The loop over 16 modes has a
 * constant length, so that the compiler unrolls it. */
static void run_plain(void *context, size_t begin, size_t end, size_t thread) {
  const bench *work = ((const entry *)context)->work;
  const supine_basis_info *m = work->info;
  const float *restrict w = work->weights;
  float *restrict xyz = work->xyz;
  (void)thread;
  for (size_t i = begin; i < end; ++i) {
    const float *c = m->coefficients + i * m->mode_count;
    float amount = 0;
    if (m->mode_count == 16) {
      for (size_t k = 0; k < 16; ++k) {
        amount += w[k] * c[k];
      }
    } else {
      for (size_t k = 0; k < m->mode_count; ++k) {
        amount += w[k] * c[k];
      }
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      xyz[3 * i + axis] = m->vertices[3 * i + axis] + amount * m->direction[3 * i + axis];
    }
  }
}

/* Compute displacements by sgemv from a matrix whose columns are the modes, then positions. */
static void run_sgemv_columns(void *context, size_t begin, size_t end, size_t thread) {
  const entry *e = context;
  const bench *work = e->work;
  (void)thread;
  cblas_sgemv(CblasColMajor, CblasNoTrans, (int)(end - begin), (int)work->info->mode_count, 1.0F,
              work->columns + begin, (int)work->info->vertex_count, work->weights, 1, 0.0F,
              work->amount + begin, 1);
  displace(work, begin, end);
}

enum { BLOCK = 16384 }; /* number of vertices whose displacements fit in the second-level cache */

/* Add the displacements by mode k to work->amount[i] for begin <= i < end. */
typedef void add_mode(const bench *work, size_t k, size_t begin, size_t end);

static void add_column(const bench *work, size_t k, size_t begin, size_t end) {
  const float *restrict c = work->columns + k * work->info->vertex_count;
  float *restrict amount = work->amount;
  const float w = work->weights[k];
  for (size_t i = begin; i < end; ++i) {
    amount[i] += w * c[i];
  }
}

static void add_counts(const bench *work, size_t k, size_t begin, size_t end) {
  const int16_t *restrict c = work->counts + k * work->info->vertex_count;
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
    memset(work->amount + at, 0, (last - at) * sizeof *work->amount);
    for (size_t k = 0; k < work->info->mode_count; ++k) {
      add(work, k, at, last);
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
  const size_t n = work->info->vertex_count;
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

static size_t add_entries(bench *work, entry *entries) {
  static const char *const storages[] = {"auto", "exact", "int16", "mixed"};
  const supine_basis_info *info = work->info;
  const supine_basis *usual = work->storage[SUPINE_STORAGE_INT16];
  const double packed = supine_basis_get_info(usual)->bytes_per_vertex;
  const double plain = 4.0 * (double)info->mode_count + 36.0;
  const double normals = 12.0 + 12.0 * (double)((info->normal_count + 2) / 3);
  size_t count = 0;
  for (size_t threads = 1; threads <= 2; ++threads) {
    for (size_t s = SUPINE_STORAGE_EXACT; s < SUPINE_STORAGE_COUNT; ++s) {
      const double bytes = supine_basis_get_info(work->storage[s])->bytes_per_vertex + 12.0;
      entries[count++] = (entry){"supine",         storages[s], run_deform, work,
                                 work->storage[s], threads,     bytes,      INFINITY};
    }
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx512f")) {
      entries[count++] =
          (entry){"traffic", "int16", run_traffic, work, usual, threads, packed + 12.0, INFINITY};
    }
#endif
    if (info->normal_count > 0) {
      entries[count++] =
          (entry){"normals", "int16", run_normals, work, usual, threads, normals, INFINITY};
      entries[count++] =
          (entry){"lit", "int16", run_lit, work, usual, threads, normals + packed + 12.0, INFINITY};
    }
  }
  for (size_t s = SUPINE_SIMD_PORTABLE; s < SUPINE_SIMD_COUNT; ++s) {
    static const char *const codes[SUPINE_SIMD_COUNT] = {"auto", "portable", "avx2", "avx512"};
    if (work->simd[s] != NULL) {
      entries[count++] =
          (entry){"supine", codes[s], run_deform, work, work->simd[s], 1, packed + 12.0, INFINITY};
    }
  }
  entries[count++] =
      (entry){"sgemv_displace", "float32", run_sgemv, work, usual, 1, plain + 8.0, INFINITY};
  entries[count++] =
      (entry){"sgemv_columns", "float32", run_sgemv_columns, work, usual, 1, plain + 8.0, INFINITY};
  entries[count++] = (entry){"plain_native", "float32", run_plain, work, usual, 1, plain, INFINITY};
  entries[count++] = (entry){"planar", "float32", run_planar, work, usual, 1, plain, INFINITY};
  entries[count++] = (entry){
      "planar", "int16", run_planar_int16, work, usual, 1, 2.0 * (double)info->mode_count + 36.0,
      INFINITY};
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
  (void)printf(
      "supine int16, 1 thread, compared with:\n"
      "  sgemv_displace float32: %.2f times as fast\n  sgemv_columns float32: %.2f times as fast\n"
      "  plain_native float32: %.2f times as fast\n  planar int16: %.2f times as fast\n"
      "supine exact compared with planar float32: %.2f times as fast\n"
      "supine int16, 1 thread, compared with traffic int16: %.2f times as fast\n"
      "supine int16, 2 threads compared with 1 thread: %.2f times as fast\n",
      find(entries, count, "sgemv_displace", "float32", 1) / own,
      find(entries, count, "sgemv_columns", "float32", 1) / own,
      find(entries, count, "plain_native", "float32", 1) / own,
      find(entries, count, "planar", "int16", 1) / own,
      find(entries, count, "planar", "float32", 1) / exact32,
      find(entries, count, "traffic", "int16", 1) / own,
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
        entries[i].range == run_planar_int16) {
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

static bool open_all(bench *work, const void *bytes, size_t size, supine_error *error) {
  supine_basis_options options = {.size = sizeof options};
  for (int s = SUPINE_STORAGE_EXACT; s < SUPINE_STORAGE_COUNT; ++s) {
    options.storage = (supine_storage)s;
    options.without_normals = s != SUPINE_STORAGE_INT16;
    if (supine_basis_open_memory_with(bytes, size, &options, &work->storage[s], error) !=
        SUPINE_OK) {
      return false;
    }
  }
  options = (supine_basis_options){
      .size = sizeof options, .storage = SUPINE_STORAGE_INT16, .without_normals = true};
  for (int s = SUPINE_SIMD_PORTABLE; s < SUPINE_SIMD_COUNT; ++s) {
    options.simd = (supine_simd)s;
    (void)supine_basis_open_memory_with(bytes, size, &options, &work->simd[s], NULL);
  }
  work->info = supine_basis_get_info(work->storage[SUPINE_STORAGE_INT16]);
  return true;
}

static bool run(const char *what) {
  const size_t vertices = strtoul(what, NULL, 10);
  const double gravity[3] = {0.6, 0.8, 0.0};
  bench work = {.info = NULL};
  entry entries[ENTRIES_MAX];
  supine_error error = {0};
  unsigned char *bytes = NULL;
  size_t size = 0;
  if (vertices > 0) {
    fixture *made = fixture_create(vertices, 16, 3, 2, false, false, 5.0, 31);
    fixture_add_normals(made, 6, 32);
    bytes = fixture_bytes(made, &size);
    fixture_destroy(made);
  } else {
    bytes = test_read(what, &size);
  }
  bool good = open_all(&work, bytes, size, &error) && !work.info->vector;
  if (good) {
    const size_t n = work.info->vertex_count;
    (void)supine_basis_weights(work.storage[SUPINE_STORAGE_INT16], gravity, work.pose.weights);
    for (size_t i = 0; i < 3 * SUPINE_LUNGS_MAX; ++i) {
      work.pose.gains[i / 3][i % 3] = 0.7;
    }
    for (size_t k = 0; k < work.info->mode_count; ++k) {
      work.weights[k] = (float)(0.7 * work.pose.weights[k]);
    }
    work.xyz = aligned_alloc(64, (12 * n + 127) / 64 * 64);
    work.normals = fixture_allocate(3 * n, sizeof *work.normals);
    work.amount = fixture_allocate(n, sizeof *work.amount);
    make_columns(&work);
    const size_t count = add_entries(&work, entries);
    good = work.xyz != NULL && check_same(&work, entries, count);
    if (good) {
      (void)printf("%s: %zu vertices, %zu modes\n", what, n, work.info->mode_count);
      measure(entries, count, n);
      print(entries, count, n);
    }
  } else {
    (void)fprintf(stderr, "%s: %s\n", what, error.message);
  }
  for (size_t s = 0; s < SUPINE_STORAGE_COUNT; ++s) {
    supine_basis_close(work.storage[s]);
  }
  for (size_t s = 0; s < SUPINE_SIMD_COUNT; ++s) {
    supine_basis_close(work.simd[s]);
  }
  free(work.xyz);
  free(work.normals);
  free(work.amount);
  free(work.columns);
  free(work.counts);
  free(bytes);
  return good;
}

int main(int argc, char **argv) {
  static const char *const usual[] = {"1000000", "16000000"};
  bool good = true;
  openblas_set_num_threads(1);
  for (int i = 0; i < (argc > 1 ? argc - 1 : 2); ++i) {
    good = run(argc > 1 ? argv[i + 1] : usual[i]) && good;
  }
  return good ? 0 : 1;
}
