/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Progress on a terminal, and an orderly end when the user interrupts. */
#include <signal.h>
#include <unistd.h>

#include "sh/base/clock.h"

#include "runtime/options/command.h"

static volatile sig_atomic_t interrupted;

static void on_signal(int number) {
  (void)number;
  interrupted = 1;
}

void supine_options_interrupts_catch(void) {
  struct sigaction action = {0};
  action.sa_handler = on_signal;
  action.sa_flags = (int)SA_RESETHAND; /* a second signal ends the program at once */
  (void)sigaction(SIGINT, &action, NULL);
  (void)sigaction(SIGTERM, &action, NULL);
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
