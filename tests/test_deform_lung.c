/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A real lung with the displacement law: every storage and code path against double precision, for
 * 1,000 directions. */
#include "test.h"

#include <supine/runtime.h>
#include <supine/sh.h>

#include "runtime_fixture.h"

#include "tests/poses.h"

enum { BAND = 3, MODES = 16, DIRECTIONS = 2000 };

/* Read vertices and triangles of an OBJ file into a fixture with room for them; return false if the
 * file is missing. */
static fixture *read_obj(const char *path) {
  FILE *file = fopen(path, "r");
  if (file == NULL) {
    return NULL;
  }
  char line[256];
  size_t vertices = 0;
  while (fgets(line, sizeof line, file) != NULL) {
    vertices += line[0] == 'v' && line[1] == ' ';
  }
  rewind(file);
  fixture *f = fixture_create(vertices, MODES, BAND, 1, false, false, 1, 1);
  f->triangles = 0;
  size_t at = 0;
  while (fgets(line, sizeof line, file) != NULL) {
    char *text = line + 2;
    if (line[0] == 'v' && line[1] == ' ') {
      for (size_t axis = 0; axis < 3; ++axis) {
        f->vertex[3 * at + axis] = strtof(text, &text);
      }
      ++at;
    } else if (line[0] == 'f' && line[1] == ' ' && f->triangles < 2 * vertices) {
      for (size_t j = 0; j < 3; ++j) {
        f->triangle[3 * f->triangles + j] = (uint32_t)(strtoul(text, &text, 10) - 1);
        text += strcspn(text, " \n"); /* skip /texture/normal */
      }
      ++f->triangles;
    }
  }
  (void)fclose(file);
  return f;
}

/* Return direction i of a nearly even covering of the sphere by DIRECTIONS points. */
static void even_direction(size_t q, double g[3]) {
  const double z = 1 - (2 * (double)q + 1) / DIRECTIONS;
  const double turn = 2.399963229728653 * (double)q;
  g[0] = sqrt(1 - z * z) * cos(turn);
  g[1] = sqrt(1 - z * z) * sin(turn);
  g[2] = z;
}

/* Fill the fields: height along gravity, 0 to 1, projected to band 3, times d of (15)-(17). */
static void make_field(fixture *f) {
  const size_t n = f->vertices;
  double *sums = fixture_allocate(n * MODES, sizeof *sums);
  double *height = fixture_allocate(n, sizeof *height);
  for (size_t q = 0; q < DIRECTIONS; ++q) {
    double g[3];
    double y[MODES];
    even_direction(q, g);
    assert_int_equal(supine_sh_evaluate(BAND, g, y), SUPINE_OK);
    double low = INFINITY;
    double high = -INFINITY;
    for (size_t i = 0; i < n; ++i) {
      const float *p = f->vertex + 3 * i;
      height[i] = g[0] * (double)p[0] + g[1] * (double)p[1] + g[2] * (double)p[2];
      low = fmin(low, height[i]);
      high = fmax(high, height[i]);
    }
    for (size_t i = 0; i < n; ++i) {
      const double h = (height[i] - low) / (high - low) * (12.566370614359172 / DIRECTIONS);
      for (size_t k = 0; k < MODES; ++k) {
        sums[i * MODES + k] += h * y[k];
      }
    }
  }
  float low[3] = {INFINITY, INFINITY, INFINITY};
  float high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (size_t i = 0; i < 3 * n; ++i) {
    low[i % 3] = fminf(low[i % 3], f->vertex[i]);
    high[i % 3] = fmaxf(high[i % 3], f->vertex[i]);
  }
  memset(f->mode, 0, sizeof *f->mode * MODES * MODES);
  for (size_t k = 0; k < MODES; ++k) {
    f->mode[k * MODES + k] = 1;
  }
  for (size_t i = 0; i < n; ++i) {
    double box[3];
    for (size_t axis = 0; axis < 3; ++axis) {
      box[axis] = (double)((f->vertex[3 * i + axis] - low[axis]) / (high[axis] - low[axis]));
    }
    f->direction[3 * i] = (float)(2.0 * pow(box[0], 1.5));
    f->direction[3 * i + 1] = (float)(-1.5 * (1 - box[1]));
    f->direction[3 * i + 2] = (float)(-16 * pow(1 - box[2], 1.4));
    for (size_t k = 0; k < MODES; ++k) {
      f->coefficient[i * MODES + k] = (float)sums[i * MODES + k];
    }
  }
  free(sums);
  free(height);
}

/* Find the scale at which the lung gains 500 mL, by secants on its volume. */
static double scale_of_500(const fixture *f, const double *weights, double *exact) {
  double scales[2] = {0, 1};
  double volumes[2];
  fixture_deform(f, weights, &scales[0], exact);
  const double rest = fixture_volume(f, 0, exact);
  volumes[0] = 0;
  for (int i = 0; i < 12; ++i) {
    fixture_deform(f, weights, &scales[1], exact);
    volumes[1] = fixture_volume(f, 0, exact) - rest;
    const double slope = (volumes[1] - volumes[0]) / (scales[1] - scales[0]);
    if (fabs(volumes[1] - 500) < 1e-6) {
      break;
    }
    scales[0] = scales[1];
    volumes[0] = volumes[1];
    scales[1] += (500 - volumes[1]) / slope;
  }
  assert_true(fabs(volumes[1] - 500) < 1e-3);
  return scales[1];
}

TEST(test_deform_real_lung_every_path_within_stated_error) {
  fixture *f = read_obj(SUPINE_TEST_DATA "/lungs/chaste_left_5k.obj");
  if (f == NULL) {
    print_message("no " SUPINE_TEST_DATA "/lungs: skipped\n");
    skip();
  }
  make_field(f);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  supine_basis *bases[SUPINE_STORAGE_COUNT][SUPINE_SIMD_COUNT] = {{NULL}};
  double worst[SUPINE_STORAGE_COUNT] = {0};
  for (int storage = 0; storage < SUPINE_STORAGE_COUNT; ++storage) {
    for (int simd = 0; simd < SUPINE_SIMD_COUNT; ++simd) {
      const supine_basis_options options = {sizeof options, .storage = (supine_storage)storage,
                                            .simd = (supine_simd)simd};
      const supine_status status =
          supine_basis_open_memory_with(bytes, size, &options, &bases[storage][simd], NULL);
      assert_true(status == SUPINE_OK || status == SUPINE_ERROR_UNSUPPORTED);
    }
  }
  double *exact = fixture_allocate(3 * f->vertices, sizeof *exact);
  float *xyz = fixture_allocate(3 * f->vertices, sizeof *xyz);
  uint64_t random = 1000;
  double scale = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const double gravity[3] = {fixture_random(&random), fixture_random(&random),
                               fixture_random(&random)};
    double weights[SUPINE_MODES_MAX];
    assert_int_equal(supine_basis_weights(bases[0][0], gravity, weights), SUPINE_OK);
    if (trial % 100 == 0) { /* the scale for a volume changes little with direction */
      scale = scale_of_500(f, weights, exact);
    }
    fixture_deform(f, weights, &scale, exact);
    for (int storage = 0; storage < SUPINE_STORAGE_COUNT; ++storage) {
      for (int simd = 0; simd < SUPINE_SIMD_COUNT; ++simd) {
        const supine_basis *basis = bases[storage][simd];
        if (basis == NULL) {
          continue;
        }
        const double stated = supine_basis_error(basis, POSED(basis, weights, &scale));
        supine_deform(basis, POSED(basis, weights, &scale), xyz);
        double top = 0;
        for (size_t i = 0; i < f->vertices; ++i) {
          const double x = (double)xyz[3 * i] - exact[3 * i];
          const double y = (double)xyz[3 * i + 1] - exact[3 * i + 1];
          const double z = (double)xyz[3 * i + 2] - exact[3 * i + 2];
          top = fmax(top, sqrt(x * x + y * y + z * z));
        }
        assert_true(top <= stated);
        worst[storage] = fmax(worst[storage], top);
      }
    }
  }
  const supine_basis_info *chosen = supine_basis_get_info(bases[0][0]);
  print_message("at about 500 mL, mm: exact %.6f int16 %.6f mixed %.6f; chosen %d, stated %.6f\n",
                worst[SUPINE_STORAGE_EXACT], worst[SUPINE_STORAGE_INT16],
                worst[SUPINE_STORAGE_MIXED], (int)chosen->storage, chosen->storage_error);
  assert_int_equal(chosen->storage, SUPINE_STORAGE_INT16);
  assert_true(worst[0] <= 0.005);
  assert_true(chosen->storage_error <= 0.005);
  for (int storage = 0; storage < SUPINE_STORAGE_COUNT; ++storage) {
    for (int simd = 0; simd < SUPINE_SIMD_COUNT; ++simd) {
      supine_basis_close(bases[storage][simd]);
    }
  }
  free(exact);
  free(xyz);
  free(bytes);
  fixture_destroy(f);
}
