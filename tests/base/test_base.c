/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test status strings, output files, threads, and endings of file names. */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdatomic.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/output.h"
#include "base/parallel.h"
#include "base/remedy.h"
#include "base/text.h"
#include "tests/helpers/findings.h"
#include "tests/helpers/test.h"
#include <supine/status.h>

TEST(test_status_string_every_code_distinct) {
  for (int i = 0; i < (int)SUPINE_STATUS_COUNT; ++i) {
    for (int j = 0; j < i; ++j) {
      assert_string_not_equal(supine_status_string((supine_status)i),
                              supine_status_string((supine_status)j));
    }
  }
}

TEST(test_status_string_outside_enumeration_unknown) {
  assert_string_equal(supine_status_string(SUPINE_STATUS_COUNT), "unknown status");
  assert_string_equal(supine_status_string((supine_status)-1), "unknown status");
  assert_string_equal(supine_status_string((supine_status)1000), "unknown status");
}

TEST(test_error_wrap_cause_with_remedy_keeps_it) {
  supine_error cause;
  supine_error error;
  (void)supine_error_set(&cause, SUPINE_ERROR_MESH, "the axes are doubtful");
  assert_int_equal(cause.remedies[0].kind, SUPINE_REMEDY_NONE);
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_give("axes", "RAS", "")};
  supine_error_advise(&cause, advice);
  assert_int_equal(supine_error_wrap(&error, &cause, "%s: ", "left.ply"), SUPINE_ERROR_MESH);
  assert_int_equal(error.status, SUPINE_ERROR_MESH);
  assert_string_equal(error.message, "left.ply: the axes are doubtful");
  assert_int_equal(error.remedies[0].kind, SUPINE_REMEDY_GIVE);
  assert_string_equal(error.remedies[0].value, "RAS");
  assert_int_equal(supine_error_wrap(NULL, &cause, "x: "), SUPINE_ERROR_MESH);
  supine_error_advise(NULL, advice);
}

TEST(test_error_set_after_remedy_clears_it) {
  supine_error error;
  (void)supine_error_set(&error, SUPINE_ERROR_MESH, "first");
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_omit("band")};
  supine_error_advise(&error, advice);
  (void)supine_error_set(&error, SUPINE_ERROR_READ, "second");
  assert_int_equal(error.remedies[0].kind, SUPINE_REMEDY_NONE);
}

/* Each finding has its own remedy, and control characters of names are escaped. */
TEST(test_findings_advise_each_finding_keeps_its_own) {
  static supine_findings findings;
  supine_findings_note(&findings, "a\nb: %s", "first");
  supine_findings_warn(&findings, "second");
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_give("midline", "-12", "")};
  supine_findings_advise(&findings, advice);
  assert_string_equal(findings_text(&findings), "note: a\\x0Ab: first\nwarning: second\n");
  assert_int_equal(findings.list[0].remedies[0].kind, SUPINE_REMEDY_NONE);
  assert_string_equal(findings.list[1].remedies[0].value, "-12");
  supine_findings_warn(NULL, "nobody asks");
  supine_findings_advise(NULL, advice);
}

/* What has no room is counted, and its remedy does not become that of another finding. */
TEST(test_findings_warn_full_list_counts_dropped) {
  static supine_findings findings;
  for (size_t i = 0; i < SUPINE_FINDINGS_MAX + 2; ++i) {
    supine_findings_warn(&findings, "%zu", i);
  }
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {supine_remedy_change("edge", "")};
  supine_findings_advise(&findings, advice);
  assert_int_equal(findings.count, SUPINE_FINDINGS_MAX);
  assert_int_equal(findings.dropped, 2);
  assert_string_equal(findings.list[SUPINE_FINDINGS_MAX - 1].text, "31");
  assert_int_equal(findings.list[SUPINE_FINDINGS_MAX - 1].remedies[0].kind, SUPINE_REMEDY_NONE);
}

/* Each kind of remedy, as each host writes arguments. */
TEST(test_remedies_add_each_host_its_words) {
  const supine_remedy advice[SUPINE_REMEDIES_MAX] = {
      supine_remedy_give("held_out", "5", ""),
      supine_remedy_such_as("scanned", "supine:rest", "if it is not full"),
      supine_remedy_omit("without_normals")};
  const supine_remedy change[SUPINE_REMEDIES_MAX] = {supine_remedy_change("axes", ""),
                                                     supine_remedy_give("axes", "LPS", "")};
  static const char *const expected[] = {
      "bad; give --held-out 5, or give --scanned, such as supine:rest, if it is not full, or leave "
      "--without-normals out",
      "bad; give held_out=5, or give scanned, such as supine:rest, if it is not full, or leave "
      "without_normals out",
      "bad; give heldOut: 5, or give scanned, such as supine:rest, if it is not full, or leave "
      "withoutNormals out"};
  char text[1024];
  for (size_t words = 0; words < sizeof expected / sizeof *expected; ++words) {
    (void)snprintf(text, sizeof text, "bad");
    supine_remedies_add(advice, (supine_words)words, text, sizeof text);
    assert_string_equal(text, expected[words]);
  }
  (void)snprintf(text, sizeof text, "which?");
  supine_remedies_add(change, SUPINE_WORDS_PYTHON, text, sizeof text);
  assert_string_equal(text, "which? Change axes, or give axes='LPS'");
  const supine_remedy set[SUPINE_REMEDIES_MAX] = {
      supine_remedy_set("allow_folds", ""), supine_remedy_give("axes", "RAS", "if it is in RAS")};
  static const char *const switched[] = {
      "bad. Give --allow-folds, or give --axes RAS if it is in RAS",
      "bad. Give allow_folds=True, or give axes='RAS' if it is in RAS",
      "bad. Give allowFolds: true, or give axes: 'RAS' if it is in RAS"};
  for (size_t words = 0; words < sizeof switched / sizeof *switched; ++words) {
    (void)snprintf(text, sizeof text, "bad.");
    supine_remedies_add(set, (supine_words)words, text, sizeof text);
    assert_string_equal(text, switched[words]);
  }
  char small[12] = "bad";
  supine_remedies_add(advice, SUPINE_WORDS_COMMAND, small, sizeof small);
  assert_string_equal(small, "bad; give -");
}

TEST(test_error_set_long_message_truncated) {
  char text[2 * sizeof(((supine_error *)0)->message)];
  memset(text, 'x', sizeof text - 1);
  text[sizeof text - 1] = '\0';
  supine_error error;
  assert_int_equal(supine_error_set(&error, SUPINE_ERROR_MESH, "%s", text), SUPINE_ERROR_MESH);
  assert_int_equal(error.status, SUPINE_ERROR_MESH);
  assert_int_equal(strlen(error.message), sizeof error.message - 1);
  assert_int_equal(supine_error_set(NULL, SUPINE_ERROR_READ, "none"), SUPINE_ERROR_READ);
}

TEST(test_text_ends_in_ending_alone_false) {
  assert_true(supine_text_ends_in("pairs.csv", ".csv"));
  assert_false(supine_text_ends_in("pairs.csv.gz", ".csv"));
  assert_false(supine_text_ends_in(".csv", ".csv"));
  assert_false(supine_text_ends_in("v", ".csv"));
  assert_true(supine_text_ends_in("a.NII.gz", ".nii.gz"));
  assert_false(supine_text_ends_in("a.nii", ".nii.gz"));
  assert_false(supine_text_ends_in(".NII", ".nii"));
}

TEST(test_text_distance_below_level_of_storage_without_digits) {
  assert_string_equal(supine_text_distance(0.0).text, "below 0.002");
  assert_string_equal(supine_text_distance(0.00199).text, "below 0.002");
  assert_string_equal(supine_text_distance(0.00201).text, "0.002");
  assert_string_equal(supine_text_distance(70.88649).text, "70.886");
  assert_string_equal(supine_text_distance((double)NAN).text, "nan");
}

TEST(test_text_change_below_half_without_sign) {
  assert_string_equal(supine_text_change(-0.49).text, "0");
  assert_string_equal(supine_text_change(-0.51).text, "-1");
  assert_string_equal(supine_text_change(12.3).text, "+12");
}

static void read_text(const char *path, char *text, size_t size) {
  FILE *file = fopen(path, "rb");
  assert_non_null(file);
  text[fread(text, 1, size - 1, file)] = '\0';
  (void)fclose(file);
}

TEST(test_text_cut_ends_between_characters) {
  static const char *const texts[] = {"abcdefgh", "abc\u00E4\u00E4\u00E4",
                                      "\u0639\u0642\u062F\u0629", "\u20AC\u20AC\u20AC",
                                      "\U0001FAC1\U0001FAC1"};
  for (size_t i = 0; i < sizeof texts / sizeof *texts; ++i) {
    for (size_t size = 4; size < 16; ++size) {
      char cut[16];
      (void)supine_print_text(cut, size, "%s", texts[i]);
      assert_true(supine_text_is_utf8(cut) && strncmp(cut, texts[i], strlen(cut)) == 0);
      assert_true(strlen(cut) + 4 >= size || strcmp(cut, texts[i]) == 0);
      (void)supine_text_shorten(texts[i], size, cut);
      assert_true(supine_text_is_utf8(cut) && strlen(cut) < size);
      assert_true(strcmp(cut, texts[i]) == 0 || strcmp(cut + strlen(cut) - 3, "\xE2\x80\xA6") == 0);
    }
  }
}

TEST(test_output_commit_replaces_file_abandon_keeps_it) {
  char folder[] = "/tmp/supine-output-XXXXXX";
  assert_non_null(mkdtemp(folder));
  char path[64];
  char text[16];
  (void)snprintf(path, sizeof path, "%s/out", folder);
  supine_output output;
  assert_int_equal(supine_output_open(path, &output, NULL), SUPINE_OK);
  (void)fputs("first", output.file);
  assert_int_not_equal(access(path, F_OK), 0);
  assert_int_equal(supine_output_commit(&output, NULL), SUPINE_OK);
  read_text(path, text, sizeof text);
  assert_string_equal(text, "first");
  assert_int_equal(supine_output_open(path, &output, NULL), SUPINE_OK);
  (void)fputs("second", output.file);
  supine_output_abandon(&output);
  supine_output_abandon(&output);
  read_text(path, text, sizeof text);
  assert_string_equal(text, "first");
  assert_int_equal(unlink(path), 0);
  assert_int_equal(rmdir(folder), 0); /* fails if a temporary file is left in the folder */
}

TEST(test_output_full_disk_or_missing_folder_write_error) {
  supine_output output;
  supine_error error;
  assert_int_equal(supine_output_open("/nonexistent-folder/x", &output, &error),
                   SUPINE_ERROR_WRITE);
  assert_says(error.message, "/nonexistent-folder/x");
  assert_int_equal(supine_output_open("/tmp", &output, &error), SUPINE_ERROR_WRITE);
  assert_int_equal(supine_output_open("/dev/full", &output, &error), SUPINE_OK);
  (void)fputs("lost", output.file);
  assert_int_equal(supine_output_commit(&output, &error), SUPINE_ERROR_WRITE);
  assert_says(error.message, "/dev/full");
}

static void write_output(const char *path, const char *text) {
  supine_output output;
  assert_int_equal(supine_output_open(path, &output, NULL), SUPINE_OK);
  (void)fputs(text, output.file);
  assert_int_equal(supine_output_commit(&output, NULL), SUPINE_OK);
}

static mode_t mode_of(const char *path) {
  struct stat status;
  assert_int_equal(stat(path, &status), 0);
  return status.st_mode & 0777;
}

static void check_modes(void) {
  char folder[] = "/tmp/supine-output-XXXXXX";
  char path[64];
  assert_non_null(mkdtemp(folder));
  (void)snprintf(path, sizeof path, "%s/out", folder);
  static const mode_t masks[] = {022, 027, 077, 0};
  for (size_t i = 0; i < sizeof masks / sizeof *masks; ++i) {
    const mode_t before = umask(masks[i]);
    write_output(path, "new");
    assert_int_equal(mode_of(path), 0666 & ~masks[i]);
    assert_int_equal(chmod(path, 0640), 0);
    write_output(path, "old"); /* overwriting a file must keep its mode */
    assert_int_equal(mode_of(path), 0640);
    assert_int_equal(umask(before), masks[i]);
    assert_int_equal(unlink(path), 0);
  }
  write_output(path, "kept");
  assert_int_equal(chmod(path, 0444), 0);
  supine_output output;
  supine_error error;
  assert_int_equal(supine_output_open(path, &output, &error), SUPINE_ERROR_WRITE);
  assert_says(error.message, "Permission denied");
  assert_int_equal(unlink(path), 0);
  assert_int_equal(rmdir(folder), 0);
}

static void check_links(void) {
  char folder[] = "/tmp/supine-output-XXXXXX";
  char target[64];
  char link[64];
  char over[64];
  char text[16];
  assert_non_null(mkdtemp(folder));
  (void)snprintf(target, sizeof target, "%s/target", folder);
  (void)snprintf(link, sizeof link, "%s/link", folder);
  (void)snprintf(over, sizeof over, "%s/over", folder);
  assert_int_equal(symlink("target", link), 0);
  assert_int_equal(symlink(link, over), 0);
  for (int i = 0; i < 2; ++i) { /* first the target of the link is missing, then it exists */
    struct stat status;
    write_output(over, i == 0 ? "first" : "second");
    read_text(target, text, sizeof text);
    assert_string_equal(text, i == 0 ? "first" : "second");
    assert_int_equal(lstat(over, &status), 0);
    assert_true(S_ISLNK(status.st_mode));
  }
  assert_int_equal(unlink(over) + unlink(link) + unlink(target), 0);
  assert_int_equal(rmdir(folder), 0);
}

/* Limit the size of files, like a full disk does. Assert that, whichever write fails, an error is
 * returned, the old file stays and no temporary file is left. */
static void check_full_disk(void) {
  char folder[] = "/tmp/supine-output-XXXXXX";
  char path[64];
  char text[16];
  static char much[1 << 20];
  struct rlimit limit;
  assert_non_null(mkdtemp(folder));
  (void)snprintf(path, sizeof path, "%s/out", folder);
  write_output(path, "old");
  assert_int_equal(getrlimit(RLIMIT_FSIZE, &limit), 0);
  (void)signal(SIGXFSZ, SIG_IGN);
  for (size_t room = 0; room <= sizeof much; room += sizeof much / 8) {
    const struct rlimit least = {room, limit.rlim_max};
    supine_output output;
    supine_error error;
    assert_int_equal(supine_output_open(path, &output, NULL), SUPINE_OK);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &least), 0);
    for (size_t i = 0; i < sizeof much; i += 4096) {
      (void)fwrite(much + i, 1, 4096, output.file);
    }
    const supine_status status = supine_output_commit(&output, &error);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &limit), 0);
    if (room < sizeof much) {
      assert_int_equal(status, SUPINE_ERROR_WRITE);
      assert_says(error.message, "File too large");
      read_text(path, text, sizeof text);
      assert_string_equal(text, "old");
    } else {
      assert_int_equal(status, SUPINE_OK);
    }
  }
  assert_int_equal(unlink(path), 0);
  assert_int_equal(rmdir(folder), 0);
}

TEST(test_output_commit_keeps_modes_links_and_old_files) {
  check_modes();
  check_links();
  check_full_disk();
}

TEST(test_output_abandon_all_removes_temporary_files) {
  char folder[] = "/tmp/supine-output-XXXXXX";
  char path[64];
  assert_non_null(mkdtemp(folder));
  (void)snprintf(path, sizeof path, "%s/out", folder);
  supine_output output;
  assert_int_equal(supine_output_open(path, &output, NULL), SUPINE_OK);
  assert_int_equal(access(output.temporary, F_OK), 0);
  supine_output_abandon_all();
  assert_int_equal(rmdir(folder), 0); /* fails if a temporary file is left in the folder */
  supine_output_abandon(&output);
  assert_int_equal(supine_output_try("/nonexistent-folder/x", NULL), SUPINE_ERROR_WRITE);
}

TEST(test_thread_count_invalid_variable_ignored) {
  assert_int_equal(unsetenv("SUPINE_THREADS"), 0);
  const size_t own = supine_thread_count();
  static const struct {
    const char *text;
    size_t count; /* expected number of threads; 0: `text` is invalid and ignored */
  } cases[] = {{"1", 1},   {"7", 7},          {"255", 255}, {"256", 256}, {"257", 0},
               {"0", 0},   {"-1", 0},         {"2 x", 0},   {"", 0},      {"many", 0},
               {"1e2", 0}, {"4294967297", 0}, {"3.", 0},    {"0x10", 0}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    assert_int_equal(setenv("SUPINE_THREADS", cases[i].text, 1), 0);
    assert_int_equal(supine_thread_count(), cases[i].count == 0 ? own : cases[i].count);
  }
  assert_int_equal(unsetenv("SUPINE_THREADS"), 0);
}

typedef struct tally {
  _Atomic unsigned char seen[1000];
  size_t grain;
} tally;

static void tally_range(void *context, size_t begin, size_t end, size_t thread) {
  tally *counts = context;
  assert_true(thread < 8);
  assert_int_equal(begin % counts->grain, 0);
  for (size_t i = begin; i < end; ++i) {
    (void)atomic_fetch_add(&counts->seen[i], 1);
  }
}

TEST(test_parallel_for_any_split_covers_each_item_once) {
  static const size_t sizes[] = {0, 1, 2, 7, 16, 17, 999, 1000};
  for (size_t s = 0; s < sizeof sizes / sizeof *sizes; ++s) {
    for (size_t threads = 1; threads <= 8; ++threads) {
      for (size_t grain = 1; grain <= 33; grain += 16) {
        tally counts = {.grain = grain};
        supine_parallel_for(sizes[s], grain, threads, tally_range, &counts);
        for (size_t i = 0; i < 1000; ++i) {
          assert_int_equal(counts.seen[i], i < sizes[s] ? 1 : 0);
        }
      }
    }
  }
  assert_true(supine_thread_count() >= 1);
}

static supine_status fill(size_t count, size_t size, supine_error *error) {
  SUPINE_ARENA arena = {0};
  unsigned char *zeros = supine_arena_zeros(&arena, 1000, 1);
  unsigned char *many = supine_arena_take(&arena, count, size);
  if (arena.failed) {
    return supine_error_memory(error, "%zu items", count);
  }
  for (size_t i = 0; i < 1000; ++i) {
    assert_int_equal(zeros[i], 0);
  }
  memset(many, 1, count * size);
  assert_int_equal((uintptr_t)many % _Alignof(max_align_t), 0);
  SUPINE_TRY(count == 0 ? SUPINE_ERROR_MESH : SUPINE_OK);
  return SUPINE_OK;
}

/* A sanitizer or valgrind would report arrays that an early return leaves behind. */
TEST(test_arena_overflow_and_early_return_free_everything) {
  supine_error error;
  assert_int_equal(fill(100, 7, &error), SUPINE_OK);
  assert_int_equal(fill(0, 7, &error), SUPINE_ERROR_MESH);
  assert_int_equal(fill(SIZE_MAX / 4, 8, &error), SUPINE_ERROR_MEMORY);
  assert_int_equal(error.status, SUPINE_ERROR_MEMORY);
  assert_non_null(strstr(error.message, "out of memory: "));
}
