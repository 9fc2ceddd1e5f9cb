/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Functions that all fuzzers share: inputs as files, and assertions. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fuzz.h"

void supine_fuzz_expect(int sound, const char *words) {
  if (!sound) {
    (void)fprintf(stderr, "expected: %s\n", words);
    abort();
  }
}

void supine_fuzz_expect_words(supine_status status, const supine_error *error) {
  supine_fuzz_expect(status == SUPINE_OK || (error->status == status && error->message[0] != '\0' &&
                                             strchr(error->message, '\n') == NULL),
                     "an error with its status and a message of one line");
}

uint8_t *supine_fuzz_text(const char *text, size_t *size) {
  *size = strlen(text);
  uint8_t *bytes = malloc(*size + 1);
  supine_fuzz_expect(bytes != NULL, "memory for a seed");
  memcpy(bytes, text, *size + 1);
  return bytes;
}

const char *supine_fuzz_file(const uint8_t *bytes, size_t size, const char *ending) {
  static char path[128];
  const char *folder = access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp";
  (void)snprintf(path, sizeof path, "%s/supine-fuzz-%ld%s", folder, (long)getpid(), ending);
  FILE *file = fopen(path, "wb");
  supine_fuzz_expect(file != NULL && fwrite(bytes, 1, size, file) == size && fclose(file) == 0,
                     "a file with the bytes of the input");
  return path;
}

uint8_t *supine_fuzz_take(const char *path, size_t *size) {
  FILE *file = fopen(path, "rb");
  supine_fuzz_expect(file != NULL && fseek(file, 0, SEEK_END) == 0, "the file of a seed to open");
  *size = (size_t)ftell(file);
  rewind(file);
  uint8_t *bytes = malloc(*size + 1);
  supine_fuzz_expect(bytes != NULL && fread(bytes, 1, *size, file) == *size,
                     "the bytes of a seed to be read");
  (void)fclose(file);
  (void)unlink(path);
  return bytes;
}
