/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Morph targets of a basis, and the glTF file that holds them. */
#include "test.h"

#include <jansson.h>

#include <supine/sh.h>

#include <export.h>
#include <targets.h>

#include "export_helpers.h"
#include "program/export/targets.h"
#include "sh/base/vec3.h"

#include "tests/poses.h"

enum { MODES = 11, BAND = 4, VERTICES = 40 };

static char *folder;
static char scalar[256], vector[256], open_surface[256], out[256];
static char text[8192];

static int setup(void **state) {
  (void)state;
  folder = fixture_folder();
  export_basis_make(folder, "scalar", MODES, BAND, false, true, scalar);
  export_basis_make(folder, "vector", MODES, BAND, true, false, vector);
  export_basis_make(folder, "open", MODES, BAND, false, false, open_surface);
  (void)snprintf(out, sizeof out, "%s/out.glb", folder);
  return 0;
}

static int teardown(void **state) {
  (void)state;
  fixture_folder_remove(folder);
  return 0;
}

static uint32_t word(const unsigned char *at) {
  uint32_t value;
  memcpy(&value, at, sizeof value);
  return value;
}

/* The file's JSON; `bytes` (malloc) and where its numbers begin. */
static json_t *read_glb(unsigned char **bytes, const unsigned char **numbers) {
  size_t size = 0;
  *bytes = fixture_read(out, &size);
  assert_true(size > 28);
  assert_int_equal(word(*bytes), 0x46546C67); /* "glTF" */
  assert_int_equal(word(*bytes + 4), 2);
  assert_int_equal(word(*bytes + 8), size);
  const uint32_t length = word(*bytes + 12);
  assert_int_equal(length % 4, 0);
  assert_int_equal(word(*bytes + 16), 0x4E4F534A); /* "JSON" */
  const unsigned char *tail = *bytes + 20 + length;
  assert_int_equal(word(tail), size - 28 - length);
  assert_int_equal(word(tail + 4), 0x004E4942); /* "BIN" */
  *numbers = tail + 8;
  json_t *root = json_loadb((const char *)*bytes + 20, length, 0, NULL);
  assert_non_null(root);
  json_t *buffer = json_array_get(json_object_get(root, "buffers"), 0);
  assert_int_equal(json_integer_value(json_object_get(buffer, "byteLength")), word(tail));
  return root;
}

static size_t number(const json_t *object, const char *key) {
  return (size_t)json_integer_value(json_object_get(object, key));
}

static double extra(const json_t *root, const char *key, size_t index) {
  const json_t *mesh = json_array_get(json_object_get(root, "meshes"), 0);
  const json_t *supine = json_object_get(json_object_get(mesh, "extras"), "supine");
  return json_number_value(json_array_get(json_object_get(supine, key), index));
}

/* Component `axis` of element `i` of an accessor, and that it is within its bounds. */
static double component(const json_t *root, const unsigned char *numbers, size_t accessor, size_t i,
                        size_t axis) {
  const json_t *a = json_array_get(json_object_get(root, "accessors"), accessor);
  const json_t *view =
      json_array_get(json_object_get(root, "bufferViews"), number(a, "bufferView"));
  const unsigned char *at = numbers + number(view, "byteOffset");
  double value;
  if (number(a, "componentType") == 5122) {
    int16_t x;
    memcpy(&x, at + number(view, "byteStride") * i + 2 * axis, sizeof x);
    value = x;
  } else {
    float x;
    memcpy(&x, at + 12 * i + 4 * axis, sizeof x);
    value = (double)x;
  }
  const json_t *low = json_object_get(a, "min");
  if (low != NULL) {
    assert_true(value >= json_number_value(json_array_get(low, axis)));
    assert_true(value <= json_number_value(json_array_get(json_object_get(a, "max"), axis)));
  }
  return value;
}

static const double pose_gravity[3] = {0.48, -0.6, 0.64};

/* base + sum of weight target, with weights as the extras say, is what the library evaluates. */
static void check_pose(const char *path, const supine_pose *given, double s, double t,
                       double tolerance) {
  unsigned char *bytes = NULL;
  const unsigned char *numbers = NULL;
  json_t *root = read_glb(&bytes, &numbers);
  const json_t *mesh = json_array_get(json_object_get(root, "meshes"), 0);
  const json_t *primitive = json_array_get(json_object_get(mesh, "primitives"), 0);
  const json_t *targets = json_object_get(primitive, "targets");
  const size_t base = number(json_object_get(primitive, "attributes"), "POSITION");
  const json_t *node = json_array_get(json_object_get(root, "nodes"), 1);
  const double mm = 1000 * json_number_value(json_array_get(json_object_get(node, "scale"), 0));
  export_source source = {0};
  assert_int_equal(supine_export_source_open(path, &source, NULL), SUPINE_OK);
  double y[(SUPINE_SH_BAND_MAX + 1) * (SUPINE_SH_BAND_MAX + 1)];
  float *xyz = fixture_allocate(3 * source.info->vertex_count, sizeof *xyz);
  supine_deform(source.basis, given, xyz);
  assert_int_equal(supine_sh_evaluate(source.info->band, pose_gravity, y), SUPINE_OK);
  const json_t *modes =
      json_object_get(json_object_get(json_object_get(mesh, "extras"), "supine"), "modes");
  const size_t mixes = json_array_size(modes);
  for (size_t i = 0; i < source.info->vertex_count; ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      double x = component(root, numbers, base, i, axis);
      for (size_t j = 0; j < json_array_size(targets); ++j) {
        double sum = 0;
        for (size_t k = 0; k < source.terms; ++k) {
          sum += json_number_value(json_array_get(json_array_get(modes, j % mixes), k)) * y[k];
        }
        const double weight =
            ((j < mixes ? s : t) * sum - extra(root, "offset", j)) / extra(root, "unit", j);
        x += weight *
             component(root, numbers, number(json_array_get(targets, j), "POSITION"), i, axis);
      }
      assert_true(fabs(x * mm - (double)xyz[3 * i + axis]) < tolerance);
    }
  }
  supine_export_source_close(&source);
  json_decref(root);
  free(bytes);
  free(xyz);
}

static void check_positions(const char *path, double depth, double tolerance) {
  supine_basis *basis = NULL;
  double weights[SUPINE_MODES_MAX];
  double scales[2] = {depth, depth};
  assert_int_equal(supine_basis_open(path, &basis, NULL), SUPINE_OK);
  assert_int_equal(supine_basis_weights(basis, pose_gravity, weights), SUPINE_OK);
  if (supine_basis_get_info(basis)->has_volume) {
    assert_int_equal(posed_scale(basis, weights, depth, &scales[0], NULL), SUPINE_OK);
    scales[1] = scales[0];
  }
  check_pose(path, POSED(basis, weights, scales), scales[0], 0, tolerance);
  supine_basis_close(basis);
}

/* Of a basis whose gains differ between axes the bend has targets of its own. */
static void test_glb_bent_basis_targets_make_the_library_s_positions(void **state) {
  (void)state;
  char lungs[280];
  char path[280];
  (void)snprintf(lungs, sizeof lungs, "%s/bent.ply", folder);
  (void)snprintf(path, sizeof path, "%s/bent", folder);
  assert_int_equal(
      COMMAND_RUN(&supine_command_phantom, KEPT_BOTH, text, "--vertices", "120", "-o", lungs), 0);
  assert_int_equal(COMMAND_RUN(&supine_command_precompute, KEPT_BOTH, text, lungs, "--held-out",
                               "9", "-o", path),
                   0);
  static const char *const profiles[] = {"raw", "clamp-safe", "8"};
  for (size_t i = 0; i < sizeof profiles / sizeof *profiles; ++i) {
    assert_int_equal(EXPORT_RUN(text, path, "-o", out, "--profile", profiles[i]), 0);
    assert_non_null(strstr(text, "8 morph targets"));
    export_source source = {0};
    supine_pose pose;
    assert_int_equal(supine_export_source_open(path, &source, NULL), SUPINE_OK);
    const export_breath breath = {.volume = 600};
    assert_int_equal(supine_export_breath_pose(&source, &breath, pose_gravity, 0.7, &pose, NULL),
                     SUPINE_OK);
    const double *gain = pose.gains[0];
    const double *bend = source.info->bend;
    assert_true(bend[0] == 0 && fabs(gain[2] - gain[0]) > 0.01 * fabs(gain[0]));
    check_pose(path, &pose, gain[0], (gain[2] - gain[0]) / bend[2], 1e-4);
    supine_export_source_close(&source);
  }
}

static void test_glb_raw_targets_make_the_library_s_positions(void **state) {
  (void)state;
  assert_int_equal(EXPORT_RUN(text, scalar, "-o", out), 0);
  assert_non_null(strstr(text, "11 morph targets"));
  check_positions(scalar, 40, 1e-4);
  assert_int_equal(EXPORT_RUN(text, vector, "-o", out, "--profile", "raw"), 0);
  check_positions(vector, 0.7, 1e-4);
  assert_int_equal(EXPORT_RUN(text, open_surface, "-o", out), 0);
  check_positions(open_surface, 0.7, 1e-4);
}

static void test_glb_clamp_safe_and_quantised_targets_do_too(void **state) {
  (void)state;
  assert_int_equal(EXPORT_RUN(text, open_surface, "-o", out, "--profile", "clamp-safe"), 0);
  check_positions(open_surface, 0.3, 1e-4);
  assert_int_equal(EXPORT_RUN(text, vector, "-o", out, "--quantise"), 0);
  check_positions(vector, 0.3, 0.01);
  assert_int_equal(EXPORT_RUN(text, open_surface, "-o", out, "--quantize", "--profile",
                              "clamp-safe", "--scale", "3"),
                   0);
  check_positions(open_surface, 0.05, 0.01);
}

/* Between the directions that are tried a weight may go past their extremes: a fiftieth of the
 * range is kept free at either end. */
static void test_glb_clamp_safe_weights_keep_a_margin(void **state) {
  (void)state;
  enum { TRIED = 4096 };
  export_source source = {0};
  export_targets targets = {0};
  assert_int_equal(supine_export_source_open(open_surface, &source, NULL), SUPINE_OK);
  export_glb_options options = {.clamp_safe = true};
  assert_int_equal(supine_export_breath_set(&source, 500.0, 30.0, &options.breath, NULL),
                   SUPINE_OK);
  assert_int_equal(supine_export_targets_choose(&source, &options, &targets, NULL), SUPINE_OK);
  double low[SUPINE_MODES_MAX];
  double high[SUPINE_MODES_MAX];
  for (size_t j = 0; j < targets.count; ++j) {
    low[j] = 1.0;
    high[j] = 0.0;
  }
  for (size_t i = 0; i < 2 * (size_t)TRIED; ++i) {
    double g[3];
    export_pose pose;
    supine_spiral((double)(i / 2), TRIED, 0, g);
    assert_int_equal(supine_export_targets_at(&source, &options.breath, &targets, g,
                                              (double)(i % 2), &pose, NULL),
                     SUPINE_OK);
    for (size_t j = 0; j < targets.count; ++j) {
      low[j] = fmin(low[j], pose.weights[j]);
      high[j] = fmax(high[j], pose.weights[j]);
    }
  }
  for (size_t j = 0; j < targets.count; ++j) {
    assert_true(fabs(low[j] - 0.02 / 1.04) < 1e-9);
    assert_true(fabs(high[j] - 1.02 / 1.04) < 1e-9);
  }
  supine_export_targets_free(&targets);
  supine_export_source_close(&source);
}

/* Modes 8 to 10 made copies of others: eight carry the rest exactly. */
static void test_glb_eight_targets_carry_a_basis_of_rank_eight(void **state) {
  (void)state;
  char path[256];
  (void)snprintf(path, sizeof path, "%s/rank", folder);
  fixture *f = fixture_create(VERTICES, MODES, BAND, 2, false, false, 5, 99);
  for (size_t i = 0; i < VERTICES; ++i) {
    for (size_t k = 8; k < MODES; ++k) {
      f->coefficient[i * MODES + k] = (k == 9 ? -0.5F : 2.0F) * f->coefficient[i * MODES + k - 8];
    }
  }
  fixture_write(f, path);
  assert_int_equal(EXPORT_RUN(text, path, "-o", out, "--profile", "8"), 0);
  assert_non_null(strstr(text, "8 morph targets"));
  check_positions(path, 0.4, 1e-4);
  fixture_destroy(f);
}

/* The loss that is stated is the one that is there: the mean square over the sphere of what is left
 * out, by a quadrature of the octahedron's group is too coarse for band 4, so by many directions.
 */
static void test_targets_reduce_states_its_loss(void **state) {
  (void)state;
  enum { LIMIT = 3, DIRECTIONS = 3000, TERMS = (BAND + 1) * (BAND + 1) };
  export_source source = {0};
  assert_int_equal(supine_export_source_open(scalar, &source, NULL), SUPINE_OK);
  double mix[MODES * MODES];
  double modes[MODES * TERMS];
  export_targets targets = {.mix = mix, .modes = modes};
  assert_int_equal(supine_export_targets_reduce(&source, LIMIT, &targets, NULL), SUPINE_OK);
  assert_int_equal(targets.mixes, LIMIT);
  double left = 0;
  double all = 0;
  for (int i = 0; i < DIRECTIONS; ++i) {
    const double z = (2 * i + 1) / (double)DIRECTIONS - 1;
    const double g[3] = {sqrt(1 - z * z) * cos(2.39996322972865332 * i),
                         sqrt(1 - z * z) * sin(2.39996322972865332 * i), z};
    double y[TERMS];
    double w[MODES];
    assert_int_equal(supine_sh_evaluate(BAND, g, y), SUPINE_OK);
    assert_int_equal(supine_basis_weights(source.basis, g, w), SUPINE_OK);
    double v[LIMIT] = {0};
    for (size_t t = 0; t < LIMIT * TERMS; ++t) {
      v[t / TERMS] += modes[t] * y[t % TERMS];
    }
    for (size_t vertex = 0; vertex < VERTICES; ++vertex) {
      for (size_t axis = 0; axis < 3; ++axis) {
        double whole = 0;
        double kept = 0;
        for (size_t k = 0; k < MODES; ++k) {
          double u[3];
          supine_export_field(&source, vertex, k, u);
          whole += w[k] * u[axis];
          for (size_t j = 0; j < LIMIT; ++j) {
            kept += v[j] * mix[k * LIMIT + j] * u[axis];
          }
        }
        all += whole * whole;
        left += (whole - kept) * (whole - kept);
      }
    }
  }
  assert_true(targets.loss_percent > 5 && targets.loss_percent < 95);
  assert_true(fabs(100 * sqrt(left / all) / targets.loss_percent - 1) < 1e-3);
  supine_export_source_close(&source);
}

static void test_glb_animation_has_its_channels(void **state) {
  (void)state;
  assert_int_equal(EXPORT_RUN(text, open_surface, "-o", out, "--animate"), 0);
  assert_non_null(strstr(text, "and an animation"));
  unsigned char *bytes = NULL;
  const unsigned char *numbers = NULL;
  json_t *root = read_glb(&bytes, &numbers);
  const json_t *animation = json_array_get(json_object_get(root, "animations"), 0);
  const json_t *samplers = json_object_get(animation, "samplers");
  const json_t *accessors = json_object_get(root, "accessors");
  const json_t *first = json_array_get(samplers, 0);
  const size_t frames = number(json_array_get(accessors, number(first, "input")), "count");
  assert_true(frames > 100);
  assert_int_equal(number(json_array_get(accessors, number(first, "output")), "count"),
                   frames * MODES);
  assert_int_equal(json_array_size(json_object_get(animation, "channels")), 2);
  json_decref(root);
  free(bytes);
}

static void test_glb_without_triangles_is_refused(void **state) {
  (void)state;
  char path[256];
  (void)snprintf(path, sizeof path, "%s/points", folder);
  fixture *f = fixture_create(4, 2, 1, 1, false, false, 5, 5); /* too few vertices for triangles */
  fixture_write(f, path);
  fixture_destroy(f);
  assert_int_equal(EXPORT_RUN(text, path, "-o", out), 2);
  assert_non_null(strstr(text, "without triangles"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_glb_raw_targets_make_the_library_s_positions),
      cmocka_unit_test(test_glb_bent_basis_targets_make_the_library_s_positions),
      cmocka_unit_test(test_glb_clamp_safe_and_quantised_targets_do_too),
      cmocka_unit_test(test_glb_clamp_safe_weights_keep_a_margin),
      cmocka_unit_test(test_glb_eight_targets_carry_a_basis_of_rank_eight),
      cmocka_unit_test(test_targets_reduce_states_its_loss),
      cmocka_unit_test(test_glb_animation_has_its_channels),
      cmocka_unit_test(test_glb_without_triangles_is_refused),
  };
  return cmocka_run_group_tests(tests, setup, teardown);
}
