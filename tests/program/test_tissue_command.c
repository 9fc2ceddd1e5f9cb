/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the options of `solve` and `precompute` for tissue: accepted and refused values, warnings,
 * output. */
#include "base/vec3.h"
#include "mesh/mesh.h"
#include "precompute/lungs/phantom.h"
#include "program/command/list.h"
#include "program/options/breath_turn.h"
#include "tests/helpers/test.h"
#include <supine/compare.h>
#include <supine/locate.h>
#include <supine/runtime.h>

#include "tests/helpers/command_helpers.h"

#include "tests/helpers/poses.h"

static char folder[] = "/tmp/supine-tissue-XXXXXX";
static char lungs[64], csv[64], out[64], other[64];
static char text[16384]; /* stderr of the last command */

static int setup(void **state) {
  (void)state;
  if (mkdtemp(folder) == NULL) {
    return -1;
  }
  (void)snprintf(lungs, sizeof lungs, "%s/lungs.ply", folder);
  (void)snprintf(csv, sizeof csv, "%s/a.csv", folder);
  (void)snprintf(out, sizeof out, "%s/out.ply", folder);
  (void)snprintf(other, sizeof other, "%s/other", folder);
  supine_mesh mesh = {0};
  const bool made = supine_lungs_phantom_create(2000, 3000.0, &mesh, NULL) == SUPINE_OK &&
                    supine_mesh_save(lungs, &mesh, NULL, NULL) == SUPINE_OK;
  supine_mesh_free(&mesh);
  return made ? 0 : -1;
}

static int teardown(void **state) {
  (void)state;
  (void)unlink(lungs);
  (void)unlink(csv);
  (void)unlink(out);
  (void)unlink(other);
  return rmdir(folder);
}

static int solve(const char *option, const char *value, const char *path) {
  return COMMAND_RUN(&supine_command_solve, KEPT_ERR, text, lungs, "--posture", "supine",
                     "--volume", "scan+400", "-o", path, option, value);
}

static bool same_bytes(const char *first, const char *second) {
  FILE *a = fopen(first, "rb");
  FILE *b = fopen(second, "rb");
  assert_true(a != NULL && b != NULL);
  int x;
  int y;
  do {
    x = fgetc(a);
    y = fgetc(b);
  } while (x == y && x != EOF);
  (void)fclose(a);
  (void)fclose(b);
  return x == y;
}

TEST(test_solve_neutral_tissue_options_same_bytes) {
  char ply[80];
  (void)snprintf(ply, sizeof ply, "%s.ply", other);
  assert_int_equal(solve(NULL, NULL, out), SUPINE_EXIT_OK);
  assert_int_equal(solve("--lesion", "120,-150,-100,40,1", ply), SUPINE_EXIT_OK);
  assert_null(strstr(text, "lesion"));
  assert_true(same_bytes(out, ply));
  assert_int_equal(solve("--lung", "left:1", ply), SUPINE_EXIT_OK);
  assert_true(same_bytes(out, ply));
  assert_int_equal(solve("--expandability", "uniform", ply), SUPINE_EXIT_OK);
  assert_true(same_bytes(out, ply));
  assert_int_equal(solve("--lesion", "120,-150,-100,90,3", ply), SUPINE_EXIT_OK);
  assert_false(same_bytes(out, ply));
  assert_int_equal(solve("--expandability", "exp:z:0.5:2", ply), SUPINE_EXIT_OK);
  assert_false(same_bytes(out, ply));
  assert_int_equal(solve("--reach", "15", ply), SUPINE_EXIT_OK);
  assert_false(same_bytes(out, ply));
  (void)unlink(ply);
}

TEST(test_solve_lesion_outside_warns) {
  assert_int_equal(solve("--lesion", "900,0,0,30,4", out), SUPINE_EXIT_OK);
  assert_says(text, "warning: the lesion at 900,0,0 is ");
  assert_says(text, "mm from the nearest vertex");
}

TEST(test_solve_lesion_deep_inside_explains_no_change) {
  assert_int_equal(solve("--lesion", "56,-111,-79,5,4", out), SUPINE_EXIT_OK);
  assert_says(text, "the lesion at 56,-111,-79 is");
  assert_says(text, "with a radius of 5 mm it changes nothing");
}

TEST(test_solve_bad_tissue_options_usage_error) {
  static const char *const bad[][2] = {{"--lesion", "1,2,3,4"},
                                       {"--lesion", "1,2,3,0,4"},
                                       {"--lesion", "1,2,3,4,0"},
                                       {"--lesion", "1,2,3,4,-1"},
                                       {"--lesion", "a,2,3,4,5"},
                                       {"--lung", "left"},
                                       {"--lung", "left:0"},
                                       {"--lung", "left:1.5"},
                                       {"--lung", "middle:0.5"},
                                       {"--lung", "left:x"},
                                       {"--reach", "0"},
                                       {"--reach", "-4"},
                                       {"--reach", "far"},
                                       {"--expandability", "linear:w:1:2"},
                                       {"--expandability", "linear:z:1"},
                                       {"--expandability", "linear:z:0:1"},
                                       {"--expandability", "exp:z:1:-1"},
                                       {"--expandability", "linear:"}};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    if (solve(bad[i][0], bad[i][1], out) != SUPINE_EXIT_USAGE) {
      fail_msg("%s %s", bad[i][0], bad[i][1]);
    }
    assert_says(text, bad[i][0]);
    assert_says(text, "supine solve --help");
  }
}

TEST(test_solve_bad_expandability_file_message_names_vertex) {
  test_write(csv, "expandability\n1\n1\n-3\n");
  assert_int_equal(solve("--expandability", csv, out), SUPINE_EXIT_INPUT);
  assert_says(text, "a.csv:4: expandability -3 of vertex 2: it must be positive");
  test_write(csv, "expandability\n1\n1\n");
  assert_int_equal(solve("--expandability", csv, out), SUPINE_EXIT_INPUT);
  assert_says(text, "vertex 2 of");
  assert_int_equal(solve("--expandability", "/nowhere/a.csv", out), SUPINE_EXIT_INPUT);
}

TEST(test_solve_expandability_file_of_ones_equals_uniform) {
  char ply[80];
  (void)snprintf(ply, sizeof ply, "%s.ply", other);
  supine_mesh mesh = {0};
  assert_int_equal(supine_mesh_load(lungs, NULL, &mesh, NULL, NULL), SUPINE_OK);
  FILE *file = fopen(csv, "wb");
  assert_non_null(file);
  (void)fputs("vertex,expandability\n", file);
  for (size_t i = mesh.vertex_count; i-- > 0;) {
    (void)fprintf(file, "%zu,1\n", i);
  }
  assert_int_equal(fclose(file), 0);
  supine_mesh_free(&mesh);
  assert_int_equal(solve(NULL, NULL, out), SUPINE_EXIT_OK);
  assert_int_equal(solve("--expandability", csv, ply), SUPINE_EXIT_OK);
  assert_true(same_bytes(out, ply));
  (void)unlink(ply);
}

/* If a lung is collapsed, the volumes of the deformed surface still equal the stated volumes of
 * each lung and of both. */
TEST(test_precompute_collapsed_lung_volumes_exact) {
  double volumes[2][2]; /* mL gained: [healthy, collapsed left lung][left, right] */
  double rests[2][2];
  supine_basis *healthy = NULL;
  static const char *const shares[] = {"left:1", "left:0.3"};
  for (int ill = 0; ill < 2; ++ill) {
    assert_int_equal(COMMAND_RUN(&supine_command_precompute, KEPT_ERR, text, lungs, "-o", other,
                                 "--band", "5", "--lung", shares[ill]),
                     SUPINE_EXIT_OK);
    supine_basis *basis = NULL;
    supine_error error = {0};
    if (supine_basis_open(other, &basis, &error) != SUPINE_OK) {
      fail_msg("%s", error.message);
    }
    const supine_basis_info *info = supine_basis_get_info(basis);
    const double gravity[3] = {0.6, 0.64, -0.48};
    double weights[SUPINE_MODES_MAX];
    double scales[2];
    assert_int_equal(supine_basis_weights(basis, gravity, weights), SUPINE_OK);
    assert_int_equal(posed_scale(basis, weights, 400.0, &scales[0], NULL), SUPINE_OK);
    scales[1] = scales[0];
    float *xyz = malloc(3 * info->vertex_count * sizeof *xyz);
    supine_deform(basis, POSED(basis, weights, scales), xyz);
    double whole = 0.0;
    for (size_t lung = 0; lung < 2; ++lung) {
      const float *shapes[] = {supine_basis_vertices(basis), xyz};
      double measured[2] = {0.0, 0.0};
      for (int s = 0; s < 2; ++s) {
        for (size_t t = 0; t < info->triangle_count; ++t) {
          const uint32_t *corner = supine_basis_triangles(basis) + 3 * t;
          if (corner[0] < info->lung_begin[lung] || corner[0] >= info->lung_begin[lung + 1]) {
            continue;
          }
          double p[3][3];
          for (size_t c = 0; c < 3; ++c) {
            for (size_t k = 0; k < 3; ++k) {
              p[c][k] = (double)shapes[s][3 * (size_t)corner[c] + k];
            }
          }
          measured[s] += supine_triple(p[0], p[1], p[2]) / 6000.0;
        }
      }
      const double stated = posed_lung_volume(basis, lung, weights, scales[lung]);
      rests[ill][lung] = measured[0];
      volumes[ill][lung] = stated;
      whole += measured[1] - measured[0];
      assert_true(fabs(measured[1] - measured[0] - stated) < 0.05);
    }
    assert_true(fabs(whole - 400.0) < 0.05);
    if (ill == 1) {
      assert_string_equal(supine_basis_metadata(basis, "lung_share"), "0.3,1");
    } else {
      assert_null(supine_basis_metadata(basis, "lung_share"));
    }
    free(xyz);
    if (ill == 0) {
      healthy = basis;
    } else {
      /* At equal factors on the displacement, a collapsed lung gains 0.3 times the volume of a
       * healthy one. */
      const double healthy_gain = posed_lung_volume(healthy, 0, weights, scales[0]);
      assert_true(fabs(volumes[1][0] - 0.3 * healthy_gain) < 1e-4);
      supine_basis_close(basis);
    }
  }
  supine_basis_close(healthy);
  assert_true(fabs(rests[1][0] - 0.3 * rests[0][0]) < 0.05);
  assert_true(fabs(rests[1][1] - rests[0][1]) < 0.05);
  /* The right lung gains over 50 mL more if the left lung is collapsed. */
  assert_true(volumes[1][1] > volumes[0][1] + 50.0);
  assert_true(volumes[1][0] < 0.6 * volumes[0][0]);
}

enum { INSIDE = 5 }; /* points inside the lungs, of which the first three are in the left lung */

/* Write five points to the CSV file, each within 22 mm of the middle of its lung: three in the left
 * lung, then two in the right one. */
static void write_points_inside(double given[INSIDE][3]) {
  static const double aside[INSIDE][3] = {
      {0.0, 0.0, 0.0}, {7.0, -11.0, 13.0}, {-6.0, 12.0, -17.0}, {0.0, 0.0, 0.0}, {3.0, 15.0, 11.0}};
  supine_mesh mesh = {0};
  double middle[2][3] = {{0.0}};
  assert_int_equal(supine_mesh_load(lungs, NULL, &mesh, NULL, NULL), SUPINE_OK);
  const size_t half = mesh.vertex_count / 2; /* both lungs have equally many vertices */
  for (size_t i = 0; i < 3 * mesh.vertex_count; ++i) {
    middle[i / 3 / half][i % 3] += mesh.vertices[i] / (double)half;
  }
  supine_mesh_free(&mesh);
  FILE *file = fopen(csv, "w");
  assert_non_null(file);
  (void)fputs("x,y,z\n", file);
  for (size_t i = 0; i < INSIDE; ++i) {
    for (size_t k = 0; k < 3; ++k) {
      given[i][k] = middle[i / 3][k] + aside[i][k];
    }
    (void)fprintf(file, "%.9g,%.9g,%.9g\n", given[i][0], given[i][1], given[i][2]);
  }
  (void)fclose(file);
}

/* Make a basis of lungs at rest, of which the left one has kept a share of its volume, and a basis
 * of points inside them. */
static void make_collapsed(const char *share, const char *inside, supine_basis *bases[2]) {
  supine_error error = {0};
  assert_int_equal(COMMAND_RUN(&supine_command_precompute, KEPT_ERR, text, lungs, "-o", other,
                               "--band", "5", "--scanned", "supine:rest", "--lung", share),
                   SUPINE_EXIT_OK);
  assert_int_equal(COMMAND_RUN(&supine_command_embed, KEPT_ERR, text, other, csv, "-o", inside),
                   SUPINE_EXIT_OK);
  if (supine_basis_open(other, &bases[0], &error) != SUPINE_OK ||
      supine_basis_open(inside, &bases[1], &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
}

/* Return the error of storage of a basis in a posture and volume, mm. */
static double error_at(const supine_basis *basis, const char *named) {
  supine_state state;
  supine_pose pose;
  assert_int_equal(supine_state_parse(named, &state, NULL), SUPINE_OK);
  assert_int_equal(supine_basis_pose(basis, &state, &pose, NULL), SUPINE_OK);
  return supine_basis_error(basis, &pose);
}

/* Compute the positions of a basis in a posture and volume, and the volumes of its lungs. */
static float *positions_at(const supine_basis *basis, const char *named, double volumes[2]) {
  supine_state state;
  supine_pose pose;
  float *xyz = malloc(3 * supine_basis_get_info(basis)->vertex_count * sizeof *xyz);
  assert_non_null(xyz);
  assert_int_equal(supine_state_parse(named, &state, NULL), SUPINE_OK);
  assert_int_equal(supine_basis_pose(basis, &state, &pose, NULL), SUPINE_OK);
  assert_int_equal(supine_deform(basis, &pose, xyz), SUPINE_OK);
  if (volumes != NULL) {
    assert_int_equal(supine_basis_volumes(basis, &pose, volumes), SUPINE_OK);
  }
  return xyz;
}

/* Check that collapsed positions are those of healthy lungs, shrunk about the hilum in the left
 * one.
 * @param length  factor on the lengths of the left lung
 * @param beyond  largest distance, mm, beyond the errors of storage that the bases state */
static void check_shrunk(const supine_basis *healthy, const supine_basis *ill, const char *named,
                         const double hilum[3], double length, double beyond) {
  const supine_basis_info *info = supine_basis_get_info(ill);
  float *x[2] = {positions_at(healthy, named, NULL), positions_at(ill, named, NULL)};
  const double error = error_at(healthy, named) + error_at(ill, named) + beyond;
  assert_true(error < 0.02 + beyond);
  for (size_t i = 0; i < 3 * info->vertex_count; ++i) {
    const bool left = i < 3 * info->lung_begin[1];
    const double fixed = hilum[i % 3];
    const double expected = left ? fixed + length * ((double)x[0][i] - fixed) : (double)x[0][i];
    assert_close((double)x[1][i], expected, error);
  }
  free(x[0]);
  free(x[1]);
}

/* Find the hilum of the left lung in a state of healthy lungs: the mean of the vertices that lay in
 * the first 0.35 of its box from the midline, and the middle 0.4 along y and z, in the scan. */
static void find_hilum(const supine_basis *healthy, const char *named, double hilum[3]) {
  const size_t n = 3 * supine_basis_get_info(healthy)->lung_begin[1];
  float *scan = positions_at(healthy, "supine:scan", NULL);
  float *now = positions_at(healthy, named, NULL);
  double low[3] = {INFINITY, INFINITY, INFINITY};
  double high[3] = {-INFINITY, -INFINITY, -INFINITY};
  double count = 0.0;
  for (size_t i = 0; i < n; ++i) {
    low[i % 3] = fmin(low[i % 3], (double)scan[i]);
    high[i % 3] = fmax(high[i % 3], (double)scan[i]);
  }
  hilum[0] = hilum[1] = hilum[2] = 0.0;
  for (size_t i = 0; i < n; i += 3) {
    double at[3];
    for (size_t k = 0; k < 3; ++k) {
      at[k] = ((double)scan[i + k] - low[k]) / (high[k] - low[k]);
    }
    if (at[0] < 0.35 && fabs(at[1] - 0.5) < 0.2 && fabs(at[2] - 0.5) < 0.2) {
      count += 1.0;
      for (size_t k = 0; k < 3; ++k) {
        hilum[k] += (double)now[i + k];
      }
    }
  }
  assert_true(count > 5.0);
  for (size_t k = 0; k < 3; ++k) {
    hilum[k] /= count;
  }
  free(scan);
  free(now);
}

/* The state `scan` has the lungs, and points inside them, where they were scanned; other states
 * have them collapsed, so that the displacement from the scan is the collapse. */
TEST(test_precompute_collapsed_lung_scan_is_before_collapse) {
  double given[INSIDE][3];
  const double length = cbrt(0.5);
  supine_basis *healthy[2];
  supine_basis *ill[2];
  char inside[80];
  (void)snprintf(inside, sizeof inside, "%s.inside", other);
  write_points_inside(given);
  make_collapsed("left:1", inside, healthy);
  make_collapsed("left:0.5", inside, ill);
  double volumes[4][2];
  free(positions_at(healthy[0], "supine:scan", volumes[0]));
  free(positions_at(ill[0], "supine:scan", volumes[1]));
  free(positions_at(healthy[0], "supine:rest", volumes[2]));
  free(positions_at(ill[0], "supine:rest", volumes[3]));
  assert_close(volumes[1][0], volumes[0][0], 0.05);
  assert_close(volumes[3][0], 0.5 * volumes[2][0], 0.05);
  assert_close(volumes[3][1], volumes[2][1], 0.05);
  static const char *const states[] = {"supine:rest", "prone:rest"};
  for (size_t s = 0; s < 2; ++s) {
    double hilum[3];
    find_hilum(healthy[0], states[s], hilum);
    check_shrunk(healthy[0], ill[0], states[s], hilum, length, 0.01);
    check_shrunk(healthy[1], ill[1], states[s], hilum, length, 0.05);
  }
  check_shrunk(healthy[0], ill[0], "supine:scan", given[0], 1.0, 0.01);
  check_shrunk(healthy[1], ill[1], "supine:scan", given[0], 1.0, 0.01);
  float *placed = positions_at(ill[1], "supine:scan", NULL);
  for (size_t i = 0; i < 3 * INSIDE; ++i) { /* the file keeps the order within a lung */
    assert_close((double)placed[i], given[i / 3][i % 3], error_at(ill[1], "supine:scan"));
  }
  free(placed);
  for (size_t i = 0; i < 2; ++i) {
    supine_basis_close(healthy[i]);
    supine_basis_close(ill[i]);
  }
  (void)unlink(inside);
}

/* The scan shows a lung before its collapse. Distances from the scan and their expected errors
 * include the collapse, and the shader refuses the pose of the scan. */
TEST(test_collapsed_lung_scan_pose_compared_and_refused_by_shader) {
  supine_basis *basis = NULL;
  supine_compare *compare = NULL;
  assert_int_equal(COMMAND_RUN(&supine_command_precompute, KEPT_ERR, text, lungs, "-o", other,
                               "--band", "5", "--scanned", "supine:rest", "--lung", "left:0.5"),
                   SUPINE_EXIT_OK);
  assert_int_equal(supine_basis_open(other, &basis, NULL), SUPINE_OK);
  assert_int_equal(supine_compare_create(basis, &compare, NULL), SUPINE_OK);
  const supine_basis_info *info = supine_basis_get_info(basis);
  const size_t n = info->vertex_count;
  const supine_state rest = {.gravity = {0.0, 1.0, 0.0}, .volume = {SUPINE_VOLUME_REST, 0.0}};
  supine_pose scan;
  supine_pose now;
  assert_int_equal(supine_basis_scan_pose(basis, &scan, NULL), SUPINE_OK);
  assert_int_equal(supine_basis_pose(basis, &rest, &now, NULL), SUPINE_OK);
  assert_true(scan.expansion[0] > 0.25 && scan.expansion[0] < 0.27); /* 2^(1/3) - 1 */
  assert_true(scan.expansion[1] == 0.0 && now.expansion[0] == 0.0);
  float *distance = malloc(n * sizeof *distance);
  float *sigma = malloc(n * sizeof *sigma);
  float *x[2] = {positions_at(basis, "supine:scan", NULL),
                 positions_at(basis, "supine:rest", NULL)};
  assert_int_equal(supine_compare_distances(compare, &now, &scan, distance), SUPINE_OK);
  assert_int_equal(supine_expected_error(basis, &rest, NULL, sigma, NULL), SUPINE_OK);
  double farthest = 0.0;
  for (size_t i = 0; i < n; ++i) {
    double square = 0.0;
    for (size_t k = 0; k < 3; ++k) {
      const double u = (double)x[1][3 * i + k] - (double)x[0][3 * i + k];
      square += u * u;
    }
    farthest = fmax(farthest, sqrt(square));
    assert_close((double)distance[i], sqrt(square), 1e-3);
    const double collapse = i < info->lung_begin[1] ? square : 0.0;
    assert_close((double)sigma[i], sqrt(SUPINE_EXPECTED_ERROR_MM * sqrt(square) + collapse), 0.2);
  }
  assert_true(farthest > 20.0);
  float weights[SUPINE_GL_MODES];
  float gains[6];
  assert_int_equal(supine_gl_weights(basis, &scan, weights, gains), SUPINE_ERROR_UNSUPPORTED);
  assert_int_equal(supine_gl_weights(basis, &now, weights, gains), SUPINE_OK);
  free(distance);
  free(sigma);
  free(x[0]);
  free(x[1]);
  supine_compare_destroy(compare);
  supine_basis_close(basis);
}

/* Return the RMS, mm, of the distances between two lists of points, or of a list of numbers. */
static double rms_of(size_t count, const float *values, const float *others) {
  double sum = 0.0;
  for (size_t i = 0; i < count; ++i) {
    const double d = (double)values[i] - (others != NULL ? (double)others[i] : 0.0);
    sum += d * d;
  }
  return sqrt(sum / (double)count * (others != NULL ? 3.0 : 1.0));
}

/* The expected error of a collapsed lung grows with the collapse. It is at least half the distance
 * to the other model of a lung of this volume: a healthy one that the law empties. */
TEST(test_collapsed_lung_expected_error_covers_both_models) {
  static const char *const shares[] = {"left:0.8", "left:0.5", "left:0.3"};
  double before = 0.0;
  char inside[80];
  (void)snprintf(inside, sizeof inside, "%s.inside", other);
  supine_basis *healthy[2];
  make_collapsed("left:1", inside, healthy);
  for (size_t s = 0; s < 3; ++s) {
    supine_basis *ill[2];
    supine_state prone = {.gravity = {0.0, -1.0, 0.0}, .volume = {SUPINE_VOLUME_REST, 0.0}};
    double volumes[2];
    char small[80];
    make_collapsed(shares[s], inside, ill);
    const size_t n = supine_basis_get_info(ill[0])->lung_begin[1];
    float *sigma = malloc(supine_basis_get_info(ill[0])->vertex_count * sizeof *sigma);
    float *collapsed = positions_at(ill[0], "prone:rest", volumes);
    (void)snprintf(small, sizeof small, "prone:left=%.1fmL,right=%.1fmL", volumes[0], volumes[1]);
    float *emptied = positions_at(healthy[0], small, NULL);
    assert_int_equal(supine_expected_error(ill[0], &prone, NULL, sigma, NULL), SUPINE_OK);
    const double stated = rms_of(n, sigma, NULL);
    assert_true(stated > 0.5 * rms_of(3 * n, collapsed, emptied));
    assert_true(stated > before);
    before = stated;
    free(sigma);
    free(collapsed);
    free(emptied);
    supine_basis_close(ill[0]);
    supine_basis_close(ill[1]);
  }
  supine_basis_close(healthy[0]);
  supine_basis_close(healthy[1]);
  (void)unlink(inside);
}

/* Write a tetrahedron with edges of 14 mm around a point in the left lung. */
static void write_tumour(const char *path, double corners[4][3]) {
  double given[INSIDE][3];
  uint32_t faces[12] = {0, 1, 2, 0, 3, 1, 0, 2, 3, 1, 3, 2};
  supine_mesh mesh = {4, corners[0], 4, faces};
  write_points_inside(given);
  for (size_t i = 0; i < 4; ++i) {
    for (size_t k = 0; k < 3; ++k) {
      corners[i][k] = given[1][k] + (i == 0 || i == k + 1 ? 5.0 : -5.0);
    }
  }
  assert_int_equal(supine_mesh_save(path, &mesh, NULL, NULL), SUPINE_OK);
}

/* A rigid tumour moves to the hilum with its collapsed lung, but keeps its size. In the scan, it is
 * where it was scanned. */
TEST(test_collapsed_lung_rigid_tumour_keeps_size) {
  double corners[4][3];
  char tumour[80];
  char inside[80];
  (void)snprintf(tumour, sizeof tumour, "%s.ply", other);
  (void)snprintf(inside, sizeof inside, "%s.inside", other);
  write_tumour(tumour, corners);
  assert_int_equal(COMMAND_RUN(&supine_command_precompute, KEPT_ERR, text, lungs, "-o", other,
                               "--band", "5", "--scanned", "supine:rest", "--lung", "left:0.5"),
                   SUPINE_EXIT_OK);
  assert_int_equal(COMMAND_RUN(&supine_command_embed, KEPT_ERR, text, other, tumour, "--rigid",
                               "all", "-o", inside),
                   SUPINE_EXIT_OK);
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open(inside, &basis, NULL), SUPINE_OK);
  float *scan = positions_at(basis, "supine:scan", NULL);
  float *now = positions_at(basis, "prone:rest", NULL);
  double moved = 0.0;
  for (size_t i = 0; i < 4; ++i) {
    double square = 0.0;
    for (size_t k = 0; k < 3; ++k) {
      assert_close((double)scan[3 * i + k], corners[i][k], 1e-3);
      const double edge = (double)now[3 * i + k] - (double)now[3 * ((i + 1) % 4) + k];
      square += edge * edge;
    }
    moved = fmax(moved, fabs((double)now[3 * i] - corners[i][0]));
    assert_close(sqrt(square), 10.0 * sqrt(2.0), 1e-3);
  }
  assert_true(moved > 3.0);
  free(scan);
  free(now);
  supine_basis_close(basis);
  (void)unlink(tumour);
  (void)unlink(inside);
}

/* What moves lungs by modes alone has no scan before the collapse. */
TEST(test_collapsed_lung_scan_refused_by_page_and_stream) {
  char page[80];
  (void)snprintf(page, sizeof page, "%s.html", other);
  assert_int_equal(COMMAND_RUN(&supine_command_precompute, KEPT_ERR, text, lungs, "-o", other,
                               "--band", "5", "--lung", "left:0.5"),
                   SUPINE_EXIT_OK);
  assert_int_equal(
      COMMAND_RUN(&supine_command_export, KEPT_ERR, text, other, "--from", "scan", "-o", page),
      SUPINE_EXIT_UNSUPPORTED);
  assert_says(text, "before their collapse");
  assert_int_equal(COMMAND_RUN(&supine_command_stream, KEPT_ERR, text, other, "--volume", "scan"),
                   SUPINE_EXIT_UNSUPPORTED);
  assert_says(text, "before their collapse");
  assert_int_equal(COMMAND_RUN(&supine_command_export, KEPT_ERR, text, other, "-o", page),
                   SUPINE_EXIT_OK);
  (void)unlink(page);
}

/* A breath begins in the collapsed lung, also if its volume counts from the scan. */
TEST(test_breath_of_collapsed_lung_without_rest_begins_collapsed) {
  assert_int_equal(COMMAND_RUN(&supine_command_precompute, KEPT_ERR, text, lungs, "-o", other,
                               "--band", "5", "--law", "paper", "--lung", "left:0.5"),
                   SUPINE_EXIT_OK);
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open(other, &basis, NULL), SUPINE_OK);
  static const double gravity[3] = {0.0, 1.0, 0.0};
  const supine_state begin = supine_options_breath_state(basis, gravity, 0.0);
  supine_pose pose;
  double volumes[2];
  assert_int_equal(supine_basis_pose(basis, &begin, &pose, NULL), SUPINE_OK);
  assert_int_equal(supine_basis_volumes(basis, &pose, volumes), SUPINE_OK);
  for (size_t lung = 0; lung < 2; ++lung) {
    assert_close(volumes[lung], supine_basis_get_info(basis)->reference_volume[lung], 1e-3);
  }
  supine_basis_close(basis);
}

TEST(test_solve_missing_lung_refused) {
  supine_mesh mesh = {0};
  supine_mesh left = {0};
  char one[80];
  (void)snprintf(one, sizeof one, "%s.ply", other);
  assert_int_equal(supine_mesh_load(lungs, NULL, &mesh, NULL, NULL), SUPINE_OK);
  left = mesh;
  left.vertex_count = mesh.vertex_count / 2; /* both lungs have equally many vertices */
  left.triangle_count = mesh.triangle_count / 2;
  assert_int_equal(supine_mesh_save(one, &left, NULL, NULL), SUPINE_OK);
  supine_mesh_free(&mesh);
  assert_int_equal(COMMAND_RUN(&supine_command_solve, KEPT_ERR, text, one, "--posture", "prone",
                               "-o", out, "--lung", "right:0.5"),
                   SUPINE_EXIT_USAGE);
  assert_says(text, "no right lung");
  (void)unlink(one);
}

TEST_GROUP(setup, teardown)
