/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test pictures: views, colours, colour bars and drawings. */
#include "tests/helpers/test.h"

#include "base/vec3.h"

#include "program/view/render/render.h"
#include "tests/helpers/runtime_fixture.h"

#include "tests/helpers/poses.h"

static const double gravity[3] = {0.8, 0.6, 0};

/* As the patient lies, gravity points down and the head is on the left. */
TEST(test_view_axes_lying_gravity_down_head_left) {
  static const double lying[][3] = {
      {0, 1, 0}, {0, -1, 0}, {1, 0, 0}, {-1, 0, 0}, {0.8, 0.36, 0.48}};
  for (size_t i = 0; i < sizeof lying / sizeof *lying; ++i) {
    double a[3][3];
    supine_render_view_axes(SUPINE_VIEW_LYING, lying[i], a);
    assert_true(fabs(supine_dot(a[1], lying[i]) + 1) < 1e-12);
    assert_true(a[0][2] < -0.8);
    assert_true(fabs(supine_dot(a[0], a[1])) < 1e-12 && fabs(supine_dot(a[0], a[0]) - 1) < 1e-12);
  }
}

TEST(test_view_axes_any_view_right_handed_orthonormal) {
  for (supine_view view = 0; view < SUPINE_VIEW_COUNT; ++view) {
    double a[3][3];
    assert_non_null(supine_render_view_name(view));
    supine_render_view_axes(view, gravity, a);
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3;
      const int k = (i + 2) % 3;
      for (int axis = 0; axis < 3; ++axis) {
        const int next = (axis + 1) % 3;
        const int last = (axis + 2) % 3;
        const double cross = a[i][next] * a[j][last] - a[i][last] * a[j][next];
        assert_true(fabs(cross - a[k][axis]) < 1e-14);
      }
    }
  }
  assert_null(supine_render_view_name(SUPINE_VIEW_COUNT));
}

/* The third axis of each view points from the lungs to the viewer. */
TEST(test_view_axes_each_view_points_to_viewer) {
  static const struct {
    supine_view view;
    double towards[3];
  } cases[] = {{SUPINE_VIEW_ANTERIOR, {0, -1, 0}}, {SUPINE_VIEW_POSTERIOR, {0, 1, 0}},
               {SUPINE_VIEW_LEFT, {1, 0, 0}},      {SUPINE_VIEW_RIGHT, {-1, 0, 0}},
               {SUPINE_VIEW_HEAD, {0, 0, 1}},      {SUPINE_VIEW_FEET, {0, 0, -1}}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    double axes[3][3];
    supine_render_view_axes(cases[i].view, NULL, axes);
    assert_memory_equal(axes[2], cases[i].towards, sizeof axes[2]);
  }
}

static double linear(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : pow((encoded + 0.055) / 1.055, 2.4);
}

/* Return the lightness L* of CIE 1976 of an sRGB colour. The colour maps were designed by another
 * measure of lightness. */
static double lightness(const double rgb[3]) {
  const double y = 0.2126 * linear(rgb[0]) + 0.7152 * linear(rgb[1]) + 0.0722 * linear(rgb[2]);
  return 116 * cbrt(y) - 16;
}

TEST(test_colours_increasing_value_even_steps_of_lightness) {
  enum { STEPS = 64 };
  for (supine_colours map = 0; map < SUPINE_COLOURS_COUNT; ++map) {
    double before = 0;
    for (int i = 0; i <= STEPS; ++i) {
      double rgb[3];
      supine_render_colour(map, i / (double)STEPS, rgb);
      const double here = lightness(rgb);
      for (int k = 0; k < 3; ++k) {
        assert_true(rgb[k] >= 0 && rgb[k] <= 1);
      }
      if (i > 0) {
        /* The 64 steps of a colour map together change L* by about 70, so each changes it by
         * about 1.1. */
        assert_true(here - before > 0.5 && here - before < 1.8);
      }
      before = here;
    }
  }
}

TEST(test_palette_targets_differ_in_lightness) {
  double light[2];
  for (size_t i = 0; i < 2; ++i) {
    const uint32_t tint = supine_render_palette(SUPINE_PALETTE_TARGETS, i);
    const double rgb[3] = {(tint >> 16) / 255.0, (tint >> 8 & 255U) / 255.0, (tint & 255U) / 255.0};
    light[i] = lightness(rgb);
  }
  assert_true(light[0] - light[1] > 10);
}

TEST(test_colours_out_of_range_clamped) {
  static const supine_colours map = SUPINE_COLOURS_DIFFERENCE;
  double a[3];
  double b[3];
  supine_render_colour(map, -3, a);
  supine_render_colour(map, 0, b);
  assert_memory_equal(a, b, sizeof a);
  supine_render_colour(map, 7, a);
  supine_render_colour(map, 1, b);
  assert_memory_equal(a, b, sizeof a);
}

TEST(test_bar_any_range_ends_at_round_tick) {
  static const double cases[][3] = {{31.6, 5, 35}, {18.7, 2, 20}, {20, 5, 20}, {0.043, 0.01, 0.05},
                                    {7.99, 1, 8},  {8, 2, 8},     {0, 0.2, 1}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    assert_true(fabs(supine_render_bar_step(cases[i][0]) - cases[i][1]) < 1e-12);
    assert_true(fabs(supine_render_bar_end(cases[i][0]) - cases[i][2]) < 1e-12);
  }
}

/* A synthetic basis, and a value for each vertex. */
typedef struct drawing {
  fixture *f;
  unsigned char *bytes;
  supine_basis *basis;
  float *value;
} drawing;

enum { WIDTH = 120, HEIGHT = 100, PIXELS = WIDTH * HEIGHT };

static void drawing_destroy(drawing *m) {
  supine_basis_close(m->basis);
  free(m->bytes);
  free(m->value);
  fixture_destroy(m->f);
}

static drawing drawing_create(fixture *f) {
  drawing m = {.f = f};
  size_t size = 0;
  m.bytes = fixture_bytes(f, &size);
  assert_int_equal(supine_basis_open_memory(m.bytes, size, &m.basis, NULL), SUPINE_OK);
  m.value = malloc(f->vertices * sizeof *m.value);
  assert_non_null(m.value);
  for (size_t i = 0; i < f->vertices; ++i) {
    m.value[i] = f->vertex[3 * i + 2] * 0.05F + 5;
  }
  return m;
}

static void draw(const drawing *m, supine_view view, const double *weights, double scale,
                 uint32_t *pixels) {
  const double scales[2] = {scale, scale};
  const supine_scene scene = {.pose = POSED(m->basis, weights, scales),
                              .value = m->value,
                              .largest = 10,
                              .view = view,
                              .gravity = gravity,
                              .width = WIDTH,
                              .height = HEIGHT};
  supine_error error;
  if (supine_render_draw(m->basis, &scene, pixels, &error) != SUPINE_OK) {
    fail_msg("%s", error.message);
  }
}

static size_t covered(const uint32_t *pixels) {
  size_t count = 0;
  for (size_t i = 0; i < PIXELS; ++i) {
    count += pixels[i] >> 24 > 127;
  }
  return count;
}

TEST(test_draw_lungs_background_transparent) {
  static uint32_t pixels[PIXELS];
  drawing m = drawing_create(fixture_create(900, 5, 2, 2, false, true, 1, 61));
  const double weights[5] = {0};
  for (supine_view view = 0; view < SUPINE_VIEW_COUNT; ++view) {
    draw(&m, view, weights, 1, pixels);
    assert_in_range(covered(pixels), PIXELS / 8, PIXELS * 9 / 10);
    assert_int_equal(pixels[0], 0);
    assert_int_equal(pixels[PIXELS - 1], 0);
    for (size_t i = 0; i < PIXELS; ++i) {
      for (int shift = 0; shift < 24; shift += 8) {
        /* Colours are premultiplied by opacity. */
        assert_true((pixels[i] >> shift & 255U) <= pixels[i] >> 24);
      }
    }
  }
  drawing_destroy(&m);
}

/* Seen from the front, the head is at the top: values increase with z, so the upper half is
 * lighter. */
TEST(test_draw_anterior_head_on_top) {
  static uint32_t pixels[PIXELS];
  drawing m = drawing_create(fixture_create(900, 5, 2, 2, false, true, 1, 61));
  const double weights[5] = {0};
  double half[2] = {0, 0};
  double count[2] = {0, 0};
  draw(&m, SUPINE_VIEW_ANTERIOR, weights, 1, pixels);
  for (size_t i = 0; i < PIXELS; ++i) {
    if (pixels[i] >> 24 == 255) {
      half[i / (PIXELS / 2)] += pixels[i] >> 8 & 255U;
      count[i / (PIXELS / 2)] += 1;
    }
  }
  assert_true(half[0] / count[0] > half[1] / count[1] + 20);
  drawing_destroy(&m);
}

/* The outermost vertices are projected near the outermost pixels that are drawn. */
TEST(test_project_outer_vertices_match_drawing) {
  static uint32_t pixels[PIXELS];
  drawing m = drawing_create(fixture_create(900, 5, 2, 2, false, true, 1, 61));
  const supine_basis_info *info = supine_basis_get_info(m.basis);
  const double weights[5] = {0};
  const double scales[2] = {1, 1};
  supine_mark *mark = calloc(info->vertex_count, sizeof *mark);
  double(*at)[3] = calloc(info->vertex_count, sizeof *at);
  for (size_t i = 0; i < info->vertex_count; ++i) {
    memcpy(mark[i].xyz, info->vertices + 3 * i, sizeof mark[i].xyz);
  }
  const supine_marks marks = {.count = info->vertex_count, .mark = mark};
  for (supine_view view = 0; view < SUPINE_VIEW_COUNT; ++view) {
    const supine_scene scene = {.pose = POSED(m.basis, weights, scales),
                                .view = view,
                                .gravity = gravity,
                                .width = WIDTH,
                                .height = HEIGHT};
    double projected[4] = {INFINITY, -INFINITY, INFINITY, -INFINITY};
    double drawn[4] = {INFINITY, -INFINITY, INFINITY, -INFINITY};
    draw(&m, view, weights, 1, pixels);
    supine_render_project(m.basis, &scene, &marks, false, at);
    for (size_t i = 0; i < info->vertex_count; ++i) {
      for (int side = 0; side < 2; ++side) {
        projected[2 * side] = fmin(projected[2 * side], at[i][side]);
        projected[2 * side + 1] = fmax(projected[2 * side + 1], at[i][side]);
      }
    }
    for (size_t i = 0; i < PIXELS; ++i) {
      const double place[2] = {(double)(i % WIDTH), (double)(i / WIDTH)};
      for (int side = 0; side < 2 && pixels[i] >> 24 > 127; ++side) {
        drawn[2 * side] = fmin(drawn[2 * side], place[side]);
        drawn[2 * side + 1] = fmax(drawn[2 * side + 1], place[side] + 1);
      }
    }
    /* The leftmost, rightmost, highest or lowest triangle may be too thin to cover a pixel. */
    for (int end = 0; end < 4; ++end) {
      assert_true(fabs(projected[end] - drawn[end]) < 3);
    }
  }
  free(mark);
  free(at);
  drawing_destroy(&m);
}

/* Return the coverage of a pixel, 0 to 255. */
static int coverage(uint32_t pixel) {
  return (int)(pixel >> 24);
}

/* A shell is clear in the middle and dense at its rim, and what is inside is seen through it. */
TEST(test_draw_shell_clear_inside_dense_at_rim_content_seen) {
  static uint32_t pixels[2][PIXELS];
  drawing m = drawing_create(fixture_create(900, 5, 2, 1, false, true, 1, 61));
  const supine_basis_info *info = supine_basis_get_info(m.basis);
  const double weights[5] = {0};
  const double scales[2] = {1, 1};
  supine_mark target = {.radius = 12.0F};
  double low[3] = {INFINITY, INFINITY, INFINITY};
  double high[3] = {-INFINITY, -INFINITY, -INFINITY};
  supine_render_box(info->vertices, info->vertex_count, low, high);
  for (int k = 0; k < 3; ++k) {
    target.xyz[k] = (float)(0.5 * (low[k] + high[k]));
  }
  const supine_marks marks = {.count = 1, .mark = &target};
  for (int i = 0; i < 2; ++i) {
    const supine_scene scene = {.pose = POSED(m.basis, weights, scales),
                                .look = SUPINE_LOOK_SHELL,
                                .largest = 1,
                                .gravity = gravity,
                                .content = i == 1 ? &marks : NULL,
                                .width = WIDTH,
                                .height = HEIGHT};
    assert_int_equal(supine_render_draw(m.basis, &scene, pixels[i], NULL), SUPINE_OK);
  }
  const size_t middle = PIXELS / 2 + WIDTH / 2;
  int most = 0;
  for (size_t i = 0; i < PIXELS; ++i) {
    most = coverage(pixels[0][i]) > most ? coverage(pixels[0][i]) : most;
  }
  assert_in_range(coverage(pixels[0][middle]), 20, 130); /* two layers of 0.10 or more */
  assert_true(most > 190);                               /* 0.85 at the rim */
  assert_int_equal(coverage(pixels[1][middle]), 255);
  drawing_destroy(&m);
}

TEST(test_draw_impossible_size_refused) {
  uint32_t pixel = 0;
  drawing m = drawing_create(fixture_create(100, 3, 2, 1, false, false, 1, 65));
  const double weights[3] = {0};
  const double scales[1] = {1};
  supine_scene scene = {
      .pose = POSED(m.basis, weights, scales), .value = m.value, .largest = 1, .height = 10};
  supine_error error;
  assert_int_equal(supine_render_draw(m.basis, &scene, &pixel, &error), SUPINE_ERROR_ARGUMENT);
  scene.width = (size_t)1 << 30;
  assert_int_equal(supine_render_draw(m.basis, &scene, &pixel, &error), SUPINE_ERROR_ARGUMENT);
  drawing_destroy(&m);
}
