/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The evaluator against OpenBLAS and plain loops, interleaved in one process.
 *
 *     OPENBLAS_CORETYPE=SAPPHIRERAPIDS bench_runtime [VERTICES...]
 *     bench_runtime lit [VERTICES or BASIS...]
 *
 * OpenBLAS 0.3.21 takes newer processors for old ones; the variable names one that it knows. `lit`
 * sets normals by their modes beside exact ones: at each size the made lungs' own fields, as the
 * default options make them, over and over; of a basis file, itself. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cblas.h>

#include "precompute/lungs/phantom.h"
#include "precompute/precompute.h"

#include "evaluation.h"
#include "full_solve.h"

enum { MADE_VERTICES = 40000 };
enum {
  ROWS_MAX = 256,
  PLANAR_BLOCK = 1024,
  BATCH = 64,
  BATCH_VERTICES = 50000,
  SOLVE_VERTICES_MAX = 2000000
};

/* OpenBLAS's own, which cblas.h does not declare everywhere. */
char *openblas_get_corename(void);
void openblas_set_num_threads(int threads);

typedef struct peers {
  const supine_bench_image *image;
  float *xyz;
  float weights[BATCH * 256];
  float *amount;
  float *product;
  float *planar;         /* coefficients [K, N], directions [3, N], rest [3, N] */
  int16_t *small_planar; /* the coefficients in 16 bits, a unit for all */
  float small_unit;
  full_solve *solve;
  size_t rows;
  supine_bench_row row[ROWS_MAX];
} peers;

static void displace(size_t n, const float *restrict amount, const float *restrict d,
                     const float *restrict p, float *restrict xyz) {
  for (size_t i = 0; i < n; ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      xyz[3 * i + axis] = p[3 * i + axis] + amount[i] * d[3 * i + axis];
    }
  }
}

static void run_sgemv(void *context) {
  peers *p = context;
  const supine_bench_image *m = p->image;
  const int modes = (int)m->modes;
  cblas_sgemv(CblasRowMajor, CblasNoTrans, (int)m->vertices, modes, 0.7F, m->coefficients, modes,
              p->weights, 1, 0, p->amount, 1);
  displace(m->vertices, p->amount, m->direction, m->rest, p->xyz);
}

/* The same with the coefficients mode by mode, as a product by columns likes them. */
static void run_sgemv_columns(void *context) {
  peers *p = context;
  const supine_bench_image *m = p->image;
  const int n = (int)m->vertices;
  cblas_sgemv(CblasColMajor, CblasNoTrans, n, (int)m->modes, 0.7F, p->planar, n, p->weights, 1, 0,
              p->amount, 1);
  displace(m->vertices, p->amount, m->direction, m->rest, p->xyz);
}

/* The best simple code: coefficients, directions, rest and result each in planes, so that the
 * compiler takes as many vertices at a time as a vector holds; for float32 and 16 bits. */
#define PLANAR(name, type)                                                                         \
  static void name(size_t n, const float *restrict w, const type *restrict c,                      \
                   const float *restrict d, const float *restrict p, float *restrict xyz) {        \
    for (size_t i = 0; i < n; ++i) {                                                               \
      float amount = 0;                                                                            \
      for (size_t k = 0; k < 16; ++k) {                                                            \
        amount += w[k] * (float)c[k * n + i];                                                      \
      }                                                                                            \
      for (size_t axis = 0; axis < 3; ++axis) {                                                    \
        xyz[axis * n + i] = p[axis * n + i] + amount * d[axis * n + i];                            \
      }                                                                                            \
    }                                                                                              \
  }
PLANAR(planar_float, float)
PLANAR(planar_small, int16_t)

static void run_planar(void *context) {
  peers *p = context;
  const size_t n = p->image->vertices;
  planar_float(n, p->weights, p->planar, p->planar + 16 * n, p->planar + 19 * n, p->xyz);
}

static void run_planar_small(void *context) {
  peers *p = context;
  const size_t n = p->image->vertices;
  float weights[16];
  for (size_t k = 0; k < 16; ++k) {
    weights[k] = p->small_unit * p->weights[k];
  }
  planar_small(n, weights, p->small_planar, p->planar + 16 * n, p->planar + 19 * n, p->xyz);
}

/* The image's arrays in planes. */
static bool make_planes(peers *p, const supine_bench_image *m) {
  const size_t n = m->vertices;
  float top = 0;
  free(p->planar);
  free(p->small_planar);
  p->planar = malloc(22 * n * sizeof *p->planar);
  p->small_planar = malloc(16 * n * sizeof *p->small_planar);
  if (p->planar == NULL || p->small_planar == NULL) {
    return false;
  }
  for (size_t i = 0; i < n; ++i) {
    for (size_t k = 0; k < 16; ++k) {
      p->planar[k * n + i] = m->coefficients[16 * i + k];
      top = fmaxf(top, fabsf(m->coefficients[16 * i + k]));
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      p->planar[(16 + axis) * n + i] = m->direction[3 * i + axis];
      p->planar[(19 + axis) * n + i] = m->rest[3 * i + axis];
    }
  }
  p->small_unit = top / INT16_MAX;
  for (size_t i = 0; i < 16 * n; ++i) {
    p->small_planar[i] = (int16_t)lrintf(p->planar[i] / p->small_unit);
  }
  return true;
}

/* The plain loop again, here compiled with -march=native. */
static void run_native(void *context) {
  peers *p = context;
  const supine_bench_image *m = p->image;
  const float *restrict w = p->weights;
  const float *restrict c = m->coefficients;
  float *restrict xyz = p->xyz;
  for (size_t i = 0; i < m->vertices; ++i) {
    float amount = 0;
    for (size_t k = 0; k < 16; ++k) {
      amount += w[k] * c[16 * i + k];
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      xyz[3 * i + axis] = m->rest[3 * i + axis] + amount * m->direction[3 * i + axis];
    }
  }
}

static void run_sgemm(void *context) {
  peers *p = context;
  const int modes = (int)p->image->modes;
  const int n = (int)(p->image->vertices < BATCH_VERTICES ? p->image->vertices : BATCH_VERTICES);
  cblas_sgemm(CblasRowMajor, CblasNoTrans, CblasTrans, n, BATCH, modes, 1, p->image->coefficients,
              modes, p->weights, modes, 0, p->product, BATCH);
}

/* A product of square matrices, OpenBLAS at its best. */
static void run_sgemm_square(void *context) {
  peers *p = context;
  cblas_sgemm(CblasRowMajor, CblasNoTrans, CblasTrans, 1024, 1024, 1024, 1, p->product, 1024,
              p->product + 1024 * 1024, 1024, 0, p->product + 2 * 1024 * 1024, 1024);
}

static size_t add_peers(void *context, const supine_bench_image *image, float *xyz,
                        supine_bench_entry *entries, size_t room) {
  peers *p = context;
  const size_t batch = image->vertices < BATCH_VERTICES ? image->vertices : BATCH_VERTICES;
  const size_t product = (size_t)BATCH * BATCH_VERTICES;
  free(p->amount);
  free(p->product);
  full_solve_destroy(p->solve);
  p->solve = NULL;
  p->image = image;
  p->xyz = xyz;
  p->amount = calloc(image->vertices, sizeof *p->amount);
  p->product = calloc(product, sizeof *p->product);
  if (p->amount == NULL || p->product == NULL || image->modes != 16 || room < 8 ||
      !make_planes(p, image)) {
    return 0;
  }
  for (size_t i = 0; i < sizeof p->weights / sizeof *p->weights; ++i) {
    p->weights[i] = 0.01F * (float)(i % 97) - 0.4F;
  }
  const supine_bench_row common = {.storage = "float32",
                                   .code = "openblas",
                                   .vertices = image->vertices,
                                   .modes = 16,
                                   .threads = 1};
  entries[0] = (supine_bench_entry){common, 1, run_sgemv, p};
  entries[0].row.what = "sgemv_displace";
  entries[0].row.bytes_per_vertex = 64 + 4 + 4 + 36;
  entries[0].row.multiplications = 19;
  entries[0].row.additions = 19;
  entries[1] = (supine_bench_entry){common, 1, run_native, p};
  entries[1].row.what = "plain_native";
  entries[1].row.code = "";
  entries[1].row.bytes_per_vertex = 100;
  entries[1].row.multiplications = 19;
  entries[1].row.additions = 19;
  entries[2] = (supine_bench_entry){common, 1, run_sgemm, p};
  entries[2].row.what = "sgemm64";
  entries[2].row.vertices = BATCH * batch;
  entries[2].row.bytes_per_vertex = 4 + 1;
  entries[2].row.multiplications = 16;
  entries[2].row.additions = 16;
  entries[3] = (supine_bench_entry){common, 1, run_sgemm_square, p};
  entries[3].row.what = "sgemm_square";
  entries[3].row.vertices = (size_t)1024 * 1024;
  entries[3].row.multiplications = 1024;
  entries[3].row.additions = 1024;
  static const struct {
    const char *what, *storage, *code;
    void (*run)(void *context);
    double bytes;
  } planar[] = {{"sgemv_columns", "float32", "openblas", run_sgemv_columns, 64 + 4 + 4 + 36},
                {"planar", "float32", "", run_planar, 64 + 36},
                {"planar", "int16", "", run_planar_small, 32 + 36}};
  for (size_t i = 0; i < 3; ++i) {
    entries[4 + i] = (supine_bench_entry){common, 1, planar[i].run, p};
    entries[4 + i].row.what = planar[i].what;
    entries[4 + i].row.storage = planar[i].storage;
    entries[4 + i].row.code = planar[i].code;
    entries[4 + i].row.bytes_per_vertex = planar[i].bytes;
    entries[4 + i].row.multiplications = entries[4 + i].row.additions = 19;
  }
  if (image->vertices <= SOLVE_VERTICES_MAX) {
    p->solve = full_solve_create(image->vertices);
  }
  if (p->solve == NULL) {
    return 7;
  }
  entries[7] = (supine_bench_entry){{.what = "sparse_solve",
                                     .storage = "float64",
                                     .code = "",
                                     .vertices = full_solve_vertex_count(p->solve),
                                     .threads = 1},
                                    1,
                                    full_solve_run,
                                    p->solve};
  return 8;
}

static void report(void *context, const supine_bench_row *row) {
  peers *p = context;
  if (p->rows < ROWS_MAX) {
    p->row[p->rows++] = *row;
  }
}

static double find(const peers *p, size_t from, const char *what, const char *storage,
                   size_t threads) {
  for (size_t i = from; i < p->rows; ++i) {
    if (strcmp(p->row[i].what, what) == 0 && p->row[i].threads == threads &&
        (storage[0] == '\0' || strcmp(p->row[i].storage, storage) == 0)) {
      return p->row[i].ns_per_vertex;
    }
  }
  return 0;
}

static void print(const peers *p, size_t from) {
  printf("%-16s %-8s %-8s %9s %3s %8s %6s %7s %6s %5s %5s %9s\n", "what", "storage", "code",
         "vertices", "thr", "ns/vert", "bytes", "GB/s", "triad", "mul", "add", "mul/ns");
  for (size_t i = from; i < p->rows; ++i) {
    const supine_bench_row *r = &p->row[i];
    printf("%-16s %-8s %-8s %9zu %3zu %8.4f %6.1f %7.2f %6.3f %5.0f %5.0f %9.2f\n", r->what,
           r->storage, r->code, r->vertices, r->threads, r->ns_per_vertex, r->bytes_per_vertex,
           r->gb_per_second, r->triad_share, r->multiplications, r->additions,
           r->multiplications / r->ns_per_vertex);
  }
  const double sgemv = find(p, from, "sgemv_displace", "", 1);
  const double plain = find(p, from, "plain_loop", "", 1);
  const double native = find(p, from, "plain_native", "", 1);
  static const char *const storages[] = {"mixed", "int16", "exact"};
  for (size_t i = 0; i < sizeof storages / sizeof *storages; ++i) {
    const double own = find(p, from, "supine", storages[i], 1);
    const double traffic = find(p, from, "traffic", storages[i], 1);
    printf("%-8s  sgemv+displace %.2f (traffic alone %.2f)  plain loop %.2f  plain native %.2f  "
           "two threads %.2f (arithmetic %.2f, traffic %.2f)\n",
           storages[i], sgemv / own, sgemv / traffic, plain / own, native / own,
           own / find(p, from, "supine", storages[i], 2),
           find(p, from, "arithmetic", "", 1) / find(p, from, "arithmetic", "", 2),
           traffic / find(p, from, "traffic", storages[i], 2));
    printf("          sgemv by columns %.2f  planar float32 %.2f  planar int16 "
           "%.2f\n",
           find(p, from, "sgemv_columns", "", 1) / own, find(p, from, "planar", "float32", 1) / own,
           find(p, from, "planar", "int16", 1) / own);
  }
  const double solve = find(p, from, "sparse_solve", "", 1);
  if (solve > 0) {
    printf("int16     sparse solve of (2), one direction, to 1e-6: %.0f\n",
           solve / find(p, from, "supine", "int16", 1));
  }
  const double batch = find(p, from, "supine_batch64", "", 1);
  printf("batch of 64, multiplications a ns: %.1f; sgemm of the same shape %.1f, square %.1f\n\n",
         19 / batch, 16 / find(p, from, "sgemm64", "", 1),
         1024 / find(p, from, "sgemm_square", "", 1));
}

/* What fewer modes cost, at the same size. */
static int run_modes(size_t vertices) {
  static const size_t modes[] = {1, 4, 8, 16, 32, 64};
  double sixteen = 0;
  for (size_t turn = 0; turn < 2; ++turn) {
    for (size_t i = 0; i < sizeof modes / sizeof *modes; ++i) {
      supine_bench_image image;
      supine_basis *basis = NULL;
      peers *p = calloc(1, sizeof *p);
      supine_bench_options options = {.vertices = &vertices, .vertices_count = 1, .threads = 1};
      if (p == NULL ||
          supine_bench_image_create(100000, modes[i], NULL, &image, NULL) != SUPINE_OK) {
        free(p);
        return 1;
      }
      if (supine_basis_open_memory(image.bytes, image.size, &basis, NULL) != SUPINE_OK) {
        supine_bench_image_destroy(&image);
        free(p);
        return 1;
      }
      options.like = basis;
      (void)supine_bench_run(&options, NULL, report, p, NULL);
      const double own = find(p, 0, "supine", "int16", 1);
      sixteen = modes[i] == 16 ? own : sixteen;
      if (turn == 1) {
        printf("%2zu modes, %zu vertices: %.4f ns a vertex, %.2f of sixteen\n", modes[i], vertices,
               own, own / sixteen);
      }
      supine_basis_close(basis);
      supine_bench_image_destroy(&image);
      free(p);
    }
  }
  return 0;
}

/* The loop over triangles that anyone would write, compiled with -march=native. */
static void scatter(const supine_bench_image *m, const float *restrict xyz, float *restrict n) {
  memset(n, 0, 3 * m->vertices * sizeof *n);
  for (size_t t = 0; t < m->triangle_count; ++t) {
    const uint32_t *corner = m->triangles + 3 * t;
    const float *a = xyz + 3 * (size_t)corner[0];
    const float *b = xyz + 3 * (size_t)corner[1];
    const float *c = xyz + 3 * (size_t)corner[2];
    const float u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
    const float v[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
    const float cross[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                            u[0] * v[1] - u[1] * v[0]};
    for (size_t j = 0; j < 3; ++j) {
      for (size_t axis = 0; axis < 3; ++axis) {
        n[3 * (size_t)corner[j] + axis] += cross[axis];
      }
    }
  }
  for (size_t i = 0; i < m->vertices; ++i) {
    float *at = n + 3 * i;
    const float inverse = 1 / sqrtf(at[0] * at[0] + at[1] * at[1] + at[2] * at[2] + 1e-30F);
    at[0] *= inverse;
    at[1] *= inverse;
    at[2] *= inverse;
  }
}

static void run_scatter(void *context) {
  peers *p = context;
  scatter(p->image, p->xyz, p->product);
}

static size_t add_scatter(void *context, const supine_bench_image *image, float *xyz,
                          supine_bench_entry *entries, size_t room) {
  peers *p = context;
  free(p->product);
  p->image = image;
  p->xyz = xyz;
  p->product = calloc(3 * image->vertices, sizeof *p->product);
  if (p->product == NULL || room < 1) {
    return 0;
  }
  entries[0] = (supine_bench_entry){{.what = "scatter_native",
                                     .storage = "",
                                     .code = "",
                                     .vertices = image->vertices,
                                     .modes = image->modes,
                                     .threads = 1},
                                    1,
                                    run_scatter,
                                    p};
  return 1;
}

static void print_lit(const peers *p, size_t from) {
  const double normals = find(p, from, "normals", "", 1);
  const double exact = find(p, from, "supine_normals", "", 1);
  const double lit = find(p, from, "lit", "", 1);
  const double deform = find(p, from, "supine", "int16", 1);
  printf("%zu vertices, ns each: deform %.3f  normals %.3f  lit %.3f  supine_normals %.3f  "
         "scatter %.3f\n",
         p->row[from].vertices, deform, normals, lit, exact,
         find(p, from, "scatter_native", "", 1));
  printf(
      "  normals are %.2f times as fast as supine_normals, %.2f as a plain scatter loop (>= 4); a "
      "lit frame takes %.3f of deform + supine_normals (<= 0.35)\n",
      exact / normals, find(p, from, "scatter_native", "", 1) / normals, lit / (deform + exact));
  printf("  two threads gain: normals %.2f, lit %.2f; arithmetic %.2f, bare traffic %.2f, copy "
         "%.2f\n",
         normals / find(p, from, "normals", "", 2), lit / find(p, from, "lit", "", 2),
         find(p, from, "arithmetic", "", 1) / find(p, from, "arithmetic", "", 2),
         find(p, from, "traffic", "int16", 1) / find(p, from, "traffic", "int16", 2),
         find(p, from, "copy", "", 1) / find(p, from, "copy", "", 2));
}

/* The made lungs by the default options. */
static supine_basis *made_basis(supine_error *error) {
  const char *path = "bench_runtime.safetensors";
  static const supine_scan full = {true, {.gravity = {0, 1, 0}, .volume = {SUPINE_VOLUME_FULL, 0}}};
  const supine_resting resting = supine_reference_resting_default();
  supine_precompute_options options = {
      .model = supine_physics_model(SUPINE_LAW_DEEP), .band = 23, .modes = 16, .held_out = 20};
  supine_reference reference;
  supine_precompute_report report;
  supine_mesh mesh = {0};
  supine_lungs lungs = {0};
  supine_basis *basis = NULL;
  options.reference = &reference;
  if (supine_phantom_create(MADE_VERTICES, 6000, &mesh, error) == SUPINE_OK &&
      supine_lungs_create(&mesh, 1, NULL, &lungs, error) == SUPINE_OK &&
      supine_reference_find(&lungs, &options.model, &full, &resting, &reference, error) ==
          SUPINE_OK &&
      supine_precompute(&lungs, &options, path, &report, error) == SUPINE_OK) {
    (void)supine_basis_open(path, &basis, error);
    (void)remove(path);
  }
  supine_lungs_free(&lungs);
  supine_mesh_free(&mesh);
  return basis;
}

/* One size of the made lungs, or a file's own. */
static int run_lit(const char *what, const supine_basis *made) {
  size_t vertices = strtoul(what, NULL, 10);
  supine_error error = {0};
  supine_basis *own = NULL;
  peers *p = calloc(1, sizeof *p);
  if (p == NULL || (vertices == 0 && supine_basis_open(what, &own, &error) != SUPINE_OK)) {
    (void)fprintf(stderr, "%s\n", error.message);
    free(p);
    return 1;
  }
  vertices = own != NULL ? supine_basis_get_info(own)->vertex_count : vertices;
  const supine_basis *like = own != NULL ? own : made;
  const supine_bench_options options = {
      .vertices = &vertices, .vertices_count = 1, .like = like, .lit = true};
  const supine_status status = supine_bench_run(&options, add_scatter, report, p, &error);
  if (status == SUPINE_OK) {
    const supine_basis_info *info = supine_basis_get_info(like);
    printf("%s: %zu modes, %zu of the normals\n", what, info->mode_count, info->normal_count);
    print_lit(p, 0);
  } else {
    (void)fprintf(stderr, "%s\n", error.message);
  }
  supine_basis_close(own);
  free(p->product);
  free(p);
  return status != SUPINE_OK;
}

static int run_lits(int count, char **what) {
  static char *usual[] = {"40000", "508000", "16000000"};
  supine_error error = {0};
  supine_basis *made = made_basis(&error);
  if (made == NULL) {
    (void)fprintf(stderr, "%s\n", error.message);
    return 1;
  }
  int code = 0;
  for (int i = 0; i < (count > 0 ? count : 3); ++i) {
    code |= run_lit(count > 0 ? what[i] : usual[i], made);
  }
  supine_basis_close(made);
  return code;
}

int main(int argc, char **argv) {
  static const size_t usual[] = {10000, 100000, 1000000, 16000000};
  if (argc > 1 && strcmp(argv[1], "lit") == 0) {
    return run_lits(argc - 2, argv + 2);
  }
  size_t sizes[32];
  size_t count = 0;
  for (int i = 1; i < argc && count < 32; ++i) {
    sizes[count++] = strtoul(argv[i], NULL, 10);
  }
  if (count == 0) {
    memcpy(sizes, usual, sizeof usual);
    count = sizeof usual / sizeof *usual;
  }
  openblas_set_num_threads(1);
  printf("OpenBLAS says that this is a %s\n", openblas_get_corename());
  peers *p = calloc(1, sizeof *p);
  if (p == NULL) {
    return 1;
  }
  int code = 0;
  for (size_t i = 0; i < count; ++i) {
    supine_error error = {0};
    const size_t from = p->rows;
    const supine_bench_options options = {.vertices = &sizes[i], .vertices_count = 1};
    if (supine_bench_run(&options, add_peers, report, p, &error) != SUPINE_OK) {
      (void)fprintf(stderr, "%s\n", error.message);
      code = 1;
      break;
    }
    print(p, from);
  }
  free(p->amount);
  free(p->product);
  free(p->planar);
  free(p->small_planar);
  full_solve_destroy(p->solve);
  free(p);
  return code != 0 ? code : run_modes(1000000);
}
