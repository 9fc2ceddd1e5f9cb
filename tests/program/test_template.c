/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test templates: names, sections, included files, escapes. */
#include "program/view/export/template.h"
#include "tests/helpers/test.h"

/* Assert the expansion of a template with JSON data; the files that it may include are fixed. */
static void check(const char *text, const char *json, const char *expected) {
  const supine_asset assets[] = {{"main.html", text, strlen(text)},
                                 {"part.html", "<i>{{title}}</i>", 16},
                                 {"style.css", "a{{title}}", 10},
                                 {0}};
  char *made = NULL;
  size_t size = 0;
  json_t *data = json_loads(json, 0, NULL);
  FILE *file = open_memstream(&made, &size);
  assert_non_null(data);
  assert_non_null(file);
  supine_template_fill(assets, data, "main.html", file);
  assert_int_equal(fclose(file), 0);
  assert_string_equal(made, expected);
  free(made);
  json_decref(data);
}

TEST(test_template_names_escaped) {
  check("x {{title}} y", "{\"title\": \"<b a=\\\"1\\\">&'\"}",
        "x &lt;b a=&quot;1&quot;&gt;&amp;' y");
  check("{{n}} {{r}}", "{\"n\": -12, \"r\": 0.1}", "-12 0.1");
  check("é {{title}}", "{\"title\": \"ü\"}", "é ü");
}

TEST(test_template_included_files_inserted) {
  check("{{part.html}}{{style.css}}", "{\"title\": \"&\"}", "<i>&amp;</i>a{{title}}");
}

TEST(test_template_unknown_name_writes_nothing) {
  check("a{{tensors}}b", "{}", "ab");
}

TEST(test_template_sections_repeat_and_nest) {
  check("{{#rows}}\n<r>{{name}}:{{#cells}}{{.}}{{unit}},{{/cells}}</r>\n{{/rows}}\nend",
        "{\"unit\": \"mm\", \"rows\": [{\"name\": \"a\", \"cells\": [1, 2]},"
        "{\"name\": \"b\", \"cells\": []}]}",
        "<r>a:1mm,2mm,</r>\n<r>b:</r>\nend");
}

TEST(test_template_sections_of_empty_value_skipped) {
  static const char text[] = "{{#a}}yes{{b}}{{/a}}.";
  check(text, "{\"a\": {\"b\": 3}}", "yes3.");
  check(text, "{\"a\": true, \"b\": 4}", "yes4.");
  check(text, "{\"a\": \"x\", \"b\": 5}", "yes5.");
  check(text, "{\"a\": 0, \"b\": 6}", "yes6.");
  check(text, "{\"a\": false}", ".");
  check(text, "{\"a\": null}", ".");
  check(text, "{\"a\": []}", ".");
  check(text, "{}", ".");
}

TEST(test_template_inner_names_hide_outer) {
  check("{{#a}}{{x}}{{#a}}{{x}}{{/a}}{{/a}}{{x}}",
        "{\"x\": 1, \"a\": {\"x\": 2, \"a\": {\"x\": 3}}}", "231");
}

/* An unclosed section or tag extends to the end of the template, and nothing is read beyond the
 * end. */
TEST(test_template_unclosed_tags_end_with_text) {
  check("{{#a}}x{{b}}", "{\"a\": [{\"b\": 1}, {\"b\": 2}]}", "x1x2");
  check("x{{a", "{\"a\": 1}", "x{{a");
  check("x{{/a}}y", "{\"a\": 1}", "xy");
}
