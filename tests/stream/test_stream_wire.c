/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Messages compared with those of the public OpenIGTLink library. */
#include "tests/helpers/test.h"

#include <igtl_header.h>
#include <igtl_ndarray.h>
#include <igtl_point.h>
#include <igtl_polydata.h>
#include <igtl_position.h>
#include <igtl_qtdata.h>
#include <igtl_string.h>
#include <igtl_transform.h>
#include <igtl_util.h>

#include "base/vec3.h"
#include "program/stream/frame.h"
#include "tests/helpers/runtime_fixture.h"

static void fill(unsigned char *bytes, size_t size, uint64_t seed) {
  for (size_t i = 0; i < size; ++i) {
    bytes[i] = (unsigned char)(127.5 * (1.0 + fixture_random(&seed)));
  }
}

/* The checksum is right for every length, at every alignment modulo 8, in one call and in two. */
TEST(test_crc_every_length_equals_library) {
  enum { LONGEST = 3000 };
  unsigned char *bytes = fixture_allocate(LONGEST + 8, 1);
  fill(bytes, LONGEST + 8, 4711);
  for (size_t size = 0; size <= LONGEST; ++size) {
    unsigned char *at = bytes + size % 8;
    const uint64_t wanted = crc64(at, size, 0);
    const size_t cut = size * 5 / 13;
    assert_true(supine_stream_crc64(0, at, size) == wanted);
    assert_true(supine_stream_crc64(supine_stream_crc64(0, at, cut), at + cut, size - cut) ==
                wanted);
  }
  free(bytes);
}

TEST(test_crc_large_message_equals_library) {
  const size_t size = 6096012; /* bytes of 508,001 points */
  unsigned char *bytes = fixture_allocate(size, 1);
  fill(bytes, size, 99);
  assert_true(supine_stream_crc64(0, bytes, size) == crc64(bytes, size, 0));
  free(bytes);
}

TEST(test_header_written_equals_library) {
  igtl_header theirs = {
      .version = 1, .timestamp = 0x0102030405060708u, .body_size = 48, .crc = 0xF0E1D2C3B4A59687u};
  memcpy(theirs.name, "TRANSFORM", 9);
  memcpy(theirs.device_name, "exactly20characters!", 20);
  igtl_header_convert_byte_order(&theirs);
  supine_stream_header header;
  unsigned char bytes[SUPINE_STREAM_HEADER];
  supine_error error;
  assert_int_equal(sizeof theirs, SUPINE_STREAM_HEADER);
  assert_int_equal(supine_stream_header_read((const unsigned char *)&theirs, &header, &error),
                   SUPINE_OK);
  assert_int_equal(header.version, 1);
  assert_string_equal(header.type, "TRANSFORM");
  assert_string_equal(header.device, "exactly20characters!");
  assert_true(header.stamp == 0x0102030405060708u && header.size == 48 &&
              header.crc == 0xF0E1D2C3B4A59687u);
  supine_stream_header_write(&header, bytes);
  assert_memory_equal(bytes, &theirs, sizeof bytes);
}

/* Return a header for a body, with the checksum that the library computes. */
static supine_stream_header header_of(const char *type, const char *device, unsigned version,
                                      unsigned char *body, size_t size) {
  supine_stream_header header = {.version = version, .size = size, .crc = crc64(body, size, 0)};
  strcpy(header.type, type);
  strcpy(header.device, device);
  return header;
}

static supine_stream_message read_ok(const supine_stream_header *header, const unsigned char *body,
                                     const char *device) {
  supine_stream_message message;
  supine_error error;
  assert_int_equal(supine_stream_message_read(header, body, device, &message, &error), SUPINE_OK);
  return message;
}

/* Set the body of a TRANSFORM with the matrix rows 1 2 3, 4 5 6, 7 8 9, stored by columns. */
static void make_transform(igtl_float32 transform[12]) {
  const igtl_float32 columns[12] = {1, 4, 7, 2, 5, 8, 3, 6, 9, 10, 11, 12};
  memcpy(transform, columns, sizeof columns);
  igtl_transform_convert_byte_order(transform);
}

TEST(test_read_transform_of_library_gives_rotation_or_position) {
  igtl_float32 transform[12];
  make_transform(transform);
  unsigned char *body = (unsigned char *)transform;
  supine_stream_header header = header_of("TRANSFORM", "Patient", 1, body, sizeof transform);
  const char *const devices[] = {NULL, "Patient"};
  for (int i = 0; i < 2; ++i) {
    const supine_stream_message m = read_ok(&header, body, devices[i]);
    assert_int_equal(m.kind, SUPINE_STREAM_ROTATION);
    for (int k = 0; k < 9; ++k) {
      assert_true(m.number[k] == (double)(k + 1));
    }
  }
  /* If poses come from the device Probe, a TRANSFORM of another device is an observed point. */
  const supine_stream_message place = read_ok(&header, body, "Probe");
  assert_int_equal(place.kind, SUPINE_STREAM_POSITION);
  assert_string_equal(place.text, "Patient");
  for (int k = 0; k < 3; ++k) {
    assert_true(place.number[9 + k] == (double)(k + 10));
  }
  supine_stream_message m;
  supine_error error;
  header.crc ^= 1;
  assert_int_equal(supine_stream_message_read(&header, body, NULL, &m, &error),
                   SUPINE_ERROR_FORMAT);
  assert_int_equal(m.kind, SUPINE_STREAM_NOTHING);
}

/* Read a TRANSFORM with one entry of metadata. */
static supine_stream_kind kind_of_marked(unsigned version, const char *key, const char *value) {
  unsigned char body[12 + 48 + 10 + 64] = {0, 12, 0, 10, 0, 0, 0, 0, 0, 0, 0, 1};
  const size_t key_size = strlen(key);
  const size_t value_size = strlen(value);
  igtl_float32 transform[12];
  make_transform(transform);
  memcpy(body + 12, transform, 48);
  body[7] = (unsigned char)(key_size + value_size);
  unsigned char *index = body + 60;
  index[1] = 1;
  index[3] = (unsigned char)key_size;
  index[5] = 3;
  index[9] = (unsigned char)value_size;
  memcpy(index + 10, key, key_size);
  memcpy(index + 10 + key_size, value, value_size);
  const supine_stream_header header =
      header_of("TRANSFORM", "Patient", version, body, 70 + key_size + value_size);
  return read_ok(&header, body, NULL).kind;
}

TEST(test_read_transform_marked_invalid_is_not_followed) {
  for (unsigned version = 2; version <= 3; ++version) {
    assert_int_equal(kind_of_marked(version, "TransformValid", "false"), SUPINE_STREAM_INVALID);
    assert_int_equal(kind_of_marked(version, "TransformStatus", "INVALID"), SUPINE_STREAM_INVALID);
    assert_int_equal(kind_of_marked(version, "TransformStatus", "MISSING"), SUPINE_STREAM_INVALID);
    assert_int_equal(kind_of_marked(version, "ProbeToTrackerTransformStatus", "OUT_OF_VIEW"),
                     SUPINE_STREAM_INVALID);
    assert_int_equal(kind_of_marked(version, "TransformValid", "true"), SUPINE_STREAM_ROTATION);
    assert_int_equal(kind_of_marked(version, "TransformStatus", "OK"), SUPINE_STREAM_ROTATION);
    assert_int_equal(kind_of_marked(version, "TransformStatus", "SWITCH1_IS_ON"),
                     SUPINE_STREAM_ROTATION);
    assert_int_equal(kind_of_marked(version, "Timestamp", "0"), SUPINE_STREAM_ROTATION);
  }
}

TEST(test_read_transform_of_version_2_gives_rotation) {
  igtl_float32 transform[12];
  make_transform(transform);
  /* An extended header of 14 bytes, 2 more than the protocol defines, and metadata with the key "a"
   * of value "bc". */
  unsigned char body[14 + 48 + 10 + 3] = {0, 14, 0, 10, 0, 0, 0, 3, 0, 0, 0, 77, 0xAB, 0xCD};
  const unsigned char metadata[13] = {0, 1, 0, 1, 0, 3, 0, 0, 0, 2, 'a', 'b', 'c'};
  memcpy(body + 14, transform, 48);
  memcpy(body + 14 + 48, metadata, sizeof metadata);
  supine_stream_header header = header_of("TRANSFORM", "Patient", 2, body, sizeof body);
  assert_true(read_ok(&header, body, NULL).number[8] == 9.0);
  supine_stream_message m;
  supine_error error;
  /* Each truncated body is refused: the sizes in its headers add up to more than its size. */
  for (size_t size = 0; size < sizeof body; ++size) {
    header = header_of("TRANSFORM", "Patient", 2, body, size);
    assert_int_equal(supine_stream_message_read(&header, body, NULL, &m, &error),
                     SUPINE_ERROR_FORMAT);
    assert_int_equal(m.kind, SUPINE_STREAM_NOTHING);
  }
  static const unsigned char bad[][8] = {{0, 11, 0, 10, 0, 0, 0, 3},
                                         {0xFF, 0xFF, 0, 10, 0, 0, 0, 3},
                                         {0, 14, 0xFF, 0xFF, 0, 0, 0, 3},
                                         {0, 14, 0, 10, 0xFF, 0xFF, 0xFF, 0xFF}};
  for (size_t i = 0; i < 4; ++i) {
    memcpy(body, bad[i], 8);
    header = header_of("TRANSFORM", "Patient", 2, body, sizeof body);
    assert_int_equal(supine_stream_message_read(&header, body, NULL, &m, &error),
                     SUPINE_ERROR_FORMAT);
  }
}

/* The matrix of a unit quaternion: R v = v + 2 u x (u x v + w v), where u = (x, y, z). */
static void expect_quaternion(const supine_stream_message *m, double w, double x, double y,
                              double z) {
  const double u[3] = {x, y, z};
  assert_int_equal(m->kind, SUPINE_STREAM_ROTATION);
  assert_string_equal(m->text, "");
  for (int i = 0; i < 3; ++i) {
    double v[3] = {i == 0, i == 1, i == 2};
    double inner[3];
    double outer[3];
    supine_cross(u, v, inner);
    for (int k = 0; k < 3; ++k) {
      inner[k] += w * v[k];
    }
    supine_cross(u, inner, outer);
    for (int k = 0; k < 3; ++k) { /* within the precision of 32-bit floats */
      assert_true(fabs(m->number[3 * k + i] - (v[k] + 2.0 * outer[k])) < 5e-7);
    }
  }
}

TEST(test_read_qtdata_of_library_gives_quaternion_of_device) {
  igtl_qtdata_element element[3];
  memset(element, 0, sizeof element);
  memcpy(element[0].name, "Probe", 5);
  memcpy(element[1].name, "Patient", 7);
  memcpy(element[2].name, "Camera", 6);
  for (int i = 0; i < 3; ++i) {
    element[i].type = IGTL_QTDATA_TYPE_6D;
    element[i].quaternion[i] = 0.6f;
    element[i].quaternion[3] = 0.8f;
  }
  igtl_qtdata_convert_byte_order(element, 3);
  unsigned char *body = (unsigned char *)element;
  supine_stream_header header = header_of("QTDATA", "Tracker", 1, body, sizeof element);
  supine_stream_message m = read_ok(&header, body, "Patient");
  expect_quaternion(&m, 0.8, 0, 0.6, 0);
  m = read_ok(&header, body, "Probe");
  expect_quaternion(&m, 0.8, 0.6, 0, 0);
  m = read_ok(&header, body, NULL); /* no device named: the last one is used */
  expect_quaternion(&m, 0.8, 0, 0, 0.6);
  assert_int_equal(read_ok(&header, body, "Nobody").kind, SUPINE_STREAM_NOTHING);
}

TEST(test_read_position_of_library_gives_quaternion) {
  igtl_position position = {.position = {1, 2, 3}, .quaternion = {0.48f, -0.36f, 0.48f, 0.64f}};
  igtl_position_convert_byte_order(&position);
  unsigned char *body = (unsigned char *)&position;
  supine_stream_header header = header_of("POSITION", "Patient", 1, body, 28);
  const supine_stream_message m = read_ok(&header, body, NULL);
  expect_quaternion(&m, 0.64, 0.48, -0.36, 0.48);
  header = header_of("POSITION", "Patient", 1, body, 12);
  assert_int_equal(read_ok(&header, body, NULL).kind, SUPINE_STREAM_NOTHING);
}

/* Pack an NDARRAY with elements of type `type` by the OpenIGTLink library; return its size. */
static size_t make_array(int type, size_t count, const double *values, unsigned char *body) {
  igtl_ndarray_info info;
  const igtl_uint16 size[1] = {(igtl_uint16)count};
  igtl_ndarray_init_info(&info);
  info.type = (igtl_uint8)type;
  info.dim = 1;
  assert_int_equal(igtl_ndarray_alloc_info(&info, size), 1);
  for (size_t i = 0; i < count; ++i) {
    if (type == IGTL_NDARRAY_STYPE_TYPE_FLOAT64) {
      ((double *)info.array)[i] = values[i];
    } else {
      ((float *)info.array)[i] = (float)values[i];
    }
  }
  assert_int_equal(igtl_ndarray_pack(&info, body, IGTL_TYPE_PREFIX_NONE), 1);
  const size_t bytes = (size_t)igtl_ndarray_get_size(&info, IGTL_TYPE_PREFIX_NONE);
  igtl_ndarray_free_info(&info);
  return bytes;
}

TEST(test_read_arrays_of_library_give_direction_or_volume) {
  unsigned char body[256];
  const double down[4] = {0.25, -0.5, 1.5, 7.0};
  for (int type = IGTL_NDARRAY_STYPE_TYPE_FLOAT32; type <= IGTL_NDARRAY_STYPE_TYPE_FLOAT64;
       ++type) {
    size_t size = make_array(type, 3, down, body);
    supine_stream_header header = header_of("NDARRAY", "Tilt", 1, body, size);
    supine_stream_message m = read_ok(&header, body, "Tilt");
    assert_int_equal(m.kind, SUPINE_STREAM_DOWN);
    assert_true(m.number[0] == 0.25 && m.number[1] == -0.5 && m.number[2] == 1.5);
    size = make_array(type, 1, down, body);
    header = header_of("NDARRAY", "VOLUME", 1, body, size);
    m = read_ok(&header, body, "Tilt");
    assert_int_equal(m.kind, SUPINE_STREAM_VOLUME);
    assert_true(m.number[0] == 0.25);
    size = make_array(type, 4, down, body);
    header = header_of("NDARRAY", "Tilt", 1, body, size);
    assert_int_equal(read_ok(&header, body, NULL).kind, SUPINE_STREAM_NOTHING);
  }
}

TEST(test_read_strings_of_library_give_volume_or_request) {
  igtl_string_header head = {3, 8};
  igtl_string_convert_byte_order(&head);
  unsigned char body[4 + 100] = {0};
  memcpy(body, &head, 4);
  memcpy(body + 4, "rest+350", 8);
  supine_stream_header header = header_of("STRING", "VOLUME", 1, body, 12);
  supine_stream_message m = read_ok(&header, body, "Patient");
  assert_int_equal(m.kind, SUPINE_STREAM_VOLUME_TEXT);
  assert_string_equal(m.text, "rest+350");
  header = header_of("STRING", "SEND", 1, body, 12);
  assert_int_equal(read_ok(&header, body, NULL).kind, SUPINE_STREAM_REQUEST);
  header = header_of("STRING", "Patient", 1, body, 12);
  assert_int_equal(read_ok(&header, body, NULL).kind, SUPINE_STREAM_NOTHING);
  body[3] = 64; /* The text has 64 bytes, one more than the reader stores. */
  header = header_of("STRING", "VOLUME", 1, body, 4 + 64);
  assert_int_equal(read_ok(&header, body, NULL).kind, SUPINE_STREAM_NOTHING);
}

TEST(test_read_points_of_library_give_names_and_positions) {
  igtl_point_element list[3];
  memset(list, 0, sizeof list);
  for (int i = 0; i < 3; ++i) {
    /* The longest name has no terminating NUL. */
    memset(list[i].name, 'a' + i, i == 2 ? sizeof list[i].name : 5);
    for (int k = 0; k < 3; ++k) {
      list[i].position[k] = (float)(10 * i + k);
    }
    list[i].radius = 7;
  }
  igtl_point_convert_byte_order(list, 3);
  unsigned char *body = (unsigned char *)list;
  supine_stream_header header = header_of("POINT", "Tracker", 1, body, sizeof list);
  const supine_stream_message m = read_ok(&header, body, "Patient");
  assert_int_equal(m.kind, SUPINE_STREAM_POINT_LIST);
  assert_int_equal(m.point_count, 3);
  for (size_t i = 0; i < 3; ++i) {
    char name[65];
    double position[3];
    supine_stream_message_point(&m, i, name, position);
    assert_int_equal(strlen(name), i == 2 ? 64 : 5);
    assert_int_equal(name[0], 'a' + (int)i);
    for (size_t k = 0; k < 3; ++k) {
      assert_true(position[k] == (double)(10 * i + k));
    }
  }
}

/* Every truncated body is refused, even with a correct checksum. */
TEST(test_read_every_truncation_refused) {
  static const struct {
    const char *type, *device;
    size_t whole;
    unsigned char begin[8];
  } content[] = {{"TRANSFORM", "Patient", 48, {0}},
                 {"TRANSFORM", "Sensor", 48, {0}},
                 {"POINT", "Tracker", 136, {0}},
                 {"QTDATA", "Patient", 50, {'P', 'a', 't', 'i', 'e', 'n', 't'}},
                 {"NDARRAY", "Patient", 28, {11, 1, 0, 3}},
                 {"NDARRAY", "VOLUME", 12, {11, 1, 0, 1}},
                 {"STRING", "VOLUME", 34, {0, 3, 0, 30}}};
  for (size_t i = 0; i < sizeof content / sizeof *content; ++i) {
    for (size_t size = 0; size < content[i].whole; ++size) {
      /* Of the exact size, so that a sanitizer sees any read beyond it. */
      unsigned char *body = fixture_allocate(size > 0 ? size : 1, 1);
      unsigned char *end = body + size;
      memcpy(body, content[i].begin, size < 8 ? size : 8);
      supine_stream_header header =
          header_of(content[i].type, content[i].device, 1, body, (size_t)(end - body));
      supine_stream_message m;
      supine_error error;
      const supine_status status = supine_stream_message_read(&header, body, "Patient", &m, &error);
      if (status == SUPINE_OK) { /* an empty list is accepted */
        assert_true(size == 0 || size < 4);
      }
      assert_true(m.kind == SUPINE_STREAM_NOTHING || (size == 0 && m.point_count == 0));
      free(body);
    }
  }
}

TEST(test_header_invalid_refused) {
  supine_stream_header good = {.version = 1};
  strcpy(good.type, "TRANSFORM");
  unsigned char bytes[SUPINE_STREAM_HEADER];
  supine_stream_header header;
  supine_error error;
  for (unsigned version = 0; version < 5; ++version) {
    good.version = version;
    supine_stream_header_write(&good, bytes);
    assert_int_equal(supine_stream_header_read(bytes, &header, &error),
                     version >= 1 && version <= 3 ? SUPINE_OK : SUPINE_ERROR_FORMAT);
  }
  good.version = 1;
  good.type[2] = '\x07';
  supine_stream_header_write(&good, bytes);
  assert_int_equal(supine_stream_header_read(bytes, &header, &error), SUPINE_ERROR_FORMAT);
}

/* Return the joined pieces of a message, which the caller frees. */
static unsigned char *gathered(const supine_stream_packet *packet) {
  unsigned char *bytes = fixture_allocate(packet->size, 1);
  size_t at = 0;
  for (int i = 0; i < packet->count; ++i) {
    memcpy(bytes + at, packet->piece[i].iov_base, packet->piece[i].iov_len);
    at += packet->piece[i].iov_len;
  }
  assert_int_equal(at, packet->size);
  return bytes;
}

typedef struct sample {
  fixture *made;
  unsigned char *bytes;
  supine_basis *basis;
  supine_stream_snapshot moment;
} sample;

static sample sample_open(fixture *made) {
  sample s = {.made = made};
  size_t size = 0;
  supine_error error;
  s.bytes = fixture_bytes(s.made, &size);
  assert_int_equal(supine_basis_open_memory(s.bytes, size, &s.basis, &error), SUPINE_OK);
  s.moment = (supine_stream_snapshot){.gravity = {0.36, 0.48, -0.8}, .stamp = 0x11223344AABBCCDDu};
  assert_int_equal(supine_basis_weights(s.basis, s.moment.gravity, s.moment.pose.weights),
                   SUPINE_OK);
  for (size_t i = 0; i < 3 * made->lungs; ++i) { /* factors for each lung and axis */
    s.moment.pose.gains[i / 3][i % 3] = 0.7 - 0.17 * (double)i;
  }
  return s;
}

static sample sample_create(void) {
  return sample_open(fixture_create(2311, 6, 3, 2, false, true, 20.0, 17));
}

static void sample_destroy(sample *s) {
  supine_basis_close(s->basis);
  free(s->bytes);
  fixture_destroy(s->made);
}

/* Assert that `bytes` equal the OpenIGTLink library's message of version 1 with this body. */
static void expect_message(const unsigned char *bytes, const char *type, uint64_t stamp,
                           unsigned char *body, size_t size) {
  igtl_header header = {
      .version = 1, .timestamp = stamp, .body_size = size, .crc = crc64(body, size, 0)};
  memcpy(header.name, type, strlen(type));
  memcpy(header.device_name, "SUPINE", 6);
  igtl_header_convert_byte_order(&header);
  assert_memory_equal(bytes, &header, sizeof header);
  assert_memory_equal(bytes + sizeof header, body, size);
}

/* Assert that the frame of a sample has the weights of all modes, then the factors of each lung's
 * displacements along x, y and z. Destroy the sample. */
static void expect_weights_frame(sample s) {
  supine_stream_frames *frames = NULL;
  supine_error error;
  supine_stream_packet packet;
  const size_t modes = s.made->modes;
  const size_t count = modes + 3 * s.made->lungs;
  double values[SUPINE_MODES_MAX + 3 * SUPINE_LUNGS_MAX];
  unsigned char body[4 + sizeof values / 2];
  memcpy(values, s.moment.pose.weights, modes * sizeof *values);
  memcpy(values + modes, s.moment.pose.gains, 3 * s.made->lungs * sizeof *values);
  const size_t size = make_array(IGTL_NDARRAY_STYPE_TYPE_FLOAT32, count, values, body);
  assert_int_equal(supine_stream_frames_create(s.basis, "SUPINE", false, &frames, &error),
                   SUPINE_OK);
  supine_stream_frame *frame = supine_stream_frame_acquire(frames, &s.moment);
  supine_stream_frame_pack(frames, frame, SUPINE_STREAM_WEIGHTS, false, &packet);
  unsigned char *bytes = gathered(&packet);
  assert_int_equal(packet.size, SUPINE_STREAM_HEADER + size);
  expect_message(bytes, "NDARRAY", s.moment.stamp, body, size);
  free(bytes);
  supine_stream_frame_release(frames, frame);
  supine_stream_frames_destroy(frames);
  sample_destroy(&s);
}

TEST(test_weights_written_equal_ndarray_of_library) {
  expect_weights_frame(sample_create());
}

/* A basis with the largest numbers of modes and lungs gives a complete frame. */
TEST(test_weights_largest_basis_frame_complete) {
  expect_weights_frame(sample_open(fixture_create(16 * SUPINE_LUNGS_MAX, SUPINE_MODES_MAX, 15,
                                                  SUPINE_LUNGS_MAX, false, false, 20.0, 23)));
}

static uint32_t word_at(const unsigned char *bytes) {
  return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
}

/* Pack the surface of a sample by the OpenIGTLink library, with `count` triangle strips if `strips`
 * is not NULL. Multiply x and y by `sign`. Set `size` to the size of the result. */
static unsigned char *make_polydata(const sample *s, const struct iovec *strips, uint32_t count,
                                    double sign, size_t *size) {
  const supine_basis_info *info = supine_basis_get_info(s->basis);
  igtl_polydata_info surface;
  igtl_polydata_init_info(&surface);
  surface.header.npoints = (igtl_uint32)info->vertex_count;
  surface.header.ntriangle_strips = count;
  surface.header.size_triangle_strips = strips != NULL ? (igtl_uint32)strips->iov_len : 0;
  assert_int_equal(igtl_polydata_alloc_info(&surface), 1);
  supine_deform(s->basis, &s->moment.pose, surface.points);
  for (size_t i = 0; i < info->vertex_count; ++i) {
    surface.points[3 * i] *= (float)sign;
    surface.points[3 * i + 1] *= (float)sign;
  }
  /* the OpenIGTLink library expects triangle strips in native byte order */
  for (size_t i = 0; strips != NULL && i < strips->iov_len / 4; ++i) {
    surface.triangle_strips[i] = word_at((const unsigned char *)strips->iov_base + 4 * i);
  }
  *size = (size_t)igtl_polydata_get_size(&surface, IGTL_TYPE_PREFIX_NONE);
  unsigned char *body = fixture_allocate(*size, 1);
  assert_int_equal(igtl_polydata_pack(&surface, body, IGTL_TYPE_PREFIX_NONE), 1);
  assert_int_equal(igtl_polydata_free_info(&surface), 1);
  return body;
}

TEST(test_attribute_written_equals_library) {
  igtl_polydata_info surface;
  igtl_polydata_init_info(&surface);
  surface.header.npoints = 2;
  surface.header.nattributes = 1;
  assert_int_equal(igtl_polydata_alloc_info(&surface), 1);
  memset(surface.points, 0, 2 * 12);
  surface.attributes[0] = (igtl_polydata_attribute){.ncomponents = 1,
                                                    .n = 2,
                                                    .name = strdup("expected_error_mm"),
                                                    .data = calloc(2, sizeof(igtl_float32))};
  unsigned char theirs[256] = {0};
  unsigned char ours[256] = {0};
  const size_t size = (size_t)igtl_polydata_get_size(&surface, IGTL_TYPE_PREFIX_NONE);
  assert_int_equal(size, 40 + 24 + SUPINE_STREAM_ATTRIBUTE + 8);
  assert_int_equal(igtl_polydata_pack(&surface, theirs, IGTL_TYPE_PREFIX_NONE), 1);
  assert_int_equal(igtl_polydata_free_info(&surface), 1);
  assert_int_equal(supine_stream_polydata_head(2, 0, 0, 1, ours), 40);
  assert_int_equal(supine_stream_attribute_head(2, ours + 40 + 24), SUPINE_STREAM_ATTRIBUTE);
  assert_memory_equal(ours, theirs, size);
}

TEST(test_surface_written_equals_polydata_of_library) {
  sample s = sample_create();
  supine_error error;
  for (int ras = 0; ras < 2; ++ras) {
    supine_stream_frames *frames = NULL;
    assert_int_equal(supine_stream_frames_create(s.basis, "SUPINE", ras == 1, &frames, &error),
                     SUPINE_OK);
    supine_stream_frame *frame = supine_stream_frame_acquire(frames, &s.moment);
    for (int triangles = 0; triangles < 2; ++triangles) {
      size_t size = 0;
      supine_stream_packet packet;
      supine_stream_frame_pack(frames, frame, SUPINE_STREAM_SURFACE, triangles == 1, &packet);
      unsigned char *bytes = gathered(&packet);
      unsigned char *body =
          make_polydata(&s, triangles == 1 ? &packet.piece[2] : NULL,
                        word_at(bytes + SUPINE_STREAM_HEADER + 28), ras == 1 ? -1.0 : 1.0, &size);
      assert_int_equal(packet.size, SUPINE_STREAM_HEADER + size);
      expect_message(bytes, "POLYDATA", s.moment.stamp, body, size);
      free(bytes);
      free(body);
    }
    supine_stream_frame_release(frames, frame);
    /* A frame that is reused holds the points of the new pose. */
    supine_stream_snapshot other = s.moment;
    other.pose.gains[0][1] = -0.1;
    supine_stream_frame *again = supine_stream_frame_acquire(frames, &other);
    supine_stream_packet packet;
    assert_ptr_equal(again, frame);
    supine_stream_frame_pack(frames, again, SUPINE_STREAM_POINTS, false, &packet);
    float first[3];
    supine_deform_range(s.basis, &other.pose, 0, 1, first);
    for (int k = 0; ras == 1 && k < 2; ++k) {
      first[k] = -first[k];
    }
    supine_stream_encode_floats(3, first);
    assert_memory_equal(again->points, first, sizeof first);
    supine_stream_frame_release(frames, again);
    supine_stream_frames_destroy(frames);
  }
  sample_destroy(&s);
}

typedef struct triangle {
  uint32_t corner[3];
} triangle;

static int by_corners(const void *a, const void *b) {
  const uint32_t *x = ((const triangle *)a)->corner;
  const uint32_t *y = ((const triangle *)b)->corner;
  for (int i = 0; i < 2; ++i) {
    if (x[i] != y[i]) {
      return x[i] < y[i] ? -1 : 1;
    }
  }
  return (x[2] > y[2]) - (x[2] < y[2]);
}

/* Return a triangle with its corners rotated so that the lowest comes first; orientation is
 * kept. */
static triangle face(uint32_t a, uint32_t b, uint32_t c) {
  const triangle way[3] = {{{a, b, c}}, {{b, c, a}}, {{c, a, b}}};
  const triangle *first = by_corners(&way[1], &way[0]) < 0 ? &way[1] : &way[0];
  return by_corners(&way[2], first) < 0 ? way[2] : *first;
}

/* Add a triangle to the list unless two of its corners are equal. */
static void add(triangle *list, size_t *count, uint32_t a, uint32_t b, uint32_t c) {
  if (a != b && b != c && c != a) {
    list[(*count)++] = face(a, b, c);
  }
}

/* The strips of a surface hold each of its triangles once, with its orientation. */
TEST(test_strips_of_surface_hold_each_triangle_once) {
  sample s = sample_create();
  const size_t count = supine_basis_get_info(s.basis)->triangle_count;
  const uint32_t *corner = supine_basis_triangles(s.basis);
  supine_stream_frames *frames = NULL;
  supine_error error;
  supine_stream_packet packet;
  assert_int_equal(supine_stream_frames_create(s.basis, "SUPINE", false, &frames, &error),
                   SUPINE_OK);
  supine_stream_frame *frame = supine_stream_frame_acquire(frames, &s.moment);
  supine_stream_frame_pack(frames, frame, SUPINE_STREAM_SURFACE, true, &packet);
  const unsigned char *at = packet.piece[2].iov_base;
  const unsigned char *end = at + packet.piece[2].iov_len;
  triangle *wanted = fixture_allocate(count, sizeof *wanted);
  triangle *made = fixture_allocate(packet.piece[2].iov_len / 4, sizeof *made);
  size_t wanted_count = 0;
  size_t made_count = 0;
  uint32_t strips = 0;
  for (; at < end; ++strips) {
    const size_t length = word_at(at);
    assert_true(length >= 3 && at + 4 + 4 * length <= end);
    for (size_t j = 0; j + 2 < length; ++j) {
      const unsigned char *c = at + 4 + 4 * j;
      add(made, &made_count, word_at(c), word_at(c + 4 + 4 * (j % 2)),
          word_at(c + 8 - 4 * (j % 2)));
    }
    at += 4 + 4 * length;
  }
  assert_ptr_equal(at, end);
  assert_int_equal(strips, word_at(packet.front + SUPINE_STREAM_HEADER + 28));
  for (size_t i = 0; i < count; ++i) {
    add(wanted, &wanted_count, corner[3 * i], corner[3 * i + 1], corner[3 * i + 2]);
  }
  assert_int_equal(made_count, wanted_count);
  qsort(wanted, wanted_count, sizeof *wanted, by_corners);
  qsort(made, made_count, sizeof *made, by_corners);
  assert_memory_equal(made, wanted, made_count * sizeof *made);
  free(wanted);
  free(made);
  supine_stream_frame_release(frames, frame);
  supine_stream_frames_destroy(frames);
  sample_destroy(&s);
}
