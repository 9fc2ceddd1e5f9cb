/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test comparisons of orientations: distances, and volumes of horizontal slabs. */

#include "tests/helpers/test.h"

#include <supine/compare.h>

#include "tests/helpers/runtime_fixture.h"

#include "tests/helpers/poses.h"

enum { LUNGS_MAX = 3 };

typedef struct made {
  fixture *f;
  unsigned char *bytes;
  supine_basis *basis;
  supine_compare *compare;
} made;

static made make_resting(size_t vertices, size_t modes, size_t band, size_t lungs, bool vector,
                         bool volume, const double *resting) {
  made m = {.f = fixture_create(vertices, modes, band, lungs, vector, volume, 6.3, 20041)};
  m.f->resting = resting;
  size_t size = 0;
  m.bytes = fixture_bytes(m.f, &size);
  const supine_basis_options exact = {sizeof exact, .storage = SUPINE_STORAGE_EXACT};
  assert_int_equal(supine_basis_open_memory_with(m.bytes, size, &exact, &m.basis, NULL), SUPINE_OK);
  assert_int_equal(supine_compare_create(m.basis, &m.compare, NULL), SUPINE_OK);
  return m;
}

static made make(size_t vertices, size_t modes, size_t band, size_t lungs, bool vector,
                 bool volume) {
  return make_resting(vertices, modes, band, lungs, vector, volume, NULL);
}

static void unmake(made *m) {
  supine_compare_destroy(m->compare);
  supine_basis_close(m->basis);
  free(m->bytes);
  fixture_destroy(m->f);
}

static void random_direction(uint64_t *state, double g[3]) {
  do {
    for (int i = 0; i < 3; ++i) {
      g[i] = fixture_random(state);
    }
  } while (g[0] * g[0] + g[1] * g[1] + g[2] * g[2] < 0.01);
}

/* Return each vertex's share of the total area, computed by Heron's formula (malloc). */
static double *area_shares(const fixture *f) {
  double *share = calloc(f->vertices, sizeof *share);
  assert_non_null(share);
  double total = 0;
  for (size_t t = 0; t < f->triangles; ++t) {
    const uint32_t *corner = f->triangle + 3 * t;
    double side[3];
    for (int v = 0; v < 3; ++v) {
      const float *a = f->vertex + 3 * corner[v];
      const float *b = f->vertex + 3 * corner[(v + 1) % 3];
      side[v] = hypot(hypot((double)a[0] - (double)b[0], (double)a[1] - (double)b[1]),
                      (double)a[2] - (double)b[2]);
    }
    const double s = (side[0] + side[1] + side[2]) / 2;
    const double area = sqrt(s * (s - side[0]) * (s - side[1]) * (s - side[2]));
    total += area;
    for (int v = 0; v < 3; ++v) {
      share[corner[v]] += area / 3;
    }
  }
  for (size_t i = 0; i < f->vertices; ++i) {
    share[i] /= total;
  }
  return share;
}

typedef struct pair {
  double weights[2][SUPINE_MODES_MAX];
  double scales[2][LUNGS_MAX];
} pair;

static pair random_pair(const made *m, uint64_t *state) {
  pair p;
  for (int side = 0; side < 2; ++side) {
    double g[3];
    random_direction(state, g);
    assert_int_equal(supine_basis_weights(m->basis, g, p.weights[side]), SUPINE_OK);
    for (int lung = 0; lung < LUNGS_MAX; ++lung) {
      p.scales[side][lung] = 1.5 + fixture_random(state);
    }
  }
  return p;
}

/* Return the distance of each vertex between the poses of p, mm, in double precision (malloc). */
static double *direct_distances(const made *m, const pair *p) {
  const size_t n = m->f->vertices;
  double *a = malloc(3 * n * sizeof *a);
  double *b = malloc(3 * n * sizeof *b);
  double *distance = malloc(n * sizeof *distance);
  assert_true(a && b && distance);
  fixture_deform(m->f, p->weights[0], p->scales[0], a);
  fixture_deform(m->f, p->weights[1], p->scales[1], b);
  for (size_t i = 0; i < n; ++i) {
    distance[i] =
        hypot(hypot(a[3 * i] - b[3 * i], a[3 * i + 1] - b[3 * i + 1]), a[3 * i + 2] - b[3 * i + 2]);
  }
  free(a);
  free(b);
  return distance;
}

typedef struct ranked {
  double distance, share;
} ranked;

static int by_distance(const void *a, const void *b) {
  const double x = ((const ranked *)a)->distance;
  const double y = ((const ranked *)b)->distance;
  return (x > y) - (x < y);
}

TEST(test_compare_statistics_random_pairs_equal_sorted_distances) {
  made m = make(3001, 11, 3, 2, false, false);
  double *share = area_shares(m.f);
  float *distance = malloc(m.f->vertices * sizeof *distance);
  ranked *sorted = malloc(m.f->vertices * sizeof *sorted);
  assert_true(distance && sorted);
  uint64_t random = 991;
  for (int repeat = 0; repeat < 5; ++repeat) {
    const pair p = random_pair(&m, &random);
    double *direct = direct_distances(&m, &p);
    double mean = 0;
    double square = 0;
    double total = 0;
    for (size_t i = 0; i < m.f->vertices; ++i) {
      mean += share[i] * direct[i];
      square += share[i] * direct[i] * direct[i];
      sorted[i] = (ranked){direct[i], share[i]};
    }
    qsort(sorted, m.f->vertices, sizeof *sorted, by_distance);
    size_t at = 0;
    while (total + sorted[at].share < 0.95) {
      total += sorted[at++].share;
    }
    supine_distance_statistics found;
    supine_compare_distances(m.compare, POSED(m.basis, p.weights[0], p.scales[0]),
                             POSED(m.basis, p.weights[1], p.scales[1]), distance);
    supine_compare_statistics(m.compare, distance, &found);
    assert_close(found.mean, mean, 1e-6 * mean);
    assert_close(found.rms, sqrt(square), 1e-6 * sqrt(square));
    assert_close(found.p95, sorted[at].distance, 1e-6 * mean);
    assert_close(found.max, sorted[m.f->vertices - 1].distance, 1e-6 * found.max);
    free(direct);
  }
  memset(distance, 0, m.f->vertices * sizeof *distance);
  supine_distance_statistics none;
  supine_compare_statistics(m.compare, distance, &none);
  assert_true(none.mean == 0 && none.rms == 0 && none.p95 == 0 && none.max == 0);
  free(sorted);
  free(distance);
  free(share);
  unmake(&m);
}

TEST(test_compare_energy_all_bands_sum_to_mean_square) {
  enum { LATITUDES = 12, LONGITUDES = 25, BAND = 4 };
  made m = make(301, 6, BAND, 2, true, false);
  double *share = area_shares(m.f);
  double energy[BAND + 1];
  supine_compare_energy(m.compare, energy);
  double total = 0;
  for (int l = 0; l <= BAND; ++l) {
    assert_true(energy[l] >= 0);
    total += energy[l];
  }
  /* Average the mean square displacement over a grid of directions of gravity. The average is exact
   * for products of two harmonics of degree BAND, as LONGITUDES > 2 BAND, and as Fejer's first rule
   * is exact to degree LATITUDES - 1 > 2 BAND in z. */
  double mean = 0;
  for (int j = 0; j < LATITUDES; ++j) {
    const double turn = 3.14159265358979323846 * (2 * j + 1) / (2.0 * LATITUDES);
    double weight = 1;
    for (int k = 1; k <= LATITUDES / 2; ++k) {
      weight -= 2 * cos(2 * k * turn) / (4.0 * k * k - 1);
    }
    weight *= 2.0 / LATITUDES;
    for (int k = 0; k < LONGITUDES; ++k) {
      const double around = 2 * 3.14159265358979323846 * k / LONGITUDES;
      const double g[3] = {sin(turn) * cos(around), sin(turn) * sin(around), cos(turn)};
      pair p = {.scales = {{1, 1}, {0, 0}}};
      assert_int_equal(supine_basis_weights(m.basis, g, p.weights[0]), SUPINE_OK);
      double *distance = direct_distances(&m, &p);
      for (size_t i = 0; i < m.f->vertices; ++i) {
        const double stored = (double)(float)share[i]; /* as the library stores it */
        mean += weight / (2.0 * LONGITUDES) * stored * distance[i] * distance[i];
      }
      free(distance);
    }
  }
  free(share);
  assert_close(total, mean, 1e-12 * mean);
  unmake(&m);
}

TEST(test_compare_create_surface_without_area_refused) {
  fixture *f = fixture_create(50, 3, 2, 1, false, false, 3, 9);
  memset(f->vertex, 0, 3 * f->vertices * sizeof *f->vertex);
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  supine_basis *basis = NULL;
  supine_compare *compare = NULL;
  supine_error error;
  assert_int_equal(supine_basis_open_memory(bytes, size, &basis, NULL), SUPINE_OK);
  assert_int_equal(supine_compare_create(basis, &compare, &error), SUPINE_ERROR_MESH);
  assert_null(compare);
  supine_compare_destroy(NULL);
  supine_basis_close(basis);
  free(bytes);
  fixture_destroy(f);
}

/* Return the position x + matrix x + shift of each vertex x of the basis (malloc). */
static float *moved(const fixture *f, const double matrix[3][3], const double shift[3]) {
  float *xyz = malloc(3 * f->vertices * sizeof *xyz);
  assert_non_null(xyz);
  for (size_t i = 0; i < f->vertices; ++i) {
    const float *p = f->vertex + 3 * i;
    for (size_t row = 0; row < 3; ++row) {
      xyz[3 * i + row] =
          (float)((double)p[row] + matrix[row][0] * (double)p[0] + matrix[row][1] * (double)p[1] +
                  matrix[row][2] * (double)p[2] + shift[row]);
    }
  }
  return xyz;
}

enum { SLABS = 10 };

TEST(test_slabs_reference_volumes_sum_to_lung_volume) {
  made m = make(902, 4, 2, 2, false, true);
  double *reference = malloc(3 * m.f->vertices * sizeof *reference);
  assert_non_null(reference);
  for (size_t i = 0; i < 3 * m.f->vertices; ++i) {
    reference[i] = (double)m.f->vertex[i];
  }
  uint64_t random = 12;
  for (int repeat = 0; repeat < 20; ++repeat) {
    supine_slab slabs[2 * SLABS];
    double g[3];
    random_direction(&random, g);
    assert_int_equal(supine_compare_slabs(m.basis, g, NULL, m.f->vertex, SLABS, slabs, NULL),
                     SUPINE_OK);
    for (size_t lung = 0; lung < 2; ++lung) {
      double volume = 0;
      for (size_t s = 0; s < SLABS; ++s) {
        assert_true(slabs[lung * SLABS + s].gain == 0);
        assert_true(slabs[lung * SLABS + s].volume >= -1e-9);
        volume += slabs[lung * SLABS + s].volume;
      }
      const double whole = fixture_volume(m.f, lung, reference);
      assert_close(volume, whole, 1e-9 * whole);
    }
  }
  free(reference);
  unmake(&m);
}

/* Cut a bipyramid of height 2 h into horizontal slabs. For z <= h, the part within the height z of
 * a tip has (z / h)^3 times half the volume. */
TEST(test_slabs_bipyramid_volumes_grow_with_cube_of_height) {
  fixture *f = fixture_create(602, 3, 2, 1, false, true, 2, 8);
  for (size_t i = 0; i < 600; ++i) {
    f->vertex[3 * i + 2] = 0;
  }
  f->vertex[3 * 600 + 2] = -100;
  f->vertex[3 * 601 + 2] = 100;
  size_t size = 0;
  unsigned char *bytes = fixture_bytes(f, &size);
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open_memory(bytes, size, &basis, NULL), SUPINE_OK);
  const double g[3] = {0, 0, -2.5};
  supine_slab slabs[SLABS];
  assert_int_equal(supine_compare_slabs(basis, g, NULL, f->vertex, SLABS, slabs, NULL), SUPINE_OK);
  double whole = 0;
  for (size_t s = 0; s < SLABS; ++s) {
    whole += slabs[s].volume;
  }
  for (size_t s = 0; s < SLABS / 2; ++s) {
    const double part = (pow((double)(s + 1) / 5, 3) - pow((double)s / 5, 3)) / 2;
    assert_close(slabs[s].volume / whole, part, 1e-6);
    assert_close(slabs[SLABS - 1 - s].volume / whole, part, 1e-6);
  }
  supine_basis_close(basis);
  free(bytes);
  fixture_destroy(f);
}

/* Displacing every point x by M x + shift multiplies the volume of each slab by det(I + M). */
TEST(test_slabs_affine_displacement_gains_equal_determinant) {
  static const double matrices[][3][3] = {
      {{0}},                                        /* a shift without rotation or scale */
      {{0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 0.1}},      /* expansion by 10 % */
      {{-0.2, -0.6, 0}, {0.6, -0.2, 0}, {0, 0, 0}}, /* rotation by 37 degrees */
      {{0.04, 0.08, -0.3}, {0.02, -0.06, 0.05}, {-0.09, 0.01, 0.07}}};
  static const double shift[3] = {1.7, -2.9, 3.3};
  made m = make(902, 4, 2, 2, false, true);
  uint64_t random = 121;
  for (size_t i = 0; i < sizeof matrices / sizeof *matrices; ++i) {
    float *xyz = moved(m.f, matrices[i], shift);
    double a[3][3];
    for (size_t k = 0; k < 9; ++k) {
      a[k / 3][k % 3] = matrices[i][k / 3][k % 3] + (k % 4 == 0);
    }
    const double determinant = a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) -
                               a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
                               a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
    for (int repeat = 0; repeat < 10; ++repeat) {
      supine_slab slabs[2 * SLABS];
      double g[3];
      random_direction(&random, g);
      assert_int_equal(supine_compare_slabs(m.basis, g, NULL, xyz, SLABS, slabs, NULL), SUPINE_OK);
      /* A slab has about 100 mL. The tolerance, mL, is for the rounding of positions to float. */
      for (size_t s = 0; s < 2 * SLABS; ++s) {
        assert_close(slabs[s].gain, (determinant - 1) * slabs[s].volume, 1e-3);
      }
    }
    free(xyz);
  }
  unmake(&m);
}

TEST(test_slabs_random_gravity_gains_sum_to_exact_volume) {
  made m = make(1203, 7, 3, 2, false, true);
  float *xyz = malloc(3 * m.f->vertices * sizeof *xyz);
  assert_non_null(xyz);
  uint64_t random = 17;
  for (int repeat = 0; repeat < 10; ++repeat) {
    supine_slab slabs[2 * SLABS];
    double g[3];
    double weights[SUPINE_MODES_MAX];
    const double scales[2] = {0.7, 1.2};
    random_direction(&random, g);
    assert_int_equal(supine_basis_weights(m.basis, g, weights), SUPINE_OK);
    supine_deform(m.basis, POSED(m.basis, weights, scales), xyz);
    assert_int_equal(supine_compare_slabs(m.basis, g, NULL, xyz, SLABS, slabs, NULL), SUPINE_OK);
    for (size_t lung = 0; lung < 2; ++lung) {
      double gain = 0;
      for (size_t s = 0; s < SLABS; ++s) {
        gain += slabs[lung * SLABS + s].gain;
      }
      assert_close(gain, posed_lung_volume(m.basis, lung, weights, scales[lung]),
                   1e-3); /* tolerance, mL, for rounding to float */
    }
  }
  free(xyz);
  unmake(&m);
}

TEST(test_slabs_bad_arguments_refused) {
  made open = make(203, 4, 2, 1, false, false);
  made closed = make(203, 4, 2, 1, false, true);
  const double g[3] = {0, 1, 0};
  const double none[3] = {0, 0, 0};
  const double infinite[3] = {INFINITY, 0, 0};
  supine_slab slabs[SUPINE_SLABS_MAX];
  supine_error error;
  assert_int_equal(supine_compare_slabs(open.basis, g, NULL, open.f->vertex, 10, slabs, &error),
                   SUPINE_ERROR_OPEN_SURFACE);
  assert_int_equal(
      supine_compare_slabs(closed.basis, none, NULL, closed.f->vertex, 10, slabs, &error),
      SUPINE_ERROR_ARGUMENT);
  assert_int_equal(
      supine_compare_slabs(closed.basis, infinite, NULL, closed.f->vertex, 10, slabs, NULL),
      SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_compare_slabs(closed.basis, g, NULL, closed.f->vertex, 0, slabs, &error),
                   SUPINE_ERROR_ARGUMENT);
  assert_int_equal(supine_compare_slabs(closed.basis, g, NULL, closed.f->vertex,
                                        SUPINE_SLABS_MAX + 1, slabs, &error),
                   SUPINE_ERROR_ARGUMENT);
  unmake(&open);
  unmake(&closed);
}
