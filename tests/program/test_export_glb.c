/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test glTF files made from a basis, and their morph targets. */
#include "tests/helpers/test.h"

#include <jansson.h>

#include <supine/sh.h>

#include <export.h>

#include "base/vec3.h"
#include "program/command/list.h"
#include "program/view/export/targets.h"
#include "tests/helpers/export_helpers.h"

enum { TARGETS = 8 };

static char *folder;
static char lungs[256], basis[256], out[256];
static char text[8192];

static int setup(void **state) {
  (void)state;
  folder = fixture_folder();
  (void)snprintf(lungs, sizeof lungs, "%s/lungs.ply", folder);
  (void)snprintf(basis, sizeof basis, "%s/basis", folder);
  (void)snprintf(out, sizeof out, "%s/out.glb", folder);
  assert_int_equal(
      COMMAND_RUN(&supine_command_phantom, KEPT_BOTH, text, "--vertices", "120", "-o", lungs), 0);
  assert_int_equal(COMMAND_RUN(&supine_command_precompute, KEPT_BOTH, text, lungs, "--held-out",
                               "9", "-o", basis),
                   0);
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

/* Read the GLB file `out` and return its JSON. Set `bytes` to the content of the file (malloc) and
 * `numbers` to the binary chunk within it. */
static json_t *read_glb(unsigned char **bytes, const unsigned char **numbers) {
  size_t size = 0;
  *bytes = test_read(out, &size);
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

/* Return coordinate `axis` of element i of a glTF accessor. Assert that the coordinate is between
 * the accessor's min and max. */
static double component(const json_t *root, const unsigned char *numbers, size_t accessor, size_t i,
                        size_t axis) {
  const json_t *a = json_array_get(json_object_get(root, "accessors"), accessor);
  const json_t *view =
      json_array_get(json_object_get(root, "bufferViews"), number(a, "bufferView"));
  const unsigned char *at = numbers + number(view, "byteOffset");
  float x;
  memcpy(&x, at + 12 * i + 4 * axis, sizeof x);
  const json_t *low = json_object_get(a, "min");
  if (low != NULL) {
    assert_true(x >= (float)json_number_value(json_array_get(low, axis)));
    assert_true(x <= (float)json_number_value(json_array_get(json_object_get(a, "max"), axis)));
  }
  return (double)x;
}

static const double pose_gravity[3] = {0.48, -0.6, 0.64};

static const json_t *child(const json_t *object, const char *key, size_t index) {
  return json_array_get(json_object_get(object, key), index);
}

static double real(const json_t *object, const char *key, size_t index) {
  return json_number_value(child(object, key, index));
}

/* Assert that the morph weights given by the formula in `extras` reproduce the positions of
 * supine_deform, at the vertices that remain if the surface was simplified to about `simplify`. The
 * pose multiplies the displacement of lung i along axis a by s[i] + t[i] * bend[a], where bend[a]
 * is a constant of the basis. */
static void check_pose(const supine_pose *given, const double s[2], const double t[2],
                       size_t simplify) {
  unsigned char *bytes = NULL;
  const unsigned char *numbers = NULL;
  json_t *root = read_glb(&bytes, &numbers);
  const json_t *all = json_object_get(json_object_get(root, "extras"), "supine");
  const supine_basis_options exact = {sizeof exact, .storage = SUPINE_STORAGE_EXACT};
  supine_basis *source = NULL;
  assert_int_equal(supine_basis_open_with(basis, &exact, &source, NULL), SUPINE_OK);
  const supine_basis_info *info = supine_basis_get_info(source);
  double y[(SUPINE_SH_BAND_MAX + 1) * (SUPINE_SH_BAND_MAX + 1)];
  float *xyz = fixture_allocate(3 * info->vertex_count, sizeof *xyz);
  supine_deform(source, given, xyz);
  assert_int_equal(supine_sh_evaluate(info->band, pose_gravity, y), SUPINE_OK);
  const size_t k = info->mode_count;
  SUPINE_ARENA arena = {0};
  export_order order = {0};
  assert_int_equal(supine_export_order_make(info, false, simplify, &arena, &order, NULL),
                   SUPINE_OK);
  for (size_t i = 0; i < 3 * order.vertex_count; ++i) {
    const size_t lung = i / 3 >= order.lung_begin[1];
    const size_t vertex = i / 3 - order.lung_begin[lung];
    const json_t *mesh = child(root, "meshes", lung);
    const json_t *primitive = child(mesh, "primitives", 0);
    const json_t *own = json_object_get(json_object_get(mesh, "extras"), "supine");
    const size_t base = number(json_object_get(primitive, "attributes"), "POSITION");
    double x = real(all, "middle", i % 3) + component(root, numbers, base, vertex, i % 3);
    for (size_t j = 0; j < json_array_size(json_object_get(primitive, "targets")); ++j) {
      double v = 0;
      for (size_t term = 0; term < supine_sh_count(info->band); ++term) {
        v += json_number_value(json_array_get(child(all, "modes", j % k), term)) * y[term] *
             json_number_value(json_object_get(all, "modeUnit"));
      }
      const double gain = j < k ? s[lung] : t[lung];
      x += (gain * v - real(own, "offset", j)) / real(own, "unit", j) *
           component(root, numbers, number(child(primitive, "targets", j), "POSITION"), vertex,
                     i % 3);
    }
    assert_true(fabs(x - (double)xyz[3 * order.vertex[i / 3] + i % 3]) < 1e-4);
  }
  supine_basis_close(source);
  json_decref(root);
  free(bytes);
  free(xyz);
}

/* Assert that the file `out` morphs to the positions of the library. */
static void check_morphs(size_t simplify) {
  supine_basis *source = NULL;
  supine_pose pose;
  assert_int_equal(supine_basis_open(basis, &source, NULL), SUPINE_OK);
  assert_int_equal(supine_export_breath_pose(source, 600, pose_gravity, 0.7, &pose, NULL),
                   SUPINE_OK);
  const supine_basis_info *info = supine_basis_get_info(source);
  double s[2];
  double t[2];
  for (size_t lung = 0; lung < 2; ++lung) {
    const double *gain = pose.gains[lung];
    assert_true(info->bend[0] == 0 && fabs(gain[2] - gain[0]) > 0.01 * fabs(gain[0]));
    s[lung] = gain[0];
    t[lung] = (gain[2] - gain[0]) / info->bend[2];
  }
  assert_true(fabs(s[0] - s[1]) > 0.01 * fabs(s[0]));
  check_pose(&pose, s, t, simplify);
  supine_basis_close(source);
}

TEST(test_glb_bent_basis_morphs_to_positions_of_library) {
  assert_int_equal(EXPORT_RUN(text, basis, "-o", out, "--plain"), 0);
  check_morphs(0);
}

TEST(test_glb_simplified_morphs_to_positions_of_library) {
  assert_int_equal(EXPORT_RUN(text, basis, "-o", out, "--plain", "--simplify", "60"), 0);
  assert_says(text, "simplified from ");
  check_morphs(60);
}

TEST(test_glb_compressed_names_remedy_for_model_viewer) {
  assert_int_equal(EXPORT_RUN(text, basis, "-o", out), 0);
  assert_says(text, "for model-viewer, set its meshoptDecoderLocation or use --plain");
}

/* Find the range of each morph weight of the first lung, in `tried` directions of gravity and at
 * `phases` equal steps from the start to the end of a breath. */
static void find_weight_range(double breath, size_t tried, size_t phases, double low[TARGETS],
                              double high[TARGETS]) {
  supine_basis *source = NULL;
  export_targets *targets = fixture_allocate(1, sizeof *targets);
  assert_int_equal(supine_basis_open(basis, &source, NULL), SUPINE_OK);
  assert_int_equal(supine_export_targets_choose(source, breath, targets, NULL), SUPINE_OK);
  assert_int_equal(targets->count, TARGETS);
  for (size_t j = 0; j < TARGETS; ++j) {
    low[j] = INFINITY;
    high[j] = -INFINITY;
  }
  for (size_t i = 0; i < phases * tried; ++i) {
    double g[3];
    double weights[EXPORT_TARGETS_MAX];
    supine_pose pose;
    supine_spiral((double)(i / phases), (double)tried, 0, g);
    assert_int_equal(supine_export_breath_pose(source, breath, g,
                                               (double)(i % phases) / (double)(phases - 1), &pose,
                                               NULL),
                     SUPINE_OK);
    supine_export_targets_weights(targets, &pose, 0, weights);
    for (size_t j = 0; j < TARGETS; ++j) {
      low[j] = fmin(low[j], weights[j]);
      high[j] = fmax(high[j], weights[j]);
    }
  }
  free(targets);
  supine_basis_close(source);
}

/* Morph weights are between 0 and 1 for any direction of gravity. They are scaled by the range of
 * sampled directions, widened at either end by a fiftieth, because other directions may exceed the
 * sampled range. */
TEST(test_glb_weights_any_direction_between_0_and_1) {
  double low[TARGETS];
  double high[TARGETS];
  find_weight_range(500, 4096, 2, low, high);
  for (size_t j = 0; j < TARGETS; ++j) {
    assert_true(fabs(low[j] - 0.02 / 1.04) < 1e-9);
    assert_true(fabs(high[j] - 1.02 / 1.04) < 1e-9);
  }
}

/* The curved part of the vertices' paths is largest at a volume within a breath of 2500 mL. Its
 * weight is at most 1 there, too. */
TEST(test_glb_weights_within_large_breath_between_0_and_1) {
  double low[TARGETS];
  double high[TARGETS];
  find_weight_range(2500, 65, 20, low, high);
  for (size_t j = 0; j < TARGETS; ++j) {
    assert_true(low[j] >= 0.0 && high[j] <= 1.0);
  }
}

TEST(test_glb_compressed_views_fill_file_without_gaps) {
  assert_int_equal(EXPORT_RUN(text, basis, "-o", out), 0);
  unsigned char *bytes = NULL;
  const unsigned char *numbers = NULL;
  json_t *root = read_glb(&bytes, &numbers);
  size_t packed = 0;
  size_t decoded = 0;
  size_t i = 0;
  json_t *view = NULL;
  json_array_foreach(json_object_get(root, "bufferViews"), i, view) {
    const json_t *extension =
        json_object_get(json_object_get(view, "extensions"), "EXT_meshopt_compression");
    assert_int_equal(number(extension, "byteOffset"), packed);
    assert_int_equal(number(view, "byteOffset"), decoded);
    assert_int_equal(number(view, "byteLength"),
                     number(extension, "count") * number(extension, "byteStride"));
    packed += (number(extension, "byteLength") + 3) / 4 * 4;
    decoded += number(view, "byteLength");
  }
  assert_int_equal(packed, number(child(root, "buffers", 0), "byteLength"));
  assert_int_equal(decoded, number(child(root, "buffers", 1), "byteLength"));
  json_decref(root);
  free(bytes);
}

TEST(test_glb_postures_one_animation_each) {
  assert_int_equal(EXPORT_RUN(text, basis, "-o", out, "--animate"), 0);
  assert_says(text, "and animations");
  unsigned char *bytes = NULL;
  const unsigned char *numbers = NULL;
  json_t *root = read_glb(&bytes, &numbers);
  assert_int_equal(json_array_size(json_object_get(root, "animations")), 5);
  for (size_t i = 0; i < 5; ++i) {
    const json_t *animation = child(root, "animations", i);
    const json_t *sampler = child(animation, "samplers", 1);
    const size_t frames = number(child(root, "accessors", number(sampler, "input")), "count");
    assert_int_equal(frames, i == 0 ? 24 * 6 + 1 : 3 * 6 + 1);
    assert_int_equal(number(child(root, "accessors", number(sampler, "output")), "count"),
                     frames * TARGETS);
    assert_int_equal(json_array_size(json_object_get(animation, "channels")), 3);
  }
  json_decref(root);
  free(bytes);
}

TEST(test_glb_without_triangles_refused) {
  char path[256];
  (void)snprintf(path, sizeof path, "%s/points", folder);
  fixture *f = fixture_create(4, 2, 1, 1, false, true, 5, 5); /* 4 vertices and no triangle */
  fixture_write(f, path);
  fixture_destroy(f);
  assert_int_equal(EXPORT_RUN(text, path, "-o", out), 2);
  assert_says(text, "no triangles");
}

TEST_GROUP(setup, teardown)
