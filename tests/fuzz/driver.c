/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Run a fuzzer without libFuzzer (gcc), and write its seeds.
 *
 *     fuzz_X FILE...                           run each file
 *     fuzz_X -seeds FOLDER                     write the seeds
 *     fuzz_X -runs N [-seed S] [-dict FILE]    run N mutations of the seeds
 *
 * Print the number of inputs, the longest time and the peak memory. Exit with 1 if an input took
 * more than 0.5 s of processor time (5 s with a sanitizer) or the process used more than 2 GB. An
 * input that crashes, or takes 20 times as long, is saved as crash-input in the working folder. */
#include <fcntl.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include "fuzz.h"

enum { SEEDS_MAX = 8192, WORDS_MAX = 256, WORD_MAX = 64, SIZE_MOST = 1 << 16 };
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
static const double seconds_most = 5.0;
#else
static const double seconds_most = 0.5;
#endif
static const double megabytes_most = 2000.0;

typedef struct word {
  uint8_t bytes[WORD_MAX];
  size_t size;
} word;

static word words[WORDS_MAX];
static size_t word_count;
static uint8_t *seeds[SEEDS_MAX];
static size_t seed_size[SEEDS_MAX];
static size_t seed_count;
static uint64_t state;
static double slowest;

/* the input that is being run, which the crash handler saves */
static const uint8_t *current;
static size_t current_size;

static uint64_t next_random(void) {
  state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
  return state >> 33;
}

static void keep_crasher(int number) {
  static const char name[] = "crash-input";
  const int file = open(name, O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (file >= 0 && write(file, current, current_size) >= 0) {
    (void)!write(2, "saved: crash-input\n", 19);
  }
  (void)signal(number, SIG_DFL);
  (void)raise(number);
}

/* Read words from a file with a line name="word" or "word" for each word, in which \\, \" and \xHH
 * are escapes. */
static void read_dictionary(const char *path) {
  char line[512];
  FILE *file = fopen(path, "r");
  supine_fuzz_expect(file != NULL, path);
  while (word_count < WORDS_MAX && fgets(line, sizeof line, file) != NULL) {
    const char *at = line[0] == '#' ? NULL : strchr(line, '"');
    word *made = &words[word_count];
    made->size = 0;
    while (at != NULL && *++at != '"' && *at != '\0' && made->size < WORD_MAX) {
      unsigned value = (unsigned char)*at;
      if (*at == '\\' && at[1] == 'x' && sscanf(at + 2, "%2x", &value) == 1) {
        at += 3;
      } else if (*at == '\\') {
        value = (unsigned char)*++at;
      }
      made->bytes[made->size++] = (uint8_t)value;
    }
    word_count += made->size > 0;
  }
  (void)fclose(file);
}

static size_t put_word(uint8_t *bytes, size_t size, size_t place, const uint8_t *with, size_t count,
                       bool insert) {
  if (insert && size + count <= SIZE_MOST) {
    memmove(bytes + place + count, bytes + place, size - place);
    size += count;
  }
  memcpy(bytes + place, with, place + count <= size ? count : size - place);
  return size;
}

/* Apply one random mutation: change a bit or byte, delete or repeat bytes, truncate, or insert (or
 * write over others) a number, bytes of a seed or a dictionary word. Return the new size. */
static size_t change(uint8_t *bytes, size_t size) {
  static const char *const numbers[] = {"-1",    "0",   "4294967296",
                                        "1e999", "nan", "99999999999999999999"};
  const size_t place = size == 0 ? 0 : next_random() % size;
  const size_t length = size == 0 ? 0 : 1 + next_random() % (size - place < 64 ? size - place : 64);
  uint8_t piece[64];
  switch (next_random() % 8) {
  case 0:
    bytes[place] = (uint8_t)(bytes[place] ^ 1U << next_random() % 8);
    return size;
  case 1:
    bytes[place] = (uint8_t)(next_random() % 4 == 0 ? 0xFF : next_random());
    return size;
  case 2:
    memmove(bytes + place, bytes + place + length, size - place - length);
    return size - length;
  case 3:
    memcpy(piece, bytes + place, length);
    return put_word(bytes, size, place, piece, length, true);
  case 4: {
    const char *number = numbers[next_random() % (sizeof numbers / sizeof *numbers)];
    return put_word(bytes, size, place, (const uint8_t *)number, strlen(number), next_random() % 2);
  }
  case 5: {
    const size_t other = next_random() % seed_count;
    const size_t from = next_random() % (seed_size[other] + 1);
    const size_t count = seed_size[other] - from < 64 ? seed_size[other] - from : 64;
    return put_word(bytes, size, place, seeds[other] + from, count, next_random() % 2);
  }
  case 6:
    return next_random() % 8 == 0 ? place : size;
  default: {
    const word *chosen = word_count == 0 ? NULL : &words[next_random() % word_count];
    return chosen == NULL
               ? size
               : put_word(bytes, size, place, chosen->bytes, chosen->size, next_random() % 2);
  }
  }
}

/* Return the processor time that this process has used, s. */
static double seconds(void) {
  struct timespec now;
  (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* End the process by SIGPROF after this processor time, s; 0 stops the clock. */
static void limit_time(double limit) {
  const struct itimerval timer = {.it_value.tv_sec = (time_t)limit};
  (void)setitimer(ITIMER_PROF, &timer, NULL);
}

/* Run one input from a block of its exact size, so that a sanitizer detects reads past the end. */
static void run(const uint8_t *bytes, size_t size) {
  uint8_t *copy = malloc(size + (size == 0));
  supine_fuzz_expect(copy != NULL, "memory for an input");
  memcpy(copy, bytes, size);
  current = copy;
  current_size = size;
  const double begin = seconds();
  limit_time(20.0 * seconds_most);
  (void)LLVMFuzzerTestOneInput(copy, size);
  limit_time(0.0);
  const double took = seconds() - begin;
  slowest = took > slowest ? took : slowest;
  free(copy);
}

static void run_made(unsigned long count) {
  static uint8_t bytes[SIZE_MOST + WORD_MAX];
  for (size_t i = 0; i < seed_count; ++i) {
    run(seeds[i], seed_size[i]);
  }
  for (unsigned long n = 0; n < count; ++n) {
    const size_t chosen = next_random() % seed_count;
    size_t size = seed_size[chosen] < SIZE_MOST ? seed_size[chosen] : SIZE_MOST;
    memcpy(bytes, seeds[chosen], size);
    for (uint64_t changes = 1 + next_random() % 6; changes > 0; --changes) {
      size = change(bytes, size);
    }
    run(bytes, size);
  }
}

static void write_seeds(const char *folder) {
  for (size_t i = 0; i < seed_count; ++i) {
    char path[512];
    (void)snprintf(path, sizeof path, "%s/seed-%zu", folder, i);
    FILE *file = fopen(path, "wb");
    supine_fuzz_expect(file != NULL && fwrite(seeds[i], 1, seed_size[i], file) == seed_size[i] &&
                           fclose(file) == 0,
                       path);
  }
}

int main(int argc, char **argv) {
  unsigned long runs = 0;
  unsigned long inputs = 0;
  static const int signals[] = {SIGSEGV, SIGABRT, SIGFPE, SIGBUS, SIGILL, SIGPROF};
  for (size_t i = 0; i < sizeof signals / sizeof *signals; ++i) {
    (void)signal(signals[i], keep_crasher);
  }
  while (seed_count < SEEDS_MAX &&
         (seeds[seed_count] = supine_fuzz_seed(seed_count, &seed_size[seed_count])) != NULL) {
    ++seed_count;
  }
  supine_fuzz_expect(seed_count > 0 && seed_count < SEEDS_MAX, "1 to SEEDS_MAX - 1 seeds");
  state = 20080312;
  for (int i = 1; i < argc; ++i) {
    const bool has_value = i + 1 < argc;
    if (strcmp(argv[i], "-seeds") == 0 && has_value) {
      write_seeds(argv[++i]);
    } else if (strcmp(argv[i], "-runs") == 0 && has_value) {
      runs = strtoul(argv[++i], NULL, 10);
    } else if (strcmp(argv[i], "-seed") == 0 && has_value) {
      state = strtoul(argv[++i], NULL, 10);
    } else if (strcmp(argv[i], "-dict") == 0 && has_value) {
      read_dictionary(argv[++i]);
    } else {
      FILE *file = fopen(argv[i], "rb");
      static uint8_t bytes[16 << 20];
      supine_fuzz_expect(file != NULL, argv[i]);
      run(bytes, fread(bytes, 1, sizeof bytes, file));
      (void)fclose(file);
      ++inputs;
    }
  }
  if (runs > 0) {
    run_made(runs);
    inputs += runs + seed_count;
  }
  struct rusage usage;
  (void)getrusage(RUSAGE_SELF, &usage);
  const double megabytes = (double)usage.ru_maxrss / 1024.0;
  (void)printf("%lu inputs, slowest %.3f s, peak memory %.0f MB\n", inputs, slowest, megabytes);
  for (size_t i = 0; i < seed_count; ++i) {
    free(seeds[i]);
  }
  return slowest > seconds_most || megabytes > megabytes_most;
}
