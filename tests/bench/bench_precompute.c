/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measure the time to precompute a basis file from the mesh files of two lungs with default
 * options, against the time that assimp alone takes to load the same files one after the other and
 * join identical vertices. Runs alternate. Print the least time of each, then how the time grows
 * from 5,000 to 509,000 vertices.
 *
 *     bench_precompute [REPEATS] */
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <unistd.h>

#include <assimp/cimport.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "base/clock.h"
#include "base/parallel.h"
#include "precompute/precompute.h"
#include "tests/helpers/basis_helpers.h"

static const char *const sizes[][2] = {
    {"chaste_left_5k.obj", "chaste_right_5k.obj"},
    {"chaste_left.ply", "chaste_right.ply"},
    {"chaste_left_full.ply", "chaste_right_full.ply"},
};

enum { SIZES = 3, STAGES = 3 };

static const char *const stages[STAGES] = {"load", "join", "solve, project, measure, write"};

typedef struct pair {
  char path[2][512];
  supine_mesh mesh[2];
  supine_error error[2];
} pair;

static double run_assimp(const pair *files) {
  const double begin = supine_clock_seconds();
  for (size_t i = 0; i < 2; ++i) {
    const struct aiScene *scene = aiImportFile(files->path[i], aiProcess_JoinIdenticalVertices);
    if (scene == NULL) {
      return -1.0;
    }
    aiReleaseImport(scene);
  }
  return supine_clock_seconds() - begin;
}

static void load_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  pair *files = context;
  for (size_t i = begin; i < end; ++i) {
    (void)supine_mesh_load(files->path[i], NULL, &files->mesh[i], NULL, &files->error[i]);
  }
}

/* Set the time of each stage, s. Return the total time, s, or -1 if a stage fails. */
static double run_ours(pair *files, const char *out, double times[STAGES], size_t *vertices) {
  supine_lungs lungs = {0};
  supine_error error;
  const double begin = supine_clock_seconds();
  supine_parallel_for(2, 1, 2, load_range, files);
  const double loaded = supine_clock_seconds();
  supine_status status = supine_lungs_create(files->mesh, 2, NULL, &lungs, &error);
  supine_mesh_free(&files->mesh[0]);
  supine_mesh_free(&files->mesh[1]);
  const double joined = supine_clock_seconds();
  *vertices = lungs.mesh.vertex_count;
  static const supine_scan full = {.known = true,
                                   .state = {.gravity = {0, 1, 0}, .volume = {SUPINE_VOLUME_FULL}}};
  const supine_resting resting = supine_reference_resting_default();
  supine_prepared prepared = {.source = {.lungs = lungs},
                              .model = supine_physics_model(SUPINE_LAW_DEEP)};
  if (status == SUPINE_OK) {
    status = supine_reference_find(&prepared.source.lungs, &prepared.model, &full, &resting,
                                   &prepared.reference, &error);
  }
  if (status == SUPINE_OK) {
    const supine_basis_choice choice = {.band = 23, .modes = 16};
    status = helper_write_basis(out, &prepared, &choice, NULL, &error);
  }
  supine_precompute_prepared_free(&prepared);
  const double end = supine_clock_seconds();
  if (status != SUPINE_OK) {
    (void)fprintf(stderr, "%s\n", error.message);
    return -1.0;
  }
  const double marks[STAGES + 1] = {begin, loaded, joined, end};
  for (size_t s = 0; s < STAGES; ++s) {
    times[s] = marks[s + 1] - marks[s];
  }
  return end - begin;
}

int main(int argc, char **argv) {
  const int repeats = argc > 1 ? (int)strtol(argv[1], NULL, 10) : 7;
  char out[] = "/tmp/supine-bench-XXXXXX";
  const int descriptor = mkstemp(out);
  if (descriptor < 0) {
    return EXIT_FAILURE;
  }
  (void)close(descriptor);
  (void)printf("%9s %9s %9s %7s %12s   stages\n", "vertices", "assimp s", "supine s", "ratio",
               "us a vertex");
  for (size_t size = 0; size < SIZES; ++size) {
    pair files = {0};
    double assimp = 1e9;
    double ours = 1e9;
    double best[STAGES] = {0.0};
    size_t vertices = 0;
    for (size_t i = 0; i < 2; ++i) {
      (void)snprintf(files.path[i], sizeof files.path[i], "%s/lungs/%s", SUPINE_TEST_DATA,
                     sizes[size][i]);
      if (access(files.path[i], R_OK) != 0) {
        (void)fprintf(stderr, "cannot read %s\n", files.path[i]);
        return EXIT_FAILURE;
      }
    }
    for (int repeat = 0; repeat < repeats; ++repeat) {
      double times[STAGES] = {0.0};
      const double theirs = run_assimp(&files);
      const double mine = run_ours(&files, out, times, &vertices);
      if (theirs < 0.0 || mine < 0.0) {
        return EXIT_FAILURE;
      }
      assimp = theirs < assimp ? theirs : assimp;
      for (size_t s = 0; s < STAGES && mine < ours; ++s) {
        best[s] = times[s];
      }
      ours = mine < ours ? mine : ours;
    }
    (void)printf("%9zu %9.3f %9.3f %7.2f %12.2f  ", vertices, assimp, ours, ours / assimp,
                 1e6 * ours / (double)vertices);
    for (size_t s = 0; s < STAGES; ++s) {
      (void)printf(" %s %.3f%s", stages[s], best[s], s + 1 < STAGES ? "," : "\n");
    }
  }
  struct rusage usage;
  (void)getrusage(RUSAGE_SELF, &usage);
  (void)printf("peak memory of this process, which runs supine and assimp: %.0f MB\n",
               (double)usage.ru_maxrss / 1024.0);
  (void)unlink(out);
  return EXIT_SUCCESS;
}
