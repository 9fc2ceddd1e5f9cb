/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Exit codes, messages, numbers, suggestions, progress and signals, shared by the commands. */
#ifndef SUPINE_COMMAND_H
#define SUPINE_COMMAND_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include <jansson.h>

#include <supine/status.h>

#include "program/options/option.h"

enum {
  SUPINE_EXIT_OK = 0,
  SUPINE_EXIT_USAGE = 1,
  SUPINE_EXIT_INPUT = 2,
  SUPINE_EXIT_UNSUPPORTED = 3,
  SUPINE_EXIT_OUTPUT = 4,
  SUPINE_EXIT_NUMERICAL = 5
};

/* How a command speaks; the options that all commands have fill it. */
typedef struct supine_speech {
  bool json;  /* print results as JSON instead of text */
  bool quiet; /* print neither progress nor notes */
} supine_speech;

extern const supine_option supine_options_of_all[];

void supine_options_speak(const supine_speech *speech);
bool supine_options_as_json(void);

/* Print "supine COMMAND: MESSAGE" to stderr. */
void supine_options_say(const char *command, const char *format, ...) SUPINE_PRINTF(2, 3);
/* Print "supine COMMAND: note: MESSAGE" to stderr, unless --quiet is given. */
void supine_options_note(const char *command, const char *format, ...) SUPINE_PRINTF(2, 3);

/* An error's message, and what to do. */
typedef struct supine_explained {
  char text[1024];
} supine_explained;

supine_explained supine_options_explain(const supine_error *error);

/* Flush standard output; return SUPINE_EXIT_OUTPUT if the disk is full or the pipe is closed. */
int supine_options_finish(const char *command);

/* Print a JSON object or a list of objects to standard output, and release it. Without --json,
 * print text: one line for each member, and a table for each list of objects. supine_options_finish
 * reports failed writes. */
void supine_options_print(json_t *value);

/* Print a list of objects, which hold the same numbers, to standard output, and release it: as CSV
 * of `digits` significant digits, or with --json as it is. */
void supine_options_print_rows(json_t *rows, int digits);

/* Print text to standard output, unless --json is given. */
void supine_options_line(const char *format, ...) SUPINE_PRINTF(1, 2);
/* Add members to the object that --json prints at the end of the command, and release `members`.
 * The same are printed as text by supine_options_line. */
void supine_options_add(json_t *members);
/* Make and add members with --json only: outputs are written by then, and without --json no memory
 * that could be refused is needed any more. */
#define SUPINE_ADD_RESULT(members)                                                                 \
  (supine_options_as_json() ? supine_options_add(members) : (void)0)
/* Begin another object: the command has several results of a kind, and --json prints a list. */
void supine_options_next_result(void);
/* Print what was added if --json and `succeeded` are true, and release it. */
void supine_options_print_results(bool succeeded);

/* Return a text such as a file name as a JSON string; replace bytes that are not UTF-8 by "?". */
json_t *supine_options_json_text(const char *text);

/* Return a number as JSON; null if it is not finite. */
json_t *supine_options_json_number(double number);

/* Return numbers as a JSON array; numbers that are not finite become null. */
json_t *supine_options_json_numbers(size_t count, const double *numbers);

/* Read a finite number; return false for any other text. */
bool supine_options_parse_number(const char *text, double *value);
/* Read a whole number of at least 0; return false for any other text. */
bool supine_options_parse_count(const char *text, size_t *value);

/* Read `count` finite numbers separated by commas; return false for any other text. */
bool supine_options_parse_numbers(const char *text, size_t count, double *values);

/* Copy the first item of a list separated by commas to `item` [size], cut off if it is longer, and
 * advance *list. Return false at the end of the list. */
bool supine_options_next_item(const char **list, char *item, size_t size);

/* Return the candidate nearest to `text` by edit distance, or NULL if all differ too much. */
const char *supine_options_suggest(const char *text, const char *const *candidates, size_t count);

/* Progress and remaining time, shown in one line of stderr if stderr is a terminal. */
typedef struct supine_progress {
  const char *label;
  double start;    /* start of the work, s (supine_clock_seconds) */
  double shown_at; /* time at which the line was last written, s (supine_clock_seconds) */
  bool is_shown;   /* stderr is a terminal, and --quiet is not given */
} supine_progress;

supine_progress supine_options_progress_begin(const char *label);
/* Show the fraction of the work done, 0 to 1, and nothing at 1; return false if the user has
 * interrupted the work. */
bool supine_options_progress_step(void *progress, double fraction);

/* Do the same for the library `precompute`: return 0 to go on. */
int supine_options_progress_show(void *progress, double fraction);

void supine_options_progress_end(supine_progress *progress);

/* Make SIGINT, SIGTERM and SIGHUP remove unfinished outputs before they end the program. With
 * `orderly_end`, the first signal only makes supine_options_interrupted return true, so that the
 * command can stop by itself. */
void supine_options_signals_catch(bool orderly_end);
bool supine_options_interrupted(void);

#endif
