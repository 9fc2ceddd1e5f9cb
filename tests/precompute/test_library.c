/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the library supine::precompute: options and results as structs, and several bases at
 * once. */
#include <pthread.h>

#include "precompute/lungs/phantom.h"
#include "tests/helpers/test.h"
#include <supine/precompute.h>
#include <supine/runtime.h>

static supine_mesh mesh; /* synthetic lungs */
static supine_precompute_surface surface;

static int setup(void **state) {
  (void)state;
  assert_int_equal(supine_lungs_phantom_create(2000, 4000.0, &mesh, NULL), SUPINE_OK);
  surface = (supine_precompute_surface){mesh.vertex_count, mesh.vertices, mesh.triangle_count,
                                        mesh.triangles};
  return 0;
}

static int teardown(void **state) {
  (void)state;
  supine_mesh_free(&mesh);
  return 0;
}

static supine_precompute_options few_modes(void) {
  return (supine_precompute_options){.size = sizeof(supine_precompute_options),
                                     .lungs = {.surfaces = &surface, .surface_count = 1},
                                     .modes = {.band = 7, .count = 6, .held_out = 20}};
}

static supine_precompute_result *make(const supine_precompute_options *options) {
  supine_precompute_result *result = NULL;
  supine_error error;
  if (supine_precompute_basis(options, &result, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return result;
}

static void refuse(const supine_precompute_options *options, supine_status status,
                   const char *message) {
  supine_precompute_result *result = NULL;
  supine_error error = {.message = ""};
  assert_int_equal(supine_precompute_basis(options, &result, &error), status);
  assert_says(error.message, message);
  assert_null(result->bytes);
  supine_precompute_result_free(result);
}

static const char *metadata_of(const supine_basis *basis, const char *key) {
  const char *value = supine_basis_metadata(basis, key);
  return value != NULL ? value : "";
}

TEST(test_precompute_basis_defaults_report_and_findings) {
  supine_precompute_options options = few_modes();
  options.tissue.lesion_count = 1;
  options.tissue.lesions[0] = (supine_precompute_lesion){{900.0, 0.0, 0.0}, 30.0, 2.0};
  supine_precompute_result *result = make(&options);
  const supine_precompute_report *report = &result->report;
  assert_int_equal(report->lung_count, 2);
  assert_int_equal(report->vertex_count, mesh.vertex_count);
  assert_int_equal(report->band, 7);
  assert_in_range(report->mode_count, 1, 6);
  assert_int_equal(report->direction_count, 20);
  assert_true(report->relative.rms > 0.0 && report->relative.rms < 0.05);
  assert_true(report->mm.rms > 0.0 && report->mm.largest > report->mm.p95);
  assert_true(report->rest_known && report->rest_part == 1.0);
  assert_true(result->assumption_count >= 5);
  bool warned = false;
  for (size_t i = 0; i < result->findings->count; ++i) {
    const supine_finding *finding = &result->findings->list[i];
    warned = warned ||
             (finding->is_warning && strstr(finding->text, "the lesion at 900,0,0 is") != NULL);
  }
  assert_true(warned);
  supine_precompute_result_free(result);
  supine_precompute_result_free(NULL);
}

/* Options that differ from the defaults reach the model: the metadata states them. */
TEST(test_precompute_basis_every_concern_reaches_the_file) {
  supine_precompute_options options = few_modes();
  options.scan = (supine_precompute_scan){
      SUPINE_SHOWN_STATE, {.gravity = {0.0, 1.0, 0.0}, .volume = {SUPINE_VOLUME_REST, 0.0}}};
  options.law = (supine_precompute_law){.has_gain = true, .base = 0.5, .reach = 12.0};
  options.volumes.rest[SUPINE_REST_SUPINE].share[0] = 0.5;
  options.tissue.share[0] = 0.75;
  options.modes.without_normals = true;
  options.made_by = "a test";
  supine_precompute_result *result = make(&options);
  supine_basis *basis = NULL;
  assert_int_equal(supine_basis_open_memory(result->bytes, result->size, &basis, NULL), SUPINE_OK);
  assert_string_equal(metadata_of(basis, "scan_state"), "supine:rest");
  assert_says(metadata_of(basis, "force"), "base=0.5 gain=0 ");
  assert_string_equal(metadata_of(basis, "reach_mm"), "12");
  assert_string_equal(metadata_of(basis, "resting_known"), "yes");
  assert_says(metadata_of(basis, "lung_share"), "0.75");
  assert_string_equal(metadata_of(basis, "made_by"), "a test");
  assert_int_equal(supine_basis_get_info(basis)->normal_count, 0);
  supine_basis_close(basis);
  supine_precompute_result_free(result);
}

TEST(test_precompute_basis_wrong_options_refused) {
  supine_precompute_options options = few_modes();
  options.size = 8;
  refuse(&options, SUPINE_ERROR_ARGUMENT, "size of the options is 8");
  options = few_modes();
  options.lungs.surface_count = 0;
  refuse(&options, SUPINE_ERROR_ARGUMENT, "no lungs");
  options = few_modes();
  options.lungs.axes = "RAX";
  refuse(&options, SUPINE_ERROR_ARGUMENT, "three letters");
  options = few_modes();
  options.modes.count = 65;
  refuse(&options, SUPINE_ERROR_ARGUMENT, "give 1 to 64");
  options = few_modes();
  options.tissue.share[1] = 1.5;
  refuse(&options, SUPINE_ERROR_ARGUMENT, "give 0.1, which the tissue alone fills, to 1");
  options = few_modes();
  options.volumes.rest[SUPINE_REST_PRONE].share[0] = 3.0;
  refuse(&options, SUPINE_ERROR_ARGUMENT, "volume at rest in posture prone");
  options = few_modes();
  options.scan.shown = SUPINE_SHOWN_STATE;
  options.scan.state = (supine_state){.gravity = {0.0, 1.0, 0.0}, .volume = {SUPINE_VOLUME_SCAN}};
  refuse(&options, SUPINE_ERROR_ARGUMENT, "must be rest or full inflation");
}

typedef struct maker {
  supine_precompute_options options;
  supine_precompute_result *result;
  supine_status status;
} maker;

static void *run_maker(void *argument) {
  maker *of = argument;
  of->status = supine_precompute_basis(&of->options, &of->result, NULL);
  return NULL;
}

/* Two threads that make different bases at once get the bytes that each makes alone. */
TEST(test_precompute_basis_two_threads_same_bytes_as_alone) {
  enum { ROUNDS = 3 };
  maker makers[2] = {{.options = few_modes()}, {.options = few_modes()}};
  makers[0].options.law.soften = 1.0;
  makers[1].options.scan = (supine_precompute_scan){
      SUPINE_SHOWN_STATE, {.gravity = {0.0, 1.0, 0.0}, .volume = {SUPINE_VOLUME_REST, 0.0}}};
  supine_precompute_result *alone[2] = {make(&makers[0].options), make(&makers[1].options)};
  for (size_t round = 0; round < ROUNDS; ++round) {
    pthread_t threads[2];
    for (size_t i = 0; i < 2; ++i) {
      assert_int_equal(pthread_create(&threads[i], NULL, run_maker, &makers[i]), 0);
    }
    for (size_t i = 0; i < 2; ++i) {
      assert_int_equal(pthread_join(threads[i], NULL), 0);
      assert_int_equal(makers[i].status, SUPINE_OK);
      assert_int_equal(makers[i].result->size, alone[i]->size);
      assert_memory_equal(makers[i].result->bytes, alone[i]->bytes, alone[i]->size);
      supine_precompute_result_free(makers[i].result);
    }
  }
  for (size_t i = 0; i < 2; ++i) {
    supine_precompute_result_free(alone[i]);
  }
}

TEST_GROUP(setup, teardown)
