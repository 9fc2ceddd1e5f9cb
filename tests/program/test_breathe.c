/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test 'supine breathe': volumes of its frames, output files, and refusal of bad input. */
#include <dirent.h>
#include <signal.h>
#include <sys/wait.h>
#include <time.h>

#include "base/vec3.h"
#include "mesh/mesh.h"
#include "precompute/lungs/phantom.h"
#include "precompute/precompute.h"
#include "tests/helpers/basis_helpers.h"
#include "tests/helpers/test.h"
#include <supine/safetensors.h>

#include "program/command/list.h"
#include "program/options/breath_turn.h"
#include "tests/helpers/command_helpers.h"
#include "tests/helpers/lungs_helpers.h"

static char folder[] = "/tmp/supine-breathe-XXXXXX";
static char basis[64], breath[64], series[64];
static char text[16384]; /* output of the last command on stdout and stderr together */

/* Write a basis of the lungs with the left lung collapsed to `left_share` of its volume. */
static supine_status make_basis(const supine_lungs *lungs, double left_share, const char *path) {
  supine_prepared prepared = {.source = {.lungs = *lungs},
                              .model = supine_physics_model(SUPINE_LAW_PAPER)};
  const supine_basis_choice choice = {.band = 5, .modes = 16, .held_out = 5};
  prepared.model.share[0] = left_share;
  return helper_write_basis(path, &prepared, &choice, NULL, NULL);
}

static int setup(void **state) {
  (void)state;
  if (mkdtemp(folder) == NULL) {
    return -1;
  }
  (void)snprintf(basis, sizeof basis, "%s/basis", folder);
  (void)snprintf(breath, sizeof breath, "%s/out.safetensors", folder);
  (void)snprintf(series, sizeof series, "%s/a & b.vtp", folder);
  supine_mesh mesh = {0};
  supine_lungs lungs = {0};
  const bool good = supine_lungs_phantom_create(2000, 3000.0, &mesh, NULL) == SUPINE_OK &&
                    supine_lungs_create(&mesh, 1, NULL, &lungs, NULL) == SUPINE_OK &&
                    make_basis(&lungs, 1.0, basis) == SUPINE_OK;
  supine_lungs_free(&lungs);
  supine_mesh_free(&mesh);
  return good ? 0 : -1;
}

/* Remove all files from the temporary folder. */
static void empty_folder(void) {
  DIR *entries = opendir(folder);
  const struct dirent *entry;
  while (entries != NULL && (entry = readdir(entries)) != NULL) {
    if (entry->d_name[0] != '.') {
      (void)unlinkat(dirfd(entries), entry->d_name, 0);
    }
  }
  if (entries != NULL) {
    (void)closedir(entries);
  }
}

static int teardown(void **state) {
  (void)state;
  empty_folder();
  return rmdir(folder);
}

static size_t count_files(void) {
  size_t count = 0;
  DIR *entries = opendir(folder);
  assert_non_null(entries);
  while (readdir(entries) != NULL) {
    ++count;
  }
  (void)closedir(entries);
  return count;
}

#define RUN(...) COMMAND_RUN(&supine_command_breathe, KEPT_BOTH, text, __VA_ARGS__)

/* Return the volume, mL, of the lung that has the vertices begin <= i < end. */
static double volume_of(const float *xyz, const uint32_t *triangles, size_t count, size_t begin,
                        size_t end) {
  const double centre[3] = {0.0, -150.0, -95.0};
  double sum = 0.0;
  for (size_t t = 0; t < count; ++t) {
    if (triangles[3 * t] < begin || triangles[3 * t] >= end) {
      continue;
    }
    double p[3][3];
    for (size_t c = 0; c < 3; ++c) {
      for (size_t k = 0; k < 3; ++k) {
        p[c][k] = (double)xyz[3 * (size_t)triangles[3 * t + c] + k] - centre[k];
      }
    }
    sum += supine_triple(p[0], p[1], p[2]);
  }
  return sum / 6000.0;
}

/* Assert for each frame of the file `breath` that the volume in the file equals the volume of the
 * surface for each lung, and that the lungs together have gained `wanted` [frames], mL. */
static void check_volumes(const char *basis_path, const double *wanted, size_t frames) {
  supine_safetensors *file = NULL;
  supine_basis *opened = NULL;
  assert_int_equal(supine_safetensors_open(breath, &file, NULL), SUPINE_OK);
  assert_int_equal(supine_basis_open(basis_path, &opened, NULL), SUPINE_OK);
  const supine_basis_info *info = supine_basis_get_info(opened);
  const supine_tensor *positions = supine_safetensors_find(file, "positions");
  const supine_tensor *volume = supine_safetensors_find(file, "volume");
  const supine_tensor *triangles = supine_safetensors_find(file, "triangles");
  if (positions == NULL || volume == NULL || triangles == NULL) {
    fail();
    return;
  }
  assert_int_equal(positions->shape[0], frames);
  assert_int_equal(positions->shape[1], info->vertex_count);
  assert_int_equal(volume->shape[1], info->lung_count);
  double by_lung = 0.0;
  double total = 0.0;
  for (size_t t = 0; t < frames; ++t) {
    const float *xyz = (const float *)positions->data + 3 * t * info->vertex_count;
    double sum = 0.0;
    for (size_t lung = 0; lung < info->lung_count; ++lung) {
      const size_t begin = info->lung_begin[lung];
      const size_t end = info->lung_begin[lung + 1];
      const double held = volume_of(xyz, triangles->data, triangles->shape[0], begin, end);
      const double said = ((const double *)volume->data)[t * info->lung_count + lung];
      by_lung = fmax(by_lung, fabs(held - said));
      sum += held - info->reference_volume[lung];
    }
    total = fmax(total, fabs(sum - wanted[t]));
  }
  printf("%zu frames: volume errors up to %.4f mL for one lung, up to %.4f mL for all lungs "
         "together\n",
         frames, by_lung, total);
  assert_true(by_lung < 0.05);
  assert_true(total < 0.05);
  supine_safetensors_close(file);
  supine_basis_close(opened);
}

/* Return the volume inhaled at the time of each frame of a breath, mL (malloc). */
static double *breath_of(const supine_pv_breath *course, double fps, size_t frames) {
  double *time = malloc(frames * sizeof *time);
  double *volume = malloc(frames * sizeof *volume);
  for (size_t t = 0; t < frames; ++t) {
    time[t] = (double)t / fps;
  }
  assert_int_equal(
      supine_breath_evaluate(supine_breath_normal(), course, frames, time, volume, NULL, NULL),
      SUPINE_OK);
  free(time);
  return volume;
}

TEST(test_breathe_real_lungs_turning_volumes_exact_in_every_frame) {
  static const char *const names[] = {"left.obj", "right.obj"};
  char real[80];
  supine_lungs lungs = {0};
  if (!helper_real_lungs(names, 2, SUPINE_AXES_AUTO, &lungs)) {
    skip();
  }
  (void)snprintf(real, sizeof real, "%s/real", folder);
  for (int collapsed = 0; collapsed < 2; ++collapsed) {
    assert_int_equal(make_basis(&lungs, collapsed == 1 ? 0.3 : 1.0, real), SUPINE_OK);
    assert_int_equal(RUN(real, "--turn", "supine:left:5s", "-o", breath), SUPINE_EXIT_OK);
    const supine_pv_breath course = supine_breath_default();
    double *wanted = breath_of(&course, 66.66, 334);
    check_volumes(real, wanted, 334);
    free(wanted);
  }
  (void)unlink(real);
  supine_lungs_free(&lungs);
}

/* The installed library alone computes the same frames as supine breathe, bit for bit. */
TEST(test_breathe_any_frame_equals_library) {
  enum { FRAMES = 21 };
  supine_safetensors *file = NULL;
  supine_basis *opened = NULL;
  assert_int_equal(
      RUN(basis, "--turn", "supine:left:2s", "--fps", "10", "--rate", "20", "-o", breath), 0);
  assert_int_equal(supine_safetensors_open(breath, &file, NULL), SUPINE_OK);
  assert_int_equal(supine_basis_open(basis, &opened, NULL), SUPINE_OK);
  const supine_basis_info *info = supine_basis_get_info(opened);
  const float *positions = supine_safetensors_find(file, "positions")->data;
  const double *gravity = supine_safetensors_find(file, "gravity")->data;
  const double *time = supine_safetensors_find(file, "time")->data;
  assert_int_equal(supine_safetensors_find(file, "time")->shape[0], FRAMES);
  supine_pv_breath wanted = supine_breath_default();
  wanted.rate = 20.0;
  float *xyz = malloc(3 * info->vertex_count * sizeof *xyz);
  assert_non_null(xyz);
  for (size_t t = 0; t < FRAMES; ++t) {
    /* The basis has no volume at rest, so volumes are relative to the scan. */
    supine_state frame = {.volume = {SUPINE_VOLUME_SCAN, 0.0}};
    supine_pose pose;
    memcpy(frame.gravity, gravity + 3 * t, sizeof frame.gravity);
    assert_int_equal(supine_breath_evaluate(supine_breath_normal(), &wanted, 1, &time[t],
                                            &frame.volume.ml, NULL, NULL),
                     SUPINE_OK);
    assert_int_equal(supine_basis_pose(opened, &frame, &pose, NULL), SUPINE_OK);
    supine_deform(opened, &pose, xyz);
    assert_memory_equal(xyz, positions + 3 * t * info->vertex_count,
                        3 * info->vertex_count * sizeof *xyz);
  }
  free(xyz);
  supine_safetensors_close(file);
  supine_basis_close(opened);
}

TEST(test_breathe_constant_flow_volumes_exact_in_every_frame) {
  supine_pv_breath course = supine_breath_default();
  assert_int_equal(
      RUN(basis, "--posture", "prone", "--course", "flow", "--inhale", "0.5", "-o", breath),
      SUPINE_EXIT_OK);
  course.course = SUPINE_PV_CONSTANT_FLOW; /* 500 mL are inhaled in 2.5 s */
  course.inhale_fraction = 0.5;
  double *wanted = breath_of(&course, 66.66, 334);
  for (size_t t = 0; t < 166; ++t) {
    assert_true(fabs(wanted[t] - 200.0 * (double)t / 66.66) < 1e-9);
  }
  check_volumes(basis, wanted, 334);
  assert_says(text, "allowed 15 ms");
  free(wanted);

  course = supine_breath_default();
  assert_int_equal(RUN(basis, "--posture", "left", "--seconds", "6", "-o", breath), SUPINE_EXIT_OK);
  wanted = breath_of(&course, 66.66, 400);
  check_volumes(basis, wanted, 400);
  free(wanted);
}

TEST(test_breathe_all_options_volumes_exact_in_every_frame) {
  const supine_pv_breath course = {.tidal = 300.0,
                                   .rate = 20.0,
                                   .inhale_fraction = 0.4,
                                   .rest_pressure = 8.0,
                                   .course = SUPINE_PV_RAMP};
  assert_int_equal(RUN(basis, "--posture", "supine", "--tidal", "300mL", "--rate", "20", "--inhale",
                       "0.4", "--rest-pressure", "8", "--course", "ramp", "--fps", "30", "-o",
                       breath),
                   SUPINE_EXIT_OK);
  double *wanted = breath_of(&course, 30.0, 91); /* one breath takes 3 s */
  check_volumes(basis, wanted, 91);
  free(wanted);
}

TEST(test_breathe_bad_arguments_usage_error) {
  static const char *const bad[][2] = {{"--rate", "0"},
                                       {"--rate", "-3"},
                                       {"--rate", "often"},
                                       {"--tidal", "0mL"},
                                       {"--inhale", "1"},
                                       {"--inhale", "0"},
                                       {"--fps", "0"},
                                       {"--seconds", "-1"},
                                       {"--course", "sine"},
                                       {"--turn", "supine:left"},
                                       {"--turn", "supine:left:0s"},
                                       {"--turn", "supine:up:3"},
                                       {"--turn", "supine:left:soon"},
                                       {"--rest-pressure", "x"},
                                       {"--fps", "1e9"},
                                       {"--posture", "suppine"},
                                       {"--bogus", "1"}};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    const bool posture = strcmp(bad[i][0], "--turn") != 0 && strcmp(bad[i][0], "--posture") != 0;
    const int code = posture ? RUN(basis, "--posture", "supine", "-o", breath, bad[i][0], bad[i][1])
                             : RUN(basis, "-o", breath, bad[i][0], bad[i][1]);
    if (code != SUPINE_EXIT_USAGE) {
      fail_msg("%s %s: exit code %d: %s", bad[i][0], bad[i][1], code, text);
    }
  }
  assert_int_equal(RUN(basis, "-o", breath), SUPINE_EXIT_USAGE);
  assert_int_equal(RUN(basis, "--posture", "supine"), SUPINE_EXIT_USAGE);
  assert_int_equal(RUN("--posture", "supine", "-o", breath), SUPINE_EXIT_USAGE);
  assert_int_equal(RUN(basis, "--posture", "left", "--turn", "supine:left:3", "-o", breath),
                   SUPINE_EXIT_USAGE);
}

TEST(test_breathe_missing_files_or_huge_breath_refused) {
  assert_int_equal(RUN("/nowhere", "--posture", "supine", "-o", breath), SUPINE_EXIT_INPUT);
  assert_int_equal(RUN(basis, "--posture", "supine", "--pv", "/nowhere", "-o", breath),
                   SUPINE_EXIT_INPUT);
  assert_int_equal(RUN(basis, "--posture", "supine", "--tidal", "90000mL", "-o", breath),
                   SUPINE_EXIT_USAGE);
  assert_says(text, "90000");
}

TEST(test_breathe_interrupted_leaves_no_file) {
  const size_t before = count_files();
  const pid_t child = fork();
  if (child == 0) {
    (void)freopen("/dev/null", "wb", stderr);
    char *argv[] = {"breathe", basis, "--posture", "supine", "--seconds",
                    "3000",    "-o",  series,      NULL};
    optind = 0;
    _exit(supine_options_run(&supine_command_breathe, 8, argv));
  }
  assert_true(child > 0);
  int how = 0;
  pid_t ended = 0;
  while (ended == 0 && count_files() == before) { /* until the child writes, or ends too early */
    (void)nanosleep(&(struct timespec){0, 10000000}, NULL);
    ended = waitpid(child, &how, WNOHANG);
  }
  assert_int_equal(ended, 0);
  assert_int_equal(kill(child, SIGINT), 0);
  assert_int_equal(waitpid(child, &how, 0), child);
  assert_true(WIFEXITED(how));
  assert_int_equal(WEXITSTATUS(how), SUPINE_EXIT_OUTPUT);
  assert_int_equal(count_files(), before);
}

TEST(test_breath_turn_gravity_any_turn_keeps_unit_length_and_speed) {
  static const double turns[][6] = {{0, 1, 0, 1, 0, 0},  {0, 1, 0, 0, -1, 0},
                                    {0, 0, -1, 0, 0, 1}, {1, 0, 0, -1, 0, 0},
                                    {0, 1, 0, 0, 1, 0},  {0.6, 0, -0.8, 0, 0.28, 0.96}};
  static const double middles[][3] = {
      {M_SQRT1_2, M_SQRT1_2, 0}, {1, 0, 0}, {0, 1, 0}, {0, 1, 0}, {0, 1, 0}};
  for (size_t i = 0; i < 6; ++i) {
    breath_turn turn = {.seconds = 8.0};
    memcpy(turn.from, turns[i], sizeof turn.from);
    memcpy(turn.to, turns[i] + 3, sizeof turn.to);
    double last[3];
    double angle = -1.0;
    for (int s = 0; s <= 8; ++s) {
      double g[3];
      supine_options_turn_gravity(&turn, s, g);
      assert_true(fabs(hypot(hypot(g[0], g[1]), g[2]) - 1.0) < 1e-12);
      if (s > 0) {
        const double step = hypot(hypot(g[0] - last[0], g[1] - last[1]), g[2] - last[2]);
        assert_true(angle < 0.0 || fabs(step - angle) < 1e-7);
        angle = step;
      } else {
        assert_true(fabs(g[0] - turn.from[0]) + fabs(g[1] - turn.from[1]) +
                        fabs(g[2] - turn.from[2]) <
                    1e-12);
      }
      if (s == 4 && i < 5) {
        for (size_t k = 0; k < 3; ++k) {
          assert_true(fabs(g[k] - middles[i][k]) < 1e-7);
        }
      }
      memcpy(last, g, sizeof last);
    }
    assert_memory_equal(last, turn.to, sizeof last);
    supine_options_turn_gravity(&turn, 100.0, last);
    assert_memory_equal(last, turn.to, sizeof last);
  }
}

TEST_GROUP(setup, teardown)
