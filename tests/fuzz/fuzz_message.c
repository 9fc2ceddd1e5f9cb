/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fuzz OpenIGTLink messages and tables of recorded poses. The size and the checksum in a message
 * are corrected, because a message with wrong ones is refused before most of the code runs. */
#include <endian.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "program/stream/message.h"
#include "program/stream/server.h"

#include "fuzz.h"

static void read_message(const uint8_t *bytes, size_t size, bool mend) {
  supine_stream_header header = {0};
  supine_stream_message message = {0};
  supine_error error = {0};
  if (supine_stream_header_read(bytes, &header, &error) != SUPINE_OK) {
    supine_fuzz_expect(error.message[0] != '\0', "an error message");
    return;
  }
  const size_t left = size - SUPINE_STREAM_HEADER;
  if (mend) {
    header.size = left;
    header.crc = supine_stream_crc64(0, bytes + SUPINE_STREAM_HEADER, left);
  }
  if (header.size > left || header.size > SUPINE_STREAM_BODY_MAX) {
    return;
  }
  const supine_status status =
      supine_stream_message_read(&header, bytes + SUPINE_STREAM_HEADER, NULL, &message, &error);
  supine_fuzz_expect(status == SUPINE_OK || error.message[0] != '\0', "an error message");
  supine_fuzz_expect(memchr(message.text, '\0', sizeof message.text) != NULL,
                     "a text that contains NUL");
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
  if (size >= SUPINE_STREAM_HEADER) {
    uint8_t *copy = malloc(
        size); /* a block of exactly this size, so that a sanitizer detects reads past its end */
    supine_fuzz_expect(copy != NULL, "memory for a copy of the input");
    memcpy(copy, bytes, size);
    read_message(copy, size, false);
    read_message(copy, size, true);
    free(copy);
  }
  return 0;
}

uint8_t *supine_fuzz_seed(size_t index, size_t *size) {
  static const char *const types[] = {"TRANSFORM", "QTDATA", "POSITION",
                                      "NDARRAY",   "STRING", "STRING"};
  static const char *const devices[] = {"Patient", "Patient", "Patient",
                                        "Patient", "VOLUME",  "SEND"};
  enum { MESSAGES = sizeof types / sizeof *types, BODY = 64 };
  if (index >= MESSAGES) {
    return index == MESSAGES
               ? supine_fuzz_text("seconds,x,y,z\n0,0,1,0\n0.015,0,0.9,0.1\n0.03,0.1,-1,0\n", size)
               : NULL;
  }
  supine_stream_header header = {.version = 1 + index % 2, .size = BODY};
  (void)strncpy(header.type, types[index], sizeof header.type - 1);
  (void)strncpy(header.device, devices[index], sizeof header.device - 1);
  uint8_t *bytes = calloc(1, SUPINE_STREAM_HEADER + BODY);
  supine_fuzz_expect(bytes != NULL, "memory for a seed");
  uint8_t *body = bytes + SUPINE_STREAM_HEADER;
  for (size_t i = 0; i < BODY; i += 4) {
    /* The bits of 1.0F, or of a smaller float. */
    const uint32_t word = htobe32(UINT32_C(0x3F800000) >> (i % 12));
    memcpy(body + i, &word, sizeof word);
  }
  header.crc = supine_stream_crc64(0, body, BODY);
  supine_stream_header_write(&header, bytes);
  *size = SUPINE_STREAM_HEADER + BODY;
  return bytes;
}
