/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Functions that each fuzzer defines, and functions that all fuzzers share. */
#ifndef SUPINE_FUZZ_H
#define SUPINE_FUZZ_H

#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

/** Read `bytes` as a file from an unknown source. Abort if the result is not valid. */
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

/** Return a new block (malloc) with seed number `index`, a valid input to be mutated, and set its
 * size. Return NULL if there is no such seed. */
uint8_t *supine_fuzz_seed(size_t index, size_t *size);

/** Return a copy of a text (malloc), for use as a seed, and set its size. */
uint8_t *supine_fuzz_text(const char *text, size_t *size);

/** Write the bytes to a temporary file with this ending, in memory if possible. Return the path of
 * the file, which is the same for every call by one process. */
const char *supine_fuzz_file(const uint8_t *bytes, size_t size, const char *ending);

/** Return the content of a file (malloc), for use as a seed, set its size and remove the file. */
uint8_t *supine_fuzz_take(const char *path, size_t *size);

/** If `sound` is false, print `words`, which name what was expected, and abort. */
void supine_fuzz_expect(int sound, const char *words);

/** Abort unless a status is SUPINE_OK, or the error has this status and a message of one line. */
void supine_fuzz_expect_words(supine_status status, const supine_error *error);

#endif
