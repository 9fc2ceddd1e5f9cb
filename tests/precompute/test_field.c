/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test displacement fields on a grid, their inverses, and images warped by three programs. */
#include "tests/helpers/folder.h"
#include "tests/helpers/inside_helpers.h"

#include "base/vec3.h"
#include "precompute/inside/content.h"
#include "precompute/inside/embed.h"
#include "precompute/warp/tissue.h"
#include "precompute/warp/ventilation.h"

#include "tests/helpers/poses.h"

static supine_basis *surface;
static supine_basis *grid;

/* Weights at which the modes of inside_helpers.h displace points by up to about 20 mm. */
static const double weights[HELPER_MODES] = {0.5, 0.4, 0.0};
static const double scales[2] = {1.0, 1.0};

static supine_field inverse_kept;

static void make_grid(double spacing) {
  supine_inside_shells shells;
  supine_inside_content content = {0};
  supine_inside_report report;
  supine_error error;
  const supine_inside_options options = {0};
  if (supine_inside_shells_create(surface, &shells, &error) != SUPINE_OK ||
      supine_inside_content_grid(&shells, NULL, spacing, 60.0, &content, &error) != SUPINE_OK ||
      supine_inside_embed(&shells, &content, &options, in_folder("grid"), &report, &error) !=
          SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  supine_inside_content_free(&content);
  supine_inside_shells_free(&shells);
}

static int setup(void **state) {
  if (folder_make(state) != 0) {
    return -1;
  }
  helper_write_basis(in_folder("surface"), 10, 2);
  surface = helper_open(in_folder("surface"));
  make_grid(4.0);
  grid = helper_open(in_folder("grid"));
  return 0;
}

static int teardown(void **state) {
  supine_warp_free(&inverse_kept);
  supine_basis_close(surface);
  supine_basis_close(grid);
  return folder_remove(state);
}

static supine_field made_field(void) {
  supine_field field;
  supine_error error;
  if (supine_warp_create(grid, POSED(grid, weights, scales), NULL, &field, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return field;
}

/* Return the inverse field. Only the first call computes it, which takes seconds. */
static const supine_field *made_inverse(void) {
  if (inverse_kept.nodes.values == NULL) {
    supine_field field = made_field();
    supine_warp_residual residual;
    assert_int_equal(supine_warp_invert(&field, &inverse_kept, &residual, NULL), SUPINE_OK);
    supine_warp_free(&field);
  }
  return &inverse_kept;
}

static double size_of(const double v[3]) {
  return hypot(hypot(v[0], v[1]), v[2]);
}

/* Turn over the cells in the lungs alone, by u = -2 x there, and then those of the body alone. */
TEST(test_field_folded_counts_cells_in_lungs_and_around) {
  supine_field field = made_field();
  const float *depth = field.depth.values;
  double share[2];
  supine_warp_folded(&field, share);
  assert_true(share[0] == 0.0);
  for (int part = 0; part < 2; ++part) {
    const size_t *size = field.nodes.size;
    for (size_t i = 0; i < size[0] * size[1] * size[2]; ++i) {
      const double index[3] = {(double)(i % size[0]), (double)(i / size[0] % size[1]),
                               (double)(i / size[0] / size[1])};
      double u[3] = {0.0, 0.0, 0.0};
      for (size_t k = 0; k < 9 && (depth[i] > 0.0F) == (part == 0); ++k) {
        u[k % 3] -= 2.0 * field.nodes.step[k / 3][k % 3] * index[k / 3];
      }
      supine_image_put(&field.nodes, 3 * i, 3, u);
    }
    supine_warp_folded(&field, share);
    assert_true(share[part] > 0.5);
    assert_true(share[part] > share[1 - part]);
  }
  supine_warp_free(&field);
}

/* Stretch the body by 1.1 along each axis: tissue everywhere takes in 1.1^3 - 1 of its volume. Two
 * labels divide the lungs between them. */
TEST(test_ventilation_of_stretch_is_share_and_sums_to_lungs_and_labels) {
  supine_field field = made_field();
  const supine_image *nodes = &field.nodes;
  for (size_t i = 0; i < nodes->size[0] * nodes->size[1] * nodes->size[2]; ++i) {
    double place[3];
    supine_image_place(nodes, i, place);
    const double u[3] = {0.1 * place[0], 0.1 * place[1], 0.1 * place[2]};
    supine_image_put(&field.nodes, 3 * i, 3, u);
  }
  supine_image labels = *nodes;
  const size_t count = labels.size[0] * labels.size[1] * labels.size[2];
  labels.channels = 1;
  labels.voxel = SUPINE_VOXEL_U8;
  labels.values = malloc(count);
  assert_non_null(labels.values);
  for (size_t i = 0; i < count; ++i) {
    double place[3];
    supine_image_place(&labels, i, place);
    supine_image_put(&labels, i, 1, (double[]){place[2] > 0.0 ? 9.0 : 4.0});
  }
  supine_image made;
  supine_ventilated lungs[SUPINE_LUNGS_MAX];
  supine_ventilated parts[SUPINE_VENTILATED_MOST];
  size_t part_count;
  assert_int_equal(supine_warp_ventilation(&field, &labels, &made, lungs, NULL), SUPINE_OK);
  assert_int_equal(supine_warp_ventilated_labels(&made, &labels, parts, &part_count, NULL),
                   SUPINE_OK);
  const float *depth = field.depth.values;
  const float *values = made.values;
  for (size_t i = 0; i < count; ++i) {
    assert_true(isnan(values[i]) == !(depth[i] > 0.0F));
    assert_true(isnan(values[i]) || fabs((double)values[i] - 0.331) < 1e-4);
  }
  assert_int_equal(part_count, 2);
  assert_true(parts[0].label == 4.0 && parts[1].label == 9.0);
  double held = 0.0;
  for (size_t i = 0; i < 2; ++i) {
    assert_true(fabs(lungs[i].taken - 0.331 * lungs[i].held) < 1e-3 * lungs[i].held);
    assert_true(fabs(parts[i].taken - 0.331 * parts[i].held) < 1e-3 * parts[i].held);
    held += lungs[i].held - parts[i].held;
  }
  assert_true(lungs[0].held > 0.0 && lungs[1].held > 0.0);
  assert_true(fabs(held) < 1e-9 * lungs[0].held);
  supine_image wide = labels;
  wide.voxel = SUPINE_VOXEL_F32;
  wide.values = malloc(count * sizeof(float));
  assert_non_null(wide.values);
  for (size_t i = 0; i < count; ++i) {
    ((float *)wide.values)[i] = (float)(1 + i);
  }
  assert_int_equal(supine_warp_ventilated_labels(&made, &wide, parts, &part_count, NULL),
                   SUPINE_ERROR_ARGUMENT);
  supine_image_free(&wide);
  supine_image_free(&labels);
  supine_image_free(&made);
  supine_warp_free(&field);
}

/* At grid nodes the field equals the displacement computed by the basis. Between nodes it is
 * trilinear. Far outside the lungs it is 0. */
TEST(test_field_at_nodes_and_cells_interpolates_basis) {
  supine_field field = made_field();
  const supine_basis_info *info = supine_basis_get_info(grid);
  float *moved = malloc(3 * info->vertex_count * sizeof *moved);
  supine_displace_range(grid, POSED(grid, weights, scales), 0, info->vertex_count, moved);
  for (size_t i = 0; i < info->vertex_count; i += 97) {
    double p[3];
    double u[3];
    for (size_t k = 0; k < 3; ++k) {
      p[k] = (double)info->vertices[3 * i + k];
    }
    supine_warp_at(&field, p, u);
    for (size_t k = 0; k < 3; ++k) {
      /* The tolerance is twice the rounding of a float32 position, mm. */
      assert_close(u[k], (double)moved[3 * i + k], 2e-5);
    }
  }
  const float *values = field.nodes.values;
  assert_true(values[0] == 0.0F && values[1] == 0.0F &&
              values[2] == 0.0F); /* a corner, far outside the lungs */
  const size_t *n = field.nodes.size;
  const size_t at = n[0] / 4 + n[0] * (n[1] / 2 + n[1] * (n[2] / 2));
  double middle[3];
  double u[3];
  for (size_t k = 0; k < 3; ++k) {
    middle[k] = field.nodes.origin[k] + (double)(n[0] / 4) * field.nodes.step[0][k] +
                (double)(n[1] / 2) * field.nodes.step[1][k] +
                (double)(n[2] / 2) * field.nodes.step[2][k] + 0.25 * field.nodes.step[0][k];
  }
  supine_warp_at(&field, middle, u);
  for (size_t k = 0; k < 3; ++k) {
    assert_close(u[k], 0.75 * (double)values[3 * at + k] + 0.25 * (double)values[3 * (at + 1) + k],
                 1e-5);
  }
  free(moved);
  supine_warp_free(&field);
}

/* Return the largest displacement at the border of the grid, and at points beyond it. */
static double at_border_and_beyond(const supine_field *field) {
  const size_t *size = field->nodes.size;
  double largest = 0.0;
  for (size_t i = 0; i < size[0] * size[1] * size[2]; ++i) {
    const size_t at[3] = {i % size[0], i / size[0] % size[1], i / size[0] / size[1]};
    double way[3] = {0.0, 0.0, 0.0}; /* out of the grid, in nodes */
    for (size_t a = 0; a < 3; ++a) {
      way[a] = at[a] == 0 ? -1.0 : 0.0;
      way[a] = at[a] + 1 == size[a] ? 1.0 : way[a];
    }
    for (int nodes = 0; nodes < 60 && supine_length(way) > 0.0; nodes += 7) {
      double point[3];
      double u[3];
      supine_image_place(&field->nodes, i, point);
      for (size_t k = 0; k < 9; ++k) {
        point[k % 3] += nodes * way[k / 3] * field->nodes.step[k / 3][k % 3];
      }
      supine_warp_at(field, point, u);
      largest = fmax(largest, supine_length(u));
    }
  }
  return largest;
}

/* Fields of 60 mm on a fine and on a coarse grid, their inverses, and the field between two poses
 * are 0 at the border of the grid and beyond it, and fold nowhere outside the lungs. */
TEST(test_field_border_and_outside_zero_without_folds) {
  static const double spacings[] = {6.0, 12.0};
  static const double gains[2] = {3.0, -1.5};
  supine_basis *kept = grid;
  for (size_t i = 0; i < sizeof spacings / sizeof *spacings; ++i) {
    supine_field field;
    supine_field inverse;
    supine_field between;
    supine_warp_residual residual;
    double folded[2];
    make_grid(spacings[i]);
    grid = helper_open(in_folder("grid"));
    assert_int_equal(supine_warp_create(grid, POSED(grid, weights, gains), NULL, &field, NULL),
                     SUPINE_OK);
    assert_int_equal(supine_warp_invert(&field, &inverse, &residual, NULL), SUPINE_OK);
    assert_int_equal(supine_warp_between(grid, POSED(grid, weights, scales),
                                         POSED(grid, weights, gains), NULL, &between, NULL),
                     SUPINE_OK);
    double largest = 0.0;
    const float *u = field.nodes.values;
    for (size_t n = 0; n < field.nodes.size[0] * field.nodes.size[1] * field.nodes.size[2]; ++n) {
      const double by[3] = {(double)u[3 * n], (double)u[3 * n + 1], (double)u[3 * n + 2]};
      largest = fmax(largest, supine_length(by));
    }
    supine_warp_folded(&field, folded);
    print_message("%g mm: %.1f mm at most, at the border %.3f, %.3f and %.3f mm, folds %g\n",
                  spacings[i], largest, at_border_and_beyond(&field),
                  at_border_and_beyond(&inverse), at_border_and_beyond(&between), folded[1]);
    assert_true(largest > 40.0);
    assert_true(at_border_and_beyond(&field) == 0.0);
    assert_true(at_border_and_beyond(&inverse) == 0.0);
    assert_true(at_border_and_beyond(&between) == 0.0);
    assert_true(folded[1] == 0.0);
    supine_warp_free(&field);
    supine_warp_free(&inverse);
    supine_warp_free(&between);
    supine_basis_close(grid);
  }
  grid = kept;
}

/* The displacements of a field are relative to the scan: they are 0 in the state of the scan. In
 * another state they equal those of a point that was embedded in the lungs. */
TEST(test_field_scan_below_full_measured_from_scan) {
  supine_inside_shells below;
  supine_inside_report report;
  supine_inside_content points = {.count = 1, .part_count = 1};
  const supine_inside_options options = {0};
  supine_field field;
  supine_error error;
  supine_basis *surface_kept = surface;
  supine_basis *grid_kept = grid;
  helper_write_scanned_basis(in_folder("scanned"), 10, 2, "0.6,0.8,0", "-900");
  surface = helper_open(in_folder("scanned"));
  make_grid(8.0);
  grid = helper_open(in_folder("grid"));
  if (supine_inside_shells_create(surface, &below, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  assert_int_equal(supine_warp_create(grid, &below.scan, NULL, &field, &error), SUPINE_OK);
  const size_t count = field.nodes.size[0] * field.nodes.size[1] * field.nodes.size[2];
  for (size_t i = 0; i < 3 * count; ++i) {
    assert_true(fabs((double)((const float *)field.nodes.values)[i]) < 1e-4);
  }
  supine_warp_free(&field);
  /* Compare the field at a grid node in the lungs with the motion of a point embedded there. */
  assert_int_equal(supine_warp_create(grid, POSED(grid, weights, scales), NULL, &field, &error),
                   SUPINE_OK);
  size_t node = count / 2;
  while (!(((const float *)field.depth.values)[node] > 0.0F)) {
    ++node;
  }
  double place[3];
  for (int k = 0; k < 3; ++k) {
    const size_t *n = field.nodes.size;
    place[k] = field.nodes.origin[k] + (double)(node % n[0]) * field.nodes.step[0][k] +
               (double)(node / n[0] % n[1]) * field.nodes.step[1][k] +
               (double)(node / n[0] / n[1]) * field.nodes.step[2][k];
  }
  uint32_t part = 0;
  char names[] = "node";
  points.points = place;
  points.part = &part;
  points.names = names;
  assert_int_equal(
      supine_inside_embed(&below, &points, &options, in_folder("point"), &report, &error),
      SUPINE_OK);
  supine_basis *point = helper_open(in_folder("point"));
  float xyz[3];
  supine_deform(point, POSED(point, weights, scales), xyz);
  for (size_t k = 0; k < 3; ++k) {
    assert_close((double)xyz[k] - place[k],
                 (double)((const float *)field.nodes.values)[3 * node + k], 1e-4);
  }
  supine_basis_close(point);
  supine_warp_free(&field);
  supine_inside_shells_free(&below);
  supine_basis_close(surface);
  supine_basis_close(grid);
  surface = surface_kept;
  grid = grid_kept;
}

TEST(test_field_invert_residual_within_a_tenth_of_a_mm) {
  supine_field field = made_field();
  supine_field inverse;
  supine_warp_residual residual;
  assert_int_equal(supine_warp_invert(&field, &inverse, &residual, NULL), SUPINE_OK);
  print_message("a point moved forth and back misses its start by %.4f mm RMS, %.4f mm at most\n",
                residual.rms, residual.largest);
  assert_true(residual.largest <= 0.1);
  assert_true(residual.rms > 0.0 && residual.rms < residual.largest);
  /* Between grid nodes, moving a point by the field and then by its inverse may miss the start
   * by 1.5 times the largest residual at a node. */
  const supine_basis_info *info = supine_basis_get_info(surface);
  uint64_t seed = 3;
  double largest = 0.0;
  for (int i = 0; i < 4000; ++i) {
    const double share = 0.9 * helper_random(&seed);
    const size_t vertex = (size_t)(helper_random(&seed) * (double)info->vertex_count);
    const double centre[3] = {vertex < info->lung_begin[1] ? 71.3 : -72.9, 3.1, -40.7};
    double x[3];
    double y[3];
    double u[3];
    double v[3];
    for (size_t k = 0; k < 3; ++k) {
      x[k] = centre[k] + share * ((double)info->vertices[3 * vertex + k] - centre[k]);
    }
    supine_warp_at(&field, x, u);
    for (int k = 0; k < 3; ++k) {
      y[k] = x[k] + u[k];
    }
    supine_warp_at(&inverse, y, v);
    for (int k = 0; k < 3; ++k) {
      v[k] += u[k];
    }
    largest = fmax(largest, size_of(v));
  }
  assert_true(largest <= 1.5 * residual.largest);
  supine_warp_free(&field);
  supine_warp_free(&inverse);
}

enum { LANDMARKS = 5 };
/* Positions in the left lung, mm. */
static const double landmarks[LANDMARKS][3] = {{71.0, 3.0, -40.0},
                                               {90.0, 20.0, 10.0},
                                               {60.0, -30.0, -90.0},
                                               {95.0, 25.0, -70.0},
                                               {50.0, 5.0, 30.0}};

/* Make an image of 2 mm voxels over the left lung, with a ball of radius 9 mm at each landmark. */
static supine_image ball_image(supine_image_voxel voxel) {
  supine_image image = {.size = {100, 110, 160},
                        .origin = {-28.0, -106.0, -210.0},
                        .step = {{2, 0, 0}, {0, 2, 0}, {0, 0, 2}},
                        .voxel = voxel,
                        .channels = 1};
  image.values =
      calloc(image.size[0] * image.size[1] * image.size[2], supine_image_voxel_size(voxel));
  for (size_t i = 0; i < image.size[0] * image.size[1] * image.size[2]; ++i) {
    const double p[3] = {image.origin[0] + 2.0 * (double)(i % 100),
                         image.origin[1] + 2.0 * (double)(i / 100 % 110),
                         image.origin[2] + 2.0 * (double)(i / 11000)};
    for (int l = 0; l < LANDMARKS; ++l) {
      const double d[3] = {p[0] - landmarks[l][0], p[1] - landmarks[l][1], p[2] - landmarks[l][2]};
      if (supine_dot(d, d) < 81.0) {
        supine_image_put(&image, i, 1, &(double){voxel == SUPINE_VOXEL_U8 ? l + 1.0 : 1000.0});
      }
    }
  }
  return image;
}

/* Compute the centroid c of the voxels within 14 mm of the position `about`. If `label` is above 0,
 * use only voxels with that label. Otherwise weight the voxels by their brightness. */
static void centroid(const supine_image *image, const double about[3], int label, double c[3]) {
  double sum = 0.0;
  c[0] = c[1] = c[2] = 0.0;
  for (size_t i = 0; i < image->size[0] * image->size[1] * image->size[2]; ++i) {
    double p[3];
    double d[3];
    for (size_t k = 0; k < 3; ++k) {
      p[k] = image->origin[k] + (double)(i % image->size[0]) * image->step[0][k] +
             (double)(i / image->size[0] % image->size[1]) * image->step[1][k] +
             (double)(i / image->size[0] / image->size[1]) * image->step[2][k];
      d[k] = p[k] - about[k];
    }
    const double value = supine_image_get(image, i);
    const double weight = label > 0 ? (value == (double)label) : value;
    if (supine_dot(d, d) < 196.0 && weight > 0.0) {
      sum += weight;
      for (int k = 0; k < 3; ++k) {
        c[k] += weight * p[k];
      }
    }
  }
  assert_true(sum > 0.0);
  for (int k = 0; k < 3; ++k) {
    c[k] /= sum;
  }
}

/* Embed the landmarks as points, and compute their positions in the deformed lungs. */
static void moved_landmarks(double out[LANDMARKS][3]) {
  static bool known;
  static double kept[LANDMARKS][3];
  if (known) {
    memcpy(out, kept, sizeof kept);
    return;
  }
  supine_inside_shells shells;
  supine_inside_report report;
  const supine_inside_options options = {0};
  uint32_t part[LANDMARKS] = {0, 1, 2, 3, 4};
  char names[] = "a\nb\nc\nd\ne";
  double points[3 * LANDMARKS];
  memcpy(points, landmarks, sizeof points);
  const supine_inside_content content = {
      .count = LANDMARKS, .points = points, .part = part, .part_count = LANDMARKS, .names = names};
  assert_int_equal(supine_inside_shells_create(surface, &shells, NULL), SUPINE_OK);
  assert_int_equal(
      supine_inside_embed(&shells, &content, &options, in_folder("points"), &report, NULL),
      SUPINE_OK);
  assert_int_equal(report.outside, 0);
  assert_int_equal(report.in_lung[0], LANDMARKS);
  supine_basis *inside = helper_open(in_folder("points"));
  float xyz[3 * LANDMARKS];
  supine_deform(inside, POSED(inside, weights, scales), xyz);
  for (int i = 0; i < 3 * LANDMARKS; ++i) {
    out[i / 3][i % 3] = kept[i / 3][i % 3] = (double)xyz[i];
  }
  known = true;
  supine_basis_close(inside);
  supine_inside_shells_free(&shells);
}

/* Assert that each landmark in a warped image is within 2 mm (a voxel) of the same landmark
 * embedded in the basis as a point and moved with it. */
static void check_landmarks(const supine_image *image, bool labels) {
  double moved[LANDMARKS][3];
  double largest = 0.0;
  moved_landmarks(moved);
  for (int l = 0; l < LANDMARKS; ++l) {
    double c[3];
    double way[3];
    centroid(image, moved[l], labels ? l + 1 : 0, c);
    for (int k = 0; k < 3; ++k) {
      way[k] = moved[l][k] - landmarks[l][k];
      c[k] -= moved[l][k];
    }
    assert_true(size_of(way) > 4.0); /* every landmark must move, or the test would prove nothing */
    largest = fmax(largest, size_of(c));
  }
  print_message("landmarks in the warped image are at most %.2f mm from the embedded points\n",
                largest);
  assert_true(largest < 2.0);
}

TEST(test_resample_landmarks_follow_embedded_points) {
  for (int labels = 0; labels < 2; ++labels) {
    supine_image image = ball_image(labels ? SUPINE_VOXEL_U8 : SUPINE_VOXEL_I16);
    supine_image moved = {0};
    assert_int_equal(supine_warp_resample(made_inverse(), NULL, labels != 0, &image, &moved, NULL),
                     SUPINE_OK);
    for (size_t i = 0; i < image.size[0] * image.size[1] * image.size[2] && labels; ++i) {
      assert_true(supine_image_get(&moved, i) <= LANDMARKS);
    }
    check_landmarks(&moved, labels != 0);
    supine_image_free(&image);
    supine_image_free(&moved);
  }
}

/* Return the depth of voxel i of the image below the surface of the lungs, mm. */
static double depth_at(const supine_field *field, const supine_image *image, size_t i) {
  double p[3];
  double depth;
  supine_warp_cell cell;
  supine_image_place(image, i, p);
  supine_warp_find_cell(&field->depth, p, &cell);
  supine_warp_interpolate(&field->depth, &cell, &depth, NULL);
  return depth;
}

/* Return the mass, g, of the voxels of a CT image at which the mask has this label. */
static double mass_of(const supine_image *image, const supine_image *mask, double label) {
  double sum = 0.0;
  for (size_t i = 0; i < image->size[0] * image->size[1] * image->size[2]; ++i) {
    sum += supine_image_get(mask, i) == label ? supine_image_get(image, i) + 1000.0 : 0.0;
  }
  return 1e-6 * sum * pow(image->step[0][0], 3.0);
}

/* Move a CT of lungs of about -850 to -550 HU, in air or in a chest wall of 40 HU. Their border is
 * up to 2 mm beside the surface in the basis. If densities are scaled by the change of volume, the
 * mass within the moved mask of a lung changes by less than 1 %, and no voxel in it exceeds the
 * densest lung voxel, scaled. If not, the mass of a lung in air changes by more than 5 %. */
TEST(test_resample_scaled_density_keeps_mass) {
  supine_field field;
  supine_field inverse;
  supine_warp_residual residual;
  const double larger[2] = {-1.4, 1.2}; /* one lung inflates, the other deflates */
  assert_int_equal(supine_warp_create(grid, POSED(grid, weights, larger), NULL, &field, NULL),
                   SUPINE_OK);
  assert_int_equal(supine_warp_invert(&field, &inverse, &residual, NULL), SUPINE_OK);
  for (int lung = 0; lung < 2; ++lung) {
    for (int wall = 0; wall < 2; ++wall) {
      supine_image image = field.depth;
      supine_image mask = field.depth;
      for (size_t a = 0; a < 3; ++a) { /* 2.5 mm voxels, not centred on grid nodes */
        image.size[a] = (size_t)((double)field.depth.size[a] * 4.0 / 2.5) - 2;
        image.step[a][a] = 2.5;
        image.origin[a] += 1.1;
      }
      const size_t count = image.size[0] * image.size[1] * image.size[2];
      image.voxel = SUPINE_VOXEL_I16;
      image.values = malloc(2 * count);
      mask = image;
      mask.voxel = SUPINE_VOXEL_U8;
      mask.values = malloc(count);
      double densest = 0.0;
      for (size_t i = 0; i < count; ++i) {
        double p[3];
        supine_image_place(&image, i, p);
        const bool inside = depth_at(&field, &image, i) > 2.0 * sin(p[2] / 7.0 + p[0] / 9.0);
        const double value = inside ? -700.0 + 1.5 * p[1] + 40.0 * sin(p[2] / 11.0) : 40.0 * wall;
        supine_image_put(&image, i, 1, &(double){inside || wall ? value : -1000.0});
        densest = inside ? fmax(densest, value + 1000.0) : densest;
        supine_image_put(&mask, i, 1, &(double){inside ? (p[0] > 0.0 ? 1.0 : 2.0) : 0.0});
      }
      const double before = mass_of(&image, &mask, lung + 1.0);
      supine_image scaled;
      supine_image plain;
      supine_image moved;
      supine_error error;
      supine_tissue tissue = {.lungs = 0};
      if (supine_warp_tissue_find(&field, &image, &tissue, &error) != SUPINE_OK ||
          supine_warp_resample(&inverse, &tissue, false, &image, &scaled, &error) != SUPINE_OK ||
          supine_warp_resample(&inverse, NULL, false, &image, &plain, &error) != SUPINE_OK ||
          supine_warp_resample(&inverse, NULL, true, &mask, &moved, &error) != SUPINE_OK) {
        fail_msg("%s", error.message);
      }
      for (size_t i = 0; i < count; ++i) {
        supine_image_put(&image, i, 1, &(double){-850.0});
      }
      supine_image uniform;
      supine_warp_tissue_free(&tissue);
      assert_int_equal(supine_warp_tissue_find(&field, &image, &tissue, NULL), SUPINE_OK);
      assert_int_equal(supine_warp_resample(&inverse, &tissue, false, &image, &uniform, NULL),
                       SUPINE_OK);
      supine_warp_tissue_free(&tissue);
      for (size_t i = 0; i < count; ++i) { /* 0.5: both are rounded to whole HU */
        const double scale = (supine_image_get(&uniform, i) + 1000.5) / 150.0;
        assert_true(supine_image_get(&moved, i) == 0.0 ||
                    supine_image_get(&scaled, i) + 999.5 <= densest * scale);
      }
      const double after = mass_of(&scaled, &moved, lung + 1.0) / before - 1.0;
      const double unscaled = mass_of(&plain, &moved, lung + 1.0) / before - 1.0;
      print_message("%s lung, %s: %.0f g; change of mass %+.2f %% with scaled density, %+.1f %% "
                    "without scaling\n",
                    lung ? "right" : "left", wall ? "in the chest wall" : "in air", before,
                    100.0 * after, 100.0 * unscaled);
      assert_true(fabs(after) < 0.01);
      assert_true(wall || fabs(unscaled) > 0.05);
      size_t changed = 0;
      /* Outside the mask, only voxels at its edge may change. */
      for (size_t i = 0; i < count && wall; ++i) {
        changed += supine_image_get(&moved, i) == 0.0 && supine_image_get(&scaled, i) != 40.0;
      }
      assert_true(changed < count / 1000);
      supine_image_free(&image);
      supine_image_free(&mask);
      supine_image_free(&scaled);
      supine_image_free(&uniform);
      supine_image_free(&plain);
      supine_image_free(&moved);
    }
  }
  supine_warp_free(&field);
  supine_warp_free(&inverse);
}

/* Run `command`, which warps balls.nrrd by the field v.nrrd to warped.nrrd with another program,
 * and check the result. If the command `probe` fails, skip the test. */
static void check_warped_by(const char *probe, const char *command) {
  char text[512];
  (void)snprintf(text, sizeof text, "%s >/dev/null 2>&1", probe);
  if (system(text) != 0) { /* NOLINT(cert-env33-c) */
    print_message("skipped: the command '%s' fails\n", probe);
    skip();
  }
  supine_image image = ball_image(SUPINE_VOXEL_I16);
  supine_error error;
  if (supine_image_write(in_folder("v.nrrd"), &made_inverse()->nodes, "inverse", &error) !=
          SUPINE_OK ||
      supine_image_write(in_folder("balls.nrrd"), &image, NULL, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  (void)unlink(in_folder("warped.nrrd"));
  assert_int_equal(setenv("FOLDER", folder, 1), 0);
  (void)snprintf(text, sizeof text, "cd \"$FOLDER\" && %s", command);
  assert_int_equal(system(text), 0); /* NOLINT(cert-env33-c) */
  supine_image_free(&image);
  if (supine_image_read(in_folder("warped.nrrd"), &image, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  check_landmarks(&image, false);
  supine_image_free(&image);
}

TEST_FULL(test_plastimatch_inverse_field_warps_landmarks) {
  check_warped_by("plastimatch --version",
                  "plastimatch warp --input balls.nrrd --fixed balls.nrrd --xf v.nrrd "
                  "--output-img warped.nrrd --output-type short >plastimatch.log 2>&1");
}

/* transformix, a program of elastix, takes the inverse field as a transform. */
TEST_FULL(test_elastix_inverse_field_warps_landmarks) {
  FILE *file = fopen(in_folder("field.txt"), "wb");
  assert_non_null(file);
  (void)fputs("(Transform \"DeformationFieldTransform\")\n(NumberOfParameters 0)\n"
              "(InitialTransformParametersFileName \"NoInitialTransform\")\n"
              "(HowToCombineTransforms \"Compose\")\n"
              "(DeformationFieldFileName \"v.nrrd\")\n(DeformationFieldInterpolationOrder 1)\n"
              "(FixedImageDimension 3)\n(MovingImageDimension 3)\n"
              "(FixedInternalImagePixelType \"float\")\n(MovingInternalImagePixelType \"float\")\n"
              "(Size 100 110 160)\n(Index 0 0 0)\n(Spacing 2 2 2)\n(Origin -28 -106 -210)\n"
              "(Direction 1 0 0 0 1 0 0 0 1)\n(UseDirectionCosines \"true\")\n"
              "(ResampleInterpolator "
              "\"FinalBSplineInterpolator\")\n(FinalBSplineInterpolationOrder 1)\n(Resampler "
              "\"DefaultResampler\")\n(DefaultPixelValue 0)\n(ResultImageFormat \"nrrd\")\n"
              "(ResultImagePixelType \"short\")\n(CompressResultImage \"false\")\n",
              file);
  assert_int_equal(fclose(file), 0);
  check_warped_by("transformix --version",
                  "transformix -in balls.nrrd -tp field.txt -out . >elastix.log 2>&1 && "
                  "mv result.nrrd warped.nrrd");
}

TEST(test_resample_displacement_0_voxels_copied_exactly) {
  enum { COUNT = 150 * 9 * 8 };
  float u[3 * 27 * 9 * 8] = {0.0F};
  const supine_field field = {.nodes = {.size = {27, 9, 8},
                                        .origin = {-11.3, 4.7, 90.1},
                                        .step = {{4.3, 0, 0}, {0, 0.7, 0}, {0, 0, 0.9}},
                                        .voxel = SUPINE_VOXEL_F32,
                                        .channels = 3,
                                        .values = u}};
  supine_image image = field.nodes;
  supine_image moved;
  image.size[0] = 150;
  image.step[0][0] = 0.75;
  image.channels = 1;
  for (int voxel = 0; voxel < SUPINE_VOXEL_COUNT; ++voxel) {
    image.voxel = (supine_image_voxel)voxel;
    image.values = calloc(COUNT, sizeof(double));
    for (size_t i = 0; i < COUNT; ++i) {
      supine_image_put(&image, i, 1, &(double){60.0 + 59.0 * sin((double)i)});
    }
    assert_int_equal(supine_warp_resample(&field, NULL, false, &image, &moved, NULL), SUPINE_OK);
    assert_memory_equal(moved.values, image.values, COUNT * supine_image_voxel_size(image.voxel));
    supine_image_free(&moved);
    free(image.values);
  }
}

TEST(test_field_create_without_grid_refused) {
  supine_field field;
  supine_error error;
  assert_int_equal(
      supine_warp_create(surface, POSED(surface, weights, scales), NULL, &field, &error),
      SUPINE_ERROR_FORMAT);
  assert_says(error.message, "holds no grid");
  assert_says(error.message, "embed an image, or a grid");
}

/* Check that the basis in the file `name` is refused: when it is opened if its grid has a number
 * that is not finite, or else when a field is made. */
static void check_malformed(const char *name, bool finite) {
  supine_basis *bad = NULL;
  supine_field field;
  supine_error error;
  const supine_status opened = supine_basis_open(in_folder(name), &bad, &error);
  if (finite) {
    assert_int_equal(opened, SUPINE_OK);
    assert_int_equal(supine_warp_create(bad, POSED(bad, weights, scales), NULL, &field, &error),
                     SUPINE_ERROR_FORMAT);
    assert_says(error.message, "the grid in the basis is malformed");
  } else {
    assert_int_equal(opened, SUPINE_ERROR_FORMAT);
    assert_says(error.message, "tensor 'grid' has a number that is not finite");
  }
  supine_basis_close(bad);
}

/* A grid is refused if any of its tensors is invalid. */
TEST(test_field_malformed_grids_refused) {
  const supine_basis_info *info = supine_basis_get_info(grid);
  const size_t n = info->vertex_count;
  uint32_t *part = malloc(n * sizeof *part);
  for (int lie = 0; lie < 5; ++lie) {
    double frame[12];
    uint32_t size[3];
    memcpy(frame, supine_basis_tensor(grid, "grid")->data, sizeof frame);
    memcpy(size, supine_basis_tensor(grid, "grid_size")->data, sizeof size);
    memcpy(part, supine_basis_tensor(grid, "part")->data, n * sizeof *part);
    frame[4] = lie == 0 ? NAN : frame[4];
    part[n / 2] = lie == 1 ? 3999999999U : part[n / 2];
    size[2] = lie == 2 ? 4000000000U : lie == 3 ? 1 : size[2];
    if (lie == 4) {
      memcpy(frame + 6, frame + 3, 3 * sizeof *frame);
    }
    const supine_tensor tensors[] = {
        *supine_basis_tensor(grid, "vertices"), *supine_basis_tensor(grid, "triangles"),
        *supine_basis_tensor(grid, "lung"),     *supine_basis_tensor(grid, "coefficients"),
        *supine_basis_tensor(grid, "modes"),    *supine_basis_tensor(grid, "depth"),
        {"part", SUPINE_U32, 1, {n}, part},     {"grid", SUPINE_F64, 2, {4, 3}, frame},
        {"grid_size", SUPINE_U32, 1, {3}, size}};
    const supine_metadata metadata[] = {
        {"format", "supine-basis"}, {"version", "4"}, {"kind", "vector"}};
    assert_int_equal(supine_safetensors_write(in_folder("lie"), tensors, 9, metadata, 3, NULL),
                     SUPINE_OK);
    check_malformed("lie", lie != 0);
  }
  free(part);
}

TEST_GROUP(setup, teardown)
