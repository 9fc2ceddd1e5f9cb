/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fuzz images in the file format FUZZ_ENDING. Small images are also converted to surfaces. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "mesh/image/image.h"
#include "mesh/labels/labels.h"

#include "fuzz.h"

enum { SMALL = 1 << 15 }; /* largest number of voxels of an image that is converted */

static void expect_lungs(const char *path) {
  /* large triangles, with which the conversion is 20 times as fast */
  const supine_labels_options options = {.edge = 12.0};
  supine_mesh surfaces[2] = {0};
  supine_labels_report report = {0};
  supine_error error = {0};
  const supine_status status =
      supine_labels_surfaces(&path, 1, &options, surfaces, &report, &error);
  supine_fuzz_expect_words(status, &error);
  for (size_t lung = 0; lung < 2; ++lung) {
    for (size_t i = 0; i < 3 * surfaces[lung].vertex_count; ++i) {
      supine_fuzz_expect(isfinite(surfaces[lung].vertices[i]), "finite coordinates of each vertex");
    }
    supine_mesh_free(&surfaces[lung]);
  }
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
  const char *path = supine_fuzz_file(bytes, size, FUZZ_ENDING);
  supine_image image = {0};
  supine_error error = {0};
  const supine_status status = supine_image_read(path, &image, &error);
  supine_fuzz_expect_words(status, &error);
  if (status == SUPINE_OK) {
    const size_t count = image.size[0] * image.size[1] * image.size[2];
    double sum = 0.0;
    for (size_t i = 0; i < count * image.channels; ++i) {
      sum += supine_image_get(&image, i);
    }
    supine_fuzz_expect(count > 0 && (sum == sum || sum != sum), "an image of at least one voxel");
    if (count <= SMALL) {
      expect_lungs(path);
    }
  }
  supine_image_free(&image);
  (void)unlink(path);
  return 0;
}

/* Make a label map of two boxes with labels 1 and 2. The type of the voxels depends on `index`. */
static uint8_t *saved(size_t index, size_t *size) {
  static const supine_image_voxel voxels[] = {SUPINE_VOXEL_U8, SUPINE_VOXEL_I16, SUPINE_VOXEL_F32};
  enum { SEEDS = sizeof voxels / sizeof *voxels, X = 16, Y = 9, Z = 10 };
  if (index >= SEEDS) {
    return NULL;
  }
  supine_image image = {.size = {X, Y, Z},
                        .origin = {-60.0, -40.0, -50.0},
                        .step = {{8.0, 0.0, 0.0}, {0.0, 9.0, 0.0}, {0.0, 0.0, 10.0}},
                        .voxel = voxels[index],
                        .channels = 1};
  image.values = calloc(X * Y * Z, supine_image_voxel_size(image.voxel));
  supine_fuzz_expect(image.values != NULL, "memory for a seed");
  for (size_t i = 0; i < X * Y * Z; ++i) {
    const size_t x = i % X;
    const size_t y = i / X % Y;
    const size_t z = i / X / Y;
    const bool inside = y > 0 && y < Y - 1 && z > 0 && z < Z - 1;
    supine_image_put(&image, i, 1,
                     &(double){inside && x > 0 && x < 7       ? 2.0
                               : inside && x > 8 && x < X - 1 ? 1.0
                                                              : 0.0});
  }
  const char *path = supine_fuzz_file((const uint8_t *)"", 0, FUZZ_ENDING);
  const supine_status status = supine_image_write(path, &image, "a seed", NULL);
  supine_image_free(&image);
  return status == SUPINE_OK ? supine_fuzz_take(path, size) : NULL;
}

/* Headers with what supine_image_write does not write. */
static const char *const texts[] = {
    "NRRD0004\ntype: uchar\ndimension: 3\nspace: RAS\nsizes: 2 2 1\nspace directions: (2,0,0) "
    "(0,2,0) (0,0,2)\nspace origin: (0,0,0)\nencoding: ascii\n\n1 2 0 3\n",
    "NRRD0005\r\n# a comment\r\ntype: double\r\ndimension: 3\r\nspace: "
    "left-posterior-superior\r\nsizes: 1 1 1\r\nspace directions: (1,0,0) (0,1,0) (0,0,1)\r\n"
    "kinds: domain domain domain\r\nendian: big\r\nencoding: raw\r\nspace origin: "
    "(0,0,0)\r\nSegment0_Name:=left lung\r\n\r\nabcdefgh",
    "NRRD0004\ntype: int64\ndimension: 3\nspace: LPS\nsizes: 1 1 2\nspace directions: (1,0,0) "
    "(0,1,0) (0,0,1)\nspace origin: (0,0,0)\nencoding: raw\nendian: little\n"
    "data file: LIST\nvoxels.raw\n\nabcdefghabcdefgh"};

uint8_t *supine_fuzz_seed(size_t index, size_t *size) {
  const size_t count = strcmp(FUZZ_ENDING, ".nrrd") == 0 ? sizeof texts / sizeof *texts : 0;
  return index < count ? supine_fuzz_text(texts[index], size) : saved(index - count, size);
}
