/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine export: exit codes, and messages that say what to do. */
#include "export_helpers.h"
#include "test.h"

static char *folder;
static char basis[256], open_surface[256], glb[256], page[256];
static char text[8192];

static int setup(void **state) {
  (void)state;
  folder = fixture_folder();
  export_basis_make(folder, "basis", 4, 3, false, true, basis);
  export_basis_make(folder, "open", 4, 3, false, false, open_surface);
  (void)snprintf(glb, sizeof glb, "%s/lungs.glb", folder);
  (void)snprintf(page, sizeof page, "%s/lungs.html", folder);
  return 0;
}

static int teardown(void **state) {
  (void)state;
  fixture_folder_remove(folder);
  return 0;
}

#define EXPECT(code, message, ...)                                                                 \
  do {                                                                                             \
    const int got = EXPORT_RUN(text, __VA_ARGS__);                                                 \
    if (got != (code) || strstr(text, message) == NULL) {                                          \
      fail_msg("exit %d, \"%s\"", got, text);                                                      \
    }                                                                                              \
  } while (0)

TEST(test_export_help_prints_usage) {
  EXPECT(0, "--plain", "--help");
  assert_non_null(strstr(text, "Examples:"));
}

TEST(test_export_usage_error_exit_1) {
  EXPECT(1, "name one basis file", "-o", glb);
  EXPECT(1, "-o FILE is missing", basis);
  EXPECT(1, "must end in .html or .glb", basis, "-o", "lungs.gltf");
  EXPECT(1, "must end in .html or .glb", basis, "-o", ".glb");
  EXPECT(1, "above 0", basis, "-o", glb, "--breath", "-3");
  EXPECT(1, "ends in .glb", basis, "-o", page, "--animate");
  EXPECT(1, "ends in .html", basis, "-o", glb, "--title", "x");
  EXPECT(1, "did you mean '--plain'", basis, "--plan");
}

TEST(test_export_input_error_exit_2) {
  EXPECT(2, "/nonexistent/b", "/nonexistent/b", "-o", glb);
  EXPECT(2, "surface is open", open_surface, "-o", glb);
}

TEST(test_export_output_error_exit_4) {
  EXPECT(4, "/nonexistent/l.glb", basis, "-o", "/nonexistent/l.glb");
  EXPECT(4, "/nonexistent/l.html", basis, "-o", "/nonexistent/l.html");
}

TEST(test_export_numerical_error_exit_5) {
  EXPECT(5, "mL", basis, "-o", glb, "--breath", "1e12");
}

TEST_GROUP(setup, teardown)
