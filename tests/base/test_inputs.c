/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test the table of checks, and that docs/inputs.md shows it. With SUPINE_GOLDEN_UPDATE=1 in the
 * environment, write the page anew. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/number.h"
#include "tests/helpers/test.h"

#include <supine/inputs.h>

static const char mark[] = "<!-- The rest of this page is written from base/inputs.c. -->\n";
enum { PAGE_MAX = 1 << 17 };

static const char *interfaces_of(unsigned interfaces) {
  static const char *const names[] = {"command", "C", "Python", "JavaScript"};
  static char text[64];
  text[0] = '\0';
  for (unsigned i = 0; i < 4; ++i) {
    if ((interfaces >> i & 1) != 0) {
      strcat(text, text[0] == '\0' ? "" : ", ");
      strcat(text, names[i]);
    }
  }
  return text;
}

/* Print a limit such as "above 90"; nothing if there is none. */
static void print_limit(FILE *file, const supine_input *input, double limit) {
  if (isnan(limit)) {
    fprintf(file, " |");
  } else {
    supine_print(file, " %s %g |", input->below ? "below" : "above", limit);
  }
}

static void print_table(FILE *file) {
  const char *group = "";
  fputs(mark, file);
  for (int id = 0; id < (int)SUPINE_INPUT_COUNT; ++id) {
    const supine_input *input = supine_input_get((supine_input_id)id);
    if (strcmp(group, input->group) != 0) {
      group = input->group;
      fprintf(file,
              "\n## %s\n\n| check | input | compared with | measured | told | refused | evidence | "
              "people, n | through |\n|---|---|---|---|---|---|---|---|---|\n",
              group);
    }
    fprintf(file, "| %s | %s | %s | %s |", input->name, input->input, input->against,
            input->measured);
    print_limit(file, input, input->told);
    print_limit(file, input, input->refused);
    fprintf(file, " %s |", input->evidence);
    if (input->n > 0) {
      fprintf(file, " %d, %d |", input->people, input->n);
    } else {
      fprintf(file, " |");
    }
    fprintf(file, " %s |\n", interfaces_of(input->interfaces));
  }
}

TEST(test_input_get_every_row_complete) {
  for (int id = 0; id < (int)SUPINE_INPUT_COUNT; ++id) {
    const supine_input *input = supine_input_get((supine_input_id)id);
    assert_non_null(input);
    assert_non_null(input->name);
    assert_non_null(input->group);
    assert_non_null(input->against);
    assert_non_null(input->measured);
    assert_non_null(input->evidence);
    assert_true(input->interfaces != 0);
    assert_false(isnan(input->told) && isnan(input->refused));
    for (int other = 0; other < id; ++other) {
      assert_string_not_equal(input->name, supine_input_get((supine_input_id)other)->name);
    }
  }
  assert_null(supine_input_get(SUPINE_INPUT_COUNT));
  assert_null(supine_input_get((supine_input_id)-1));
}

TEST(test_input_judge_beyond_limits_told_or_refused) {
  assert_int_equal(supine_input_judge(SUPINE_INPUT_TILT, 90), SUPINE_INPUT_TAKEN);
  assert_int_equal(supine_input_judge(SUPINE_INPUT_TILT, 90.5), SUPINE_INPUT_REFUSED);
  assert_int_equal(supine_input_judge(SUPINE_INPUT_VOLUME_LEAST, 0.1), SUPINE_INPUT_TAKEN);
  assert_int_equal(supine_input_judge(SUPINE_INPUT_VOLUME_LEAST, 0.09), SUPINE_INPUT_REFUSED);
  assert_int_equal(supine_input_judge(SUPINE_INPUT_BREATH, 1.1), SUPINE_INPUT_TOLD);
  assert_int_equal(supine_input_judge(SUPINE_INPUT_BREATH, 1.3), SUPINE_INPUT_REFUSED);
  assert_int_equal(supine_input_judge(SUPINE_INPUT_BREATH, NAN), SUPINE_INPUT_REFUSED);
  assert_int_equal(supine_input_judge(SUPINE_INPUT_COUNT, 0), SUPINE_INPUT_REFUSED);
}

TEST(test_inputs_page_shows_the_table) {
  static char page[PAGE_MAX], table[PAGE_MAX];
  FILE *file = fopen(SUPINE_INPUTS_PAGE, "r");
  assert_non_null(file);
  page[fread(page, 1, sizeof page - 1, file)] = '\0';
  assert_int_equal(fclose(file), 0);
  char *begin = strstr(page, mark);
  assert_non_null(begin);
  if (getenv("SUPINE_GOLDEN_UPDATE") != NULL) {
    *begin = '\0';
    file = fopen(SUPINE_INPUTS_PAGE, "w");
    assert_non_null(file);
    fputs(page, file);
    print_table(file);
    assert_int_equal(fclose(file), 0);
    return;
  }
  file = tmpfile();
  assert_non_null(file);
  print_table(file);
  rewind(file);
  table[fread(table, 1, sizeof table - 1, file)] = '\0';
  assert_int_equal(fclose(file), 0);
  assert_string_equal(begin, table);
}
