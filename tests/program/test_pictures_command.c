/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the commands `supine compare` and `supine render`. */
#include "tests/helpers/program_helpers.h"

#include <jansson.h>

#include <cairo.h>
#include <webp/demux.h>

/* Quoted name of a basis file that an earlier version of the program made from an open surface. */
#define OPEN "\"" SUPINE_GOLDEN "/open_surface.safetensors\""

static size_t count_words(const char *text, const char *word) {
  size_t count = 0;
  for (const char *at = strstr(text, word); at != NULL; at = strstr(at + 1, word)) {
    ++count;
  }
  return count;
}

static int setup(void **state) {
  if (folder_make(state) != 0) {
    return -1;
  }
  return run("phantom --vertices 4000 -o lungs.ply") == 0 &&
                 run("precompute lungs.ply -o lungs.safetensors") == 0
             ? 0
             : -1;
}

static double number(const json_t *root, const char *key, const char *inner) {
  const json_t *value = json_object_get(json_object_get(root, key), inner);
  assert_true(json_is_number(value));
  return json_number_value(value);
}

static void check_statistics(const json_t *owner, const char *key) {
  const double mean = number(owner, key, "mean");
  const double rms = number(owner, key, "rms");
  const double p95 = number(owner, key, "p95");
  const double max = number(owner, key, "max");
  assert_true(mean >= 0 && mean <= rms && rms <= max && mean <= p95 && p95 <= max);
}

static double length_of(const json_t *direction) {
  assert_int_equal(json_array_size(direction), 3);
  double square = 0;
  for (size_t i = 0; i < 3; ++i) {
    const double x = json_number_value(json_array_get(direction, i));
    square += x * x;
  }
  return sqrt(square);
}

static void check_posture(const json_t *posture) {
  double gain = 0;
  double volume = 0;
  const json_t *slabs = json_object_get(posture, "slabs");
  check_statistics(posture, "displacement_mm");
  assert_true(fabs(length_of(json_object_get(posture, "gravity")) - 1) < 1e-8);
  assert_true(fabs(number(posture, "gain_ml", "left") + number(posture, "gain_ml", "right") - 400) <
              1e-6);
  assert_int_equal(json_array_size(slabs), 10);
  for (size_t s = 0; s < 10; ++s) {
    const json_t *slab = json_array_get(slabs, s);
    gain += json_number_value(json_object_get(slab, "gain_ml"));
    volume += json_number_value(json_object_get(slab, "volume_ml"));
  }
  assert_true(fabs(gain - 400) < 0.05); /* tolerance in mL, for positions rounded to float */
  /* The volumes of the ten slabs add up to the volume of both lungs. */
  const json_t *held = json_object_get(posture, "volume_ml");
  const double left = number(held, "left", "value");
  assert_true(fabs(volume - left - number(held, "right", "value")) < 0.05);
  /* The volume at rest is assumed; its range, one standard deviation of 0.08 / 0.48 of its
   * logarithm to either side, is longer upwards. */
  assert_string_equal(json_string_value(json_object_get(json_object_get(held, "left"), "source")),
                      "assumed");
  assert_true(fabs(log(number(held, "left", "high") / left) - 1.0 / 6.0) < 1e-4);
  assert_true(fabs(log(left / number(held, "left", "low")) - 1.0 / 6.0) < 1e-4);
  const json_t *top = json_array_get(slabs, 1);
  const json_t *low = json_array_get(slabs, 8);
  assert_true(json_number_value(json_object_get(low, "expansion")) >
              1.1 * json_number_value(json_object_get(top, "expansion")));
}

TEST(test_compare_json_has_stated_values) {
  EXPECT(0, "{",
         "compare lungs.safetensors --postures supine,prone,supine+15,0.6:0:-0.8 "
         "--volume rest --breath 400mL --json");
  json_error_t problem;
  json_t *root = json_loads(printed, 0, &problem);
  assert_non_null(root);
  const json_t *postures = json_object_get(root, "postures");
  assert_int_equal(json_array_size(postures), 4);
  for (size_t i = 0; i < 4; ++i) {
    check_posture(json_array_get(postures, i));
  }
  const json_t *tilted = json_object_get(json_array_get(postures, 2), "gravity");
  assert_true(fabs(json_number_value(json_array_get(tilted, 2)) - 0.258819045) < 1e-8);
  json_decref(root);
}

/* Assert that elements are closed in order, attributes are quoted, and no '<' or '&' is left
 * unescaped. */
static void check_markup(const char *text) {
  char open[64][16];
  size_t depth = 0;
  for (const char *at = text; *at != '\0'; ++at) {
    if (*at == '&') {
      assert_true(strcspn(at, ";") < 8);
    }
    if (*at != '<') {
      continue;
    }
    const char *name = at + 1 + (at[1] == '/');
    const size_t length = strcspn(name, " />\n");
    const char *end = name + length;
    for (bool quoted = false; *end != '\0' && (*end != '>' || quoted); ++end) {
      quoted ^= *end == '"';
      assert_true(*end != '<');
    }
    assert_true(*end == '>' && length > 0 && length < sizeof open[0]);
    if (at[1] == '/') {
      assert_true(depth > 0 && strlen(open[depth - 1]) == length &&
                  strncmp(open[depth - 1], name, length) == 0);
      --depth;
    } else if (at[1] != '!' && end[-1] != '/') {
      assert_true(depth < sizeof open / sizeof *open);
      (void)snprintf(open[depth++], sizeof open[0], "%.*s", (int)length, name);
    }
    at = end;
  }
  assert_int_equal(depth, 0);
}

static void check_report(const char *name) {
  size_t size = 0;
  char *text = test_read(in_folder(name), &size);
  assert_int_equal(strlen(text), size);
  check_markup(text);
  assert_null(strstr(text, "http:"));
  assert_null(strstr(text, "https:"));
  assert_null(strstr(text, "<script"));
  assert_null(strstr(text, "<link"));
  assert_null(strstr(text, "url("));
  for (const char *at = strstr(text, "src="); at != NULL; at = strstr(at + 1, "src=")) {
    assert_true(strncmp(at, "src=\"data:", 10) == 0);
  }
  assert_says(text, "prefers-color-scheme:dark");
  assert_says(text, "@media print");
  assert_int_equal(count_words(text, "<polyline"), 3);
  assert_says(text, "expected error");
  free(text);
}

TEST(test_compare_scan_with_itself_all_zero) {
  EXPECT(0, "  supine         0    0     0        0",
         "compare lungs.safetensors --volume scan --from scan -o still.html");
  assert_null(strstr(printed, "nan"));
  size_t size = 0;
  char *text = test_read(in_folder("still.html"), &size);
  check_markup(text);
  assert_null(strstr(text, "nan,"));
  assert_null(strstr(text, "\"nan"));
  free(text);
}

TEST(test_report_html_well_formed_and_self_contained) {
  EXPECT(0, "", "compare lungs.safetensors --postures supine,prone,left -o report.html");
  check_report("report.html");
}

TEST(test_compare_misuse_usage_error) {
  EXPECT(1, "did you mean 'prone'", "compare lungs.safetensors --postures supine,pron");
  EXPECT(1, "not all 0", "compare lungs.safetensors --postures 0:0:0");
  EXPECT(1, "three numbers", "compare lungs.safetensors --postures 1:2");
  EXPECT(1, "three numbers", "compare lungs.safetensors --postures 1:nan:2");
  EXPECT(1, "no posture ''", "compare lungs.safetensors --postures supine,,prone");
  EXPECT(1, "give rest, full or scan", "compare lungs.safetensors --volume much");
  EXPECT(0, "\"has_volume\": false", "info " OPEN " --json");
  EXPECT(2, "surface is open", "compare " OPEN);
  EXPECT(2, "surface is open", "breathe " OPEN " --posture left -o a.vtp");
  EXPECT(2, "surface is open", "export " OPEN " -o a.html");
  EXPECT(2, "surface is open", "stream " OPEN " --listen 0 --seconds 0.1");
  EXPECT(2, "close the mesh", "deform " OPEN " --posture prone -o a.ply");
  EXPECT(1, ".html", "compare lungs.safetensors -o report.pdf");
  EXPECT(1, "one basis file", "compare");
  EXPECT(1, "did you mean '--postures'", "compare lungs.safetensors --posturse supine");
  EXPECT(2, "nothere", "compare nothere.safetensors");
  EXPECT(4, "nowhere", "compare lungs.safetensors -o nowhere/report.html");
  EXPECT(5, "volume", "compare lungs.safetensors --volume scan-1e9");
  EXPECT(0, "Usage", "compare --help");
}

TEST(test_render_misuse_usage_error) {
  EXPECT(1, ".png", "render lungs.safetensors --posture prone");
  EXPECT(1, ".png", "render lungs.safetensors --posture prone -o lung.gif");
  EXPECT(1, "the posture is missing", "render lungs.safetensors -o lung.png");
  EXPECT(1, "did you mean 'posterior'", "render lungs.safetensors --view posteror -o a.png");
  EXPECT(1, "WIDTHxHEIGHT", "render lungs.safetensors --size 100 -o a.png");
  EXPECT(1, "WIDTHxHEIGHT", "render lungs.safetensors --size 0x100 -o a.png");
  EXPECT(1, "WIDTHxHEIGHT", "render lungs.safetensors --size 100x100000 -o a.png");
  EXPECT(
      1, "at most 8",
      "render lungs.safetensors --posture left,left,left,left,left,left,left,left,left -o a.png");
  EXPECT(2, "surface is open", "render " OPEN " --posture left -o a.png");
  EXPECT(2, "nothere", "render nothere.safetensors --posture left -o a.png");
  EXPECT(1, "two postures", "render lungs.safetensors --posture left -o a.webp");
  EXPECT(1, ".webp", "render lungs.safetensors --turn supine:left:1s -o a.png");
  EXPECT(1, "not both", "render lungs.safetensors --turn supine:left:1s --posture left -o a.webp");
  EXPECT(1, "FROM:TO:SECONDS", "render lungs.safetensors --turn supine:left -o a.webp");
  EXPECT(1, "above 0 s", "render lungs.safetensors --turn supine:left:0s -o a.webp");
  EXPECT(1, "frames", "render lungs.safetensors --turn supine:left:1e9s -o a.webp");
  EXPECT(1, "shell or displacement", "render lungs.safetensors --posture left --look x -o a.png");
  EXPECT(0, "Usage", "render --help");
  assert_int_equal(count_files("a.png"), 0);
}

/* Run supine render with these arguments. Return false, and print why, if drawing is not
 * available. */
SUPINE_PRINTF(1, 2)
static bool render(const char *format, ...) {
  char arguments[512];
  va_list list;
  va_start(list, format);
  (void)vsnprintf(arguments, sizeof arguments, format, list);
  va_end(list);
  const int code = run("render %s", arguments);
  if (code == 3) {
    print_message("skipped: %s", printed);
    return false;
  }
  expect(0, " pixels", code);
  return true;
}

/* Return the mean difference of colour values, 0 to 255, between two pictures of equal size. */
static double png_difference(const char *a, const char *b) {
  cairo_surface_t *image[2] = {cairo_image_surface_create_from_png(a),
                               cairo_image_surface_create_from_png(b)};
  for (int i = 0; i < 2; ++i) {
    assert_int_equal(cairo_surface_status(image[i]), CAIRO_STATUS_SUCCESS);
  }
  const int width = cairo_image_surface_get_width(image[0]);
  const int height = cairo_image_surface_get_height(image[0]);
  assert_int_equal(width, cairo_image_surface_get_width(image[1]));
  assert_int_equal(height, cairo_image_surface_get_height(image[1]));
  double sum = 0;
  for (int y = 0; y < height; ++y) {
    const unsigned char *row[2];
    for (int i = 0; i < 2; ++i) {
      row[i] = cairo_image_surface_get_data(image[i]) +
               (ptrdiff_t)y * cairo_image_surface_get_stride(image[i]);
    }
    for (int x = 0; x < 4 * width; ++x) {
      sum += x % 4 == 3 ? 0 : abs((int)row[0][x] - (int)row[1][x]);
    }
  }
  cairo_surface_destroy(image[0]);
  cairo_surface_destroy(image[1]);
  return sum / (3.0 * width * height);
}

/* The tolerance allows for other versions of fonts, but not for another posture. */
TEST(test_render_same_as_golden_picture) {
  static const double tolerance = 1.5;
  if (!render("lungs.safetensors --posture prone --view anterior --look displacement --largest 40 "
              "--size 240x180 -o golden.png")) {
    skip();
  }
  const double same = png_difference(in_folder("golden.png"), SUPINE_GOLDEN "/render_prone.png");
  assert_true(
      render("lungs.safetensors --posture left --view anterior --look displacement --largest 40 "
             "--size 240x180 -o other.png"));
  const double other = png_difference(in_folder("other.png"), SUPINE_GOLDEN "/render_prone.png");
  print_message("difference from the golden picture: prone %.3f, left side %.3f of 255\n", same,
                other);
  assert_true(same < tolerance);
  assert_true(other > 2 * tolerance);
}

/* Return the number of dark pixels in the line of text below the subtitle of panel 0 or 1, in a
 * picture of two panels and the default size. */
static int dark_pixels(const char *path, int panel) {
  cairo_surface_t *image = cairo_image_surface_create_from_png(path);
  assert_int_equal(cairo_surface_status(image), CAIRO_STATUS_SUCCESS);
  int count = 0;
  for (int y = 93; y < 113; ++y) {
    const unsigned char *row =
        cairo_image_surface_get_data(image) + (ptrdiff_t)y * cairo_image_surface_get_stride(image);
    for (int x = 440 * panel + 160; x < 440 * panel + 400; ++x) {
      count += row[4 * x] < 160;
    }
  }
  cairo_surface_destroy(image);
  return count;
}

/* No error is expected where nothing moves. */
TEST(test_render_moved_lungs_state_expected_error) {
  if (!render("lungs.safetensors --posture supine,prone --look displacement -o stated.png")) {
    skip();
  }
  assert_int_equal(dark_pixels(in_folder("stated.png"), 0), 0);
  assert_true(dark_pixels(in_folder("stated.png"), 1) > 100);
}

/* Find the arrow of gravity on the ball in the upper left of a picture: set `place` to the mean
 * position of its orange pixels relative to the centre of the ball, in pixels. */
static void find_arrow(const char *path, double place[2]) {
  cairo_surface_t *image = cairo_image_surface_create_from_png(path);
  assert_int_equal(cairo_surface_status(image), CAIRO_STATUS_SUCCESS);
  const int width = cairo_image_surface_get_width(image);
  const int stride = cairo_image_surface_get_stride(image);
  double sum[2] = {0, 0};
  double count = 0;
  int low[2] = {width, width};
  int high[2] = {0, 0};
  /* Search for the arrow only in the ball, left of the title of the picture. */
  for (int y = width / 24; y < width / 5; ++y) {
    const unsigned char *row = cairo_image_surface_get_data(image) + (ptrdiff_t)y * stride;
    for (int x = width / 24; x < width / 5; ++x) {
      const unsigned char *pixel = row + (ptrdiff_t)4 * x; /* bytes: blue, green, red */
      const int at[2] = {x, y};
      const bool orange = pixel[2] > 180 && pixel[1] < 140 && pixel[0] < 110;
      for (int k = 0; k < 2; ++k) {
        sum[k] += orange ? at[k] : 0;
        low[k] = pixel[1] < 245 && at[k] < low[k] ? at[k] : low[k];
        high[k] = pixel[1] < 245 && at[k] > high[k] ? at[k] : high[k];
      }
      count += orange;
    }
  }
  cairo_surface_destroy(image);
  assert_true(count > 10);
  for (int k = 0; k < 2; ++k) {
    place[k] = sum[k] / count - 0.5 * (low[k] + high[k]);
  }
}

/* Seen from the front, the left lung is on the right and the feet are below. If the patient is
 * supine or prone, gravity is along the line of sight. */
TEST(test_render_arrow_points_along_gravity) {
  static const struct {
    const char *posture;
    int toward[2]; /* direction of the arrow: to the right, downwards */
  } cases[] = {{"supine", {0, 0}}, {"prone", {0, 0}},   {"left", {1, 0}},
               {"right", {-1, 0}}, {"upright", {0, 1}}, {"inverted", {0, -1}}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    double place[2];
    if (!render("lungs.safetensors --look displacement --view anterior --posture %s --size 480x360 "
                "-o arrow.png",
                cases[i].posture)) {
      skip();
    }
    find_arrow(in_folder("arrow.png"), place);
    print_message("%s: arrow %.1f right, %.1f down\n", cases[i].posture, place[0], place[1]);
    for (int k = 0; k < 2; ++k) {
      assert_true(cases[i].toward[k] == 0 ? fabs(place[k]) < 1.5
                                          : cases[i].toward[k] * place[k] > 4.0);
    }
  }
}

/* A picture shows even a single point inside the lungs. */
TEST(test_render_one_point_inside_visible) {
  test_write(in_folder("one.csv"), "name,x,y,z\nnodule,-80,-120,-90\n");
  EXPECT(0, "", "embed lungs.safetensors one.csv -o one.safetensors");
  for (int i = 0; i < 2; ++i) {
    if (!render("lungs.safetensors %s --posture supine --size 240x180 -o inside%d.png",
                i == 0 ? "" : "--inside one.safetensors", i)) {
      skip();
    }
  }
  assert_true(png_difference(in_folder("inside0.png"), in_folder("inside1.png")) > 0.02);
}

/* Return a picture that `render` made. */
static cairo_surface_t *picture_of(const char *name) {
  cairo_surface_t *image = cairo_image_surface_create_from_png(in_folder(name));
  assert_int_equal(cairo_surface_status(image), CAIRO_STATUS_SUCCESS);
  return image;
}

/* Count the pixels whose red, green and blue are within the limits. */
static size_t count_pixels(cairo_surface_t *image, const int low[3], const int high[3]) {
  size_t count = 0;
  for (int y = 0; y < cairo_image_surface_get_height(image); ++y) {
    const unsigned char *row =
        cairo_image_surface_get_data(image) + (ptrdiff_t)y * cairo_image_surface_get_stride(image);
    for (int x = 0; x < cairo_image_surface_get_width(image); ++x) {
      const unsigned char *bgr = row + 4 * (ptrdiff_t)x;
      bool within = true;
      for (int k = 0; k < 3; ++k) {
        within = within && bgr[2 - k] >= low[k] && bgr[2 - k] <= high[k];
      }
      count += within;
    }
  }
  return count;
}

/* Count the pixels whose red is at least 12 above their blue, or at least 60 below. */
static size_t count_tinted(cairo_surface_t *image, bool red) {
  size_t count = 0;
  for (int y = 0; y < cairo_image_surface_get_height(image); ++y) {
    const unsigned char *row =
        cairo_image_surface_get_data(image) + (ptrdiff_t)y * cairo_image_surface_get_stride(image);
    for (int x = 0; x < cairo_image_surface_get_width(image); ++x) {
      const int excess = row[4 * x + 2] - row[4 * x];
      count += red ? excess >= 12 : excess <= -60;
    }
  }
  return count;
}

/* The shell is pink; in the other look, lungs that have not moved are violet. */
TEST(test_render_look_shell_is_pink_displacement_is_coloured) {
  size_t red[2];
  size_t blue[2];
  for (int i = 0; i < 2; ++i) {
    if (!render("lungs.safetensors --posture supine --size 240x240 --look %s -o look.png",
                i == 0 ? "shell" : "displacement")) {
      skip();
    }
    cairo_surface_t *image = picture_of("look.png");
    red[i] = count_tinted(image, true);
    blue[i] = count_tinted(image, false);
    cairo_surface_destroy(image);
  }
  print_message("pink %zu and %zu, violet %zu and %zu pixels\n", red[0], red[1], blue[0], blue[1]);
  assert_true(red[0] > 2 * red[1] + 1000);
  assert_true(blue[1] > 2 * blue[0] + 1000);
  EXPECT(1, "give --look displacement",
         "render lungs.safetensors --posture supine --largest 5 -o largest.png");
}

/* The selected target is orange, with a ring of its expected error unless it has not moved; airways,
 * which are longer than a target, are blue. */
TEST(test_render_selected_target_orange_ringed_when_moved_anatomy_blue) {
  static const int orange[2][3] = {{170, 60, 0}, {255, 170, 110}};
  static const int blue[2][3] = {{40, 70, 110}, {130, 170, 255}};
  static const int ring[2][3] = {{225, 155, 95}, {255, 190, 130}};
  size_t count[2][3];
  test_write(in_folder("target.csv"), "name,x,y,z\nnodule,-90,-120,-150\n");
  test_write(in_folder("airway.obj"), "v -90 -120 -60\nv -90 -120 -180\nv -70 -120 -180\n"
                                      "v -90 -100 -180\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n");
  EXPECT(0, "", "embed lungs.safetensors target.csv airway.obj -o both.safetensors");
  for (size_t i = 0; i < 2; ++i) {
    if (!render("lungs.safetensors --inside both.safetensors --posture %s --size 440x480 "
                "-o target.png",
                i == 0 ? "supine" : "left")) {
      skip();
    }
    cairo_surface_t *image = picture_of("target.png");
    count[i][0] = count_pixels(image, orange[0], orange[1]);
    count[i][1] = count_pixels(image, blue[0], blue[1]);
    count[i][2] = count_pixels(image, ring[0], ring[1]);
    print_message("orange %zu, blue %zu, ring %zu pixels\n", count[i][0], count[i][1], count[i][2]);
    assert_true(count[i][0] > 75 && count[i][1] > 150);
    cairo_surface_destroy(image);
  }
  assert_true(count[1][2] > count[0][2] + 60);
}

/* A picture names eight targets at most, and says how many more there are. */
TEST(test_render_thirty_targets_eight_named) {
  char text[2048] = "name,x,y,z\n";
  size_t used = strlen(text);
  for (int i = 0; i < 30; ++i) {
    used += (size_t)snprintf(text + used, sizeof text - used, "n%d,%d,%d,%d\n", i,
                             (i % 2 == 0 ? 1 : -1) * (70 + i), -100 - 2 * i, -80 - 3 * i);
  }
  test_write(in_folder("thirty.csv"), text);
  EXPECT(0, "", "embed lungs.safetensors thirty.csv -o thirty.safetensors");
  if (!render("lungs.safetensors --inside thirty.safetensors --posture prone -o thirty.pdf")) {
    skip();
  }
  assert_int_equal(setenv("PICTURE", in_folder("thirty"), 1), 0);
  if (system("pdftotext \"$PICTURE.pdf\" \"$PICTURE.txt\" 2>/dev/null") != 0) {
    print_message("pdftotext is not installed\n");
    skip();
  }
  size_t size = 0;
  char *words = test_read(in_folder("thirty.txt"), &size);
  char joined[4096];
  size_t length = 0; /* pdftotext may set spaces between letters */
  for (const char *at = words; *at != '\0' && length + 1 < sizeof joined; ++at) {
    if (*at != ' ') {
      joined[length++] = *at;
    }
  }
  joined[length] = '\0';
  assert_says(joined, "and22moretargets");
  free(words);
}

/* `compare` lists airways and open surfaces apart from targets, with their volume and mean motion,
 * in text, JSON and the report, which tells of the first target, not of the first part. */
TEST(test_compare_anatomy_listed_apart_from_targets) {
  test_write(in_folder("target.csv"), "name,x,y,z\nnodule,-90,-120,-150\n");
  test_write(in_folder("airway.obj"), "v -90 -120 -60\nv -90 -120 -180\nv -70 -120 -180\n"
                                      "v -90 -100 -180\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n");
  test_write(in_folder("fissure.obj"), "v -90 -120 -90\nv -90 -140 -90\nv -70 -120 -90\nf 1 2 3\n");
  EXPECT(0, "", "embed lungs.safetensors airway.obj fissure.obj target.csv -o parts.safetensors");
  EXPECT(0, "\nanatomy\n", "compare parts.safetensors --postures supine,prone");
  static const char *const commands[] = {
      "compare parts.safetensors --postures supine,prone --json",
      "compare lungs.safetensors --inside parts.safetensors --postures prone --json"};
  for (size_t i = 0; i < 2; ++i) {
    EXPECT(0, "{", "%s", commands[i]);
    json_t *root = json_loads(printed, 0, NULL);
    assert_non_null(root);
    json_t *lists = i == 0 ? root : json_array_get(json_object_get(root, "postures"), 0);
    json_t *targets = json_object_get(lists, "targets");
    json_t *anatomy = json_object_get(lists, "anatomy");
    const json_t *airway = json_array_get(anatomy, 0);
    const json_t *fissure = json_array_get(anatomy, 1);
    assert_int_equal(json_array_size(anatomy), 2);
    assert_string_equal(json_string_value(json_object_get(airway, "name")), "airway");
    assert_true(json_number_value(json_object_get(airway, "volume_before_ml")) > 1.0);
    assert_true(json_number_value(json_object_get(airway, "mm")) > 1.0);
    assert_string_equal(json_string_value(json_object_get(fissure, "name")), "fissure");
    assert_true(json_is_null(json_object_get(fissure, "volume_after_ml")));
    const json_t *nodule = json_array_get(targets, 0);
    assert_string_equal(json_string_value(json_object_get(nodule, "name")), "nodule");
    json_decref(root);
  }
  EXPECT(0, "\nanatomy\n",
         "compare lungs.safetensors --inside parts.safetensors --postures supine,prone "
         "-o anatomy.html");
  size_t size = 0;
  char *text = test_read(in_folder("anatomy.html"), &size);
  check_markup(text);
  const char *targets = strstr(text, "<th scope=\"col\">target, mm</th>");
  const char *anatomy = strstr(text, "<h2>Lobes and other large structures</h2>");
  assert_non_null(targets);
  assert_non_null(anatomy);
  assert_says(text, "Prone, nodule");
  assert_true(strstr(targets, "<th scope=\"row\">nodule</th>") < anatomy);
  assert_true(strstr(text, "<th scope=\"row\">airway</th>") > anatomy);
  assert_true(strstr(text, "<th scope=\"row\">fissure</th>") > anatomy);
  free(text);
}

/* `deform` names the part whose surface folds, here between a full lung and one at rest. */
TEST(test_deform_folded_part_named) {
  test_write(in_folder("bridge.obj"), "v -2 -150 -60\nv 2 -150 -60\nv -2 -146 -60\n"
                                      "v -2 -150 -56\nf 1 3 2\nf 1 4 3\nf 1 2 4\nf 2 3 4\n");
  test_write(in_folder("body.obj"), "v -90 -120 -100\nv -80 -120 -100\nv -90 -110 -100\n"
                                    "v -90 -120 -90\nf 1 3 2\nf 1 4 3\nf 1 2 4\nf 2 3 4\n");
  EXPECT(0, "", "embed lungs.safetensors bridge.obj body.obj -o bridge.safetensors");
  EXPECT(0, "warning: bridge: its surface folds: ",
         "deform bridge.safetensors --posture left --volume left=rest,right=full --allow-folds "
         "-o bridge.ply");
  assert_null(strstr(printed, "body:"));
}

/* Pictures with names of any script and length are whole, in every format. Cairo would draw nothing
 * after a name that is cut inside a character. */
TEST(test_render_long_names_of_any_script_picture_whole) {
  static const char *const name[] = {
      "a name of 134 characters, which is far longer than there is room for in any picture, and "
      "goes on, and on, until nobody wants to read it",
      "\u0639\u0642\u062F\u0629 \u0631\u0626\u0648\u064A\u0629 "
      "\u0639\u0642\u062F\u0629 \u0631\u0626\u0648\u064A\u0629 "
      "\u0639\u0642\u062F\u0629 \u0631\u0626\u0648\u064A\u0629 "
      "\u0639\u0642\u062F\u0629 \u0631\u0626\u0648\u064A\u0629 "
      "\u0639\u0642\u062F\u0629 \u0631\u0626\u0648\u064A\u0629 "
      "\u0639\u0642\u062F\u0629 \u0631\u0626\u0648\u064A\u0629 "
      "\u0639\u0642\u062F\u0629 \u0631\u0626\u0648\u064A\u0629 "
      "\u0639\u0642\u062F\u0629 \u0631\u0626\u0648\u064A\u0629 "
      "\u0639\u0642\u062F\u0629 \u0631\u0626\u0648\u064A\u0629 "
      "\u0639\u0642\u062F\u0629 \u0631\u0626\u0648\u064A\u0629 "
      "\u0639\u0642\u062F\u0629 \u0631\u0626\u0648\u064A\u0629 "
      "\u0639\u0642\u062F\u0629 \u0631\u0626\u0648\u064A\u0629 "
      "\u0639\u0642\u062F\u0629",
      "29 letters and then an uml\u00E4\u00E4\u00E4\u00E4\u00E4"};
  for (size_t i = 0; i < sizeof name / sizeof *name; ++i) {
    static const char *const ending[] = {"png", "pdf", "svg"};
    char csv[800];
    (void)snprintf(csv, sizeof csv, "name,x,y,z\n\"%s\",-80,-120,-90\n", name[i]);
    test_write(in_folder("long.csv"), csv);
    EXPECT(0, "", "embed lungs.safetensors long.csv -o long.safetensors");
    for (size_t k = 0; k < sizeof ending / sizeof *ending; ++k) {
      if (!render("lungs.safetensors --inside long.safetensors --posture supine,left "
                  "--size 640x360 -o long.%s",
                  ending[k])) {
        skip();
      }
    }
    /* The caption of the right panel is drawn after the names in the left one. */
    cairo_surface_t *image = picture_of("long.png");
    const unsigned char *row =
        cairo_image_surface_get_data(image) + (ptrdiff_t)18 * cairo_image_surface_get_stride(image);
    size_t light = 0;
    for (int x = 330; x < 640; ++x) {
      light += row[4 * x] > 100;
    }
    assert_true(light > 5);
    cairo_surface_destroy(image);
  }
}

/* PDF and SVG have the format that the name promises, and no date. */
TEST(test_render_pdf_and_svg_have_their_format) {
  static const char *const begin[2][2] = {{"page.pdf", "%PDF-1."}, {"page.svg", "<?xml"}};
  for (int i = 0; i < 2; ++i) {
    size_t size = 0;
    if (!render("lungs.safetensors --posture supine,prone --look displacement -o %s",
                begin[i][0])) {
      skip();
    }
    char *bytes = test_read(in_folder(begin[i][0]), &size);
    assert_true(size > 10000 && strncmp(bytes, begin[i][1], strlen(begin[i][1])) == 0);
    assert_null(memmem(bytes, size, "CreationDate", 12)); /* the bytes do not depend on the time */
    free(bytes);
  }
}

/* Names of scripts that only pango can shape are told of once where it cannot be loaded. */
TEST(test_render_without_pango_warns_once_of_names_it_would_shape) {
  static const char *const name[] = {"n\u00F3dulo", "\u05D2\u05D9\u05D3\u05D5\u05DC"};
  test_write(in_folder("libpango-1.0.so.0"), ""); /* no library */
  for (size_t i = 0; i < 2; ++i) {
    char csv[128];
    (void)snprintf(csv, sizeof csv, "name,x,y,z\n%s,-80,-120,-90\nb%s,80,-120,-90\n", name[i],
                   name[i]);
    test_write(in_folder("names.csv"), csv);
    EXPECT(0, "", "embed lungs.safetensors names.csv -o names.safetensors");
    assert_int_equal(setenv("LD_LIBRARY_PATH", folder, 1), 0);
    const bool drawn = render("lungs.safetensors --inside names.safetensors "
                              "--posture supine,left --size 300x240 -o names.png");
    assert_int_equal(unsetenv("LD_LIBRARY_PATH"), 0);
    if (!drawn) {
      skip();
    }
    assert_int_equal(count_words(printed, "pango is not installed"), i);
  }
}

/* Return frame number `wanted` of an animation as RGBA (malloc). Set `time` to the end of this
 * frame, ms, and `info` to the properties of the animation. */
static unsigned char *read_frame(const char *name, unsigned wanted, WebPAnimInfo *info, int *time) {
  size_t size = 0;
  char *bytes = test_read(in_folder(name), &size);
  const WebPData data = {(const unsigned char *)bytes, size};
  WebPAnimDecoder *decoder = WebPAnimDecoderNew(&data, NULL);
  assert_non_null(decoder);
  assert_true(WebPAnimDecoderGetInfo(decoder, info));
  const size_t area = (size_t)info->canvas_width * info->canvas_height;
  unsigned char *copy = malloc(4 * area);
  unsigned char *frame = NULL;
  assert_non_null(copy);
  for (unsigned i = 0; i <= wanted; ++i) {
    assert_true(WebPAnimDecoderGetNext(decoder, &frame, time));
  }
  memcpy(copy, frame, 4 * area);
  WebPAnimDecoderDelete(decoder);
  free(bytes);
  return copy;
}

/* Return the mean difference of colour values, 0 to 255, between two frames. */
static double frame_difference(const unsigned char *a, const unsigned char *b, size_t area) {
  double sum = 0;
  for (size_t i = 0; i < 4 * area; ++i) {
    sum += i % 4 == 3 ? 0 : abs((int)a[i] - (int)b[i]);
  }
  return sum / (3.0 * (double)area);
}

/* Successive frames differ, and the last is shown for a second. The animation of the reverse turn
 * begins with the last frame of this one. */
TEST(test_render_turn_animates_between_postures) {
  enum { FRAMES = 7, WIDTH = 240, HEIGHT = 180 };
  /* Largest mean difference of colour values, 0 to 255, between frames of one posture. They differ
   * because the codec is lossy and because the angle is printed. */
  static const double loss = 2.5;
  WebPAnimInfo info;
  int time = 0;
  if (!render("lungs.safetensors --turn supine:left:0.4s --size 240x180 -o there.webp")) {
    skip();
  }
  assert_true(render("lungs.safetensors --turn left:supine:0.4s --size 240x180 -o back.webp"));
  unsigned char *frame[FRAMES];
  for (unsigned i = 0; i < FRAMES; ++i) {
    frame[i] = read_frame("there.webp", i, &info, &time);
    assert_int_equal(time, i + 1 < FRAMES ? 66 * ((int)i + 1) : 66 * (FRAMES - 1) + 1000);
    assert_true(i == 0 || frame_difference(frame[i - 1], frame[i], WIDTH * HEIGHT) > 0.1);
  }
  assert_int_equal(info.canvas_width, WIDTH);
  assert_int_equal(info.canvas_height, HEIGHT);
  assert_int_equal(info.frame_count, FRAMES);
  assert_int_equal(info.loop_count, 0); /* 0: repeats for ever */
  unsigned char *first = read_frame("back.webp", 0, &info, &time);
  unsigned char *last = read_frame("back.webp", FRAMES - 1, &info, &time);
  assert_true(frame_difference(frame[0], last, WIDTH * HEIGHT) < loss);
  assert_true(frame_difference(frame[FRAMES - 1], first, WIDTH * HEIGHT) < loss);
  assert_true(frame_difference(frame[0], first, WIDTH * HEIGHT) > 2 * loss);
  for (unsigned i = 0; i < FRAMES; ++i) {
    free(frame[i]);
  }
  free(first);
  free(last);
  EXPECT(1, "at most 16383",
         "render lungs.safetensors --turn supine:left:1s --size 16384x200 -o "
         "wide.webp");
  EXPECT(4, "cannot write", "render lungs.safetensors --turn supine:left:1s -o nowhere/a.webp");
  EXPECT(2, "nothere",
         "render lungs.safetensors --turn supine:left:1s -o a.webp --inside "
         "nothere.safetensors");
}

/* Read red, green and blue of the upper left corner of a picture, 0 to 255. */
static void corner_of(const char *name, int rgb[3]) {
  cairo_surface_t *image = cairo_image_surface_create_from_png(in_folder(name));
  uint32_t pixel;
  assert_int_equal(cairo_surface_status(image), CAIRO_STATUS_SUCCESS);
  memcpy(&pixel, cairo_image_surface_get_data(image), sizeof pixel);
  for (int i = 0; i < 3; ++i) {
    rgb[i] = (int)(pixel >> (16 - 8 * i) & 255U);
  }
  cairo_surface_destroy(image);
}

/* Lungs in the colours of values are for paper; the shell, which is bright at its rim, needs a dark
 * ground. */
TEST(test_render_background_white_for_colours_dark_for_shell) {
  static const int limits[2][2] = {{240, 255}, {0, 40}};
  for (int i = 0; i < 2; ++i) {
    int rgb[3];
    if (!render("lungs.safetensors --posture supine --size 260x380 --look %s -o ground.png",
                i == 0 ? "displacement" : "shell")) {
      skip();
    }
    corner_of("ground.png", rgb);
    for (int k = 0; k < 3; ++k) {
      assert_in_range(rgb[k], limits[i][0], limits[i][1]);
    }
  }
}

/* A film of postures turns through them and stops at each for a second. */
TEST(test_render_film_stops_at_each_posture) {
  WebPAnimInfo info;
  int time = 0;
  if (!render("lungs.safetensors --posture supine,left,prone --size 200x180 -o film.webp")) {
    skip();
  }
  free(read_frame("film.webp", 30, &info, &time));
  assert_int_equal(info.frame_count, 31); /* the first, and 15 for each turn of 1 s */
  assert_int_equal(time, 29 * 66 + 2 * 1000);
  EXPECT(1, "two postures", "render lungs.safetensors --posture supine -o one.webp");
  EXPECT(1, "one volume", "render lungs.safetensors --posture supine,prone:full -o two.webp");
}

/* A film of a breath ends with the frame it begins with, is most different at the peak, and is refused
 * as 'breathe' refuses the same breath. */
TEST(test_render_breath_film_ends_as_it_begins) {
  enum { FRAMES = 76, PEAK = 25, AREA = 120 * 150 }; /* a breath of 5 s, inhaled in a third of it */
  static const char *const doors[] = {"breathe lungs.safetensors -o a.vtp --tidal",
                                      "render lungs.safetensors -o a.webp --breath"};
  WebPAnimInfo info;
  int time = 0;
  for (size_t i = 0; i < sizeof doors / sizeof *doors; ++i) {
    EXPECT(1, "inhale limb gains above", "%s 9000mL --posture left", doors[i]);
    EXPECT(1, "is no breath", "%s 0mL --posture left", doors[i]);
    EXPECT(1, "starts at rest: give --posture without a volume", "%s 500mL --posture left:rest",
           doors[i]);
  }
  EXPECT(1, "one posture", "%s 500mL --posture left,prone", doors[1]);
  EXPECT(1, "not both", "%s 500mL --turn supine:left:1s", doors[1]);
  EXPECT(1, "not both", "%s 500mL --posture left --volume rest", doors[1]);
  EXPECT(1, ".webp", "render lungs.safetensors --posture left --breath 500mL -o a.png");
  if (!render("lungs.safetensors --posture left --breath 700mL --size 120x150 -o breath.webp")) {
    skip();
  }
  unsigned char *first = read_frame("breath.webp", 0, &info, &time);
  unsigned char *peak = read_frame("breath.webp", PEAK, &info, &time);
  unsigned char *late = read_frame("breath.webp", FRAMES - 2, &info, &time);
  unsigned char *last = read_frame("breath.webp", FRAMES - 1, &info, &time);
  assert_int_equal(info.frame_count, FRAMES);
  assert_int_equal(time, FRAMES * 66);
  assert_memory_equal(first, last, (size_t)4 * AREA);
  assert_true(frame_difference(first, peak, AREA) > 2 * frame_difference(first, late, AREA));
  free(first);
  free(peak);
  free(late);
  free(last);
}

TEST(test_render_options_change_the_picture) {
  static const char *const variants[] = {
      "",
      "--view lateral",
      "--volume scan+200",
      "--volume left=rest+100,right=rest+300",
      "--from prone:rest",
      "--view anterior,posterior",
      "--view head,feet",
  };
  enum { VARIANTS = sizeof variants / sizeof *variants };
  char *png[VARIANTS];
  size_t size[VARIANTS];
  for (size_t i = 0; i < VARIANTS; ++i) {
    if (!render("lungs.safetensors --posture supine --size 260x380 %s -o v.png", variants[i])) {
      skip();
    }
    png[i] = test_read(in_folder("v.png"), &size[i]);
    for (size_t j = 0; j < i; ++j) {
      assert_true(size[i] != size[j] || memcmp(png[i], png[j], size[i]) != 0);
    }
  }
  for (size_t i = 0; i < VARIANTS; ++i) {
    free(png[i]);
  }
}

TEST(test_render_seven_postures_drawn_bad_output_refused) {
  if (!render("lungs.safetensors --posture supine,prone,left,right,upright,inverted,0.6:0:-0.8 "
              "--size 1400x260 -o row.png")) {
    skip();
  }
  assert_int_equal(run("render lungs.safetensors --posture supine --size 20x20 -o tiny.png"), 1);
  assert_int_equal(run("render lungs.safetensors --posture supine -o nowhere/a.png"), 4);
  assert_int_equal(count_files("tiny.png"), 0);
}

TEST_GROUP(setup, folder_remove)
