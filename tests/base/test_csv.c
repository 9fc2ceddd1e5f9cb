/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test CSV files: what is written is read again, and what is not text is refused. */
#include <unistd.h>

#include "base/csv.h"
#include "base/number.h"
#include "tests/helpers/test.h"

static char path[] = "/tmp/supine-csv-XXXXXX";

static int make_file(void **state) {
  (void)state;
  return mkstemp(path) < 0;
}

static int remove_file(void **state) {
  (void)state;
  return unlink(path);
}

static void write_text(const char *text) {
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  (void)fputs(text, file);
  assert_int_equal(fclose(file), 0);
}

static const char *const columns[] = {"name", "value"};

/* Read all rows; return the status, and set `rows` to their number. */
static supine_status read_all(size_t *rows, supine_error *error) {
  supine_csv csv;
  *rows = 0;
  supine_status status = supine_csv_open(path, columns, 2, 2, &csv, error);
  for (bool more = status == SUPINE_OK; more; *rows += more ? 1 : 0) {
    status = supine_csv_next(&csv, &more, error);
    more = more && status == SUPINE_OK;
  }
  if (status == SUPINE_OK || csv.file != NULL) {
    supine_csv_close(&csv);
  }
  return status;
}

TEST(test_csv_written_any_name_read_same) {
  static const char *const names[] = {
      "nodule, RUL", "5\" tube",   "\"quoted\"", "Lunge größer als früher",
      "two\nlines",  "a\r\nb\n",   "#1",         " blanks ",
      "\ttab",       "semi;colon", "",           "\"",
      ",",           "结节",       "plain",      "ends in \"",
      "\n"};
  enum { COUNT = sizeof names / sizeof *names };
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  (void)fputs("# a comment, with \"a quote\nname,x,value\n", file);
  for (size_t i = 0; i < COUNT; ++i) {
    supine_csv_row row = {.file = file};
    supine_csv_add_text(&row, names[i]);
    supine_csv_add(&row, "%zu,%.3f", i, (double)i + 0.25);
    supine_csv_end_row(&row);
  }
  assert_int_equal(fclose(file), 0);
  supine_csv csv;
  bool more = false;
  assert_int_equal(supine_csv_open(path, columns, 2, 2, &csv, NULL), SUPINE_OK);
  for (size_t i = 0; i < COUNT; ++i) {
    double value = 0.0;
    assert_int_equal(supine_csv_next(&csv, &more, NULL), SUPINE_OK);
    assert_true(more);
    assert_string_equal(supine_csv_text(&csv, 0), names[i]);
    assert_int_equal(supine_csv_number(&csv, 1, "value", &value, NULL), SUPINE_OK);
    assert_true(value == (double)i + 0.25);
  }
  assert_int_equal(supine_csv_next(&csv, &more, NULL), SUPINE_OK);
  assert_false(more);
  supine_csv_close(&csv);
}

TEST(test_csv_any_separator_reads_quotes) {
  static const char *const texts[] = {"name,value\n\"a,b\",1.5\n",
                                      "name;value\r\n\"a,b\";1,5\r\n",
                                      "name\tvalue\n\"a,b\"\t1.5\n",
                                      "\xEF\xBB\xBF\"name\" , \"value\"\n \"a,b\" , 1.5",
                                      "sep=;\r\nname;value\r\n\"a,b\";1,5\r\n",
                                      "name;value;notes, if any\n\"a,b\";1,5;x\n",
                                      "sep=\t\nname\tvalue\n\"a,b\"\t1.5\n",
                                      "name,value\n,\n\"a,b\",\"1,5\"\n,\n",
                                      "name\tvalue\tnote\n\t\t\na,b\t1,5\t\n",
                                      "name,value (cm)\n\"a,b\",.15\n",
                                      "name,value[mm]\n\"a,b\",1.5\n"};
  for (size_t i = 0; i < sizeof texts / sizeof *texts; ++i) {
    supine_csv csv;
    bool more = false;
    double value = 0.0;
    write_text(texts[i]);
    assert_int_equal(supine_csv_open(path, columns, 2, 2, &csv, NULL), SUPINE_OK);
    assert_int_equal(supine_csv_next(&csv, &more, NULL), SUPINE_OK);
    assert_string_equal(supine_csv_text(&csv, 0), "a,b");
    assert_int_equal(supine_csv_number(&csv, 1, "value", &value, NULL), SUPINE_OK);
    assert_true(value == 1.5);
    supine_csv_close(&csv);
  }
}

TEST(test_csv_malformed_refused_with_line) {
  static const struct {
    const char *text, *message;
  } rows[] = {
      {"name,value\na,1\nM\xFCller,2\n", ":3: the text is not UTF-8: save the file with"},
      {"na\xE4me,value\na,1\n", ":1: the text is not UTF-8"},
      {"name,value\n\"two\nlines\",1\n\"\xC0\xAF\",2\n", ":4: the text is not UTF-8"},
      {"name,value\na,1\n\"open,2\nb,3\n", ":3: a quote is not closed: add \""},
      {"name,value\n\"a\"b,1\n", ":2: a quote is not closed"},
      {"name,value (ell)\na,1\n", ":1: the unit of column \"value (ell)\" is unknown"},
      {"name,value,value (mm)\na,1,1\n", ":1: repeated column \"value (mm)\""},
      {"name,value\n\"two\nlines\",1\nb\n", ":4: 1 field, but the header has 2"},
  };
  for (size_t i = 0; i < sizeof rows / sizeof *rows; ++i) {
    supine_error error = {0};
    size_t count = 0;
    write_text(rows[i].text);
    assert_int_equal(read_all(&count, &error), SUPINE_ERROR_FORMAT);
    assert_says(error.message, rows[i].message);
  }
}

TEST(test_csv_comment_in_latin_1_skipped) {
  size_t count = 0;
  write_text("# Gr\xF6\xDF"
             "e\nname,value\na,1\n\n  # \xE4\nb,2");
  assert_int_equal(read_all(&count, NULL), SUPINE_OK);
  assert_int_equal(count, 2);
}

/* Excel's "Unicode text" is UTF-16 with tabs. */
TEST(test_csv_utf_16_read) {
  static const unsigned short text[] = {0xFEFF, 'n',    'a',    'm',  'e',  '\t', 'v',
                                        'a',    'l',    'u',    'e',  '\r', '\n', 0xE9,
                                        0x7ED3, 0xD83D, 0xDE00, '\t', '1',  ',',  '5'};
  for (unsigned high = 0; high < 2; ++high) { /* which byte comes first */
    FILE *file = fopen(path, "wb");
    supine_csv csv;
    bool more = false;
    double value = 0.0;
    assert_non_null(file);
    for (size_t i = 0; i < sizeof text / sizeof *text; ++i) {
      (void)putc(text[i] >> 8 * high & 0xFF, file);
      (void)putc(text[i] >> 8 * (1 - high) & 0xFF, file);
    }
    assert_int_equal(fclose(file), 0);
    assert_int_equal(supine_csv_open(path, columns, 2, 2, &csv, NULL), SUPINE_OK);
    assert_int_equal(supine_csv_next(&csv, &more, NULL), SUPINE_OK);
    assert_string_equal(supine_csv_text(&csv, 0), "\xC3\xA9\xE7\xBB\x93\xF0\x9F\x98\x80");
    assert_int_equal(supine_csv_number(&csv, 1, "value", &value, NULL), SUPINE_OK);
    assert_true(value == 1.5);
    supine_csv_close(&csv);
  }
}

TEST_GROUP(make_file, remove_file)

TEST(test_csv_bare_file_reads_columns_of_given_header) {
  supine_csv csv;
  bool more = false;
  double value = 0.0;
  write_text("# comment\na,1.5,further\n");
  assert_int_equal(supine_csv_open_bare(path, "name,value", columns, 2, 2, &csv, NULL), SUPINE_OK);
  assert_true(supine_csv_has(&csv, 1));
  assert_int_equal(supine_csv_next(&csv, &more, NULL), SUPINE_OK);
  assert_string_equal(supine_csv_text(&csv, 0), "a");
  assert_int_equal(supine_csv_number(&csv, 1, "value", &value, NULL), SUPINE_OK);
  assert_true(value == 1.5);
  supine_csv_close(&csv);
}
