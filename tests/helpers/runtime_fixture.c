/* SPDX-License-Identifier: GPL-3.0-or-later */
#include <dirent.h>

#include "tests/helpers/runtime_fixture.h"
#include "tests/helpers/test.h"
#include <supine/safetensors.h>

void *fixture_allocate(size_t count, size_t size) {
  void *memory = calloc(count + 1, size);
  if (memory == NULL) {
    abort();
  }
  return memory;
}

double fixture_random(uint64_t *state) {
  uint64_t z = (*state += UINT64_C(0x9E3779B97F4A7C15));
  z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
  z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
  return (double)((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1;
}

/* Make a lung from the vertices begin <= i < end. Five or more vertices form a bipyramid. */
static void make_lung(fixture *f, size_t lung, size_t begin, size_t end, uint64_t *state) {
  const size_t corners = end - begin >= 5 ? end - begin - 2 : 0;
  for (size_t i = begin; i < end; ++i) {
    float *p = f->vertex + 3 * i;
    const double turn = 2.399 * (double)(i - begin);
    const double angle =
        corners > 0 ? 6.283185307179586 * (double)(i - begin) / (double)corners : turn;
    const bool tip = corners > 0 && i >= end - 2;
    const double height = tip ? (i == end - 1 ? 131.7 : -118.3) : 7 * fixture_random(state);
    p[0] = (float)(150.3 * ((double)lung - 0.5) + (tip ? 0 : 70.7 * cos(angle)));
    p[1] = (float)(tip ? 3.1 : 88.9 * sin(angle));
    p[2] = (float)height;
    f->lung[i] = (unsigned char)lung;
  }
  for (size_t j = 0; j < corners; ++j) {
    const uint32_t here = (uint32_t)(begin + j);
    const uint32_t next = (uint32_t)(begin + (j + 1) % corners);
    const uint32_t down = (uint32_t)(end - 2);
    const uint32_t up = (uint32_t)(end - 1);
    const uint32_t pair[6] = {here, next, up, next, here, down};
    memcpy(f->triangle + 3 * f->triangles, pair, sizeof pair);
    f->triangles += 2;
  }
}

/* Compute the displacement u, mm, that mode k with weight 1 causes at vertex i. */
static void mode_displacement(const fixture *f, size_t i, size_t k, double u[3]) {
  for (size_t axis = 0; axis < 3; ++axis) {
    u[axis] = f->vector
                  ? (double)f->coefficient[(3 * i + axis) * f->modes + k]
                  : (double)f->coefficient[i * f->modes + k] * (double)f->direction[3 * i + axis];
  }
}

static double det(const double *a, const double *b, const double *c) {
  return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
         a[2] * (b[0] * c[1] - b[1] * c[0]);
}

/* Copy one coordinate of a vector, and set the others to 0. */
static void keep_axis(const double *vector, size_t axis, double *kept) {
  for (size_t i = 0; i < 3; ++i) {
    kept[i] = i == axis ? vector[i] : 0;
  }
}

/* Add the contribution of one triangle to the volume of a lung, mL: a sixth of the determinant of
 * its displaced corners. Split it into terms of degree 1, 2 and 3 in the weights of the modes. Each
 * product in a determinant has one coordinate along each axis. Terms of degree 1 are summed by the
 * axis of the displaced coordinate, and those of degree 2 by that of the other coordinate. */
static void add_forms(fixture *f, const uint32_t *corner, size_t lung) {
  const size_t K = f->modes;
  double r[3][3];
  for (size_t v = 0; v < 3; ++v) {
    for (size_t axis = 0; axis < 3; ++axis) {
      r[v][axis] = (double)f->vertex[3 * corner[v] + axis];
    }
  }
  for (size_t i = 0; i < K; ++i) {
    double a[3][3];
    for (size_t v = 0; v < 3; ++v) {
      mode_displacement(f, corner[v], i, a[v]);
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      for (size_t v = 0; v < 3; ++v) {
        double along[3];
        keep_axis(a[v], axis, along);
        f->linear[(3 * lung + axis) * K + i] += det(along, r[(v + 1) % 3], r[(v + 2) % 3]) / 6000;
      }
    }
    for (size_t j = 0; j < K; ++j) {
      double b[3][3];
      for (int v = 0; v < 3; ++v) {
        mode_displacement(f, corner[v], j, b[v]);
      }
      for (size_t axis = 0; axis < 3; ++axis) {
        for (size_t v = 0; v < 3; ++v) {
          double along[3];
          keep_axis(r[v], axis, along);
          f->quadratic[((3 * lung + axis) * K + i) * K + j] +=
              det(along, a[(v + 1) % 3], b[(v + 2) % 3]) / 6000;
        }
      }
      for (size_t m = 0; m < K; ++m) {
        double c[3];
        mode_displacement(f, corner[2], m, c);
        f->cubic[((lung * K + i) * K + j) * K + m] += det(a[0], b[1], c) / 6000;
      }
    }
  }
}

fixture *fixture_create(size_t vertices, size_t modes, size_t band, size_t lungs, bool vector,
                        bool volume, double amplitude, uint64_t seed) {
  assert_true(vertices > 0 && modes > 0 && lungs > 0);
  uint64_t state = seed;
  fixture *f = calloc(1, sizeof *f);
  assert_non_null(f);
  *f = (fixture){.vertices = vertices,
                 .modes = modes,
                 .band = band,
                 .lungs = lungs,
                 .vector = vector,
                 .volume = volume};
  const size_t axes = vector ? 3 : 1;
  const size_t harmonics = (band + 1) * (band + 1);
  f->vertex = calloc(3 * vertices, sizeof *f->vertex);
  f->triangle = calloc(6 * vertices, sizeof *f->triangle);
  f->direction = calloc(3 * vertices, sizeof *f->direction);
  f->coefficient = calloc(axes * vertices * modes, sizeof *f->coefficient);
  f->mode = calloc(modes * harmonics, sizeof *f->mode);
  f->lung = calloc(vertices, 1);
  assert_true(f->vertex && f->triangle && f->direction && f->coefficient && f->mode && f->lung);
  for (size_t j = 0; j < lungs; ++j) {
    f->lung_begin[j + 1] = vertices * (j + 1) / lungs;
    make_lung(f, j, f->lung_begin[j], f->lung_begin[j + 1], &state);
  }
  for (size_t i = 0; i < 3 * vertices; ++i) {
    f->direction[i] = (float)(amplitude * fixture_random(&state));
  }
  for (size_t i = 0; i < axes * vertices * modes; ++i) {
    const double size = (vector ? amplitude : 1) / (1 + 0.5 * (double)(i % modes));
    f->coefficient[i] = (float)(size * fixture_random(&state));
  }
  for (size_t i = 0; i < modes * harmonics; ++i) {
    f->mode[i] = fixture_random(&state);
  }
  if (volume) {
    fixture_add_forms(f);
  }
  return f;
}

void fixture_add_forms(fixture *f) {
  const size_t k = f->modes;
  f->volume = true;
  free(f->linear);
  free(f->quadratic);
  free(f->cubic);
  f->linear = calloc(3 * f->lungs * k + 1, sizeof *f->linear);
  f->quadratic = calloc(3 * f->lungs * k * k + 1, sizeof *f->quadratic);
  f->cubic = calloc(f->lungs * k * k * k + 1, sizeof *f->cubic);
  assert_true(f->linear && f->quadratic && f->cubic);
  for (size_t t = 0; t < f->triangles; ++t) {
    add_forms(f, f->triangle + 3 * t, f->lung[f->triangle[3 * t]]);
  }
}

const double fixture_resting[18] = {850 * -3.5449077018110318, [9] = 850 * -3.5449077018110318};

fixture *fixture_create_shrinking(size_t vertices, size_t modes, uint64_t seed) {
  fixture *f = fixture_create(vertices, modes, 1, 2, false, false, 1, seed);
  memset(f->mode, 0, 4 * modes * sizeof *f->mode);
  memset(f->coefficient, 0, vertices * modes * sizeof *f->coefficient);
  f->mode[0] = 1 / 0.28209479177387814; /* mode 0 has the weight 1 for any direction of gravity */
  f->mode[4 + 1] = 1 / 0.48860251190291992; /* mode 1 has the weight y, as Y(1, -1) = 0.4886 y */
  for (size_t i = 0; i < vertices; ++i) {
    const float *p = f->vertex + 3 * i;
    const double middle = 150.3 * ((double)f->lung[i] - 0.5);
    f->direction[3 * i] = (float)(0.2 * ((double)p[0] - middle));
    f->direction[3 * i + 1] = 0.2F * p[1];
    f->direction[3 * i + 2] = 0.2F * (p[2] - 131.7F);
    f->coefficient[modes * i] = 1;
    f->coefficient[modes * i + 1] = p[1] / 300;
  }
  fixture_add_forms(f);
  return f;
}

/* Set the numbers of one cluster for one mode so that each part of a displacement is about
 * `size` mm. Positions are up to 250 mm from the origin, and scalars up to 32767. */
static void make_cluster(float *numbers, double size, uint64_t *random) {
  static const double farthest[3] = {1, 250, 32767}; /* what m, B and P are multiplied by */
  for (size_t i = 0; i < 18; ++i) {
    const size_t part = (i >= 3 ? 1U : 0U) + (i >= 12 ? 1U : 0U);
    numbers[i] = (float)(size / farthest[part] * fixture_random(random));
  }
}

void fixture_add_clusters(fixture *f, size_t clusters, double amplitude, uint64_t seed) {
  uint64_t random = seed;
  const size_t modes = f->modes;
  assert_true(f->vector && clusters >= f->lungs && clusters <= f->vertices);
  f->clusters = clusters;
  f->cluster = fixture_allocate(f->vertices, sizeof *f->cluster);
  f->scalar = fixture_allocate(2 * f->vertices, sizeof *f->scalar);
  f->cluster_vector = fixture_allocate(clusters * modes * 18, sizeof *f->cluster_vector);
  for (size_t row = 0; row < clusters * modes; ++row) {
    make_cluster(f->cluster_vector + 18 * row, amplitude / (double)(1 + row % modes), &random);
  }
  for (size_t i = 0; i < f->vertices; ++i) {
    const size_t own = f->lung[i] + 7 * i % clusters / f->lungs * f->lungs;
    f->cluster[i] = (uint16_t)(own < clusters ? own : f->lung[i]);
    for (size_t s = 0; s < 2; ++s) {
      f->scalar[2 * i + s] = (int16_t)(32767 * fixture_random(&random));
    }
    for (size_t k = 0; k < modes; ++k) {
      const float *v = f->cluster_vector + (f->cluster[i] * modes + k) * 18;
      for (size_t axis = 0; axis < 3; ++axis) {
        double u = (double)v[axis];
        for (size_t j = 0; j < 3; ++j) {
          u += (double)v[3 + 3 * axis + j] * (double)f->vertex[3 * i + j];
        }
        for (size_t s = 0; s < 2; ++s) {
          u += f->scalar[2 * i + s] * (double)v[12 + 3 * s + axis];
        }
        f->coefficient[(3 * i + axis) * modes + k] = (float)u;
      }
    }
  }
  if (f->volume) {
    fixture_add_forms(f);
  }
}

fixture *fixture_create_simulated(size_t vertices, uint64_t seed) {
  static const double constant = 1 / 0.28209479177387814; /* Y(0, 0) times this is 1 */
  static const double along_y = 1 / 0.48860251190291992;  /* Y(1, -1) times this is g_y */
  fixture *f = fixture_create(vertices, 2, 1, 2, true, false, 1, seed);
  free(f->mode);
  f->orders = 3;
  f->fields = true;
  f->mode = fixture_allocate(2 * 4 * f->orders, sizeof *f->mode);
  f->mode[1] = 0.1 * constant;
  f->mode[12 + 3] = 0.2 * along_y;
  f->mode[12 + 5] = 0.05 * along_y;
  double *reference = fixture_allocate(3 * vertices, sizeof *reference);
  for (size_t i = 0; i < vertices; ++i) {
    const float *p = f->vertex + 3 * i;
    float *u = f->coefficient + 6 * i; /* [3, 2] */
    memset(u, 0, 6 * sizeof *u);
    u[0] = p[0] - (float)(150.3 * ((double)f->lung[i] - 0.5));
    u[1] = p[1];
    u[2] = p[1];
    u[4] = p[2];
    for (size_t axis = 0; axis < 3; ++axis) {
      reference[3 * i + axis] = (double)p[axis];
    }
  }
  fixture_add_forms(f);
  for (size_t lung = 0; lung < 2; ++lung) {
    const double v = fixture_volume(f, lung, reference);
    for (size_t side = 0; side < 2; ++side) {
      const double sign = side == 0 ? -1 : 1;
      f->range[lung][side] = v * (pow(1 + 0.1 * sign, 3) - 1);
      f->limits[lung][side][0] = 0.2 * sign * v * constant;
      f->limits[lung][side][1] = 0.02 * v * along_y;
      f->total[side] += 0.25 * sign * v;
    }
    /* of the total, 0.22 or 0.28 times the reference volume for each of T_1 = 1 */
    f->shares[lung][0][1] = (lung == 0 ? 0.22 : 0.28) * v * constant;
  }
  free(reference);
  return f;
}

void fixture_destroy(fixture *f) {
  free(f->vertex);
  free(f->triangle);
  free(f->direction);
  free(f->coefficient);
  free(f->mode);
  free(f->lung);
  free(f->linear);
  free(f->quadratic);
  free(f->cubic);
  free(f->normal);
  free(f->normal_weight);
  free(f->cluster);
  free(f->scalar);
  free(f->cluster_vector);
  free(f);
}

void fixture_add_normals(fixture *f, size_t modes, uint64_t seed) {
  uint64_t state = seed;
  const size_t terms = (f->modes + 1) * (f->modes + 2) / 2;
  f->normals = modes;
  f->normal = calloc(3 * f->vertices * modes, sizeof *f->normal);
  f->normal_weight = calloc(f->lungs * modes * terms, sizeof *f->normal_weight);
  assert_true(f->normal && f->normal_weight);
  for (size_t i = 0; i < 3 * f->vertices * modes; ++i) {
    const int number = (int)(32767 * fixture_random(&state));
    f->normal[i] = (int16_t)(number / 256 * 256 + (i % modes == 0 ? number % 256 / 2 : 0));
  }
  for (size_t i = 0; i < f->lungs * modes * terms; ++i) {
    f->normal_weight[i] = 1e-5 * fixture_random(&state);
  }
}

/* Return the number j of byte j of a row of `modes` vectors, or for j = modes the last byte
 * (supine_basis_info.normals). */
static int8_t normal_byte(const int16_t *row, size_t modes, size_t j) {
  return (int8_t)(j < modes ? row[j] / 256 : row[0] % 256);
}

/* Return the coefficients of the weights of normals, for three axes. On the first axis, the terms
 * of the gain of the third are 0. */
static double *wide_normal_weights(const fixture *f) {
  const size_t k = f->modes;
  const size_t narrow = (k + 1) * (k + 2) / 2;
  const size_t terms = narrow + k;
  double *wide = fixture_allocate(3 * f->lungs * f->normals * terms, sizeof *wide);
  for (size_t i = 0; i < f->lungs * f->normals; ++i) {
    const double *from = f->normal_weight + i * narrow;
    double *to = wide + 3 * i * terms;
    memcpy(to, from, (1 + k) * sizeof *to);
    memcpy(to + 1 + 2 * k, from + 1 + k, (narrow - 1 - k) * sizeof *to);
  }
  return wide;
}

/* The tensors of a file, and the memory that they need beside that of the fixture. */
typedef struct tensors {
  supine_tensor list[16];
  size_t count;
  void *memory[8];
  size_t memory_count;
} tensors;

static void add_tensor(tensors *t, supine_tensor tensor) {
  t->list[t->count++] = tensor;
}

static void *owned(tensors *t, void *memory) {
  t->memory[t->memory_count++] = memory;
  return memory;
}

static void add_field(const fixture *f, tensors *t) {
  const size_t n = f->vertices;
  const size_t k = f->modes;
  if (f->clusters > 0) {
    add_tensor(t, (supine_tensor){"clusters", SUPINE_U16, 1, {n}, f->cluster});
    add_tensor(t, (supine_tensor){"cluster_scalars", SUPINE_I16, 2, {n, 2}, f->scalar});
    add_tensor(t, (supine_tensor){
                      "cluster_vectors", SUPINE_F32, 3, {f->clusters, k, 18}, f->cluster_vector});
  } else if (f->vector) {
    add_tensor(t, (supine_tensor){"coefficients", SUPINE_F32, 3, {n, 3, k}, f->coefficient});
  } else {
    add_tensor(t, (supine_tensor){"coefficients", SUPINE_F32, 2, {n, k}, f->coefficient});
    add_tensor(t, (supine_tensor){"direction", SUPINE_F32, 2, {n, 3}, f->direction});
  }
}

static void add_volumes(const fixture *f, tensors *t) {
  const size_t k = f->modes;
  const size_t g = f->lungs;
  if (f->volume) {
    add_tensor(t, (supine_tensor){"volume_linear", SUPINE_F64, 3, {g, 3, k}, f->linear});
    add_tensor(t, (supine_tensor){"volume_quadratic", SUPINE_F64, 4, {g, 3, k, k}, f->quadratic});
    add_tensor(t, (supine_tensor){"volume_cubic", SUPINE_F64, 4, {g, k, k, k}, f->cubic});
  }
  if (f->resting != NULL) {
    add_tensor(t, (supine_tensor){"resting_volume", SUPINE_F64, 2, {g, 9}, f->resting});
  }
  if (f->orders > 1) {
    add_tensor(t, (supine_tensor){"simulated_range", SUPINE_F64, 2, {g, 2}, f->range});
    add_tensor(t, (supine_tensor){"simulated_limits", SUPINE_F64, 3, {g, 2, 9}, f->limits});
    add_tensor(t, (supine_tensor){"simulated_shares", SUPINE_F64, 3, {g, 9, 2}, f->shares});
  }
  if (f->full != NULL) {
    add_tensor(t, (supine_tensor){"full_volume", SUPINE_F64, 2, {g, 9}, f->full});
  }
  if (f->error_share != NULL) {
    add_tensor(t, (supine_tensor){"error_share", SUPINE_F32, 1, {f->vertices}, f->error_share});
  }
  if (f->landmarks != NULL) {
    add_tensor(t,
               (supine_tensor){"landmarks", SUPINE_F32, 2, {f->landmark_count, 4}, f->landmarks});
  }
  if (f->vertex_error != NULL) {
    add_tensor(t, (supine_tensor){"error_vertices", SUPINE_F32, 1, {f->vertices}, f->vertex_error});
  }
  if (f->error_gravity != NULL) {
    const size_t shape[] = {2 * f->band + 4, (f->band + 2) * (f->band + 2)};
    add_tensor(
        t, (supine_tensor){"error_gravity", SUPINE_F64, 2, {shape[0], shape[1]}, f->error_gravity});
  }
  if (f->error_volume != NULL) {
    add_tensor(t, (supine_tensor){
                      "error_volume", SUPINE_F64, 1, {f->error_volume_count}, f->error_volume});
  }
  if (f->held != NULL) {
    add_tensor(t, (supine_tensor){"volume_range", SUPINE_F64, 3, {27, g, 2}, f->held});
  }
}

static void add_normals(const fixture *f, tensors *t) {
  const size_t k = f->modes;
  const size_t q = f->normals;
  const size_t terms = 1 + 2 * k + k * (k + 1) / 2;
  int8_t *bytes = owned(t, fixture_allocate(3 * f->vertices * (q + 1), 1));
  for (size_t i = 0; i < 3 * f->vertices * (q + 1); ++i) {
    bytes[i] = normal_byte(f->normal + i / (q + 1) * q, q, i % (q + 1));
  }
  const double *weights = owned(t, wide_normal_weights(f));
  add_tensor(t, (supine_tensor){"normals", SUPINE_I8, 3, {f->vertices, 3, q + 1}, bytes});
  add_tensor(t, (supine_tensor){"normal_weights", SUPINE_F64, 4, {f->lungs, q, 3, terms}, weights});
}

void fixture_write(const fixture *f, const char *path) {
  const size_t n = f->vertices;
  const size_t harmonics = (f->band + 1) * (f->band + 1);
  const size_t orders = f->orders > 1 ? f->orders : 1;
  char total[64];
  tensors t = {.count = 0};
  add_tensor(&t, (supine_tensor){"vertices", SUPINE_F32, 2, {n, 3}, f->vertex});
  add_tensor(&t, (supine_tensor){"triangles", SUPINE_U32, 2, {f->triangles, 3}, f->triangle});
  add_tensor(&t, (supine_tensor){"modes", SUPINE_F64, 3, {f->modes, harmonics, orders}, f->mode});
  add_tensor(&t, (supine_tensor){"lung", SUPINE_U8, 1, {n}, f->lung});
  add_field(f, &t);
  add_volumes(f, &t);
  if (f->normals > 0) {
    add_normals(f, &t);
  }
  (void)snprintf(total, sizeof total, "%.17g,%.17g", f->total[0], f->total[1]);
  supine_metadata metadata[9] = {
      {"format", "supine-basis"},
      {"version", "4"},
      {"kind", f->vector ? "vector" : "scalar"},
      {"units", "mm"},
      {"route", f->fields ? "fields" : "linear"},
  };
  size_t metadata_count = 5;
  if (orders > 1) {
    metadata[metadata_count++] = (supine_metadata){"simulated_total_ml", total};
  }
  if (f->bend != NULL) {
    metadata[metadata_count++] = (supine_metadata){"bend", f->bend};
  }
  if (f->scan_gravity != NULL) {
    metadata[metadata_count++] = (supine_metadata){"scan_gravity", f->scan_gravity};
  }
  if (f->landmarks != NULL) {
    metadata[metadata_count++] = (supine_metadata){"expected_error_share", "0.5"};
  }
  supine_error error = {0};
  const supine_status status =
      supine_safetensors_write(path, t.list, t.count, metadata, metadata_count, &error);
  for (size_t i = 0; i < t.memory_count; ++i) {
    free(t.memory[i]);
  }
  if (status != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
}

supine_basis *fixture_open(const unsigned char *bytes, size_t size, supine_storage storage,
                           supine_simd simd) {
  const supine_basis_options options = {sizeof options, .storage = storage, .simd = simd};
  supine_basis *basis = NULL;
  supine_error error = {0};
  const supine_status status = supine_basis_open_memory_with(bytes, size, &options, &basis, &error);
  if (status == SUPINE_ERROR_UNSUPPORTED) {
    return NULL;
  }
  if (status != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return basis;
}

unsigned char *fixture_bytes(const fixture *f, size_t *size) {
  char *folder = fixture_folder();
  char path[256];
  (void)snprintf(path, sizeof path, "%s/basis.safetensors", folder);
  fixture_write(f, path);
  unsigned char *bytes = test_read(path, size);
  fixture_folder_remove(folder);
  return bytes;
}

void fixture_deform(const fixture *f, const double *weights, const double *scales, double *xyz) {
  for (size_t i = 0; i < f->vertices; ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      xyz[3 * i + axis] = (double)f->vertex[3 * i + axis];
    }
    for (size_t k = 0; k < f->modes; ++k) {
      double u[3];
      mode_displacement(f, i, k, u);
      for (size_t axis = 0; axis < 3; ++axis) {
        xyz[3 * i + axis] += scales[f->lung[i]] * weights[k] * u[axis];
      }
    }
  }
}

double fixture_volume(const fixture *f, size_t lung, const double *xyz) {
  double sum = 0;
  for (size_t t = 0; t < f->triangles; ++t) {
    const uint32_t *corner = f->triangle + 3 * t;
    if (f->lung[corner[0]] == lung) {
      sum += det(xyz + 3 * corner[0], xyz + 3 * corner[1], xyz + 3 * corner[2]);
    }
  }
  return sum / 6000;
}

char *fixture_folder(void) {
  char *folder = strdup("/tmp/supine-test-XXXXXX");
  assert_non_null(folder);
  assert_non_null(mkdtemp(folder));
  return folder;
}

void fixture_folder_remove(char *folder) {
  DIR *listing = opendir(folder);
  assert_non_null(listing);
  for (const struct dirent *item = readdir(listing); item != NULL; item = readdir(listing)) {
    char path[512];
    (void)snprintf(path, sizeof path, "%s/%s", folder, item->d_name);
    (void)unlink(path);
  }
  (void)closedir(listing);
  assert_int_equal(rmdir(folder), 0);
  free(folder);
}
