/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What a process inherits does no harm: ignored signals, closed descriptors, a limit of addresses,
 * a clock that steps back. A program that does not end is ended after TOO_LONG seconds. */
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <time.h>

#include "program/options/command.h"
#include "tests/helpers/program_helpers.h"

enum { TOO_LONG = 300 };

/* Seconds by which the clock of the day is behind; it steps back at each call. Durations must not
 * be measured by it. */
static volatile sig_atomic_t behind;

time_t time(time_t *result) {
  struct timespec now;
  (void)clock_gettime(CLOCK_REALTIME, &now);
  if (result != NULL) {
    *result = now.tv_sec;
  }
  return now.tv_sec;
}

int clock_gettime(clockid_t clock, struct timespec *now) {
  const long failed = syscall(SYS_clock_gettime, clock, now);
  if (clock == CLOCK_REALTIME) {
    now->tv_sec -= behind++;
  }
  return (int)failed;
}

static void make_lungs(void) {
  EXPECT(0, "", "phantom --vertices 300 -o lungs.stl");
  EXPECT(0, "", "precompute lungs.stl --band 2 -o lungs.safetensors");
}

/* Start the program with its descriptors, limits and signals as the caller of fork() has set them.
 * Does not return. */
static _Noreturn void become(char *const *words) {
  (void)alarm(TOO_LONG);
  (void)execv(SUPINE_PROGRAM, words);
  _exit(126);
}

static int wait_for(pid_t child) {
  int how = 0;
  assert_true(child > 0);
  assert_int_equal(waitpid(child, &how, 0), child);
  return how;
}

/* Write pressures from -10 to 36 cmH2O, and volumes. */
static void write_samples(FILE *file, int count) {
  (void)fprintf(file, "pressure_cmH2O,volume_mL\n");
  for (int i = 0; i < count; ++i) {
    const double p = -10 + 46.0 * i / count;
    (void)fprintf(file, "%g,%.3f\n", p, 3000 / (1 + exp((8 - p) / 5.0)));
  }
}

/* Send the signal to a program that reads a FIFO, and return how the program ends after that. */
static int signal_reader(int number, bool ignored) {
  char *words[] = {"supine", "pv", "fit", "samples", "-o", "patient.pv.json", NULL};
  const pid_t child = fork();
  if (child == 0) {
    (void)signal(number, ignored ? SIG_IGN : SIG_DFL);
    if (chdir(folder) != 0 || freopen("/dev/null", "w", stdout) == NULL) {
      _exit(126);
    }
    become(words);
  }
  FILE *samples = fopen(in_folder("samples"), "w"); /* waits until the program opens the FIFO */
  assert_non_null(samples);
  assert_int_equal(kill(child, number), 0);
  (void)signal(SIGPIPE, SIG_IGN); /* the program may have ended */
  write_samples(samples, 23);
  (void)fclose(samples);
  return wait_for(child);
}

TEST(test_program_inherited_ignored_signal_stays_ignored) {
  static const int numbers[] = {SIGHUP, SIGINT, SIGTERM};
  assert_int_equal(mkfifo(in_folder("samples"), 0600), 0);
  for (size_t i = 0; i < 3; ++i) {
    const int how = signal_reader(numbers[i], true);
    assert_true(WIFEXITED(how));
    assert_int_equal(WEXITSTATUS(how), 0);
  }
  for (size_t i = 0; i < 3; ++i) {
    const int how = signal_reader(numbers[i], false);
    assert_true(WIFSIGNALED(how));
    assert_int_equal(WTERMSIG(how), numbers[i]);
  }
}

/* Run the command, without those of the descriptors 0 to 2 whose bit is set in `closed`. */
static int run_closed(unsigned closed, char *const *words) {
  const pid_t child = fork();
  if (child == 0) {
    const int nowhere = open("/dev/null", O_RDWR | O_CLOEXEC);
    if (chdir(folder) != 0 || dup2(nowhere, 1) < 0 || dup2(nowhere, 2) < 0) {
      _exit(126);
    }
    for (int i = 0; i < 3; ++i) {
      if ((closed >> i & 1) != 0) {
        (void)close(i);
      }
    }
    become(words);
  }
  const int how = wait_for(child);
  return WIFEXITED(how) ? WEXITSTATUS(how) : -1;
}

TEST(test_program_closed_descriptors_same_files) {
  char *solve[] = {"supine", "solve", "lungs.stl", "--posture", "prone", "-o", "closed.ply", NULL};
  char *info[] = {"supine", "info", "lungs.safetensors", NULL};
  char *standard[] = {"supine", "deform", "lungs.safetensors", "--posture", "prone", "-o",
                      "-.ply",  NULL};
  make_lungs();
  assert_int_equal(setenv("FOLDER", folder, 1), 0);
  EXPECT(0, "", "solve lungs.stl --posture prone -o open.ply");
  for (unsigned closed = 0; closed < 8; ++closed) {
    const bool written = (closed & 2) == 0;
    /* What cannot be printed is an error, but the file is complete. */
    assert_int_equal(run_closed(closed, solve), written ? 0 : SUPINE_EXIT_OUTPUT);
    assert_int_equal(system("cd \"$FOLDER\" && cmp open.ply closed.ply && rm closed.ply"), 0);
    assert_int_equal(run_closed(closed, info), written ? 0 : SUPINE_EXIT_OUTPUT);
    assert_int_equal(run_closed(closed, standard), written ? 0 : SUPINE_EXIT_USAGE);
  }
}

TEST(test_signals_clock_steps_back_second_interrupt_ends_program) {
  const pid_t child = fork();
  if (child == 0) {
    (void)alarm(TOO_LONG);
    supine_options_signals_catch(true);
    for (;;) {
      (void)raise(SIGINT);
      (void)nanosleep(&(struct timespec){0, 20000000}, NULL);
    }
  }
  const int how = wait_for(child);
  assert_true(WIFSIGNALED(how));
  assert_int_equal(WTERMSIG(how), SIGINT);
}

/* Run the command with a limit of addresses; set `printed`. Return its exit code. */
static int run_limited(rlim_t megabytes, char *const *words) {
  int ends[2];
  size_t size = 0;
  assert_int_equal(pipe(ends), 0);
  const pid_t child = fork();
  if (child == 0) {
    const struct rlimit limit = {megabytes << 20, megabytes << 20};
    if (chdir(folder) != 0 || dup2(ends[1], 1) < 0 || dup2(ends[1], 2) < 0) {
      _exit(126);
    }
    (void)close(ends[0]);
    (void)close(ends[1]);
    (void)unsetenv("OPENBLAS_NUM_THREADS");
    (void)setenv("SUPINE_THREADS", "2", 1);
    (void)setrlimit(RLIMIT_AS, &limit);
    become(words);
  }
  (void)close(ends[1]);
  for (ssize_t got; (got = read(ends[0], printed + size, sizeof printed - 1 - size)) > 0;) {
    size += (size_t)got;
  }
  printed[size] = '\0';
  (void)close(ends[0]);
  const int how = wait_for(child);
  return WIFEXITED(how) ? WEXITSTATUS(how) : -1;
}

TEST(test_program_limit_of_addresses_ends_with_reason) {
  char *words[][10] = {
      {"supine", "precompute", "lungs.stl", "--band", "2", "-o", "limited.safetensors"},
      {"supine", "solve", "lungs.stl", "--posture", "prone", "-o", "limited.ply"},
      {"supine", "embed", "lungs.safetensors", "--grid", "60", "-o", "inside.safetensors"},
      {"supine", "validate", "lungs.safetensors", "--state", "supine:lungs.stl"},
      {"supine", "fit", "lungs.stl", "other.stl", "-o", "patient.json"},
      {"supine", "pv", "fit", "many.csv", "-o", "patient.pv.json"},
      {"supine", "--version"}};
#ifdef SUPINE_SANITIZED
  skip(); /* sanitizers need terabytes of addresses */
#endif
  make_lungs();
  EXPECT(0, "", "solve lungs.stl --posture supine -o other.stl");
  FILE *samples = fopen(in_folder("many.csv"), "w"); /* so many that the fit uses OpenBLAS */
  assert_non_null(samples);
  write_samples(samples, 4000);
  (void)fclose(samples);
  for (size_t w = 0; w < sizeof words / sizeof *words; ++w) {
    size_t refused = 0;
    for (rlim_t megabytes = 100; megabytes <= 1000; megabytes += megabytes < 500 ? 50 : 250) {
      const int code = run_limited(megabytes, words[w]);
      if (code == -1) {
        fail_msg("%s under %d MiB did not end", words[w][1], (int)megabytes);
      }
      if (strstr(printed, "OpenBLAS needs another") != NULL) {
        char limit[64];
        assert_int_equal(code, SUPINE_EXIT_NUMERICAL);
        assert_says(printed, strcmp(words[w][1], "pv") == 0
                                 ? "128 MiB of addresses for 1 thread, and"
                                 : "256 MiB of addresses for 2 threads, and");
        (void)snprintf(limit, sizeof limit, "the limit of the process is %d MiB", (int)megabytes);
        assert_says(printed, limit);
        ++refused;
      } else if (code != 0 && code != 127) { /* 127: a library cannot be loaded */
        assert_says(printed, "memory");
      }
    }
    assert_true((refused > 0) == (strcmp(words[w][1], "--version") != 0));
  }
}

TEST_GROUP(folder_make, folder_remove)
