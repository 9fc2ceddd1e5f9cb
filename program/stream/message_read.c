/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read messages from untrusted bytes. */
#include <math.h>
#include <string.h>

#include "program/stream/crc64.h"
#include "program/stream/message.h"

/* The unread part of a body. Reading beyond its end returns zeros and sets `short_of`. */
typedef struct cursor {
  const unsigned char *at;
  size_t left;
  int short_of;
} cursor;

static const unsigned char *pass(cursor *c, size_t size) {
  static const unsigned char nothing[32];
  if (size > c->left) {
    c->short_of = 1;
    c->left = 0;
    return nothing;
  }
  const unsigned char *at = c->at;
  c->at += size;
  c->left -= size;
  return at;
}

static uint64_t whole(cursor *c, int size) {
  const unsigned char *bytes = pass(c, (size_t)size);
  uint64_t value = 0;
  for (int i = 0; i < size; ++i) {
    value = value << 8 | bytes[i];
  }
  return value;
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

/* Read a quaternion, which is X, Y, Z, W on the wire. */
static void quaternion(cursor *c, supine_stream_message *m) {
  m->kind = SUPINE_STREAM_QUATERNION;
  for (int i = 1; i < 4; ++i) {
    m->number[i] = real32(c);
  }
  m->number[0] = real32(c);
}

static void transform(cursor *c, const char *device, int ours, supine_stream_message *m) {
  m->kind = ours ? SUPINE_STREAM_ROTATION : SUPINE_STREAM_PLACE;
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

/* Layout of a point, in bytes: name 64, group 32, colour 4, position 12, diameter 4, owner 20. */
enum { POINT_NAME = 64, POINT_PLACE = 100, POINT_SIZE = 136 };

static void points(cursor *c, supine_stream_message *m) {
  m->kind = SUPINE_STREAM_PLACES;
  m->point_count = c->left / POINT_SIZE;
  m->points = pass(c, m->point_count * POINT_SIZE);
  c->short_of |= c->left > 0;
}

void supine_stream_message_point(const supine_stream_message *message, size_t point, char name[65],
                                 double position[3]) {
  const unsigned char *at = message->points + POINT_SIZE * point;
  cursor place = {at + POINT_PLACE, 12, 0};
  memcpy(name, at, POINT_NAME);
  name[POINT_NAME] = '\0';
  for (int i = 0; i < 3; ++i) {
    position[i] = real32(&place);
  }
}

/* Read the orientation of a POSITION. One of 12 bytes has none; one of 24 omits W, which is then
 * not negative. */
static void position(cursor *c, supine_stream_message *m) {
  const size_t size = c->left;
  if (size == 12) {
    return;
  }
  (void)pass(c, 12);
  if (size != 24) {
    quaternion(c, m);
    return;
  }
  m->kind = SUPINE_STREAM_QUATERNION;
  double square = 0.0;
  for (int i = 1; i < 4; ++i) {
    m->number[i] = real32(c);
    square += m->number[i] * m->number[i];
  }
  m->number[0] = sqrt(fmax(0.0, 1.0 - square));
}

/* Read the quaternion of the instrument `device`, or of any where the message itself is of that
 * device; the last where there are several. */
static void instruments(cursor *c, const char *device, const supine_stream_header *header,
                        supine_stream_message *m) {
  const int all = device == NULL || strcmp(header->device, device) == 0;
  while (c->left != 0 && c->short_of == 0) {
    char name[21] = {0};
    memcpy(name, pass(c, 20), 20);
    (void)pass(c, 2 + 12); /* type, reserved, position */
    if (all || strcmp(name, device) == 0) {
      quaternion(c, m);
    } else {
      (void)pass(c, 16);
    }
  }
}

/* Read an array of `expected` numbers, and ignore any other. */
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

static void sensor(cursor *c, supine_stream_message *m) {
  const uint64_t count = whole(c, 1);
  (void)pass(c, 1 + 8); /* status, unit */
  if (count != 3) {
    return;
  }
  m->kind = SUPINE_STREAM_DOWN;
  for (int i = 0; i < 3; ++i) {
    m->number[i] = -real64(c);
  }
}

static void string(cursor *c, supine_stream_message *m, supine_stream_kind kind) {
  (void)pass(c, 2); /* encoding: ASCII words are the same in all */
  const size_t length = (size_t)whole(c, 2);
  const unsigned char *text = pass(c, length);
  if (c->short_of == 0 && length < sizeof m->text) {
    memcpy(m->text, text, length);
    m->kind = kind;
  }
}

enum { TRANSFORM, QTDATA, POSITION, POINT, NDARRAY, SENSOR, STRING, TYPES };
static const char *const types[TYPES] = {"TRANSFORM", "QTDATA", "POSITION", "POINT",
                                         "NDARRAY",   "SENSOR", "STRING"};

static int type_of(const supine_stream_header *header) {
  int type = 0;
  while (type < TYPES && strcmp(header->type, types[type]) != 0) {
    ++type;
  }
  return type;
}

int supine_stream_message_wanted(const supine_stream_header *header) {
  return type_of(header) != TYPES;
}

/* Remove extension and metadata from a body of version 2; return 0 where their sizes are wrong. */
static int unwrap(cursor *c) {
  const size_t all = c->left;
  const uint64_t extension = whole(c, 2);
  const uint64_t metadata = whole(c, 2) + whole(c, 4);
  (void)pass(c, 4);
  if (c->short_of != 0 || extension < SUPINE_STREAM_EXTENSION || extension + metadata > all) {
    return 0;
  }
  (void)pass(c, (size_t)extension - SUPINE_STREAM_EXTENSION);
  c->left -= (size_t)metadata;
  return 1;
}

supine_status supine_stream_message_read(const supine_stream_header *header,
                                         const unsigned char *body, const char *device,
                                         supine_stream_message *message, supine_error *error) {
  *message = (supine_stream_message){0};
  const size_t size = (size_t)header->size;
  if (supine_stream_crc64(0, body, size) != header->crc) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: the checksum is wrong", header->type);
  }
  cursor c = {body, size, 0};
  if (header->version == 2 && !unwrap(&c)) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: the sizes of extension and metadata do not match that of the body",
                            header->type);
  }
  const int type = type_of(header);
  const int ours = device == NULL || strcmp(header->device, device) == 0;
  if (strcmp(header->device, "VOLUME") == 0 || strcmp(header->device, "SEND") == 0) {
    const int volume = header->device[0] == 'V';
    if (type == STRING) {
      string(&c, message, volume ? SUPINE_STREAM_VOLUME_TEXT : SUPINE_STREAM_REQUEST);
    } else if (type == NDARRAY && volume) {
      array(&c, message, SUPINE_STREAM_VOLUME, 1);
    }
  } else if (type == QTDATA) {
    instruments(&c, device, header, message);
  } else if (type == TRANSFORM) {
    transform(&c, header->device, ours, message);
  } else if (type == POINT) {
    points(&c, message);
  } else if (type == POSITION && ours) {
    position(&c, message);
  } else if (type == NDARRAY && ours) {
    array(&c, message, SUPINE_STREAM_DOWN, 3);
  } else if (type == SENSOR && ours) {
    sensor(&c, message);
  }
  if (c.short_of != 0) {
    message->kind = SUPINE_STREAM_NOTHING;
    return supine_error_set(error, SUPINE_ERROR_FORMAT,
                            "%s: a body of size %zu is too short for its content", header->type,
                            size);
  }
  return SUPINE_OK;
}
