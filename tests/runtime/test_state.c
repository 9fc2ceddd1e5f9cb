/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test states as text: every valid form is parsed, printed and parsed again; other text is refused
 * with a message. */
#include "tests/helpers/test.h"

#include <supine/state.h>

static const supine_state unset = {.gravity = {0.0, 1.0, 0.0}};

TEST(test_state_parse_every_form_gives_posture_and_volume) {
  static const struct {
    const char *text;
    double gravity[3];
    supine_volume volume;
    const char *printed;
  } rows[] = {
      {"prone", {0, -1, 0}, {SUPINE_VOLUME_DEFAULT, 0}, "prone"},
      {"HFDR", {-1, 0, 0}, {SUPINE_VOLUME_DEFAULT, 0}, "right"},
      {"rest", {0, 1, 0}, {SUPINE_VOLUME_REST, 0}, "supine:rest"},
      {"REST+500", {0, 1, 0}, {SUPINE_VOLUME_REST, 500}, "supine:rest+500"},
      {"full-3000mL", {0, 1, 0}, {SUPINE_VOLUME_FULL, -3000}, "supine:full-3000"},
      {"scan+12.5", {0, 1, 0}, {SUPINE_VOLUME_SCAN, 12.5}, "supine:scan+12.5"},
      {"2600mL", {0, 1, 0}, {SUPINE_VOLUME_ABSOLUTE, 2600}, "supine:2600mL"},
      {"2.6L", {0, 1, 0}, {SUPINE_VOLUME_ABSOLUTE, 2600}, "supine:2600mL"},
      {"prone:FRC+0.5l", {0, -1, 0}, {SUPINE_VOLUME_REST, 500}, "prone:rest+500"},
      {"tlc", {0, 1, 0}, {SUPINE_VOLUME_FULL, 0}, "supine:full"},
      {"left:rest-100", {1, 0, 0}, {SUPINE_VOLUME_REST, -100}, "left:rest-100"},
      {"0:0:-7:full", {0, 0, -1}, {SUPINE_VOLUME_FULL, 0}, "upright:full"},
      {"0.6:0:-0.8", {0.6, 0, -0.8}, {SUPINE_VOLUME_DEFAULT, 0}, "0.6:0:-0.8"},
      {"1e200:1e200:0:1ml",
       {0.70710678118654757, 0.70710678118654757, 0},
       {SUPINE_VOLUME_ABSOLUTE, 1},
       "supine@45:1mL"},
      {"supine+15:rest",
       {0, 0.96592582628906831, 0.25881904510252074},
       {SUPINE_VOLUME_REST, 0},
       "supine+15:rest"},
      {"prone-20",
       {0, -0.93969262078590838, -0.34202014332566871},
       {SUPINE_VOLUME_DEFAULT, 0},
       "prone-20"},
      {"left+30:full", {0.86602540378443865, 0, 0.5}, {SUPINE_VOLUME_FULL, 0}, "left+30:full"},
      {"supine@-30", {-0.5, 0.86602540378443865, 0}, {SUPINE_VOLUME_DEFAULT, 0}, "supine@-30"},
      {"prone>+30:rest",
       {-0.5, -0.86602540378443865, 0},
       {SUPINE_VOLUME_REST, 0},
       "supine@-150:rest"},
      {"supine@30+90", {0, 0, 1}, {SUPINE_VOLUME_DEFAULT, 0}, "inverted"},
      {"supine@30-15",
       {0.48296291314453416, 0.83651630373780788, -0.25881904510252074},
       {SUPINE_VOLUME_DEFAULT, 0},
       "0.482962913:0.836516304:-0.258819045"},
  };
  for (size_t i = 0; i < sizeof rows / sizeof *rows; ++i) {
    supine_state parsed = unset;
    supine_state again = unset;
    char text[160];
    assert_int_equal(supine_state_parse(rows[i].text, &parsed, NULL), SUPINE_OK);
    for (int k = 0; k < 3; ++k) {
      assert_true(fabs(parsed.gravity[k] - (rows[i].gravity[k])) <= 1e-15);
    }
    assert_int_equal(parsed.volume.kind, rows[i].volume.kind);
    assert_true(fabs(parsed.volume.ml - (rows[i].volume.ml)) <= 0);
    assert_int_equal(supine_state_print(&parsed, text, sizeof text), strlen(rows[i].printed));
    assert_string_equal(text, rows[i].printed);
    assert_int_equal(supine_state_parse(text, &again, NULL), SUPINE_OK);
    for (int k = 0; k < 3; ++k) {
      assert_true(fabs(again.gravity[k] - (parsed.gravity[k])) <= 1e-9);
    }
  }
}

TEST(test_state_parse_volumes_by_lung_keeps_each_name) {
  supine_state parsed = unset;
  char text[160];
  assert_int_equal(supine_state_parse("right:left=rest+100,right=2600mL", &parsed, NULL),
                   SUPINE_OK);
  assert_int_equal(parsed.lung_count, 2);
  assert_string_equal(parsed.lungs[0].name, "left");
  assert_int_equal(parsed.lungs[1].volume.kind, SUPINE_VOLUME_ABSOLUTE);
  (void)supine_state_print(&parsed, text, sizeof text);
  assert_string_equal(text, "right:left=rest+100,right=2600mL");
  (void)supine_state_describe(&parsed, text, sizeof text);
  assert_string_equal(text, "right side, left lung at rest + 100 mL, right lung at 2600 mL");
}

TEST(test_state_parse_bare_number_refused_with_meanings) {
  static const char *const numbers[] = {"500", "+500", "supine:500", "left=500,right=rest"};
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; ++i) {
    supine_state parsed = unset;
    supine_error error;
    assert_int_equal(supine_state_parse(numbers[i], &parsed, &error), SUPINE_ERROR_ARGUMENT);
    assert_says(error.message, "rest+500");
    assert_says(error.message, "500mL");
    assert_memory_equal(&parsed, &unset, sizeof parsed);
  }
}

TEST(test_state_parse_malformed_text_refused_state_unchanged) {
  static const char *const texts[] = {
      "",
      "sup",
      "rest+",
      "rest500",
      "rest*2",
      "full+nan",
      "restful",
      "-2600mL",
      "0:0:0",
      "1:0",
      "supine+",
      "supine+x",
      "supine:",
      ":rest",
      "left=",
      "left=rest,",
      "=rest",
      "a=rest,b=rest,c=rest",
      "supine:up",
      "rest:left",
      "infmL",
      "prone:rest:rest",
      "left=rest:3",
      "scan+1e400",
      "supine+15+15",
      "supine@",
      "supine@30@30",
      "supine@200",
      "upright@30",
      "supine+91",
      "a_name_of_a_lung_that_is_much_too_long=rest",
      "a posture whose name is longer than sixty-four characters, which none is:rest"};
  for (size_t i = 0; i < sizeof texts / sizeof *texts; ++i) {
    supine_state parsed = unset;
    supine_error error = {0};
    assert_int_equal(supine_state_parse(texts[i], &parsed, &error), SUPINE_ERROR_ARGUMENT);
    assert_true(strlen(error.message) > 10);
    assert_memory_equal(&parsed, &unset, sizeof parsed);
  }
}

TEST(test_state_parse_tilt_beyond_90_refused_with_volume_as_remedy) {
  static const char *const texts[] = {"supine+500", "left-500", "supine@20+500"};
  for (size_t i = 0; i < sizeof texts / sizeof *texts; ++i) {
    supine_state parsed = unset;
    supine_error error = {0};
    assert_int_equal(supine_state_parse(texts[i], &parsed, &error), SUPINE_ERROR_ARGUMENT);
    assert_says(error.message, strchr(texts[i], '+') != NULL ? "supine:rest+500" : "rest-500");
    assert_int_equal(supine_state_parse_posture(texts[i], &parsed, &error), SUPINE_ERROR_ARGUMENT);
    assert_says(error.message, "at most 90");
  }
}

TEST(test_state_parse_foreign_word_refused_without_suggestion) {
  supine_state parsed = unset;
  supine_error error = {0};
  assert_int_equal(supine_state_parse("Bauchlage", &parsed, &error), SUPINE_ERROR_ARGUMENT);
  assert_null(strstr(error.message, "did you mean"));
  assert_says(error.message, "prone");
  assert_int_equal(supine_state_parse("sitting", &parsed, &error), SUPINE_ERROR_ARGUMENT);
  assert_says(error.message, "did you mean 'upright'");
}

TEST(test_state_join_two_volumes_refused) {
  supine_state posture = unset;
  supine_state volume = {.gravity = {0.0}};
  supine_state joined = unset;
  supine_error error = {0};
  assert_int_equal(supine_state_parse("prone", &posture, NULL), SUPINE_OK);
  assert_int_equal(supine_state_join(&posture, &volume, &joined, &error), SUPINE_OK);
  assert_int_equal(joined.volume.kind, SUPINE_VOLUME_DEFAULT);
  assert_int_equal(supine_state_parse_volume("full", &volume, NULL), SUPINE_OK);
  assert_int_equal(supine_state_join(&posture, &volume, &joined, &error), SUPINE_OK);
  assert_int_equal(joined.volume.kind, SUPINE_VOLUME_FULL);
  assert_true(joined.gravity[1] < 0);
  assert_int_equal(supine_state_parse("prone:rest", &posture, NULL), SUPINE_OK);
  joined = unset;
  assert_int_equal(supine_state_join(&posture, &volume, &joined, &error), SUPINE_ERROR_ARGUMENT);
  assert_says(error.message, "prone:rest");
  assert_says(error.message, "full");
  assert_memory_equal(&joined, &unset, sizeof joined);
  assert_int_equal(supine_state_parse_volume("left=rest,right=full", &volume, NULL), SUPINE_OK);
  assert_int_equal(supine_state_join(&posture, &volume, &joined, &error), SUPINE_ERROR_ARGUMENT);
}

TEST(test_state_print_short_buffer_cut_full_length_returned) {
  supine_state parsed = unset;
  char text[8] = "xxxxxxx";
  assert_int_equal(supine_state_parse("left:rest+500", &parsed, NULL), SUPINE_OK);
  assert_int_equal(supine_state_print(&parsed, text, 5), 13);
  assert_string_equal(text, "left");
  assert_int_equal(text[5], 'x');
  assert_int_equal(supine_state_print(&parsed, NULL, 0), 13);
}

TEST(test_state_describe_names_posture_and_volume_in_words) {
  static const char *const rows[][2] = {{"left:rest+500", "left side at rest + 500 mL"},
                                        {"prone", "prone"},
                                        {"upright:full", "upright at full inflation"},
                                        {"supine:scan-200", "supine at the scan's volume - 200 mL"},
                                        {"0.6:0:-0.8", "gravity 0.6:0:-0.8"},
                                        {"supine+15:2600mL", "supine+15 at 2600 mL"}};
  for (size_t i = 0; i < sizeof rows / sizeof *rows; ++i) {
    supine_state parsed = unset;
    char text[160];
    assert_int_equal(supine_state_parse(rows[i][0], &parsed, NULL), SUPINE_OK);
    (void)supine_state_describe(&parsed, text, sizeof text);
    assert_string_equal(text, rows[i][1]);
  }
}
