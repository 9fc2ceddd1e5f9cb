/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test surfaces made from label maps: accuracy, meanings of labels, reports, refused maps. */
#include "mesh/labels/labels.h"
#include "mesh/labels/mask.h"
#include "precompute/lungs/phantom.h"
#include "precompute/lungs/surface.h"
#include "tests/helpers/folder.h"

#include "tests/helpers/labels_helpers.h"
#include "tests/helpers/sh_helpers.h"

static size_t voxels(const supine_image *image) {
  return image->size[0] * image->size[1] * image->size[2];
}

static size_t count_label(const supine_image *image, uint8_t label) {
  size_t count = 0;
  for (size_t i = 0; i < voxels(image); ++i) {
    count += ((const uint8_t *)image->values)[i] == label;
  }
  return count;
}

typedef struct made {
  supine_mesh surface[2];
  supine_labels_report report;
} made;

static made surfaces_of(const char *const *paths, size_t count,
                        const supine_labels_options *options) {
  made out = {0};
  supine_error error;
  if (supine_labels_surfaces(paths, count, options, out.surface, &out.report, &error) !=
      SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return out;
}

/* Write the image to a file, and make surfaces of the lungs from this file. */
static made surfaces_of_image(const supine_image *image, const char *name,
                              const supine_labels_options *options) {
  const char *path = in_folder(name);
  supine_error error;
  if (supine_image_write(path, image, NULL, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  return surfaces_of(&path, 1, options);
}

static void release(made *out) {
  supine_mesh_free(&out->surface[0]);
  supine_mesh_free(&out->surface[1]);
}

static void check_same(const made *a, const made *b) {
  assert_int_equal(a->report.lung_count, b->report.lung_count);
  for (size_t lung = 0; lung < a->report.lung_count; ++lung) {
    const supine_mesh *p = &a->surface[lung];
    const supine_mesh *q = &b->surface[lung];
    assert_int_equal(p->vertex_count, q->vertex_count);
    assert_int_equal(p->triangle_count, q->triangle_count);
    assert_memory_equal(p->vertices, q->vertices, 3 * p->vertex_count * sizeof(double));
    assert_memory_equal(p->triangles, q->triangles, 3 * p->triangle_count * sizeof(uint32_t));
  }
}

static void check_closed(const supine_mesh *mesh) {
  supine_topology topology = {0};
  assert_int_equal(supine_mesh_topology_create(mesh, &topology), SUPINE_OK);
  assert_true(topology.closed);
  assert_int_equal(topology.component_count, 1);
  assert_true(topology.genus >= 0);
  supine_mesh_topology_free(&topology);
  assert_true(supine_mesh_volume(mesh) > 0.0);
}

/* Return the RMS distance, mm, of vertices of the left and the right lung's surface in `out` from
 * the true surface. */
static double rms_from(const supine_lungs_surface *truth, const made *out) {
  enum { EVERY = 29 };
  double sum = 0.0;
  double count = 0.0;
  for (size_t lung = 0; lung < 2; ++lung) {
    supine_inside_place place = {.depth = 0.0};
    for (size_t i = 0; i < out->surface[lung].vertex_count; i += EVERY) {
      place = supine_lungs_surface_find(truth, out->surface[lung].vertices + 3 * i, NULL);
      sum += place.depth * place.depth;
      count += 1.0;
    }
  }
  return sqrt(sum / count);
}

/* Surfaces made from voxels of 1, 2 and 3 mm have the volume of the lungs within 0.5, 1 and 2 %,
 * enclose the volume of the voxels, and are within half a voxel (RMS) of the true surface. */
TEST(test_labels_phantom_volume_and_surface_recovered) {
  supine_mesh phantom = {0};
  supine_lungs_surface *truth = NULL;
  assert_int_equal(supine_lungs_phantom_create(20000, 6000.0, &phantom, NULL), SUPINE_OK);
  assert_int_equal(supine_lungs_surface_create(phantom.vertices, phantom.triangle_count,
                                               phantom.triangles, true, &truth, NULL),
                   SUPINE_OK);
  const size_t half = phantom.triangle_count / 2; /* the triangles of the left lung come first */
  const double share[] = {0.005, 0.01, 0.02};
  for (int h = 1; h <= 3; ++h) {
    const double spacing[3] = {h, h, h};
    const supine_labels_options options = {.labels = NULL};
    supine_image image = helper_image_over(&phantom, spacing);
    helper_voxelise(&phantom, 0, half, 2, &image);
    helper_voxelise(&phantom, half, phantom.triangle_count, 1, &image);
    made out = surfaces_of_image(&image, "phantom.nii.gz", &options);
    assert_int_equal(out.report.lung_count, 2);
    assert_int_equal(out.report.lung[0].side, 1);
    const supine_mesh_anatomy anatomy = supine_mesh_anatomy_find(out.surface, 2);
    assert_int_equal(anatomy.axes, SUPINE_AXES_LPS);
    assert_true(anatomy.certain);
    for (size_t lung = 0; lung < 2; ++lung) {
      const supine_mesh part = {phantom.vertex_count, phantom.vertices, half,
                                phantom.triangles + (lung == 0 ? 0 : 3 * half)};
      const double wanted = 1e-3 * supine_mesh_volume(&part);
      const supine_labels_lung *is = &out.report.lung[lung];
      check_closed(&out.surface[lung]);
      assert_true(fabs(is->surface - wanted) < share[h - 1] * wanted);
      assert_true(fabs(is->surface - 1e-3 * supine_mesh_volume(&out.surface[lung])) <
                  1e-9 * wanted);
      assert_true(fabs(is->surface - is->mask) < 1e-9 * wanted);
      assert_int_equal(is->tunnels, 0);
      assert_true(is->cut == 0.0);
    }
    const double rms = rms_from(truth, &out);
    printf("voxels of %d mm: surfaces err by %.3f mm RMS; volume of surface minus volume of mask: "
           "left %+.2f mL, right %+.2f mL\n",
           h, rms, out.report.lung[0].surface - out.report.lung[0].mask,
           out.report.lung[1].surface - out.report.lung[1].mask);
    assert_true(rms < 0.5 * h);
    release(&out);
    supine_image_free(&image);
  }
  supine_lungs_surface_destroy(truth);
  supine_mesh_free(&phantom);
}

/* Return a copy of a label map. Relabel the left lung, 2, as left[0] in the lower half and left[1]
 * in the upper, and the right lung, 1, as right[0] to right[2] in thirds from bottom to top. */
static supine_image relabelled(const supine_image *from, const uint8_t left[2],
                               const uint8_t right[3]) {
  supine_image image = *from;
  uint8_t *at = malloc(voxels(from));
  image.values = at;
  for (size_t i = 0; i < voxels(from); ++i) {
    const uint8_t was = ((const uint8_t *)from->values)[i];
    const size_t k = i / from->size[0] / from->size[1];
    const size_t two = k * 2 / from->size[2];
    const size_t three = k * 3 / from->size[2];
    at[i] = was == 0 ? 0 : was == 2 ? left[two] : right[three];
  }
  return image;
}

TEST(test_labels_any_convention_same_lungs) {
  static const struct {
    uint8_t left[2], right[3];
    const char *options[3]; /* values of --labels to try; a first NULL stands for no --labels */
    const char *said;
  } maps[] = {
      {{2, 2}, {1, 1, 1}, {NULL, "lungmask", "left=2,right=1"}, "2 left; 1 right"},
      {{1, 1}, {2, 2, 2}, {NULL, "left=1,right=2", NULL}, "1 left; 2 right (by their sides)"},
      {{7, 7}, {9, 9, 9}, {NULL, "right=9,left=7", NULL}, "7 left; 9 right"},
      {{2, 1}, {5, 4, 3}, {NULL, "lobes", NULL}, "1, 2 left; 3, 4, 5 right (convention lobes)"},
      {{11, 10}, {14, 13, 12}, {NULL, "totalsegmentator", NULL}, "10, 11 left; 12, 13, 14 right"},
      {{14, 13}, {17, 16, 15}, {NULL, "totalsegmentator-v1", NULL}, "13, 14 left"},
      {{1, 1}, {1, 1, 1}, {NULL, "one", NULL}, "1 both lungs"},
      {{6, 3}, {1, 2, 5}, {"one", "left=3+6,right=1+2+5", NULL}, "both lungs"},
  };
  supine_image image = helper_two_lungs(4.0);
  const supine_labels_options plain = {.edge = 5.0};
  made wanted = surfaces_of_image(&image, "wanted.nrrd", &plain);
  assert_int_equal(wanted.report.lung_count, 2);
  for (size_t m = 0; m < sizeof maps / sizeof *maps; ++m) {
    supine_image map = relabelled(&image, maps[m].left, maps[m].right);
    for (size_t o = 0; o < 3 && (o == 0 || maps[m].options[o] != NULL); ++o) {
      const supine_labels_options options = {.labels = maps[m].options[o], .edge = 5.0};
      made out = surfaces_of_image(&map, "map.nrrd", &options);
      check_same(&out, &wanted);
      if (o == 0) {
        assert_says(out.report.taken, maps[m].said);
      }
      release(&out);
    }
    supine_image_free(&map);
  }
  release(&wanted);
  supine_image_free(&image);
}

/* One map of all lobes, one file for each lobe, and a map that also has other organs give the same
 * lungs. */
TEST(test_labels_other_organs_ignored_and_files_of_lobes_joined) {
  static const uint8_t left[2] = {11, 10};
  static const uint8_t right[3] = {14, 13, 12};
  supine_image image = helper_two_lungs(4.0);
  supine_image map = relabelled(&image, left, right);
  const supine_labels_options plain = {.edge = 5.0};
  const supine_labels_options named = {.labels = "totalsegmentator", .edge = 5.0};
  made wanted = surfaces_of_image(&map, "wanted.nrrd", &plain);
  const char *paths[5];
  for (uint8_t lobe = 0; lobe < 5; ++lobe) {
    char name[32];
    supine_image mask = map;
    uint8_t *at = malloc(voxels(&map));
    for (size_t i = 0; i < voxels(&map); ++i) {
      at[i] = ((const uint8_t *)map.values)[i] == 10 + lobe;
    }
    mask.values = at;
    (void)snprintf(name, sizeof name, "lobe%u.nrrd", lobe);
    paths[lobe] = in_folder(name);
    assert_int_equal(supine_image_write(paths[lobe], &mask, NULL, NULL), SUPINE_OK);
    supine_image_free(&mask);
  }
  made out = surfaces_of(paths, 5, &plain);
  check_same(&out, &wanted);
  release(&out);
  ((uint8_t *)map.values)[0] = 51;
  ((uint8_t *)map.values)[1] = 5;
  out = surfaces_of_image(&map, "organs.nrrd", &named);
  check_same(&out, &wanted);
  release(&out);
  image.size[0] -= 1;
  assert_int_equal(supine_image_write(paths[4], &image, NULL, NULL), SUPINE_OK);
  supine_error error;
  assert_int_equal(supine_labels_surfaces(paths, 5, &plain, out.surface, &out.report, &error),
                   SUPINE_ERROR_FORMAT);
  assert_says(error.message, "lobe4.nrrd");
  image.size[0] += 1;
  release(&wanted);
  supine_image_free(&map);
  supine_image_free(&image);
}

/* If --labels names the label of one lung only, the result is this lung alone. */
TEST(test_labels_one_lung_of_given_side_accepted) {
  supine_image image = helper_two_lungs(4.0);
  const supine_labels_options left = {.labels = "left=2", .edge = 5.0};
  const supine_labels_options both = {.edge = 5.0};
  made wanted = surfaces_of_image(&image, "both.nrrd", &both);
  made out = surfaces_of_image(&image, "one.nrrd", &left);
  assert_int_equal(out.report.lung_count, 1);
  assert_int_equal(out.report.lung[0].side, 1);
  assert_string_equal(out.report.taken, "2 left");
  wanted.report.lung_count = 1;
  check_same(&out, &wanted);
  release(&out);
  release(&wanted);
  supine_image_free(&image);
}

static void box_set(supine_image *image, const size_t low[3], const size_t high[3], uint8_t value) {
  for (size_t k = low[2]; k < high[2]; ++k) {
    for (size_t j = low[1]; j < high[1]; ++j) {
      for (size_t i = low[0]; i < high[0]; ++i) {
        ((uint8_t *)image->values)[i + image->size[0] * (j + image->size[1] * k)] = value;
      }
    }
  }
}

TEST(test_labels_touching_lungs_separated) {
  supine_image image = helper_two_lungs(4.0);
  const size_t left = count_label(&image, 2);
  const size_t right = count_label(&image, 1);
  for (size_t i = 0; i < voxels(&image); ++i) {
    ((uint8_t *)image.values)[i] = ((uint8_t *)image.values)[i] != 0;
  }
  /* Join the lungs by a bridge of voxels across the midline, 9 x 5 x 4 voxels along x, y and z. */
  const size_t low[3] = {image.size[0] / 2 - 5, image.size[1] / 2 - 2, image.size[2] / 2 - 2};
  const size_t high[3] = {image.size[0] / 2 + 4, image.size[1] / 2 + 3, image.size[2] / 2 + 2};
  box_set(&image, low, high, 1);
  const double added = (double)(count_label(&image, 1) - left - right) * 0.064;
  const supine_labels_options options = {.edge = 4.0};
  made out = surfaces_of_image(&image, "touch.nrrd", &options);
  assert_int_equal(out.report.lung_count, 2);
  assert_true(out.report.neck >= 16.0 && out.report.neck <= 24.0);
  /* The bridge that joins the lungs is divided between them. No other voxel changes lungs. */
  assert_true(out.report.lung[0].mask >= 0.064 * (double)left - added &&
              out.report.lung[0].mask <= 0.064 * (double)left + added);
  assert_true(fabs(out.report.lung[0].mask + out.report.lung[1].mask -
                   0.064 * (double)(left + right) - added) < 1e-9);
  assert_int_equal(out.report.lung[0].islands + out.report.lung[1].islands, 0);
  release(&out);
  supine_image_free(&image);
}

TEST(test_labels_islands_cavities_tunnels_counted) {
  supine_image image = helper_two_lungs(4.0);
  const double voxel = 0.064;
  const double left = voxel * (double)count_label(&image, 2);
  const size_t middle[3] = {(size_t)((66.0 - image.origin[0]) / 4.0), image.size[1] / 2,
                            image.size[2] / 2};
  /* Add cavities of 8, 1 and 1 voxels. Two share only an edge, so they count as two. */
  for (size_t c = 0; c < 3; ++c) {
    const size_t low[3] = {middle[0] + (c == 2 ? 1 : 4 * c) - 2, middle[1] + (c == 2 ? 1 : 0),
                           middle[2] + (c == 0 ? 4 : 0)};
    const size_t high[3] = {low[0] + (c == 0 ? 2 : 1), low[1] + (c == 0 ? 2 : 1),
                            low[2] + (c == 0 ? 2 : 1)};
    box_set(&image, low, high, 0);
  }
  /* Add an island of 12 voxels in a corner of the image, with the label of the right lung. */
  box_set(&image, (const size_t[3]){1, 1, 1}, (const size_t[3]){4, 3, 3}, 1);
  const supine_labels_options options = {.edge = 5.0};
  made out = surfaces_of_image(&image, "holes.nrrd", &options);
  const supine_labels_lung *lung = out.report.lung;
  assert_int_equal(lung[0].cavities, 3);
  assert_true(fabs(lung[0].filled - 10.0 * voxel) < 1e-9);
  assert_int_equal(lung[0].islands, 0);
  assert_true(fabs(lung[0].mask - left) < 1e-6);
  assert_int_equal(lung[1].islands, 1);
  assert_true(fabs(lung[1].dropped - 12.0 * voxel) < 1e-9);
  assert_int_equal(lung[1].cavities, 0);
  release(&out);
  /* A hollow with a channel to the outside is not a cavity. The channel is reported as a tunnel,
   * unless --close closes it. */
  const size_t hollow_low[3] = {middle[0] - 3, middle[1] - 3, middle[2] - 3};
  const size_t hollow_high[3] = {middle[0] + 4, middle[1] + 4, middle[2] + 4};
  box_set(&image, hollow_low, hollow_high, 0);
  const size_t channel_low[3] = {middle[0], 0, middle[2]};
  const size_t channel_high[3] = {middle[0] + 1, image.size[1], middle[2] + 1};
  box_set(&image, channel_low, channel_high, 0);
  const supine_labels_options fine = {.edge = 3.0};
  out = surfaces_of_image(&image, "channel.nrrd", &fine);
  /* The channel runs through the whole lung from front to back: one tunnel, not two. */
  assert_int_equal(out.report.lung[0].tunnels, 1);
  assert_true(left - out.report.lung[0].mask > 300.0 * voxel);
  release(&out);
  const supine_labels_options closing = {.edge = 3.0, .close = 4.5};
  out = surfaces_of_image(&image, "channel.nrrd", &closing);
  assert_int_equal(out.report.lung[0].tunnels, 0);
  assert_int_equal(out.report.lung[0].cavities, 1);
  assert_true(out.report.lung[0].closed > 0.0);
  assert_true(fabs(left - out.report.lung[0].mask) < 0.01 * left);
  release(&out);
  supine_image_free(&image);
}

/* The shape of the lungs shows which axes a wrong header has reversed. */
TEST(test_labels_flipped_header_axes_found_by_anatomy) {
  static const double spacing[3] = {4.0, 4.0, 4.0};
  const supine_labels_options options = {.labels = "one", .edge = 5.0};
  supine_mesh phantom = {0};
  assert_int_equal(supine_lungs_phantom_create(2000, 6000.0, &phantom, NULL), SUPINE_OK);
  const size_t half = phantom.triangle_count / 2; /* the triangles of the left lung come first */
  supine_image image = helper_image_over(&phantom, spacing);
  helper_voxelise(&phantom, 0, half, 2, &image);
  helper_voxelise(&phantom, half, phantom.triangle_count, 1, &image);
  supine_mesh_free(&phantom);
  for (int flips = 0; flips < 8; ++flips) {
    static const char *const ways[3][2] = {{"left", "right"}, {"back", "front"}, {"head", "feet"}};
    char wanted[64];
    supine_image map = image;
    for (int a = 0; a < 3; ++a) { /* reverses axes in the header only, not in the voxels */
      const bool flip = (flips >> a & 1) != 0;
      map.step[a][a] = flip ? -4.0 : 4.0;
      map.origin[a] = flip ? image.origin[a] + 4.0 * (double)(image.size[a] - 1) : image.origin[a];
    }
    made out = surfaces_of_image(&map, "flip.nrrd", &options);
    (void)snprintf(wanted, sizeof wanted, "i to the %s, j to the %s, k to the %s",
                   ways[0][flips & 1], ways[1][flips >> 1 & 1], ways[2][flips >> 2 & 1]);
    assert_string_equal(out.report.axes, wanted);
    assert_string_equal(out.report.source, "space directions");
    const char letters[4] = {"LR"[flips & 1], "PA"[flips >> 1 & 1], "SI"[flips >> 2 & 1], '\0'};
    char found[4];
    const supine_mesh_anatomy anatomy = supine_mesh_anatomy_find(out.surface, 2);
    supine_mesh_axes_letters(anatomy.axes, found);
    assert_string_equal(found, letters);
    for (size_t lung = 0; lung < 2; ++lung) {
      /* Triangles face outwards even if the axes are left-handed. */
      check_closed(&out.surface[lung]);
    }
    release(&out);
  }
  /* If --labels names the sides of the lungs, a header that mirrors left and right is refused. */
  supine_image map = image;
  map.step[0][0] = -4.0;
  const supine_labels_options named = {.labels = "lungmask"};
  const char *path = in_folder("mirrored.nrrd");
  supine_error error;
  made out = {0};
  assert_int_equal(supine_image_write(path, &map, NULL, NULL), SUPINE_OK);
  assert_int_equal(supine_labels_surfaces(&path, 1, &named, out.surface, &out.report, &error),
                   SUPINE_ERROR_MESH);
  assert_int_equal(error.remedies[1].kind, SUPINE_REMEDY_NONE);
  assert_string_equal(error.remedies[0].value, "RPS");
  /* So is one that mirrors front and back, or head and feet, unless the user states its axes. */
  for (int a = 1; a < 3; ++a) {
    supine_labels_options stated = {.labels = "lungmask", .axes = SUPINE_AXES_LPS};
    map = image;
    map.step[a][a] = -4.0;
    assert_int_equal(supine_image_write(path, &map, NULL, NULL), SUPINE_OK);
    assert_int_equal(supine_labels_surfaces(&path, 1, &named, out.surface, &out.report, &error),
                     SUPINE_ERROR_MESH);
    assert_says(error.message, "mirrored (labels 2 left; 1 right");
    assert_string_equal(error.remedies[1].when, "if the header is correct");
    assert_string_equal(error.remedies[0].value, a == 1 ? "LAS" : "LPI");
    made accepted = surfaces_of(&path, 1, &stated);
    release(&accepted);
    stated = (supine_labels_options){.labels = NULL}; /* sides by position: nothing is named */
    accepted = surfaces_of(&path, 1, &stated);
    release(&accepted);
  }
  supine_image_free(&image);
}

TEST(test_labels_lungs_cut_at_the_border_reported) {
  supine_image image = helper_two_lungs(4.0);
  const size_t layer = image.size[0] * image.size[1];
  supine_image part = image;
  part.size[2] -= 20;
  part.values = (uint8_t *)image.values + 20 * layer;
  const supine_labels_options options = {.edge = 5.0};
  /* named, as a bed of more than a tenth of a lung would not be believed of unnamed labels */
  const supine_labels_options named = {.edge = 5.0, .labels = "left=2,right=1"};
  made out = surfaces_of_image(&part, "cut.nrrd", &options);
  for (size_t lung = 0; lung < 2; ++lung) {
    assert_true(out.report.lung[lung].cut > 0.05 * out.report.lung[lung].mask);
  }
  check_closed(&out.surface[0]);
  release(&out);
  /* Islands that are dropped do not count, and do not change the surface. */
  made clean = surfaces_of_image(&image, "whole.nrrd", &named);
  memset(image.values, 1, layer);
  out = surfaces_of_image(&image, "bed.nrrd", &named);
  assert_int_equal(out.report.lung[1].islands, 1);
  assert_true(out.report.lung[0].cut == 0.0 && out.report.lung[1].cut == 0.0);
  assert_int_equal(out.surface[1].vertex_count, clean.surface[1].vertex_count);
  assert_memory_equal(out.surface[1].vertices, clean.surface[1].vertices,
                      3 * clean.surface[1].vertex_count * sizeof(double));
  release(&clean);
  release(&out);
  supine_image_free(&image);
}

/* Return the largest distance of a vertex from the boundary of the labelled voxels, mm. */
static double farthest_of(const supine_image *image, uint8_t label, const supine_mesh *mesh) {
  const uint8_t *at = image->values;
  double farthest = 0.0;
  for (size_t v = 0; v < mesh->vertex_count; ++v) {
    double voxel[3];
    supine_image_locate(image, mesh->vertices + 3 * v, voxel);
    /* Squared distances, mm^2, to the nearest voxel without and with the label. */
    double nearest[2] = {INFINITY, INFINITY};
    for (size_t i = 0; i < voxels(image); ++i) {
      const size_t index[3] = {i % image->size[0], i / image->size[0] % image->size[1],
                               i / image->size[0] / image->size[1]};
      double square = 0.0;
      for (int a = 0; a < 3; ++a) {
        const double apart =
            fmax(0.0, fabs(voxel[a] - (double)index[a]) - 0.5) * fabs(image->step[a][a]);
        square += apart * apart;
      }
      nearest[at[i] == label] = fmin(nearest[at[i] == label], square);
    }
    farthest = fmax(farthest, fmax(nearest[0], nearest[1]));
  }
  return sqrt(farthest);
}

TEST(test_labels_surface_within_half_a_voxel_of_the_mask) {
  supine_image image = helper_two_lungs(13.0);
  image.step[2][2] = 17.0;
  const double edges[] = {9.0, 13.0, 19.0};
  for (size_t e = 0; e < 3; ++e) {
    const supine_labels_options options = {.edge = edges[e]};
    made out = surfaces_of_image(&image, "far.nrrd", &options);
    for (size_t lung = 0; lung < 2; ++lung) {
      const supine_labels_lung *is = &out.report.lung[lung];
      const double farthest = farthest_of(&image, lung == 0 ? 2 : 1, &out.surface[lung]);
      assert_true(farthest <= 0.5 * fmax(17.0, edges[e]));
      assert_true(fabs(is->mask - 2.873 * (double)count_label(&image, lung == 0 ? 2 : 1)) < 1e-6);
    }
    release(&out);
  }
  supine_image_free(&image);
}

/* Random voxels give a closed manifold surface for each lung. */
TEST(test_labels_noise_closed_manifold) {
  uint64_t seed = 7;
  for (int trial = 0; trial < 6; ++trial) {
    const double density = 0.35 + 0.11 * trial;
    supine_image image = {.size = {31, 17, 16},
                          .origin = {-60.0, 0.0, 0.0},
                          .step = {{4.0, 0.0, 0.0}, {0.0, 4.0, 0.0}, {0.0, 0.0, 4.0}},
                          .voxel = SUPINE_VOXEL_U8,
                          .channels = 1};
    uint8_t *at = calloc(voxels(&image), 1);
    image.values = at;
    for (size_t i = 0; i < voxels(&image); ++i) {
      const bool is = 0.5 + 0.5 * random_signed(&seed) < density;
      at[i] = !is || i % 31 == 15 ? 0 : i % 31 < 15 ? 1 : 2;
    }
    /* Edges of cubes, mm: 4 keeps the voxels, 8 averages eight voxels, 2.7 interpolates. */
    const double edges[] = {4.0, 8.0, 2.7};
    for (size_t e = 0; e < 3; ++e) {
      const supine_labels_options options = {.edge = edges[e]};
      const char *path = in_folder("noise.nrrd");
      made out = {0};
      assert_int_equal(supine_image_write(path, &image, NULL, NULL), SUPINE_OK);
      const supine_status status =
          supine_labels_surfaces(&path, 1, &options, out.surface, &out.report, NULL);
      if (status == SUPINE_OK) {
        check_closed(&out.surface[0]);
        check_closed(&out.surface[1]);
      } else { /* no surface: averaging has removed the sparse voxels */
        assert_int_equal(status, SUPINE_ERROR_MESH);
        assert_true(density < 0.5);
      }
      release(&out);
    }
    supine_image_free(&image);
  }
}

TEST(test_labels_distance_any_mask_equals_search_of_all_pairs) {
  uint64_t seed = 11;
  labels_mask mask = {.size = {9, 13, 7}, .spacing = {0.7, 1.3, 2.9}};
  const size_t count = supine_labels_mask_count(&mask);
  float squares[9 * 13 * 7];
  mask.at = malloc(count);
  for (int trial = 0; trial < 4; ++trial) {
    for (size_t i = 0; i < count; ++i) {
      mask.at[i] = random_signed(&seed) > 0.9 - 0.5 * trial;
    }
    for (int zero = 0; zero < 2; ++zero) {
      assert_int_equal(supine_labels_distance(&mask, zero != 0, squares), SUPINE_OK);
      for (size_t i = 0; i < count; ++i) {
        double nearest = INFINITY;
        for (size_t j = 0; j < count; ++j) {
          const double apart[3] = {0.7 * ((double)(i % 9) - (double)(j % 9)),
                                   1.3 * ((double)(i / 9 % 13) - (double)(j / 9 % 13)),
                                   2.9 * ((double)(i / 117) - (double)(j / 117))};
          if ((mask.at[j] == 0) == (zero != 0)) {
            nearest =
                fmin(nearest, apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2]);
          }
        }
        assert_true(fabs((double)squares[i] - nearest) < 1e-5 * (1.0 + nearest));
      }
    }
  }
  free(mask.at);
}

static void refused(const char *name, const supine_labels_options *options, supine_status status,
                    const char *said) {
  const char *path = in_folder(name);
  made out = {0};
  supine_error error = {.message = ""};
  assert_int_equal(supine_labels_surfaces(&path, 1, options, out.surface, &out.report, &error),
                   status);
  assert_says(error.message, said);
  assert_null(out.surface[0].vertices);
  assert_null(out.surface[1].vertices);
}

/* Each label gives one surface, even if its voxels form two balls (label 700) or a tube (label 9).
 * The voxels have unequal sides. */
TEST(test_labels_shapes_any_label_one_surface_each) {
  supine_image image = {.voxel = SUPINE_VOXEL_U16, .channels = 1, .size = {60, 50, 40}};
  static const double spacing[3] = {0.8, 0.9, 1.3};
  image.values = calloc(voxels(&image), sizeof(uint16_t));
  uint16_t *at = image.values;
  for (int a = 0; a < 3; ++a) {
    image.origin[a] = 31.7 - 40.3 * a;
    image.step[a][a] = a == 1 ? -spacing[a] : spacing[a]; /* left-handed axes */
  }
  for (size_t i = 0; i < voxels(&image); ++i) {
    const double p[3] = {spacing[0] * (double)(i % 60), spacing[1] * (double)(i / 60 % 50),
                         spacing[2] * (double)(i / 3000)};
    const double ball = hypot(hypot(p[0] - 12.0, p[1] - 20.0), p[2] - 20.0);
    const double other = hypot(hypot(p[0] - 12.0, p[1] - 36.0), p[2] - 36.0);
    const double tube = hypot(p[0] - 36.0, p[1] - 20.0);
    at[i] = ball < 8.0 || other < 4.0 ? 700 : tube < 5.0 && tube > 2.5 ? 9 : 0;
  }
  const char *path = in_folder("shapes.nii.gz");
  supine_labels_shape *shapes = NULL;
  supine_error error = {0};
  size_t count = 0;
  assert_int_equal(supine_image_write(path, &image, NULL, &error), SUPINE_OK);
  if (supine_labels_shapes(path, NULL, 0, &shapes, &count, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
  assert_int_equal(count, 2);
  assert_true(shapes[0].label == 9 && shapes[1].label == 700);
  for (size_t s = 0; s < 2; ++s) {
    size_t wanted = 0;
    supine_topology topology = {0};
    for (size_t i = 0; i < voxels(&image); ++i) {
      wanted += at[i] == shapes[s].label;
    }
    const double ml = 1e-3 * 0.8 * 0.9 * 1.3 * (double)wanted;
    const double surface = 1e-3 * supine_mesh_volume(&shapes[s].surface);
    assert_true(fabs(shapes[s].mask - ml) < 1e-6 * ml);
    assert_true(fabs(surface - ml) < 0.06 * ml);
    assert_int_equal(supine_mesh_topology_create(&shapes[s].surface, &topology), SUPINE_OK);
    assert_true(topology.closed);
    /* shapes[0] is one tube, shapes[1] is two balls */
    assert_int_equal(topology.component_count, s == 0 ? 1 : 2);
    supine_mesh_topology_free(&topology);
  }
  double low[3];
  double high[3];
  /* The surface is where the header of the image puts it. */
  supine_mesh_box(&shapes[1].surface, low, high);
  assert_true(fabs(low[0] - (31.7 + 4.0)) < 0.65 && fabs(high[0] - (31.7 + 20.0)) < 0.65);
  assert_true(fabs(high[1] - (31.7 - 40.3 - 12.0)) < 0.65);
  supine_labels_shapes_free(shapes, count);
  const unsigned chosen[] = {700, 9};
  assert_int_equal(supine_labels_shapes(path, chosen, 2, &shapes, &count, &error), SUPINE_OK);
  assert_true(count == 2 && shapes[0].label == 700);
  supine_labels_shapes_free(shapes, count);
  static const unsigned absent[] = {9, 8, 0, 70000};
  for (size_t i = 1; i < 4; ++i) {
    assert_int_equal(supine_labels_shapes(path, &absent[i], 1, &shapes, &count, &error),
                     SUPINE_ERROR_MESH);
    assert_says(error.message, "no voxel holds the label");
  }
  memset(at, 0, voxels(&image) * sizeof *at);
  assert_int_equal(supine_image_write(path, &image, NULL, NULL), SUPINE_OK);
  assert_int_equal(supine_labels_shapes(path, NULL, 0, &shapes, &count, &error), SUPINE_ERROR_MESH);
  assert_says(error.message, "every voxel is 0");
  for (size_t i = 0; i < voxels(&image); ++i) {
    at[i] = (uint16_t)(i % 400);
  }
  assert_int_equal(supine_image_write(path, &image, NULL, NULL), SUPINE_OK);
  assert_int_equal(supine_labels_shapes(path, NULL, 0, &shapes, &count, &error), SUPINE_ERROR_MESH);
  assert_says(error.message, "more than 256 labels");
  assert_int_equal(supine_labels_shapes(in_folder("absent.nrrd"), NULL, 0, &shapes, &count, &error),
                   SUPINE_ERROR_READ);
  supine_image_free(&image);
}

/* Two labels that nobody named must be two lungs; probabilities and scaled integers are read. */
TEST(test_labels_unlikely_pairs_refused_scaled_values_read) {
  const supine_labels_options plain = {.edge = 5.0};
  supine_image image = helper_two_lungs(4.0);
  const size_t count = voxels(&image);
  uint8_t *at = image.values;
  made clean = surfaces_of_image(&image, "clean.nrrd", &plain);
  SUPINE_ARENA arena = {0};
  float *scaled = supine_arena_take(&arena, count, sizeof *scaled);
  assert_non_null(scaled);
  for (size_t i = 0; i < count; ++i) {
    scaled[i] = (float)at[i] + (i % 2 == 0 ? 9e-4F : -9e-4F);
  }
  supine_image other = image;
  other.values = scaled;
  other.voxel = SUPINE_VOXEL_F32;
  made out = surfaces_of_image(&other, "scaled.nrrd", &plain);
  assert_true(out.report.lung[0].mask == clean.report.lung[0].mask);
  release(&out);
  for (size_t i = 0; i < count; ++i) { /* probabilities of both lungs */
    scaled[i] = at[i] != 0 ? 0.6F : 0.4F;
  }
  out = surfaces_of_image(&other, "probable.nrrd", &plain);
  assert_true(fabs(out.report.lung[0].mask + out.report.lung[1].mask - clean.report.lung[0].mask -
                   clean.report.lung[1].mask) < 1e-9);
  release(&out);
  release(&clean);
  size_t inside = 0;
  for (size_t i = 0; i < count; ++i) { /* label 1 is both lungs, label 2 a part of one */
    inside += at[i] == 2;
    at[i] = at[i] == 0 ? 0 : (uint8_t)(at[i] == 2 && inside < 600 ? 2 : 1);
  }
  assert_int_equal(supine_image_write(in_folder("bad.nrrd"), &image, NULL, NULL), SUPINE_OK);
  refused("bad.nrrd", &plain, SUPINE_ERROR_MESH, "hardly the two lungs");
  supine_image_free(&image);
}

TEST(test_labels_bad_maps_refused) {
  const supine_labels_options plain = {.edge = 5.0};
  supine_image image = helper_two_lungs(4.0);
  uint8_t *at = image.values;
  const char *path = in_folder("bad.nrrd");
  static const struct {
    const char *labels;
    supine_status status;
    const char *said;
  } wrong[] = {
      {"both", SUPINE_ERROR_ARGUMENT, "not 'both'"},
      {"left=", SUPINE_ERROR_ARGUMENT, "not 'left='"},
      {"left=1,left=2", SUPINE_ERROR_ARGUMENT, "labels must be"},
      {"left=1,right=1", SUPINE_ERROR_ARGUMENT, "labels must be"},
      {"left=1+", SUPINE_ERROR_ARGUMENT, "labels must be"},
      {"left=0", SUPINE_ERROR_ARGUMENT, "labels must be"},
      {"left=70000", SUPINE_ERROR_ARGUMENT, "labels must be"},
      {"left=-1", SUPINE_ERROR_ARGUMENT, "labels must be"},
      {"left=1,right=2", SUPINE_ERROR_MESH, "does not lie left of the right lung"},
      {"left=2,right=3", SUPINE_ERROR_MESH, "given for the right lung"},
      {"totalsegmentator", SUPINE_ERROR_MESH, "the left lung; the labels present are 1, 2"},
      {"left=9", SUPINE_ERROR_MESH, "given for the left lung"},
  };
  assert_int_equal(supine_image_write(path, &image, NULL, NULL), SUPINE_OK);
  for (size_t i = 0; i < sizeof wrong / sizeof *wrong; ++i) {
    const supine_labels_options options = {.labels = wrong[i].labels};
    refused("bad.nrrd", &options, wrong[i].status, wrong[i].said);
  }
  const supine_labels_options edges[] = {
      {.edge = 0.1}, {.edge = 30.0}, {.edge = NAN}, {.close = -1.0}, {.close = 1e3}};
  for (size_t i = 0; i < sizeof edges / sizeof *edges; ++i) {
    refused("bad.nrrd", &edges[i], SUPINE_ERROR_ARGUMENT, "give an edge from");
  }
  refused("absent.nii.gz", &plain, SUPINE_ERROR_READ, "absent.nii.gz");
  refused("map.mhd", &plain, SUPINE_ERROR_FORMAT, ".nrrd");

  at[0] = 3;
  assert_int_equal(supine_image_write(path, &image, NULL, NULL), SUPINE_OK);
  refused("bad.nrrd", &plain, SUPINE_ERROR_MESH, "which of its labels (1, 2, 3)");
  at[0] = 0;
  for (size_t i = 0; i < voxels(&image); ++i) { /* one lung, whose side is unknown */
    at[i] = at[i] == 2 ? 2 : 0;
  }
  assert_int_equal(supine_image_write(path, &image, NULL, NULL), SUPINE_OK);
  refused("bad.nrrd", &plain, SUPINE_ERROR_MESH, "cannot split the mask into two lungs");
  for (size_t i = 0; i < voxels(&image); ++i) { /* two labels, one above the other */
    at[i] = at[i] == 0 ? 0 : i < voxels(&image) / 2 ? 1 : 2;
  }
  assert_int_equal(supine_image_write(path, &image, NULL, NULL), SUPINE_OK);
  refused("bad.nrrd", &plain, SUPINE_ERROR_MESH, "does not lie left of the right lung");
  memset(at, 0, voxels(&image));
  assert_int_equal(supine_image_write(path, &image, NULL, NULL), SUPINE_OK);
  refused("bad.nrrd", &plain, SUPINE_ERROR_MESH, "every voxel is 0");
  at[5000] = 1;
  at[5030] = 2;
  assert_int_equal(supine_image_write(path, &image, NULL, NULL), SUPINE_OK);
  refused("bad.nrrd", &plain, SUPINE_ERROR_MESH, "impossible for a lung");
  /* Sheets one voxel thick vanish if averaged over cubes of 20 mm. */
  const supine_labels_options coarse = {.edge = 20.0};
  box_set(&image, (const size_t[3]){5, 5, 5}, (const size_t[3]){6, 40, 50}, 1);
  box_set(&image, (const size_t[3]){60, 5, 5}, (const size_t[3]){61, 40, 50}, 2);
  assert_int_equal(supine_image_write(path, &image, NULL, NULL), SUPINE_OK);
  refused("bad.nrrd", &coarse, SUPINE_ERROR_MESH, "smaller edge");
  image.step[2][2] *= 100.0; /* as if the header were in another unit */
  assert_int_equal(supine_image_write(path, &image, NULL, NULL), SUPINE_OK);
  refused("bad.nrrd", &plain, SUPINE_ERROR_MESH, "impossible for a lung");
  supine_image_free(&image);
}

/* A lung of exactly 1 mL and one exactly 1000 mm long are accepted. */
TEST(test_labels_lungs_of_limit_size_accepted) {
  static const size_t sizes[2][3] = {{10, 10, 10}, {100, 2, 2}};
  for (int k = 0; k < 2; ++k) {
    const double spacing = k == 0 ? 1.0 : 10.0;
    const supine_labels_options options = {.labels = "left=1", .edge = spacing};
    supine_image image = {.voxel = SUPINE_VOXEL_U8, .channels = 1};
    for (int a = 0; a < 3; ++a) {
      image.size[a] = sizes[k][a] + 2;
      image.step[a][a] = spacing;
    }
    image.values = calloc(voxels(&image), 1);
    box_set(&image, (const size_t[3]){1, 1, 1},
            (const size_t[3]){sizes[k][0] + 1, sizes[k][1] + 1, sizes[k][2] + 1}, 1);
    made out = surfaces_of_image(&image, "limit.nrrd", &options);
    assert_int_equal(out.report.lung_count, 1);
    release(&out);
    supine_image_free(&image);
  }
}

TEST(test_labels_impossible_voxels_refused) {
  static const struct {
    supine_image_voxel voxel;
    double value;
    const char *said;
  } wrong[] = {{SUPINE_VOXEL_F32, 0.37, "but labels are whole"},
               {SUPINE_VOXEL_F64, NAN, "but labels are"},
               {SUPINE_VOXEL_F32, INFINITY, "but labels are"},
               {SUPINE_VOXEL_I16, -850.0, "the CT itself"},
               {SUPINE_VOXEL_I32, 65536.0, "but labels are"}};
  const supine_labels_options plain = {.edge = 5.0};
  supine_image image = helper_two_lungs(4.0);
  for (size_t w = 0; w < sizeof wrong / sizeof *wrong; ++w) {
    supine_image map = image;
    map.voxel = wrong[w].voxel;
    map.values = calloc(voxels(&image), supine_image_voxel_size(map.voxel));
    for (size_t i = 0; i < voxels(&image); ++i) {
      supine_image_put(&map, i, 1, &(double){supine_image_get(&image, i)});
    }
    assert_int_equal(supine_image_write(in_folder("none.nrrd"), &map, NULL, NULL), SUPINE_OK);
    const char *path = in_folder("none.nrrd");
    /* Whole numbers of any voxel type are accepted as labels. */
    made out = surfaces_of(&path, 1, &plain);
    assert_int_equal(out.report.lung_count, 2);
    release(&out);
    supine_image_put(&map, voxels(&image) - 1, 1, &(double){wrong[w].value});
    assert_int_equal(supine_image_write(in_folder("none.nrrd"), &map, NULL, NULL), SUPINE_OK);
    refused("none.nrrd", &plain, SUPINE_ERROR_FORMAT, wrong[w].said);
    supine_image_free(&map);
  }
  supine_image_free(&image);
}

/* Damaged files are refused (test_image.c has more cases). */
TEST(test_labels_damaged_files_refused) {
  const supine_labels_options plain = {.edge = 5.0};
  supine_image image = helper_two_lungs(8.0);
  assert_int_equal(supine_image_write(in_folder("whole.nii.gz"), &image, NULL, NULL), SUPINE_OK);
  FILE *file = fopen(in_folder("whole.nii.gz"), "rb");
  unsigned char bytes[1 << 16];
  const size_t size = fread(bytes, 1, sizeof bytes, file);
  (void)fclose(file);
  assert_true(size > 100 && size < sizeof bytes);
  file = fopen(in_folder("short.nii.gz"), "wb");
  (void)fwrite(bytes, 1, size - size / 3, file);
  (void)fclose(file);
  refused("short.nii.gz", &plain, SUPINE_ERROR_FORMAT, "short.nii.gz");
  file = fopen(in_folder("huge.nrrd"), "w");
  (void)fputs("NRRD0004\ntype: uchar\ndimension: 3\nspace: LPS\nsizes: 10000 10000 10000\nspace "
              "directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nencoding: gzip\n\n",
              file);
  (void)fclose(file);
  refused("huge.nrrd", &plain, SUPINE_ERROR_FORMAT, "do not fit in");
  supine_image_free(&image);
}

/* Let the work continue for the first `*left` calls, then stop it. */
static bool stop_at(void *context, double fraction) {
  long *left = context;
  assert_true(fraction >= 0.0 && fraction <= 1.0);
  return (*left)-- > 0;
}

TEST(test_labels_interrupted_anywhere_nothing_leaks) {
  supine_image image = helper_two_lungs(8.0);
  assert_int_equal(supine_image_write(in_folder("stop.nrrd"), &image, NULL, NULL), SUPINE_OK);
  long calls = 0;
  for (;; ++calls) {
    long left = calls;
    const supine_labels_options options = {
        .edge = 8.0, .progress = stop_at, .progress_context = &left};
    const char *path = in_folder("stop.nrrd");
    made out = {0};
    const supine_status status =
        supine_labels_surfaces(&path, 1, &options, out.surface, &out.report, NULL);
    release(&out);
    if (status == SUPINE_OK) {
      break;
    }
    assert_int_equal(status, SUPINE_ERROR_INTERRUPTED);
    assert_true(calls < 100);
  }
  assert_true(calls >= 4);
  supine_image_free(&image);
}

TEST_GROUP(folder_make, folder_remove)
