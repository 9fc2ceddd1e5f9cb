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

/* Add the contribution of one triangle to the volume of a lung, mL: a sixth of the determinant of
 * its displaced corners. Split it into terms of degree 1, 2 and 3 in the weights of the modes. */
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
    f->linear[lung * K + i] +=
        (det(a[0], r[1], r[2]) + det(r[0], a[1], r[2]) + det(r[0], r[1], a[2])) / 6000;
    for (size_t j = 0; j < K; ++j) {
      double b[3][3];
      for (int v = 0; v < 3; ++v) {
        mode_displacement(f, corner[v], j, b[v]);
      }
      f->quadratic[(lung * K + i) * K + j] +=
          (det(a[0], b[1], r[2]) + det(a[0], r[1], b[2]) + det(r[0], a[1], b[2])) / 6000;
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
  f->linear = calloc(f->lungs * k + 1, sizeof *f->linear);
  f->quadratic = calloc(f->lungs * k * k + 1, sizeof *f->quadratic);
  f->cubic = calloc(f->lungs * k * k * k + 1, sizeof *f->cubic);
  assert_true(f->linear && f->quadratic && f->cubic);
  for (size_t t = 0; t < f->triangles; ++t) {
    add_forms(f, f->triangle + 3 * t, f->lung[f->triangle[3 * t]]);
  }
}

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
  free(f->normal_byte);
  free(f->normal_weight);
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
    f->normal[i] = (int16_t)(32767 * fixture_random(&state));
  }
  for (size_t i = 0; i < f->lungs * modes * terms; ++i) {
    f->normal_weight[i] = 1e-5 * fixture_random(&state);
  }
}

void fixture_round_normals(fixture *f) {
  const size_t modes = f->normals;
  f->normal_byte = fixture_allocate(3 * f->vertices * (modes + 1), 1);
  for (size_t i = 0; i < 3 * f->vertices; ++i) {
    int8_t *bytes = f->normal_byte + i * (modes + 1);
    int16_t *row = f->normal + i * modes;
    for (size_t j = 0; j < modes; ++j) {
      bytes[j] = (int8_t)(row[j] / 256);
      bytes[modes] = j == 0 ? (int8_t)(row[0] % 256 / 2) : bytes[modes];
      row[j] = (int16_t)(256 * bytes[j] + (j == 0 ? bytes[modes] : 0));
    }
  }
}

void fixture_write(const fixture *f, const char *path) {
  const size_t n = f->vertices;
  const size_t k = f->modes;
  const size_t g = f->lungs;
  supine_tensor tensors[12] = {
      {"vertices", SUPINE_F32, 2, {n, 3}, f->vertex},
      {"triangles", SUPINE_U32, 2, {f->triangles, 3}, f->triangle},
      {"coefficients", SUPINE_F32, 2, {n, k}, f->coefficient},
      {"modes", SUPINE_F64, 2, {k, (f->band + 1) * (f->band + 1)}, f->mode},
      {"lung", SUPINE_U8, 1, {n}, f->lung},
  };
  size_t count = 5;
  if (f->vector) {
    tensors[2] = (supine_tensor){"coefficients", SUPINE_F32, 3, {n, 3, k}, f->coefficient};
  } else {
    tensors[count++] = (supine_tensor){"direction", SUPINE_F32, 2, {n, 3}, f->direction};
  }
  if (f->volume) {
    tensors[count++] = (supine_tensor){"volume_linear", SUPINE_F64, 2, {g, k}, f->linear};
    tensors[count++] = (supine_tensor){"volume_quadratic", SUPINE_F64, 3, {g, k, k}, f->quadratic};
    tensors[count++] = (supine_tensor){"volume_cubic", SUPINE_F64, 4, {g, k, k, k}, f->cubic};
  }
  if (f->resting != NULL) {
    tensors[count++] = (supine_tensor){"resting_volume", SUPINE_F64, 1, {9}, f->resting};
  }
  if (f->normals > 0) {
    tensors[count++] =
        f->normal_byte != NULL
            ? (supine_tensor){"normals", SUPINE_I8, 3, {n, 3, f->normals + 1}, f->normal_byte}
            : (supine_tensor){"normals", SUPINE_I16, 3, {n, 3, f->normals}, f->normal};
    tensors[count++] = (supine_tensor){
        "normal_weights", SUPINE_F64, 3, {g, f->normals, (k + 1) * (k + 2) / 2}, f->normal_weight};
  }
  const supine_metadata metadata[] = {
      {"format", "supine-basis"},
      {"version", "2"},
      {"kind", f->vector ? "vector" : "scalar"},
      {"units", "mm"},
      {"route", f->fields ? "fields" : "linear"},
  };
  supine_error error = {0};
  const supine_status status = supine_safetensors_write(path, tensors, count, metadata,
                                                        sizeof metadata / sizeof *metadata, &error);
  if (status != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
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
