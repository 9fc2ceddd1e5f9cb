/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read messages from untrusted bytes. Write headers, floats, and the first fields of a body. */
#include <arpa/inet.h>
#include <stdbool.h>
#include <string.h>

#include "base/arena.h"
#include "base/ascii.h"
#include "base/clones.h"
#include "base/vec3.h"
#include "program/stream/message.h"

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
  SUPINE_REFUSE_IF(header->version < 1 || header->version > 3, error, SUPINE_ERROR_FORMAT,
                   "message header version %u is unknown: send version 1, 2 or 3", header->version);
  for (const char *c = header->type; *c != '\0'; ++c) {
    SUPINE_REFUSE_IF(*c < ' ' || *c > '~', error, SUPINE_ERROR_FORMAT,
                     "the type of a message is not text: send OpenIGTLink messages");
  }
  return SUPINE_OK;
}

void supine_stream_header_write(const supine_stream_header *header,
                                unsigned char bytes[SUPINE_STREAM_HEADER]) {
  put(bytes, 2, header->version);
  memcpy(bytes + 2, header->type, sizeof header->type - 1);
  memcpy(bytes + 14, header->device, sizeof header->device - 1);
  put(bytes + 34, 8, header->stamp);
  put(bytes + 42, 8, header->size);
  put(bytes + 50, 8, header->crc);
}

size_t supine_stream_polydata_head(size_t points, size_t strips, size_t size, size_t attributes,
                                   unsigned char *bytes) {
  memset(bytes, 0, 40); /* zeros: no vertices, lines or polygons */
  put(bytes, 4, points);
  put(bytes + 28, 4, strips);
  put(bytes + 32, 4, size);
  put(bytes + 36, 4, attributes);
  return 40;
}

size_t supine_stream_attribute_head(size_t points, unsigned char *bytes) {
  /* The protocol requires an even length; the text and its NUL have 18 bytes. */
  static const char text[] = "expected_error_mm";
  _Static_assert(6 + sizeof text == SUPINE_STREAM_ATTRIBUTE,
                 "the size must be that of type, count and name");
  put(bytes, 2, 1); /* type 0 (a scalar) and 1 component */
  put(bytes + 2, 4, points);
  memcpy(bytes + 6, text, sizeof text);
  return SUPINE_STREAM_ATTRIBUTE;
}

size_t supine_stream_status_write(const char *device, const char *text, unsigned char *bytes) {
  enum { UNREACHABLE = 8, NAME_AT = 10, TEXT_AT = 30 };
  unsigned char *body = bytes + SUPINE_STREAM_HEADER;
  supine_stream_header header = {.version = 1, .type = "STATUS"};
  memset(body, 0, TEXT_AT);
  put(body, 2, UNREACHABLE);
  memcpy(body + NAME_AT, "refused", strlen("refused"));
  (void)snprintf((char *)body + TEXT_AT, SUPINE_STREAM_STATUS_TEXT, "%s", text);
  (void)snprintf(header.device, sizeof header.device, "%s", device);
  header.size = TEXT_AT + strlen((char *)body + TEXT_AT) + 1;
  header.crc = supine_stream_crc64(0, body, header.size);
  supine_stream_header_write(&header, bytes);
  return SUPINE_STREAM_HEADER + header.size;
}

SUPINE_CLONES void supine_stream_encode_floats(size_t count, float *values) {
  for (size_t i = 0; i < count; ++i) {
    uint32_t word;
    memcpy(&word, values + i, sizeof word);
    word = htonl(word);
    memcpy(values + i, &word, sizeof word);
  }
}

/* Unread part of a body. Reading beyond the end returns zeros and sets `overrun`. */
typedef struct cursor {
  const unsigned char *at;
  size_t left;
  int overrun;
} cursor;

static const unsigned char *pass(cursor *c, size_t size) {
  static const unsigned char nothing[32];
  if (size > c->left) {
    c->overrun = 1;
    c->left = 0;
    return nothing;
  }
  const unsigned char *at = c->at;
  c->at += size;
  c->left -= size;
  return at;
}

static uint64_t whole(cursor *c, int size) {
  return number(pass(c, (size_t)size), size);
}

static double real32(cursor *c) {
  const uint32_t bits = (uint32_t)whole(c, 4);
  float value;
  memcpy(&value, &bits, sizeof value);
  return (double)value;
}

static double real64(cursor *c) {
  const uint64_t bits = whole(c, 8);
  double value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

/* Read a quaternion, which is sent as x, y, z, w, as a matrix. */
static void quaternion(cursor *c, supine_stream_message *m) {
  double q[4];
  m->kind = SUPINE_STREAM_ROTATION;
  for (int i = 0; i < 4; ++i) {
    q[(i + 1) % 4] = real32(c);
  }
  supine_quaternion_matrix(q, m->number);
}

static void transform(cursor *c, const char *device, int ours, supine_stream_message *m) {
  m->kind = ours ? SUPINE_STREAM_ROTATION : SUPINE_STREAM_POSITION;
  memcpy(m->text, device, strlen(device) + 1);
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) {
      m->number[3 * row + column] = real32(c);
    }
  }
  for (int row = 0; row < 3; ++row) {
    m->number[9 + row] = real32(c);
  }
}

/* A point: name (64 bytes), group (32), colour (4), position (12), diameter (4), owner (20). */
enum { POINT_NAME_SIZE = 64, POINT_POSITION_OFFSET = 100, POINT_SIZE = 136 };

static void points(cursor *c, supine_stream_message *m) {
  m->kind = SUPINE_STREAM_POINT_LIST;
  m->point_count = c->left / POINT_SIZE;
  m->points = pass(c, m->point_count * POINT_SIZE);
  c->overrun |= c->left > 0;
}

void supine_stream_message_point(const supine_stream_message *message, size_t point, char name[65],
                                 double position[3]) {
  const unsigned char *at = message->points + POINT_SIZE * point;
  cursor place = {at + POINT_POSITION_OFFSET, 12, 0};
  memcpy(name, at, POINT_NAME_SIZE);
  name[POINT_NAME_SIZE] = '\0';
  for (int i = 0; i < 3; ++i) {
    position[i] = real32(&place);
  }
}

/* Read the quaternion of the instrument named `device`. If `device` is NULL or names the sender of
 * the message, read the quaternion of the last instrument. */
static void instruments(cursor *c, const char *device, const supine_stream_header *header,
                        supine_stream_message *m) {
  const int all = device == NULL || strcmp(header->device, device) == 0;
  while (c->left != 0 && c->overrun == 0) {
    char name[21] = {0};
    memcpy(name, pass(c, 20), 20);
    (void)pass(c, 2 + 12); /* skip type, a reserved byte and position */
    if (all || strcmp(name, device) == 0) {
      quaternion(c, m);
    } else {
      (void)pass(c, 16);
    }
  }
}

/* Read an array of `expected` 32-bit or 64-bit floats; ignore other lengths and types. */
static void array(cursor *c, supine_stream_message *m, supine_stream_kind kind, uint64_t expected) {
  const uint64_t type = whole(c, 1);
  const uint64_t dimension = whole(c, 1);
  uint64_t count = 1;
  for (uint64_t i = 0; i < dimension; ++i) {
    const uint64_t size = whole(c, 2);
    count = count > SUPINE_STREAM_BODY_MAX ? count : count * size; /* cannot overflow */
  }
  if (count != expected || (type != 10 && type != 11)) {
    return;
  }
  m->kind = kind;
  for (uint64_t i = 0; i < count; ++i) {
    m->number[i] = type == 10 ? real32(c) : real64(c);
  }
}

static void string(cursor *c, supine_stream_message *m, supine_stream_kind kind) {
  (void)pass(c, 2); /* skip the encoding: valid texts are ASCII, which all encodings share */
  const size_t length = (size_t)whole(c, 2);
  const unsigned char *text = pass(c, length);
  if (c->overrun == 0 && length < sizeof m->text) {
    memcpy(m->text, text, length);
    m->kind = kind;
  }
}

static bool is(const supine_stream_header *header, const char *type) {
  return strcmp(header->type, type) == 0;
}

/* Skip the extended header of a body and cut off its metadata, which are written to `metadata`;
 * return 0 if a size is invalid. */
static int unwrap(cursor *c, cursor *metadata) {
  const size_t all = c->left;
  const uint64_t extension = whole(c, 2);
  const uint64_t size = whole(c, 2) + whole(c, 4);
  (void)pass(c, 4);
  if (c->overrun != 0 || extension < SUPINE_STREAM_EXTENSION || extension + size > all) {
    return 0;
  }
  (void)pass(c, (size_t)extension - SUPINE_STREAM_EXTENSION);
  c->left -= (size_t)size;
  *metadata = (cursor){c->at + c->left, (size_t)size, 0};
  return 1;
}

static bool ends_in(const unsigned char *key, size_t size, const char *end) {
  const size_t length = strlen(end);
  return size >= length && memcmp(key + size - length, end, length) == 0;
}

static bool equals(const unsigned char *value, size_t size, const char *word) {
  return size == strlen(word) && supine_ascii_same_begin((const char *)value, word, size);
}

/* Return whether an entry of the metadata marks a pose as invalid. The state of a tool's switch is
 * also a status, of a valid pose. */
static bool marks_invalid(const unsigned char *key, size_t key_size, const unsigned char *value,
                          size_t value_size) {
  if (ends_in(key, key_size, "TransformValid")) {
    return equals(value, value_size, "false") || equals(value, value_size, "0");
  }
  return ends_in(key, key_size, "TransformStatus") && !equals(value, value_size, "OK") &&
         !(value_size > 6 && equals(value, 6, "SWITCH"));
}

/* Return whether the metadata mark the pose as invalid. They are an index, which has their number
 * (2) and for each the sizes of its key (2) and value (4) and an encoding (2), and then the texts.
 */
static bool is_invalid(cursor metadata) {
  cursor index = metadata;
  const uint64_t count = whole(&index, 2);
  cursor texts = index;
  (void)pass(&texts, (size_t)count * 8);
  for (uint64_t i = 0; i < count && texts.overrun == 0; ++i) {
    const size_t key_size = (size_t)whole(&index, 2);
    (void)pass(&index, 2);
    const size_t value_size = (size_t)whole(&index, 4);
    const unsigned char *key = pass(&texts, key_size);
    const unsigned char *value = pass(&texts, value_size);
    if (texts.overrun == 0 && marks_invalid(key, key_size, value, value_size)) {
      return true;
    }
  }
  return false;
}

supine_status supine_stream_message_read(const supine_stream_header *header,
                                         const unsigned char *body, const char *device,
                                         supine_stream_message *message, supine_error *error) {
  *message = (supine_stream_message){0};
  const size_t size = (size_t)header->size;
  const uint64_t crc = supine_stream_crc64(0, body, size);
  SUPINE_REFUSE_IF(crc != header->crc, error, SUPINE_ERROR_FORMAT,
                   "%s: the checksum is wrong: send the message again", header->type);
  cursor c = {body, size, 0};
  cursor metadata = {NULL, 0, 0};
  if (header->version >= 2) {
    const bool fits = unwrap(&c, &metadata);
    SUPINE_REFUSE_IF(!fits, error, SUPINE_ERROR_FORMAT,
                     "%s: the sizes of extension and metadata exceed the body: correct the sender",
                     header->type);
  }
  const int ours = device == NULL || strcmp(header->device, device) == 0;
  if (strcmp(header->device, "VOLUME") == 0 || strcmp(header->device, "SEND") == 0) {
    const int volume = header->device[0] == 'V';
    if (is(header, "STRING")) {
      string(&c, message, volume ? SUPINE_STREAM_VOLUME_TEXT : SUPINE_STREAM_REQUEST);
    } else if (is(header, "NDARRAY") && volume) {
      array(&c, message, SUPINE_STREAM_VOLUME, 1);
    }
  } else if (is(header, "QTDATA")) {
    instruments(&c, device, header, message);
  } else if (is(header, "TRANSFORM")) {
    transform(&c, header->device, ours, message);
  } else if (is(header, "POINT")) {
    points(&c, message);
  } else if (is(header, "POSITION") && ours && size > 12) { /* a shorter one has no quaternion */
    (void)pass(&c, 12);
    quaternion(&c, message);
  } else if (is(header, "NDARRAY") && ours) {
    array(&c, message, SUPINE_STREAM_DOWN, 3);
  }
  if (c.overrun != 0) {
    message->kind = SUPINE_STREAM_NOTHING;
    return supine_error_set(
        error, SUPINE_ERROR_FORMAT,
        "%s: a body of %zu bytes is too short for its content: correct the sender", header->type,
        size);
  }
  if ((message->kind == SUPINE_STREAM_ROTATION || message->kind == SUPINE_STREAM_POSITION) &&
      metadata.left > 0 && is_invalid(metadata)) {
    message->kind = SUPINE_STREAM_INVALID;
  }
  return SUPINE_OK;
}
