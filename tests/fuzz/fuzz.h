/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Entry points that each fuzzer defines, and helpers that all of them share. */
#ifndef SUPINE_FUZZ_H
#define SUPINE_FUZZ_H

#include <stddef.h>
#include <stdint.h>

/** Read `bytes` as an untrusted file; abort if the result is not valid. */
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

/** Return seed `index` in a new block (malloc) and set its size; return NULL if there is no such
 * seed. */
uint8_t *supine_fuzz_seed(size_t index, size_t *size);

/** Return a copy of a text (malloc) and its size, as a seed. */
uint8_t *supine_fuzz_text(const char *text, size_t *size);

/** Write the bytes to a temporary file with this ending, in memory if possible; return its path,
 * the same for every call of a process. */
const char *supine_fuzz_file(const uint8_t *bytes, size_t size, const char *ending);

/** Return the content of a file (malloc) and its size, as a seed, and remove the file. */
uint8_t *supine_fuzz_take(const char *path, size_t *size);

/** Abort if `sound` is false, and print what was expected. */
void supine_fuzz_expect(int sound, const char *words);

#endif
