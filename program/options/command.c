/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Report errors and progress, read numbers, suggest names, and handle interrupts. */
#include <errno.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/number.h"
#include "base/output.h"
#include "base/quantity.h"
#include "base/utf8.h"

#include "program/options/command.h"
#include "runtime/words.h"

static supine_speech spoken; /* standard output and error belong to the process, and so does this */

#define FILLS(member) SUPINE_FILLS(supine_speech, member)

const supine_option supine_options_of_all[] = {
    {.help = "Of every command:"},
    {"json", 'j', NULL, "print results as JSON instead of text", FILLS(json)},
    {"quiet", 'q', NULL, "print neither progress nor notes, only results, warnings and errors",
     FILLS(quiet)},
    {.name = NULL}};

void supine_options_speak(const supine_speech *speech) {
  spoken = *speech;
}

bool supine_options_as_json(void) {
  return spoken.json;
}

static void say(const char *command, const char *kind, const char *format, va_list arguments) {
  enum { LONGEST = 4096 };
  char text[LONGEST];
  char printable[LONGEST];
  (void)supine_print_text_list(text, sizeof text, format, arguments);
  supine_number_shorten(text);
  supine_utf8_escape(text, "\n", printable, sizeof printable);
  (void)fprintf(stderr, "supine %s: %s%s\n", command, kind, printable);
}

void supine_options_say(const char *command, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  say(command, "", format, arguments);
  va_end(arguments);
}

void supine_options_note(const char *command, const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  if (!spoken.quiet) {
    say(command, "note: ", format, arguments);
  }
  va_end(arguments);
}

supine_explained supine_options_explain(const supine_error *error) {
  supine_explained explained;
  (void)snprintf(explained.text, sizeof explained.text, "%s", error->message);
  supine_remedies_add(error->remedies, SUPINE_WORDS_COMMAND, explained.text, sizeof explained.text);
  return explained;
}

int supine_options_finish(const char *command) {
  errno = 0;
  if (ferror(stdout) != 0 || fflush(stdout) != 0) {
    supine_options_say(command, "standard output: %s", strerror(errno == 0 ? EIO : errno));
    return SUPINE_EXIT_OUTPUT;
  }
  return SUPINE_EXIT_OK;
}

bool supine_options_parse_number(const char *text, double *value) {
  return supine_options_parse_numbers(text, 1, value);
}

bool supine_options_parse_numbers(const char *text, size_t count, double *values) {
  return supine_quantity_parse(text, SUPINE_QUANTITY_NUMBER, count, values, NULL) == SUPINE_OK;
}

bool supine_options_parse_count(const char *text, size_t *value) {
  char *end = NULL;
  errno = 0;
  const unsigned long long number = strtoull(text, &end, 10);
  if (end == text || *end != '\0' || errno != 0 || strchr(text, '-') != NULL) {
    return false;
  }
  *value = (size_t)number;
  return true;
}

bool supine_options_next_item(const char **list, char *item, size_t size) {
  const char *at = *list;
  if (at == NULL) {
    return false;
  }
  (void)snprintf(item, size, "%.*s", (int)strcspn(at, ","), at);
  at = strchr(at, ',');
  *list = at != NULL ? at + 1 : NULL;
  return true;
}

const char *supine_options_suggest(const char *text, const char *const *candidates, size_t count) {
  const char *best = NULL;
  size_t fewest = 0;
  for (size_t i = 0; i < count; ++i) {
    const size_t edits = supine_words_distance(text, candidates[i]);
    if (supine_words_close(text, candidates[i]) && (best == NULL || edits < fewest)) {
      fewest = edits;
      best = candidates[i];
    }
  }
  return best;
}

static volatile sig_atomic_t command_polls, interrupted;
static volatile double interrupted_at; /* s by supine_clock_seconds */

/* Handle a signal. A command that polls supine_options_interrupted is told to stop, and only a
 * later signal ends it. Signals within a second of the first are ignored, because timeout(1)
 * sends each signal twice. Any other command ends at once. */
static void on_signal(int number) {
  const double now = supine_clock_seconds(); /* this clock never steps back */
  if (command_polls != 0 && interrupted == 0) {
    interrupted = 1;
    interrupted_at = now;
  }
  if (command_polls != 0 && now - interrupted_at < 1.0) {
    return;
  }
  supine_output_abandon_all();
  (void)signal(number, SIG_DFL);
  (void)raise(number); /* ends the program when this handler returns */
}

void supine_options_signals_catch(bool orderly_end) {
  static const int numbers[] = {SIGINT, SIGTERM, SIGHUP};
  struct sigaction action = {0};
  action.sa_handler = on_signal;
  action.sa_flags = SA_RESTART;
  command_polls = orderly_end ? 1 : 0;
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; ++i) {
    struct sigaction before;
    /* A signal that nohup(1), or a shell in the background, made the program ignore stays
     * ignored. */
    if (sigaction(numbers[i], NULL, &before) == 0 && before.sa_handler != SIG_IGN) {
      (void)sigaction(numbers[i], &action, NULL);
    }
  }
  (void)signal(SIGXFSZ, SIG_IGN); /* makes a write beyond the file size limit fail */
}

bool supine_options_interrupted(void) {
  return interrupted != 0;
}

supine_progress supine_options_progress_begin(const char *label) {
  const double start = supine_clock_seconds();
  return (supine_progress){label, start, start, !spoken.quiet && isatty(STDERR_FILENO) == 1};
}

bool supine_options_progress_step(void *progress, double fraction) {
  supine_progress *state = progress;
  const double time = supine_clock_seconds();
  if (fraction >= 1.0) {
    supine_options_progress_end(state);
  } else if (state->is_shown && time - state->shown_at > 0.1) {
    state->shown_at = time;
    const double spent = time - state->start;
    (void)supine_print(stderr, "\r%s: %3.0f %%", state->label, 100.0 * fraction);
    if (fraction > 0.02 && spent > 1.0) {
      (void)supine_print(stderr, ", %.0f s left ", spent * (1.0 - fraction) / fraction);
    }
    (void)fflush(stderr);
  }
  return !supine_options_interrupted();
}

int supine_options_progress_show(void *progress, double fraction) {
  return supine_options_progress_step(progress, fraction) ? 0 : 1;
}

void supine_options_progress_end(supine_progress *progress) {
  if (progress->is_shown) {
    (void)fputs("\r\033[K", stderr);
    (void)fflush(stderr);
  }
}
