/* SPDX-License-Identifier: GPL-3.0-or-later */
/* What a fuzzer of one reader gives, beside libFuzzer's own LLVMFuzzerTestOneInput. */
#ifndef SUPINE_FUZZ_H
#define SUPINE_FUZZ_H

#include <stddef.h>
#include <stdint.h>

/** Reads `bytes` as a file from anywhere; ends the program where what came of it is not sound. */
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

/** Seed `index` into a new block of `size` bytes; NULL where there is no such seed. */
uint8_t *supine_fuzz_seed(size_t index, size_t *size);

/** A copy of a text, as a seed. */
uint8_t *supine_fuzz_text(const char *text, size_t *size);

/** The bytes as a file of this ending, in a folder of memory where there is one; its name stays
 * that of the process. */
const char *supine_fuzz_file(const uint8_t *bytes, size_t size, const char *ending);

/** All of a file that supine_fuzz_file named, which is removed, as a seed. */
uint8_t *supine_fuzz_take(const char *path, size_t *size);

/** Ends the program as a crash does, with the words, where `sound` is false. */
void supine_fuzz_expect(int sound, const char *words);

#endif
