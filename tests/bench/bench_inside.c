/* SPDX-License-Identifier: GPL-3.0-or-later */
/* From a label map of 512 x 512 x 300 voxels to a basis, and 20,000 points embedded in a basis of
 * twice 20,000 vertices: seconds, processor seconds and memory of the program itself.
 *
 *     bench_inside path/to/supine [FOLDER] */
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "precompute/lungs/phantom.h"

#include "../labels_helpers.h"
#include "program.h"

static void take(const char *what, char *const *arguments) {
  bench_program_print(what, bench_program_run(what, arguments));
}

/* 512 x 512 x 300 voxels of 0.7 x 0.7 x 1 mm around the phantom, lungmask's labels or one. */
static void write_map(const supine_mesh *phantom, bool one, const char *path) {
  const double spacing[3] = {0.7, 0.7, 1.0};
  const size_t half = phantom->triangle_count / 2;
  double low[3];
  double high[3];
  supine_image image = {.size = {512, 512, 300}, .voxel = SUPINE_VOXEL_U8, .channels = 1};
  supine_mesh_box(phantom, low, high);
  for (int a = 0; a < 3; ++a) {
    image.step[a][a] = spacing[a];
    image.origin[a] = 0.5 * (low[a] + high[a]) - 0.5 * spacing[a] * (double)image.size[a] + 0.013;
  }
  image.values = calloc((size_t)512 * 512 * 300, 1);
  helper_voxelise(phantom, 0, half, one ? 1 : 2, &image);
  helper_voxelise(phantom, half, phantom->triangle_count, 1, &image);
  supine_error error;
  if (supine_image_write(path, &image, NULL, &error) != SUPINE_OK) {
    (void)fprintf(stderr, "%s\n", error.message);
    exit(1);
  }
  supine_image_free(&image);
}

/* Every n-th vertex of the phantom drawn towards its lung's middle: inside, at all depths. */
static void write_points(const supine_mesh *phantom, size_t count, const char *path) {
  FILE *file = fopen(path, "w");
  const size_t half = phantom->vertex_count / 2;
  double middle[2][3] = {{0.0}};
  if (file == NULL) {
    exit(1);
  }
  for (size_t i = 0; i < phantom->vertex_count; ++i) {
    for (size_t k = 0; k < 3; ++k) {
      middle[i / half % 2][k] += phantom->vertices[3 * i + k] / (double)half;
    }
  }
  (void)fputs("x,y,z\n", file);
  for (size_t i = 0; i < count; ++i) {
    const size_t v = i * phantom->vertex_count / count;
    const double share = 0.3 + 0.65 * (double)(i * 7919 % count) / (double)count;
    double p[3];
    for (size_t k = 0; k < 3; ++k) {
      const double *m = middle[v / half % 2];
      p[k] = m[k] + share * (phantom->vertices[3 * v + k] - m[k]);
    }
    (void)fprintf(file, "%.4f,%.4f,%.4f\n", p[0], p[1], p[2]);
  }
  (void)fclose(file);
}

int main(int argc, char **argv) {
  enum { VERTICES = 40000, POINTS = 20000 };
  if (argc < 2 || (argc > 2 && chdir(argv[2]) != 0)) {
    (void)fprintf(stderr, "usage: bench_inside path/to/supine [FOLDER]\n");
    return 1;
  }
  char *supine = argv[1];
  supine_mesh phantom = {0};
  if (supine_phantom_create(VERTICES, 6000.0, &phantom, NULL) != SUPINE_OK ||
      supine_mesh_save("bench-lungs.ply", &phantom, NULL, NULL) != SUPINE_OK) {
    return 1;
  }
  write_map(&phantom, false, "bench-two.nii.gz");
  write_map(&phantom, true, "bench-one.nii.gz");
  write_points(&phantom, POINTS, "bench-points.csv");
  char *two[] = {supine, "precompute", "bench-two.nii.gz", "-o", "bench-two.safetensors", NULL};
  char *one[] = {supine, "precompute", "bench-one.nii.gz", "-o", "bench-one.safetensors", NULL};
  char *mesh[] = {supine, "precompute", "bench-lungs.ply", "-o", "bench-lungs.safetensors", NULL};
  char *embed[] = {supine,
                   "embed",
                   "bench-lungs.safetensors",
                   "bench-points.csv",
                   "-o",
                   "bench-inside.safetensors",
                   NULL};
  take("label map of two lungs, to a basis", two);
  take("label map of one label, parted, to a basis", one);
  take("40,000 vertices, to a basis", mesh);
  take("20,000 points into it", embed);
  supine_mesh_free(&phantom);
  return 0;
}
