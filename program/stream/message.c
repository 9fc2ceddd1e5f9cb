/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read and write headers of messages; write points, and the beginning of each content. */
#include <ctype.h>
#include <string.h>

#include "program/stream/message.h"
#include "sh/base/clones.h"

static uint64_t number(const unsigned char *bytes, int size) {
  uint64_t value = 0;
  for (int i = 0; i < size; ++i) {
    value = value << 8 | bytes[i];
  }
  return value;
}

static void put(unsigned char *bytes, int size, uint64_t value) {
  for (int i = size - 1; i >= 0; --i, value >>= 8) {
    bytes[i] = (unsigned char)value;
  }
}

supine_status supine_stream_header_read(const unsigned char bytes[SUPINE_STREAM_HEADER],
                                        supine_stream_header *header, supine_error *error) {
  *header = (supine_stream_header){.version = (unsigned)number(bytes, 2),
                                   .stamp = number(bytes + 34, 8),
                                   .size = number(bytes + 42, 8),
                                   .crc = number(bytes + 50, 8)};
  memcpy(header->type, bytes + 2, sizeof header->type - 1);
  memcpy(header->device, bytes + 14, sizeof header->device - 1);
  if (header->version != 1 && header->version != 2) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "message header version %u is unknown: send version 1 or 2",
                            header->version);
  }
  for (const char *c = header->type; *c != '\0'; ++c) {
    if (!isprint((unsigned char)*c)) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "the type of a message is not text: send OpenIGTLink messages");
    }
  }
  return SUPINE_OK;
}

void supine_stream_header_write(const supine_stream_header *header,
                                unsigned char bytes[SUPINE_STREAM_HEADER]) {
  put(bytes, 2, header->version);
  memcpy(bytes + 2, header->type, sizeof header->type - 1); /* padded with zeros */
  memcpy(bytes + 14, header->device, sizeof header->device - 1);
  put(bytes + 34, 8, header->stamp);
  put(bytes + 42, 8, header->size);
  put(bytes + 50, 8, header->crc);
}

void supine_stream_put32(unsigned char *bytes, uint32_t value) {
  put(bytes, 4, value);
}

size_t supine_stream_ndarray_head(size_t count, unsigned char *bytes) {
  bytes[0] = 10; /* type: 32-bit floats */
  bytes[1] = 1;  /* number of dimensions */
  put(bytes + 2, 2, count);
  return 4;
}

size_t supine_stream_polydata_head(size_t points, size_t strips, size_t size, size_t attributes,
                                   unsigned char *bytes) {
  memset(bytes, 0, 40); /* no vertices, lines, polygons */
  put(bytes, 4, points);
  put(bytes + 28, 4, strips);
  put(bytes + 32, 4, size);
  put(bytes + 36, 4, attributes);
  return 40;
}

size_t supine_stream_attribute_head(size_t points, unsigned char *bytes) {
  static const char text[] =
      "expected_error_mm"; /* its length with the NUL is even, as the protocol requires */
  _Static_assert(6 + sizeof text == SUPINE_STREAM_ATTRIBUTE, "type, components, count, name");
  put(bytes, 2, 1); /* a scalar of one component */
  put(bytes + 2, 4, points);
  memcpy(bytes + 6, text, sizeof text);
  return SUPINE_STREAM_ATTRIBUTE;
}

/* Points that are converted to big-endian together, by vector instructions. */
enum { BUNCH = 16 };

SUPINE_CLONES static void put_bunch(const float *xyz, const uint32_t *sign, unsigned char *bytes) {
  uint32_t word[3 * BUNCH];
  memcpy(word, xyz, sizeof word);
  for (size_t i = 0; i < 3 * BUNCH; ++i) {
    word[i] ^= sign[i];
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    word[i] = __builtin_bswap32(word[i]);
#endif
  }
  memcpy(bytes, word, sizeof word);
}

void supine_stream_put_points(size_t count, const float *xyz, int flip, unsigned char *bytes) {
  uint32_t sign[3 * BUNCH];
  for (size_t i = 0; i < 3 * BUNCH; ++i) {
    sign[i] = flip != 0 && i % 3 < 2 ? 0x80000000u : 0u;
  }
  const size_t whole = count - count % BUNCH;
  for (size_t i = 0; i < whole; i += BUNCH) {
    put_bunch(xyz + 3 * i, sign, bytes + 12 * i);
  }
  float rest[3 * BUNCH] = {0.0F};
  unsigned char last[12 * BUNCH];
  memcpy(rest, xyz + 3 * whole, 12 * (count - whole));
  put_bunch(rest, sign, last);
  memcpy(bytes + 12 * whole, last, 12 * (count - whole));
}
