/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test which parts of a CT and of a label map are found to be compact, so that they stay rigid. */
#include <stdlib.h>
#include <string.h>

#include "precompute/inside/content.h"
#include "precompute/warp/tissue.h"
#include "tests/helpers/test.h"

enum { NODES = 36, VOXELS = 88 };
static const double radius = 60.0; /* of the lung, a ball around the origin, mm */

/* Make an image of cubes of `step` mm around the origin. */
static supine_image cubes(size_t size, double step, supine_image_voxel voxel, size_t bytes) {
  supine_image image = {.size = {size, size, size}, .channels = 1, .voxel = voxel};
  for (size_t a = 0; a < 3; ++a) {
    image.step[a][a] = step;
    image.origin[a] = -0.5 * step * (double)(size - 1);
  }
  image.values = calloc(size * size * size, bytes);
  assert_non_null(image.values);
  return image;
}

static double length_of(const double p[3]) {
  return sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
}

/* Return the field of a lung that is a ball: its depth is what finds tissue. */
static supine_field ball_field(void) {
  supine_field field = {.depth = cubes(NODES, 4.0, SUPINE_VOXEL_F32, sizeof(float)),
                        .lung = cubes(NODES, 4.0, SUPINE_VOXEL_U8, 1)};
  for (size_t i = 0; i < (size_t)NODES * NODES * NODES; ++i) {
    double p[3];
    supine_image_place(&field.depth, i, p);
    supine_image_put(&field.depth, i, 1, &(double){radius - length_of(p)});
  }
  return field;
}

enum { AIR, TISSUE, CAVITY };
typedef enum shape { BALL, HOLLOW, IRREGULAR, PLEURAL, VESSEL, LOBE, SHAPES } shape;

/* Return what a point belongs to: AIR of the lung, the TISSUE of a shape, or its CAVITY. */
static int belongs(shape which, const double p[3]) {
  const double at[3] = {p[0] - 11.3, p[1] + 7.9, p[2] - (which == PLEURAL ? 50.5 : 4.2)};
  const double r = length_of(at);
  switch (which) {
  case HOLLOW:
    return r < 7.0 ? CAVITY : r < 12.0;
  case IRREGULAR:
    return r < 9.0 + 2.0 * sin(0.31 * at[0]) * cos(0.4 * at[1]) + 1.5 * sin(0.5 * at[2]);
  case VESSEL:
    return hypot(at[0] + 0.4 * at[2], at[1]) < 3.6 && fabs(at[2]) < 45.0;
  case LOBE:
    return p[2] > 0.0;
  default:
    return r < 9.0;
  }
}

/* Find the parts of a shape, in a CT or in a label map, and return their number. Write the volume
 * of the first, and that of the shape with its cavity, mL. */
static size_t find(const supine_field *field, shape which, bool ct, double volume[2]) {
  supine_image image = cubes(VOXELS, 1.6, SUPINE_VOXEL_I16, 2);
  supine_tissue tissue = {.part_count = 0};
  volume[0] = volume[1] = 0.0;
  for (size_t i = 0; i < (size_t)VOXELS * VOXELS * VOXELS; ++i) {
    double p[3];
    supine_image_place(&image, i, p);
    const bool lung = length_of(p) < radius;
    const int part = lung ? belongs(which, p) : AIR;
    const double soft = part == TISSUE && which != LOBE ? 30.0 : -850.0;
    const double hounsfield = lung ? soft : 40.0;
    const double label = lung ? 1.0 + (part == TISSUE) : 0.0;
    supine_image_put(&image, i, 1, &(double){ct ? hounsfield : label});
    volume[1] += part == AIR ? 0.0 : 1e-3 * 1.6 * 1.6 * 1.6;
  }
  assert_int_equal(ct ? supine_warp_tissue_find(field, &image, &tissue, NULL)
                      : supine_warp_tissue_find_labels(field, &image, &tissue, NULL),
                   SUPINE_OK);
  const size_t count = tissue.part_count;
  volume[0] = count > 0 ? tissue.parts[0].volume : 0.0;
  supine_warp_tissue_free(&tissue);
  supine_image_free(&image);
  return count;
}

/* A tumour has one volume, whether a CT or a label map shows it. */
TEST(test_tissue_find_tumours_same_volume_in_ct_and_labels) {
  static const char *const names[SHAPES] = {"ball",    "hollow", "irregular",
                                            "pleural", "vessel", "lobe"};
  supine_field field = ball_field();
  for (shape which = BALL; which < SHAPES; ++which) {
    for (int ct = 0; ct < 2; ++ct) {
      double volume[2];
      const size_t count = find(&field, which, ct == 1, volume);
      print_message("%s in a %s: %zu, %.2f of %.2f mL\n", names[which], ct == 1 ? "CT" : "map",
                    count, volume[0], volume[1]);
      /* The opening takes spikes off; the field is rigid a few mm around a part, so that they stay.
       * In a map, a cavity that has the label of the lung is a part of the same group. */
      assert_true(which < VESSEL ? count == 1 || (which == HOLLOW && count == 2) : count == 0);
      if (which < VESSEL) {
        assert_true(fabs(volume[0] - volume[1]) < 0.1 * volume[1]);
      }
    }
  }
  supine_image_free(&field.depth);
  supine_image_free(&field.lung);
}

/* Return a box of the given half sides around a place as a mesh, turned inwards if `inwards`. */
static supine_mesh box(const double half[3], const double centre[3], bool inwards) {
  static const uint32_t faces[36] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                     2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
  supine_mesh mesh = {8, malloc(24 * sizeof(double)), 12, malloc(36 * sizeof(uint32_t))};
  for (size_t i = 0; i < 24; ++i) {
    mesh.vertices[i] = centre[i % 3] + (i / 3 >> i % 3 & 1U ? half[i % 3] : -half[i % 3]);
  }
  for (size_t i = 0; i < 36; ++i) {
    mesh.triangles[i] = faces[inwards ? 35 - i : i];
  }
  return mesh;
}

/* Append a mesh to another, and free it. */
static void join(supine_mesh *mesh, supine_mesh other) {
  const size_t n = mesh->vertex_count;
  const size_t t = mesh->triangle_count;
  mesh->vertices = realloc(mesh->vertices, 3 * (n + other.vertex_count) * sizeof(double));
  mesh->triangles = realloc(mesh->triangles, 3 * (t + other.triangle_count) * sizeof(uint32_t));
  memcpy(mesh->vertices + 3 * n, other.vertices, 3 * other.vertex_count * sizeof(double));
  for (size_t i = 0; i < 3 * other.triangle_count; ++i) {
    mesh->triangles[3 * t + i] = other.triangles[i] + (uint32_t)n;
  }
  mesh->vertex_count += other.vertex_count;
  mesh->triangle_count += other.triangle_count;
  supine_mesh_free(&other);
}

/* Compact closed components are rigid, with the cavities in them and beside stray ones; long, large
 * and open ones are not. */
TEST(test_content_find_compact_only_compact_closed_components_rigid) {
  static const double halves[6][3] = {{8, 9, 7}, {4, 4, 40}, {20, 25, 22},
                                      {8, 9, 7}, {8, 9, 7},  {1, 1, 1}};
  static const double centre[2][3] = {{61.0, -17.0, 25.0}, {21.0, -31.0, 11.0}};
  supine_inside_content content = {.count = 0};
  for (size_t i = 0; i < 4; ++i) {
    supine_mesh mesh = box(halves[i], centre[0], false);
    mesh.triangle_count -= i == 3 ? 1 : 0; /* open */
    assert_int_equal(supine_inside_content_surface((const char *[]){"a", "b", "c", "d"}[i], &mesh,
                                                   &content, NULL),
                     SUPINE_OK);
    supine_mesh_free(&mesh);
  }
  supine_mesh mesh = box(halves[5], centre[1], false); /* a stray voxel, a tumour and its cavity */
  join(&mesh, box(halves[4], centre[0], false));
  join(&mesh, box((const double[]){3, 4, 2}, centre[0], true));
  assert_int_equal(supine_inside_content_surface("e", &mesh, &content, NULL), SUPINE_OK);
  assert_int_equal(supine_inside_content_find_compact(&content, NULL), SUPINE_OK);
  assert_int_equal(content.rigid_count, 2);
  for (size_t i = 0; i < content.count; ++i) {
    const uint32_t of_box[7] = {1, 0, 0, 0, 2, 2, 0}; /* the stray voxel comes last */
    assert_int_equal(content.rigid[i], of_box[i / 8]);
  }
  const supine_mesh moved = {24, content.points + 96, 36, mesh.triangles};
  for (size_t i = 0; i < 108; ++i) {
    mesh.triangles[i] = content.triangles[content.triangle_count * 3 - 108 + i] - 32;
  }
  assert_close(supine_mesh_volume(&moved), 8 * (8 * 9 * 7 + 1 - 3 * 4 * 2), 1e-9);
  supine_mesh_free(&mesh);
  supine_inside_content_free(&content);
}
