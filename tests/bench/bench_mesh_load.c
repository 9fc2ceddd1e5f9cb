/* SPDX-License-Identifier: GPL-3.0-or-later */
/* assimp alone, loading two lungs one after the other with their identical vertices joined, against
 * our load (with its weld) and topology, the two lungs in two threads. Interleaved; the least of
 * each is printed, and the most memory of either, each measured in a process of its own.
 *
 *     bench_mesh_load [LEFT RIGHT] */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <assimp/cimport.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "mesh/mesh.h"
#include "sh/base/clock.h"
#include "sh/base/parallel.h"

enum { REPEATS = 9 };

typedef struct lung {
  const char *path;
  double load;
  double topology;
  size_t vertices;
  size_t edges;
} lung;

/* Seconds; negative where it failed. */
static double run_assimp(const lung lungs[2], unsigned flags) {
  const double begin = supine_clock_seconds();
  for (int i = 0; i < 2; ++i) {
    const struct aiScene *scene = aiImportFile(lungs[i].path, flags);
    if (scene == NULL) {
      return -1.0;
    }
    aiReleaseImport(scene);
  }
  return supine_clock_seconds() - begin;
}

static void load_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  lung *lungs = context;
  for (size_t i = begin; i < end; ++i) {
    supine_mesh mesh = {0};
    supine_topology topology = {0};
    supine_error error;
    const double start = supine_clock_seconds();
    if (supine_mesh_load(lungs[i].path, NULL, &mesh, NULL, &error) != SUPINE_OK) {
      (void)fprintf(stderr, "%s\n", error.message);
      continue;
    }
    const double loaded = supine_clock_seconds();
    if (supine_mesh_topology_create(&mesh, &topology) == SUPINE_OK) {
      lungs[i].vertices = mesh.vertex_count;
      lungs[i].edges = topology.edge_count;
    }
    lungs[i].load = loaded - start;
    lungs[i].topology = supine_clock_seconds() - loaded;
    supine_mesh_topology_free(&topology);
    supine_mesh_free(&mesh);
  }
}

static double run_ours(lung lungs[2], size_t threads) {
  const double begin = supine_clock_seconds();
  supine_parallel_for(2, 1, threads, load_range, lungs);
  return supine_clock_seconds() - begin;
}

/* Peak MB of a process that does one or the other alone. */
static double peak_memory(lung lungs[2], int ours) {
  (void)fflush(NULL);
  const pid_t child = fork();
  if (child == 0) {
    _exit((ours ? run_ours(lungs, 2) : run_assimp(lungs, aiProcess_JoinIdenticalVertices)) < 0.0);
  }
  int status = 0;
  struct rusage usage = {0};
  if (child < 0 || wait4(child, &status, 0, &usage) != child || status != 0) {
    return -1.0;
  }
  return (double)usage.ru_maxrss / 1024.0;
}

static void keep_least(double *least, double value) {
  if (*least < 0.0 || value < *least) {
    *least = value;
  }
}

int main(int argc, char **argv) {
  lung lungs[2] = {{.path = argc == 3 ? argv[1] : SUPINE_TEST_DATA "/lungs/chaste_left_full.ply"},
                   {.path = argc == 3 ? argv[2] : SUPINE_TEST_DATA "/lungs/chaste_right_full.ply"}};
  if (access(lungs[0].path, R_OK) != 0 || access(lungs[1].path, R_OK) != 0) {
    (void)fprintf(stderr, "cannot read %s and %s\n", lungs[0].path, lungs[1].path);
    return EXIT_FAILURE;
  }
  const double memory_assimp = peak_memory(lungs, 0);
  const double memory_ours = peak_memory(lungs, 1);
  double joined = -1.0;
  double plain = -1.0;
  double ours = -1.0;
  double serial = -1.0;
  double load = -1.0;
  double topology = -1.0;
  for (int repeat = 0; repeat < REPEATS; ++repeat) {
    keep_least(&joined, run_assimp(lungs, aiProcess_JoinIdenticalVertices));
    keep_least(&ours, run_ours(lungs, 2));
    keep_least(&plain, run_assimp(lungs, 0));
    keep_least(&serial, run_ours(lungs, 1));
    keep_least(&load, lungs[0].load + lungs[1].load);
    keep_least(&topology, lungs[0].topology + lungs[1].topology);
  }
  if (joined < 0.0 || lungs[0].vertices == 0 || lungs[1].vertices == 0) {
    (void)fprintf(stderr, "a file could not be loaded\n");
    return EXIT_FAILURE;
  }
  (void)printf("vertices %zu, edges %zu\n", lungs[0].vertices + lungs[1].vertices,
               lungs[0].edges + lungs[1].edges);
  (void)printf("assimp, identical vertices joined        %7.3f s   %6.0f MB\n", joined,
               memory_assimp);
  (void)printf("assimp, nothing joined                   %7.3f s\n", plain);
  (void)printf("ours, two threads: load, weld, topology  %7.3f s   %6.0f MB\n", ours, memory_ours);
  (void)printf("ours, one thread                         %7.3f s   = load and weld %.3f + topology "
               "%.3f\n",
               serial, load, topology);
  (void)printf("ours / assimp joined                     %7.3f\n", ours / joined);
  return EXIT_SUCCESS;
}
