/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Show progress on a terminal, and end orderly when the user interrupts. */
#include <signal.h>
#include <time.h>
#include <unistd.h>

#include "sh/base/clock.h"
#include "sh/base/output.h"

#include "program/options/command.h"

/* 1: the command stops by itself after a signal; 1: that signal was received. */
static volatile sig_atomic_t orderly, interrupted;
static volatile time_t interrupted_at; /* when it was received, s since 1970 */

/* Ask the command to stop where it does so by itself; else end the program. A further signal ends
 * the program at once, but not within a second of the first: timeout(1) sends each signal twice. */
static void on_signal(int number) {
  const time_t now = time(NULL);
  if (orderly != 0 && interrupted == 0) {
    interrupted = 1;
    interrupted_at = now;
  }
  if (orderly != 0 && now - interrupted_at < 2) {
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
  orderly = orderly_end ? 1 : 0;
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; ++i) {
    (void)sigaction(numbers[i], &action, NULL);
  }
  (void)signal(SIGXFSZ, SIG_IGN); /* a file that grows too large is an error of the write */
}

bool supine_options_interrupted(void) {
  return interrupted != 0;
}

supine_progress supine_options_progress_begin(const char *label) {
  const double start = supine_clock_seconds();
  return (supine_progress){label, start, start, isatty(STDERR_FILENO) == 1};
}

bool supine_options_progress_step(void *progress, double fraction) {
  supine_progress *state = progress;
  const double time = supine_clock_seconds();
  if (state->terminal && time - state->shown > 0.1) {
    state->shown = time;
    const double spent = time - state->start;
    (void)fprintf(stderr, "\r%s: %3.0f %%", state->label, 100.0 * fraction);
    if (fraction > 0.02 && spent > 1.0) {
      (void)fprintf(stderr, ", %.0f s left ", spent * (1.0 - fraction) / fraction);
    }
    (void)fflush(stderr);
  }
  return !supine_options_interrupted();
}

void supine_options_progress_end(supine_progress *progress) {
  if (progress->terminal) {
    (void)fputs("\r\033[K", stderr);
    (void)fflush(stderr);
  }
}
