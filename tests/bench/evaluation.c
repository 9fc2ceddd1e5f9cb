/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measuring the evaluator: what takes part. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "evaluation.h"
#include "sh/base/clones.h"
#include "sh/base/parallel.h"

#include "tests/poses.h"

enum {
  TILE = 16,
  TILE_NUMBERS = 48, /* vertices that the evaluator takes at once */
  ENTRIES_MAX = 64,
  BATCH = 64,
  HUGE_PAGE = 1 << 21,
  ARITHMETIC = 2000000,
  ENOUGH = 2000000
};

const char *supine_bench_storage_name(supine_storage storage) {
  static const char *const names[SUPINE_STORAGE_COUNT] = {"auto", "exact", "int16", "mixed"};
  return storage < SUPINE_STORAGE_COUNT ? names[storage] : "";
}

const char *supine_bench_code_name(supine_simd simd) {
  static const char *const names[SUPINE_SIMD_COUNT] = {"auto", "portable", "avx2", "avx512"};
  return simd < SUPINE_SIMD_COUNT ? names[simd] : "";
}

/* What every entry of one size works on. */
typedef struct bench {
  supine_bench_image image;
  supine_basis *bases[SUPINE_STORAGE_COUNT]; /* in that storage */
  double weights[BATCH * SUPINE_MODES_MAX];
  double scales[BATCH * SUPINE_LUNGS_MAX];
  float plain_weights[SUPINE_MODES_MAX];
  float results[256]; /* of arithmetic, one a thread, so that it is not left out */
  float *xyz;         /* [N, 3] */
  float *a, *b, *c;   /* of `numbers` floats, for copy and triad */
  size_t numbers;
  size_t batch_vertices;
  float *batch; /* [BATCH, batch_vertices, 3] */
} bench;

/* An entry's context. */
typedef struct task {
  bench *work;
  const supine_basis *basis;
  size_t threads;
  supine_range_function *range;
  size_t count, rounds;
} task;

/* Each thread goes through its share `rounds` times, so that starting it counts for little. */
static void task_range(void *context, size_t begin, size_t end, size_t thread) {
  const task *t = context;
  for (size_t i = 0; i < t->rounds; ++i) {
    t->range(context, begin, end, thread);
  }
}

static void task_run(void *context) {
  task *t = context;
  supine_parallel_for(t->count, 64, t->threads, task_range, t);
}

static void range_deform(void *context, size_t begin, size_t end, size_t thread) {
  const task *t = context;
  (void)thread;
  supine_deform_range(t->basis, POSED(t->basis, t->work->weights, t->work->scales), begin, end,
                      t->work->xyz + 3 * begin);
}

static void range_normals(void *context, size_t begin, size_t end, size_t thread) {
  const task *t = context;
  (void)thread;
  (void)supine_deform_lit_range(t->basis, POSED(t->basis, t->work->weights, t->work->scales), begin,
                                end, NULL, t->work->c + 3 * begin);
}

static void range_lit(void *context, size_t begin, size_t end, size_t thread) {
  const task *t = context;
  (void)thread;
  (void)supine_deform_lit_range(t->basis, POSED(t->basis, t->work->weights, t->work->scales), begin,
                                end, t->work->xyz + 3 * begin, t->work->c + 3 * begin);
}

/* Of one thread: it knows no ranges. */
static void range_exact_normals(void *context, size_t begin, size_t end, size_t thread) {
  const task *t = context;
  (void)begin;
  (void)end;
  (void)thread;
  supine_normals(t->basis, t->work->xyz, t->work->c);
}

static void range_separate(void *context, size_t begin, size_t end, size_t thread) {
  const task *t = context;
  const size_t n = t->work->image.vertices;
  (void)thread;
  supine_deform_separate(t->basis, POSED(t->basis, t->work->weights, t->work->scales), begin, end,
                         t->work->xyz + begin, t->work->xyz + n + begin,
                         t->work->xyz + 2 * n + begin);
}

static void range_step(void *context, size_t begin, size_t end, size_t thread) {
  const task *t = context;
  (void)thread;
  supine_step(end - begin, t->work->image.direction + 3 * begin, t->work->xyz + 3 * begin);
}

static void range_batch(void *context, size_t begin, size_t end, size_t thread) {
  const task *t = context;
  (void)thread;
  supine_deform_batch(t->basis, BATCH,
                      posed_batch(t->basis, BATCH, t->work->weights, t->work->scales), begin, end,
                      t->work->batch + 3 * BATCH * begin); /* a part of its own each thread */
}

/* The loop that anyone would write. */
static inline __attribute__((always_inline)) void
plain_any(size_t n, size_t modes, const float *restrict w, const float *restrict c,
          const float *restrict d, const float *restrict p, float *restrict xyz) {
  for (size_t i = 0; i < n; ++i) {
    float amount = 0;
    for (size_t k = 0; k < modes; ++k) {
      amount += w[k] * c[i * modes + k];
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      xyz[3 * i + axis] = p[3 * i + axis] + amount * d[3 * i + axis];
    }
  }
}

SUPINE_CLONES static void plain_loop(size_t n, size_t modes, const float *w, const float *c,
                                     const float *d, const float *p, float *xyz) {
  plain_any(n, modes, w, c, d, p, xyz);
}

/* With a number of modes that the compiler knows. */
SUPINE_CLONES static void plain_loop16(size_t n, const float *w, const float *c, const float *d,
                                       const float *p, float *xyz) {
  plain_any(n, 16, w, c, d, p, xyz);
}

static void range_plain(void *context, size_t begin, size_t end, size_t thread) {
  const task *t = context;
  const supine_bench_image *m = &t->work->image;
  (void)thread;
  const float *c = m->coefficients + begin * m->modes;
  const float *d = m->direction + 3 * begin;
  if (m->modes == 16) {
    plain_loop16(end - begin, t->work->plain_weights, c, d, m->rest + 3 * begin,
                 t->work->xyz + 3 * begin);
  } else {
    plain_loop(end - begin, m->modes, t->work->plain_weights, c, d, m->rest + 3 * begin,
               t->work->xyz + 3 * begin);
  }
}

#if defined(__x86_64__) && defined(__GNUC__)
/* c = a + 0.3 b past the cache, or c = a where b is NULL; 16 numbers at a time. */
__attribute__((target("avx512f"))) static void triad_avx512(size_t n, const float *a,
                                                            const float *b, float *c) {
  for (size_t i = 0; i + 16 <= n; i += 16) {
    const __m512 x = _mm512_load_ps(a + i);
    _mm512_stream_ps(
        c + i, b == NULL ? x : _mm512_fmadd_ps(_mm512_set1_ps(0.3F), _mm512_load_ps(b + i), x));
  }
  _mm_sfence();
}

__attribute__((target("avx2,fma"))) static void triad_avx2(size_t n, const float *a, const float *b,
                                                           float *c) {
  for (size_t i = 0; i + 8 <= n; i += 8) {
    const __m256 x = _mm256_load_ps(a + i);
    _mm256_stream_ps(
        c + i, b == NULL ? x : _mm256_fmadd_ps(_mm256_set1_ps(0.3F), _mm256_load_ps(b + i), x));
  }
  _mm_sfence();
}
#endif

static void triad(supine_simd simd, size_t n, const float *a, const float *b, float *c) {
#if defined(__x86_64__) && defined(__GNUC__)
  if (simd == SUPINE_SIMD_AVX512) {
    triad_avx512(n, a, b, c);
    return;
  }
  if (simd == SUPINE_SIMD_AVX2) {
    triad_avx2(n, a, b, c);
    return;
  }
#endif
  (void)simd;
  for (size_t i = 0; i < n; ++i) {
    c[i] = b == NULL ? a[i] : a[i] + 0.3F * b[i];
  }
}

static void range_copy(void *context, size_t begin, size_t end, size_t thread) {
  const task *t = context;
  const bench *work = t->work;
  (void)thread;
  triad(supine_basis_get_info(t->basis)->simd, end - begin, work->a + begin, NULL, work->c + begin);
}

static void range_triad(void *context, size_t begin, size_t end, size_t thread) {
  const task *t = context;
  const bench *work = t->work;
  (void)thread;
  triad(supine_basis_get_info(t->basis)->simd, end - begin, work->a + begin, work->b + begin,
        work->c + begin);
}

#if defined(__x86_64__) && defined(__GNUC__)
__attribute__((target("avx512f"))) static void
traffic_avx512(const unsigned char *tiles, size_t stride, size_t count, float *xyz) {
  for (size_t t = 0; t < count; ++t, tiles += stride, xyz += TILE_NUMBERS) {
    __m512i sum = _mm512_setzero_si512();
    for (size_t line = 0; line < stride; line += 64) {
      sum = _mm512_xor_si512(sum, _mm512_load_si512(tiles + line));
    }
    for (size_t j = 0; j < 3; ++j) {
      _mm512_stream_si512((void *)(xyz + 16 * j), sum);
    }
  }
  _mm_sfence();
}
#endif

/* The evaluator's loads and stores without its arithmetic: what memory allows at best. Whole lines
 * past the cache need AVX-512 (in 16-byte parts they take a tenth longer); elsewhere the stores are
 * ordinary ones, and this is no bound. */
static void range_traffic(void *context, size_t begin, size_t end, size_t thread) {
  const task *t = context;
  const supine_basis_info *info = supine_basis_get_info(t->basis);
  const size_t stride = (size_t)(info->bytes_per_vertex * TILE);
  const unsigned char *tile = (const unsigned char *)info->packed + begin / TILE * stride;
  float *xyz = t->work->xyz + 3 * begin;
  const size_t count = (end - begin) / TILE;
  (void)thread;
#if defined(__x86_64__) && defined(__GNUC__)
  if (info->simd == SUPINE_SIMD_AVX512) {
    traffic_avx512(tile, stride, count, xyz);
    return;
  }
#endif
  for (size_t i = 0; i < count; ++i, tile += stride, xyz += TILE_NUMBERS) {
    float sum[TILE] = {0};
    for (size_t at = 0; at < stride; at += sizeof sum) {
      float line[TILE];
      memcpy(line, tile + at, sizeof line);
      for (size_t v = 0; v < TILE; ++v) {
        sum[v] = sum[v] < line[v] ? line[v] : sum[v];
      }
    }
    for (size_t j = 0; j < TILE_NUMBERS; ++j) {
      xyz[j] = sum[j % TILE];
    }
  }
}

/* Arithmetic alone: eight chains of multiplications that stay in registers. */
static void range_arithmetic(void *context, size_t begin, size_t end, size_t thread) {
  const task *t = context;
  float chain[8] = {1, 2, 3, 4, 5, 6, 7, 8};
  for (size_t i = begin; i < end; ++i) {
    for (size_t j = 0; j < 8; ++j) {
      chain[j] = chain[j] * 0.999F + 0.001F;
    }
  }
  volatile float *result = t->work->results + thread;
  *result = chain[0] + chain[1] + chain[2] + chain[3] + chain[4] + chain[5] + chain[6] + chain[7];
}

static float *floats(size_t count) {
  const size_t bytes = (count * sizeof(float) + HUGE_PAGE) / HUGE_PAGE * HUGE_PAGE;
  float *memory = aligned_alloc(HUGE_PAGE, bytes);
  if (memory != NULL) {
    (void)madvise(memory, bytes, MADV_HUGEPAGE);
    memset(memory, 0, bytes);
  }
  return memory;
}

static void bench_close(bench *work) {
  for (size_t i = 0; i < SUPINE_STORAGE_COUNT; ++i) {
    supine_basis_close(work->bases[i]);
  }
  supine_bench_image_destroy(&work->image);
  free(work->xyz);
  free(work->a);
  free(work->b);
  free(work->c);
  free(work->batch);
}

static supine_status bench_open(bench *work, size_t vertices, const supine_bench_options *options,
                                supine_error *error) {
  supine_status status =
      supine_bench_image_create(vertices, 16, options->like, &work->image, error);
  if (status != SUPINE_OK) {
    return status;
  }
  for (int storage = SUPINE_STORAGE_EXACT; storage < SUPINE_STORAGE_COUNT; ++storage) {
    if (options->lit && storage != SUPINE_STORAGE_INT16) {
      continue; /* gigabytes, where there are millions of vertices */
    }
    const supine_basis_options stored = {sizeof stored, .storage = (supine_storage)storage,
                                         .without_normals = storage != SUPINE_STORAGE_INT16};
    status = supine_basis_open_memory_with(work->image.bytes, work->image.size, &stored,
                                           &work->bases[storage], error);
    if (status != SUPINE_OK) {
      return status;
    }
  }
  work->numbers = vertices * 8 + 16; /* three arrays of 32 bytes a vertex */
  work->batch_vertices = vertices < 50000 ? vertices : 50000;
  work->xyz = floats(3 * vertices);
  work->a = floats(work->numbers);
  work->b = floats(work->numbers);
  work->c = floats(work->numbers);
  work->batch = floats(3 * BATCH * work->batch_vertices);
  if (work->xyz == NULL || work->a == NULL || work->b == NULL || work->c == NULL ||
      work->batch == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", vertices);
  }
  const supine_basis *basis = work->bases[SUPINE_STORAGE_INT16];
  for (size_t j = 0; j < BATCH; ++j) {
    const double gravity[3] = {cos((double)j), 0.9 * sin((double)j), 0.3 - 0.01 * (double)j};
    (void)supine_basis_weights(basis, gravity, work->weights + j * work->image.modes);
  }
  for (size_t i = 0; i < BATCH * SUPINE_LUNGS_MAX; ++i) {
    work->scales[i] = 0.7;
  }
  for (size_t k = 0; k < work->image.modes; ++k) {
    work->plain_weights[k] = (float)(0.7 * work->weights[k]);
  }
  return SUPINE_OK;
}

/* What is measured side by side does the same work: each storage moves the vertices to where the
 * plain loop does, but for a thousandth of the largest move. */
static supine_status check_same(bench *work, supine_error *error) {
  const supine_bench_image *m = &work->image;
  const size_t numbers = 3 * m->vertices;
  plain_loop(m->vertices, m->modes, work->plain_weights, m->coefficients, m->direction, m->rest,
             work->a);
  for (int storage = SUPINE_STORAGE_EXACT; storage < SUPINE_STORAGE_COUNT; ++storage) {
    double apart = 0.0;
    double moved = 0.0;
    if (work->bases[storage] != NULL) {
      supine_deform(work->bases[storage], POSED(work->bases[storage], work->weights, work->scales),
                    work->xyz);
      for (size_t i = 0; i < numbers; ++i) {
        apart = fmax(apart, fabs((double)work->xyz[i] - (double)work->a[i]));
        moved = fmax(moved, fabs((double)work->a[i] - (double)m->rest[i]));
      }
    }
    if (apart > 1e-3 * moved) {
      return supine_error_set(error, SUPINE_ERROR_NUMERICAL,
                              "%s storage and the plain loop end %g mm apart: times would compare "
                              "different work",
                              supine_bench_storage_name((supine_storage)storage), apart);
    }
  }
  return SUPINE_OK;
}

/* An entry and its task at the end of a list. */
typedef struct list {
  supine_bench_entry entries[ENTRIES_MAX];
  task tasks[ENTRIES_MAX];
  size_t count;
} list;

/* Eight parameters: one a column of the table of tasks. */
static supine_bench_row *add(list *l, bench *work, const char *what, const supine_basis *basis,
                             size_t threads, supine_range_function *range, size_t count,
                             double bytes) {
  task *t = &l->tasks[l->count];
  supine_bench_entry *e = &l->entries[l->count++];
  const size_t rounds = 1 + ENOUGH / count;
  *t = (task){work, basis, threads, range, count, rounds};
  *e = (supine_bench_entry){.rounds = rounds, .run = task_run, .context = t};
  e->row = (supine_bench_row){.what = what,
                              .storage = "",
                              .code = "",
                              .vertices = work->image.vertices,
                              .modes = work->image.modes,
                              .threads = threads,
                              .bytes_per_vertex = bytes};
  return &e->row;
}

/* The evaluator's own numbers; `modes` + 3 and + 2 are those of deform.c's formula. */
static void say_basis(supine_bench_row *row, const supine_basis *basis) {
  row->storage = supine_bench_storage_name(supine_basis_get_info(basis)->storage);
  row->code = supine_bench_code_name(supine_basis_get_info(basis)->simd);
  row->multiplications = (double)supine_basis_get_info(basis)->mode_count + 3;
  row->additions = (double)supine_basis_get_info(basis)->mode_count + 2;
}

/* Normals by their modes, with positions and alone, and exactly. */
static void add_lit(list *l, bench *work, size_t threads) {
  const supine_basis *basis = work->bases[SUPINE_STORAGE_INT16];
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t n = work->image.vertices;
  const double words = (double)((info->normal_count + 2) / 3); /* three modes a word of 4 bytes */
  const double output = 12;
  const double bytes = 3 * 4 * words + output;
  const double products = 3 * (double)info->normal_count;
  if (info->normal_count == 0) {
    return;
  }
  supine_bench_row *row = add(l, work, "normals", basis, threads, range_normals, n, bytes);
  say_basis(row, basis);
  row->multiplications = products + 8;
  row->additions = products + 2;
  row = add(l, work, "lit", basis, threads, range_lit, n, bytes + info->bytes_per_vertex + output);
  say_basis(row, basis);
  row->multiplications += products + 8;
  row->additions += products + 2;
  if (threads == 1) {
    const double triangles = (double)info->triangle_count / (double)n;
    (void)add(l, work, "supine_normals", basis, 1, range_exact_normals, n,
              12 * triangles + 2 * output);
  }
}

static void add_all(list *l, bench *work, size_t threads, bool lit) {
  const size_t n = work->image.vertices;
  const double modes = (double)work->image.modes;
  const double output = 12;
  supine_bench_row *row = NULL;
  for (int storage = SUPINE_STORAGE_COUNT - 1; storage >= SUPINE_STORAGE_EXACT; --storage) {
    const supine_basis *basis = work->bases[storage];
    if (basis == NULL) {
      continue;
    }
    row = add(l, work, "supine", basis, threads, range_deform, n,
              supine_basis_get_info(basis)->bytes_per_vertex + output);
    say_basis(row, basis);
    row = add(l, work, "traffic", basis, threads, range_traffic, n,
              supine_basis_get_info(basis)->bytes_per_vertex + output);
    row->storage = supine_bench_storage_name(supine_basis_get_info(basis)->storage);
  }
  const supine_basis *basis = work->bases[SUPINE_STORAGE_INT16];
  add_lit(l, work, threads);
  (void)add(l, work, "copy", basis, threads, range_copy, 8 * n, 64);
  row = add(l, work, "arithmetic", basis, threads, range_arithmetic, ARITHMETIC, 0);
  row->vertices = ARITHMETIC;
  if (lit) {
    return;
  }
  row = add(l, work, "supine_separate", basis, threads, range_separate, n,
            supine_basis_get_info(basis)->bytes_per_vertex + output);
  say_basis(row, basis);
  row = add(l, work, "supine_step", basis, threads, range_step, n, 3 * output);
  row->additions = 3;
  row = add(l, work, "supine_batch64", basis, threads, range_batch, work->batch_vertices,
            supine_basis_get_info(basis)->bytes_per_vertex / BATCH + output);
  say_basis(row, basis);
  row->vertices = BATCH * work->batch_vertices;
  row = add(l, work, "plain_loop", basis, threads, range_plain, n, 4 * modes + 3 * output);
  row->multiplications = modes + 3;
  row->additions = modes + 3;
  row = add(l, work, "triad", basis, threads, range_triad, 8 * n, 96);
  row->multiplications = 8;
  row->additions = 8;
}

static supine_status run_size(const supine_bench_options *options, size_t vertices,
                              supine_bench_peers *peers, supine_bench_report *report, void *context,
                              supine_error *error) {
  supine_status status = SUPINE_ERROR_MEMORY;
  bench *work = calloc(1, sizeof *work);
  list *l = calloc(1, sizeof *l);
  if (work == NULL || l == NULL) {
    (void)supine_error_set(error, status, "out of memory");
    goto cleanup;
  }
  status = bench_open(work, vertices, options, error);
  if (status == SUPINE_OK) {
    status = check_same(work, error);
  }
  if (status != SUPINE_OK) {
    goto cleanup;
  }
  const size_t more = options->threads == 0 ? 2 : options->threads;
  add_all(l, work, 1, options->lit);
  if (more > 1) {
    add_all(l, work, more, options->lit);
  }
  if (peers != NULL) {
    l->count +=
        peers(context, &work->image, work->xyz, l->entries + l->count, ENTRIES_MAX - l->count);
  }
  supine_bench_measure(l->entries, l->count, options->repeats == 0 ? 9 : options->repeats);
  for (size_t i = 0; i < l->count; ++i) {
    report(context, &l->entries[i].row);
  }

cleanup:
  if (work != NULL) {
    bench_close(work);
  }
  free(work);
  free(l);
  return status;
}

supine_status supine_bench_run(const supine_bench_options *options, supine_bench_peers *peers,
                               supine_bench_report *report, void *context, supine_error *error) {
  static const size_t usual[] = {10000, 100000, 1000000};
  const size_t *vertices = options->vertices == NULL ? usual : options->vertices;
  const size_t count = options->vertices == NULL ? 3 : options->vertices_count;
  if (options->threads > 256) {
    return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "threads must be 1 to 256");
  }
  for (size_t i = 0; i < count; ++i) {
    if (vertices[i] == 0 || vertices[i] > UINT32_MAX) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT, "vertices must be 1 to 4294967295");
    }
  }
  supine_status status = SUPINE_OK;
  for (size_t i = 0; i < count && status == SUPINE_OK; ++i) {
    status = run_size(options, vertices[i], peers, report, context, error);
  }
  return status;
}
