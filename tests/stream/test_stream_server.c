/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The server with peers on loopback: regular, slow, stuck, vanishing, hostile, and many. */
#include "tests/helpers/test.h"

#include <endian.h>
#include <errno.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <sys/socket.h>
#include <time.h>

#include "base/clock.h"
#include "program/stream/peer.h"
#include "program/stream/tracked_patient.h"
#include "tests/helpers/runtime_fixture.h"

#include "tests/helpers/poses.h"

enum { VERTICES = 6000, MODES = 6, LUNGS = 2, FLOATS = MODES + 3 * LUNGS };

/* Spherical-harmonic coefficients of the volume of each lung at rest. It exceeds the volume of the
 * reference surface by 10 mL plus 4 mL times the y component of gravity. */
static const double resting[9 * LUNGS] = {[0] = 10.0 / 0.2820947917738781,
                                          [1] = 4.0 / 0.4886025119029199,
                                          [9] = 10.0 / 0.2820947917738781,
                                          [10] = 4.0 / 0.4886025119029199};

/* A server that runs in a thread of its own, and the basis that it uses. */
typedef struct stage {
  fixture *made;
  unsigned char *bytes;
  supine_basis *basis;
  supine_stream_volume volume;
  supine_stream_options options;
  supine_stream_server *server;
  pthread_t thread;
  bool running;
  supine_status status;
  atomic_bool ending;
  atomic_uint warnings;
} stage;

static void count_warning(void *context, const char *text) {
  (void)text;
  (void)atomic_fetch_add(&((stage *)context)->warnings, 1);
}

static bool is_ending(void *context) {
  return atomic_load(&((stage *)context)->ending);
}

static void *run(void *context) {
  stage *s = context;
  supine_error error;
  s->status = supine_stream_server_run(s->server, &error);
  return NULL;
}

/* Open the basis of s->made, and set the options of its server. */
static void stage_open(stage *s) {
  size_t size = 0;
  supine_error error;
  s->bytes = fixture_bytes(s->made, &size);
  assert_int_equal(supine_basis_open_memory(s->bytes, size, &s->basis, &error), SUPINE_OK);
  s->options = (supine_stream_options){.listen = "0",
                                       .name = "SUPINE",
                                       .setup = supine_stream_setup_default(),
                                       .volume = &s->volume,
                                       .rate = 1000.0,
                                       .seconds = 600.0, /* ends a test that hangs */
                                       .warn = count_warning,
                                       .stop = is_ending,
                                       .context = s};
}

/* Create the server; its options may be changed before it runs. */
static stage *stage_create(void) {
  stage *s = fixture_allocate(1, sizeof *s);
  s->made = fixture_create(VERTICES, MODES, 2, LUNGS, false, true, 15.0, 29);
  /* Make the constant (degree 0) coefficient of the weight of each mode dominate, and let every
   * mode enlarge both lungs, so that no pose folds the surface. */
  for (size_t i = 0; i < LUNGS * 3 * MODES; ++i) {
    s->made->linear[i] = fabs(s->made->linear[i]);
  }
  for (size_t i = 0; i < LUNGS * 3 * MODES * MODES; ++i) {
    s->made->quadratic[i] *= 0.01;
  }
  for (size_t i = 0; i < LUNGS * MODES * MODES * MODES; ++i) {
    s->made->cubic[i] *= 0.01;
  }
  for (size_t k = 0; k < MODES; ++k) {
    double *mode = s->made->mode + 9 * k;
    for (int i = 1; i < 9; ++i) {
      mode[i] *= 0.1;
    }
    mode[0] = 3.0;
  }
  s->made->resting = resting;
  s->volume = (supine_stream_volume){.fixed = {.volume = {SUPINE_VOLUME_REST, 30.0}}};
  stage_open(s);
  return s;
}

static int stage_run(stage *s) {
  supine_error error = {.status = SUPINE_OK};
  assert_int_equal(supine_stream_server_create(s->basis, &s->options, &s->server, &error),
                   SUPINE_OK);
  assert_int_equal(pthread_create(&s->thread, NULL, run, s), 0);
  s->running = true;
  return supine_stream_server_results(s->server)->port;
}

/* Stop the server's thread, after which its counts may be read, and return the counts. */
static supine_stream_counts stage_end(stage *s) {
  atomic_store(&s->ending, true);
  assert_int_equal(pthread_join(s->thread, NULL), 0);
  s->running = false;
  assert_int_equal(s->status, SUPINE_OK);
  return supine_stream_server_results(s->server)->counts;
}

static void stage_destroy(stage *s) {
  if (s->running) {
    (void)stage_end(s);
  }
  supine_stream_server_destroy(s->server);
  supine_basis_close(s->basis);
  free(s->bytes);
  fixture_destroy(s->made);
  free(s);
}

static void sleep_for(double seconds) {
  const struct timespec time = {(time_t)seconds, (long)(1e9 * (seconds - floor(seconds)))};
  (void)nanosleep(&time, NULL);
}

static int connect_peer(int port) {
  const int s = socket(AF_INET, SOCK_STREAM, 0);
  const struct sockaddr_in here = {.sin_family = AF_INET,
                                   .sin_port = htons((uint16_t)port),
                                   .sin_addr = {htonl(INADDR_LOOPBACK)}};
  const struct timeval limit = {100, 0}; /* s; ends a test that hangs */
  assert_true(s >= 0);
  assert_int_equal(setsockopt(s, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit), 0);
  assert_int_equal(setsockopt(s, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit), 0);
  assert_int_equal(connect(s, (const struct sockaddr *)&here, sizeof here), 0);
  return s;
}

/* Send all bytes; return false if the server has closed the connection. */
static bool send_bytes(int s, const void *bytes, size_t size) {
  for (size_t sent = 0; sent < size;) {
    const ssize_t n = send(s, (const unsigned char *)bytes + sent, size - sent, MSG_NOSIGNAL);
    if (n <= 0) {
      return false;
    }
    sent += (size_t)n;
  }
  return true;
}

static bool get(int s, void *bytes, size_t size) {
  for (size_t got = 0; got < size;) {
    const ssize_t n = recv(s, (unsigned char *)bytes + got, size - got, 0);
    if (n <= 0) {
      return false;
    }
    got += (size_t)n;
  }
  return true;
}

/* Read until the server closes the connection; return false if it does not. */
static bool closed_by_server(int s) {
  unsigned char ignored[4096];
  ssize_t got = 0;
  do {
    got = recv(s, ignored, sizeof ignored, 0);
  } while (got > 0);
  return got == 0 || errno == ECONNRESET;
}

/* Write a message (header and body) into `bytes`; return the number of bytes. */
static size_t make_message(const char *type, const char *device, uint64_t stamp, const void *body,
                           size_t size, unsigned char *bytes) {
  supine_stream_header header = {
      .version = 1, .stamp = stamp, .size = size, .crc = supine_stream_crc64(0, body, size)};
  strcpy(header.type, type);
  strcpy(header.device, device);
  supine_stream_header_write(&header, bytes);
  memcpy(bytes + SUPINE_STREAM_HEADER, body, size);
  return SUPINE_STREAM_HEADER + size;
}

/* Write a direction of gravity as an NDARRAY [3] of 64-bit floats, big-endian. */
static size_t make_pose(const double down[3], uint64_t stamp, unsigned char bytes[128]) {
  unsigned char body[28] = {11, 1, 0, 3};
  for (int i = 0; i < 3; ++i) {
    uint64_t word;
    memcpy(&word, &down[i], sizeof word);
    word = htobe64(word);
    memcpy(body + 4 + 8 * i, &word, sizeof word);
  }
  return make_message("NDARRAY", "Patient", stamp, body, sizeof body, bytes);
}

static bool send_pose(int s, const double down[3], uint64_t stamp) {
  unsigned char bytes[128];
  return send_bytes(s, bytes, make_pose(down, stamp, bytes));
}

static bool send_text(int s, const char *device, const char *text) {
  unsigned char body[64] = {0, 3, 0, (unsigned char)strlen(text)};
  unsigned char bytes[128];
  memcpy(body + 4, text, strlen(text));
  return send_bytes(s, bytes, make_message("STRING", device, 0, body, 4 + strlen(text), bytes));
}

/* Receive the next message and the first 4096 bytes of its body; return false if none arrives. */
static bool receive(int s, supine_stream_header *header, unsigned char body[4096]) {
  unsigned char raw[SUPINE_STREAM_HEADER];
  unsigned char ignored[4096];
  supine_error error;
  if (!get(s, raw, sizeof raw) || supine_stream_header_read(raw, header, &error) != SUPINE_OK) {
    return false;
  }
  size_t left = (size_t)header->size;
  size_t first = left < 4096 ? left : 4096;
  uint64_t crc = 0;
  if (!get(s, body, first)) {
    return false;
  }
  crc = supine_stream_crc64(0, body, first);
  for (left -= first; left > 0;) {
    const size_t size = left < sizeof ignored ? left : sizeof ignored;
    if (!get(s, ignored, size)) {
      return false;
    }
    crc = supine_stream_crc64(crc, ignored, size);
    left -= size;
  }
  assert_true(crc == header->crc);
  return true;
}

/* Receive messages until the one with this stamp; return the number of messages before it. Fail if
 * it does not arrive. */
static int receive_stamp(int s, uint64_t stamp, supine_stream_header *header,
                         unsigned char body[4096]) {
  for (int passed = 0; passed < 100000; ++passed) {
    assert_true(receive(s, header, body));
    if (header->stamp == stamp) {
      return passed;
    }
  }
  fail();
  return 0;
}

static float float_at(const unsigned char *bytes) {
  const uint32_t word =
      (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
  float value;
  memcpy(&value, &word, sizeof value);
  return value;
}

static void expect_pose(const supine_pose *pose, const unsigned char *content) {
  const unsigned char head[4] = {10, 1, 0, FLOATS};
  assert_memory_equal(content, head, 4);
  for (int i = 0; i < FLOATS; ++i) {
    const double wanted =
        i < MODES ? pose->weights[i] : pose->gains[(i - MODES) / 3][(i - MODES) % 3];
    assert_true(fabs((double)float_at(content + 4 + 4 * i) - wanted) <= 1e-6 * fabs(wanted) + 1e-9);
  }
}

/* Return the pose for a direction of gravity and a volume in mL above rest. */
static supine_pose pose_of(const stage *s, const double gravity[3], double above) {
  const supine_state state = {.gravity = {gravity[0], gravity[1], gravity[2]},
                              .volume = {SUPINE_VOLUME_REST, above}};
  supine_pose pose;
  assert_int_equal(supine_basis_pose(s->basis, &state, &pose, NULL), SUPINE_OK);
  return pose;
}

/* Assert that `content` has the weights and displacement factors of this pose: see pose_of. */
static void expect_weights(const stage *s, const double gravity[3], double above,
                           const unsigned char *content) {
  const supine_pose pose = pose_of(s, gravity, above);
  expect_pose(&pose, content);
}

static const double poses[4][3] = {{0, 1, 0}, {0, -1, 0}, {1, 0, 0}, {0.6, 0, -0.8}};

TEST(test_server_each_pose_answered_by_weights) {
  stage *s = stage_create();
  const int peer = connect_peer(stage_run(s));
  supine_stream_header header;
  unsigned char body[4096];
  double longest = 0.0; /* time from sending a message to its answer, s */
  for (uint64_t i = 0; i < 40; ++i) {
    const double begin = supine_clock_seconds();
    assert_true(send_pose(peer, poses[i % 4], 100 + i));
    (void)receive_stamp(peer, 100 + i, &header, body);
    longest = fmax(longest, supine_clock_seconds() - begin);
    assert_string_equal(header.type, "NDARRAY");
    assert_string_equal(header.device, "SUPINE");
    assert_int_equal(header.version, 1);
    expect_weights(s, poses[i % 4], 30.0, body);
  }
  double begin = supine_clock_seconds();
  assert_true(send_text(peer, "VOLUME", "rest-12"));
  assert_true(send_pose(peer, poses[1], 200));
  (void)receive_stamp(peer, 200, &header, body);
  expect_weights(s, poses[1], -12.0, body);
  unsigned char bytes[128]; /* a message whose last byte is sent later */
  const size_t size = make_pose(poses[2], 300, bytes);
  assert_true(send_bytes(peer, bytes, size - 1));
  sleep_for(0.05);
  assert_true(send_bytes(peer, bytes + size - 1, 1));
  (void)receive_stamp(peer, 300, &header, body);
  expect_weights(s, poses[2], -12.0, body);
  longest = fmax(longest, supine_clock_seconds() - begin);
  sleep_for(2.0 * longest + 0.5); /* the latency of the next message must not include this time */
  begin = supine_clock_seconds();
  assert_true(send_text(peer, "VOLUME", "rest-11"));
  assert_true(receive(peer, &header, body));
  expect_weights(s, poses[2], -11.0, body);
  longest = fmax(longest, supine_clock_seconds() - begin);
  (void)close(peer);
  const supine_stream_counts counts = stage_end(s);
  assert_int_equal(counts.poses, 42);
  assert_int_equal(counts.refused + counts.malformed + counts.lost, 0);
  const supine_stream_latency *latency = &supine_stream_server_results(s->server)->latency[0];
  assert_true(latency->count >= 43);
  /* The latency of a message may begin when the socket was last empty, after the answer to the
   * message before. */
  assert_true(latency->worst > 0.0 && latency->worst <= 2.0 * longest);
  assert_int_equal(latency->late > 0, latency->worst > SUPINE_STREAM_BUDGET);
  stage_destroy(s);
}

TEST(test_server_volume_above_rest_equals_basis_pose) {
  stage *s = stage_create();
  const int peer = connect_peer(stage_run(s));
  supine_stream_header header;
  unsigned char body[4096];
  assert_true(send_text(peer, "VOLUME", "rest+50"));
  for (uint64_t i = 0; i < 4; ++i) {
    supine_state asked = {.volume = {SUPINE_VOLUME_REST, 50.0}};
    supine_pose pose;
    supine_error error;
    memcpy(asked.gravity, poses[i], sizeof asked.gravity);
    assert_int_equal(supine_basis_pose(s->basis, &asked, &pose, &error), SUPINE_OK);
    assert_true(send_pose(peer, poses[i], 1 + i));
    (void)receive_stamp(peer, 1 + i, &header, body);
    expect_pose(&pose, body);
  }
  /* A volume as an NDARRAY: 50.0 mL as a big-endian 64-bit float. */
  const unsigned char array[12] = {11, 1, 0, 1, 0x40, 0x49};
  unsigned char bytes[128];
  assert_true(send_text(peer, "VOLUME", "rest"));
  assert_true(
      send_bytes(peer, bytes, make_message("NDARRAY", "VOLUME", 0, array, sizeof array, bytes)));
  assert_true(send_pose(peer, poses[1], 10));
  (void)receive_stamp(peer, 10, &header, body);
  expect_weights(s, poses[1], 50.0, body);
  (void)close(peer);
  (void)stage_end(s);
  assert_int_equal(atomic_load(&s->warnings), 0);
  stage_destroy(s);
}

TEST(test_server_volume_refused_keeps_state_and_tells_peer) {
  stage *s = stage_create();
  const int peer = connect_peer(stage_run(s));
  supine_stream_header header;
  unsigned char body[4096];
  static const char *const wrong[] = {"rest+100000", "500", "rest+1e300"};
  assert_true(send_pose(peer, poses[3], 1));
  (void)receive_stamp(peer, 1, &header, body);
  for (uint64_t i = 0; i < sizeof wrong / sizeof *wrong; ++i) {
    assert_true(send_text(peer, "VOLUME", wrong[i]));
    do {
      assert_true(receive(peer, &header, body));
    } while (strcmp(header.type, "STATUS") != 0);
    assert_string_equal(header.device, "SUPINE");
    assert_memory_equal(body, "\0\10\0\0\0\0\0\0\0\0refused", 17);
    assert_non_null(strstr((const char *)body + 30, "a volume is refused: "));
    assert_true(header.size == 30 + strlen((const char *)body + 30) + 1);
    assert_true(send_pose(peer, poses[3], 2 + i));
    (void)receive_stamp(peer, 2 + i, &header, body);
    expect_weights(s, poses[3], 30.0, body);
  }
  assert_true(send_pose(peer, (const double[3]){0}, 9));
  do {
    assert_true(receive(peer, &header, body));
  } while (strcmp(header.type, "STATUS") != 0);
  assert_non_null(strstr((const char *)body + 30, "a pose is refused: its direction is zero"));
  (void)close(peer);
  const supine_stream_counts counts = stage_end(s);
  assert_int_equal(counts.unreachable, 3);
  assert_int_equal(counts.refused, 1);
  stage_destroy(s);
}

/* In fields over gravity and volume, weights and points are those of each lung at its own
 * volume. */
TEST(test_server_simulated_two_volumes_equal_basis_pose) {
  enum { COUNT = 60, NUMBERS = 2 * 2 + 3 * 2 };
  stage *s = fixture_allocate(1, sizeof *s);
  s->made = fixture_create_simulated(COUNT, 29);
  stage_open(s);
  const supine_basis_info *info = supine_basis_get_info(s->basis);
  const double *reference = info->reference_volume;
  s->volume.fixed.lung_count = 2;
  for (size_t lung = 0; lung < 2; ++lung) {
    const double ml = (lung == 0 ? 0.9 : 1.1) * reference[lung];
    strcpy(s->volume.fixed.lungs[lung].name, info->lung_names[lung]);
    s->volume.fixed.lungs[lung].volume = (supine_volume){SUPINE_VOLUME_ABSOLUTE, ml};
  }
  const int peer = connect_peer(stage_run(s));
  const unsigned char head[4] = {10, 1, 0, NUMBERS};
  supine_stream_header header;
  unsigned char body[4096];
  for (uint64_t i = 0; i < 4; ++i) {
    supine_state asked = s->volume.fixed;
    supine_pose pose;
    float xyz[3 * COUNT];
    memcpy(asked.gravity, poses[i], sizeof asked.gravity);
    assert_int_equal(supine_basis_pose(s->basis, &asked, &pose, NULL), SUPINE_OK);
    assert_int_equal(supine_deform(s->basis, &pose, xyz), SUPINE_OK);
    assert_true(send_text(peer, "SEND", "weights"));
    assert_true(send_pose(peer, poses[i], 1 + 2 * i));
    (void)receive_stamp(peer, 1 + 2 * i, &header, body);
    assert_memory_equal(body, head, sizeof head);
    for (size_t k = 0; k < NUMBERS; ++k) {
      const double wanted = k < 4 ? pose.weights[k] : pose.gains[(k - 4) / 3][(k - 4) % 3];
      assert_true(fabs((double)float_at(body + 4 + 4 * k) - wanted) <= 1e-6 * fabs(wanted) + 1e-9);
    }
    assert_true(fabs(pose.weights[0] - pose.weights[2]) > 0.05);
    assert_true(send_text(peer, "SEND", "points"));
    assert_true(send_pose(peer, poses[i], 2 + 2 * i));
    (void)receive_stamp(peer, 2 + 2 * i, &header, body);
    assert_string_equal(header.type, "POLYDATA");
    for (size_t k = 0; k < 3 * (size_t)COUNT; ++k) {
      assert_true(float_at(body + 40 + 4 * k) == xyz[k]);
    }
  }
  (void)close(peer);
  (void)stage_end(s);
  stage_destroy(s);
}

/* After a request for `points` only the first frame has triangles; after a request for `surface`
 * every frame has them. */
TEST(test_server_send_request_switches_content) {
  stage *s = stage_create();
  const int port = stage_run(s);
  const int peer = connect_peer(port);
  const supine_basis_info *info = supine_basis_get_info(s->basis);
  supine_stream_header header;
  unsigned char body[4096];
  const size_t points = 40 + 12 * info->vertex_count;
  size_t whole = 0; /* size of a message body with points and triangles, bytes */
  /* until a peer requests another content, frames contain weights of modes */
  assert_true(send_pose(peer, poses[3], 1));
  (void)receive_stamp(peer, 1, &header, body);
  const char *const requests[] = {"points", "surface"};
  for (uint64_t w = 0; w < 2; ++w) {
    assert_true(send_text(peer, "SEND", requests[w]));
    bool first = true;
    for (uint64_t i = 0; i < 4; ++i) {
      const uint64_t stamp = 10 * (w + 1) + i;
      assert_true(send_pose(peer, poses[i], stamp));
      do { /* skip the answer to the request itself, which is a frame of the current pose */
        assert_true(receive(peer, &header, body));
        whole = whole == 0 ? header.size : whole;
        assert_true(whole > points);
        assert_int_equal(header.size, w == 1 || first ? whole : points);
        assert_string_equal(header.type, "POLYDATA");
        first = false;
      } while (header.stamp != stamp);
      const supine_pose pose = pose_of(s, poses[i], 30.0);
      float xyz[300];
      supine_deform_range(s->basis, &pose, 0, 100, xyz);
      for (int k = 0; k < 300; ++k) {
        assert_true(fabsf(float_at(body + 40 + 4 * k) - xyz[k]) < 1e-4f);
      }
    }
  }
  assert_true(send_text(peer, "SEND", "nothing"));
  assert_true(send_text(peer, "SEND", "everything")); /* an unknown request changes nothing */
  /* When another peer has the answer to the second pose, everything that the server sends after the
   * first has arrived. */
  const int other = connect_peer(port);
  struct pollfd quiet = {peer, POLLIN, 0};
  for (uint64_t stamp = 77; stamp < 79; ++stamp) {
    assert_true(send_pose(peer, poses[stamp % 4], stamp));
    (void)receive_stamp(other, stamp, &header, body);
  }
  assert_int_equal(poll(&quiet, 1, 0), 0);
  (void)close(other);
  (void)close(peer);
  stage_destroy(s);
}

/* Of a thousand poses sent at once, the server answers no more than its rate allows, but always the
 * last one. */
TEST(test_server_many_poses_newest_answered) {
  enum { BURST = 1000 };
  stage *s = stage_create();
  s->options.rate = 10.0;
  const int peer = connect_peer(stage_run(s));
  supine_stream_header header;
  unsigned char body[4096];
  unsigned char *burst = fixture_allocate(BURST, 128);
  size_t size = 0;
  for (uint64_t i = 0; i < BURST; ++i) {
    const double angle = 0.001 * (double)i;
    const double down[3] = {sin(angle), cos(angle), 0};
    size += make_pose(down, i + 1, burst + size);
  }
  const double begin = supine_clock_seconds();
  assert_true(send_bytes(peer, burst, size));
  const int passed = receive_stamp(peer, BURST, &header, body);
  /* one frame at the start, and one before the first pose */
  const double most = 2.0 + s->options.rate * (supine_clock_seconds() - begin);
  assert_true(passed <= most);
  const double last[3] = {sin(0.999), cos(0.999), 0};
  expect_weights(s, last, 30.0, body);
  free(burst);
  (void)close(peer);
  const supine_stream_counts counts = stage_end(s);
  assert_int_equal(counts.poses, BURST);
  assert_true((double)counts.frames <= most);
  stage_destroy(s);
}

/* Send `count` poses, each after the answer to the one before. */
static void expect_answers(int peer, int count, uint64_t stamp) {
  supine_stream_header header;
  unsigned char body[4096];
  for (int i = 0; i < count; ++i) {
    assert_true(send_pose(peer, poses[i % 4], stamp + (uint64_t)i));
    (void)receive_stamp(peer, stamp + (uint64_t)i, &header, body);
  }
}

/* A regular peer is always answered, although one peer asks for surfaces and never reads, one
 * vanishes in the middle of a frame, and one stops in the middle of a message. */
TEST(test_server_stuck_or_vanished_peers_delay_nobody) {
  stage *s = stage_create();
  const int port = stage_run(s);
  const int regular = connect_peer(port);
  const int stuck = connect_peer(port);
  const int small = 4096;
  assert_int_equal(setsockopt(stuck, SOL_SOCKET, SO_RCVBUF, &small, sizeof small), 0);
  assert_true(send_text(stuck, "SEND", "surface"));
  const int vanished = connect_peer(port);
  assert_true(send_text(vanished, "SEND", "surface"));
  const int half = connect_peer(port);
  assert_true(send_bytes(half, "\0\1TRANS", 7));
  expect_answers(regular, 20, 1000);
  const struct linger reset = {1, 0};
  assert_int_equal(setsockopt(vanished, SOL_SOCKET, SO_LINGER, &reset, sizeof reset), 0);
  (void)close(vanished);
  expect_answers(regular, 100, 2000);
  (void)close(regular);
  const supine_stream_counts counts = stage_end(s);
  assert_int_equal(counts.peers, 4);
  assert_int_equal(counts.lost, 0); /* `lost` excludes peers that close the connection */
  (void)close(stuck);
  (void)close(half);
  stage_destroy(s);
}

static const double idle_seconds = 0.5;

/* A peer that asked for no frames and sends nothing is disconnected. One that only reads stays,
 * although there is no new frame. */
TEST(test_server_idle_peer_disconnected_reader_stays) {
  enum { MORE = 15 }; /* frames that the reader gets; without a new frame, ten a second or fewer */
  stage *s = stage_create();
  s->options.idle = idle_seconds;
  const int port = stage_run(s);
  const int reader = connect_peer(port);
  const int idle = connect_peer(port);
  supine_stream_header header;
  unsigned char body[4096];
  assert_true(send_text(idle, "SEND", "nothing"));
  assert_true(closed_by_server(idle));
  for (int i = 0; i < MORE; ++i) {
    assert_true(receive(reader, &header, body));
  }
  const supine_stream_counts counts = stage_end(s);
  assert_int_equal(counts.idle, 1);
  assert_int_equal(counts.frames, 1);
  assert_true(counts.sent >= MORE);
  const supine_stream_latency *latency = supine_stream_server_results(s->server)->latency;
  assert_int_equal(latency[0].count + latency[1].count, 0); /* a repeated frame answers no pose */
  (void)close(reader);
  (void)close(idle);
  stage_destroy(s);
}

/* A peer that does not read its frames is disconnected. */
TEST(test_server_peer_that_never_reads_disconnected) {
  stage *s = stage_create();
  s->options.idle = idle_seconds;
  const int stuck = connect_peer(stage_run(s));
  const int small = 4096;
  assert_int_equal(setsockopt(stuck, SOL_SOCKET, SO_RCVBUF, &small, sizeof small), 0);
  assert_true(send_text(stuck, "SEND", "surface"));
  for (int i = 0; i < 6000 && atomic_load(&s->warnings) == 0; ++i) {
    sleep_for(0.01);
  }
  const supine_stream_counts counts = stage_end(s);
  assert_int_equal(counts.idle, 1);
  (void)close(stuck);
  stage_destroy(s);
}

TEST(test_server_full_of_peers_one_more_refused) {
  enum { MANY = SUPINE_STREAM_PEERS_MAX };
  stage *s = stage_create();
  const int port = stage_run(s);
  int peer[MANY];
  supine_stream_header header;
  unsigned char body[4096];
  for (int i = 0; i < MANY; ++i) {
    peer[i] = connect_peer(port);
    if (i % 5 == 4) {
      assert_true(send_text(peer[i], "SEND", "surface"));
    }
  }
  for (uint64_t round = 0; round < 20; ++round) {
    assert_true(send_pose(peer[round], poses[round % 4], 500 + round));
    for (int i = 0; i < MANY; ++i) {
      (void)receive_stamp(peer[i], 500 + round, &header, body);
    }
  }
  const int extra = connect_peer(port); /* refused: too many peers */
  assert_true(closed_by_server(extra));
  (void)close(extra);
  (void)close(peer[0]);
  expect_answers(peer[1], 2, 700); /* by now, the server has seen that the connection is closed */
  peer[0] = connect_peer(port);    /* This connection takes the place of the closed one. */
  assert_true(send_pose(peer[0], poses[0], 900));
  (void)receive_stamp(peer[0], 900, &header, body);
  for (int i = 0; i < MANY; ++i) {
    (void)close(peer[i]);
  }
  const supine_stream_counts counts = stage_end(s);
  assert_int_equal(counts.turned_away, 1);
  assert_int_equal(counts.peers, MANY + 1);
  stage_destroy(s);
}

/* The server survives ten thousand messages of all types with random changes. Half of them get the
 * right checksum, so that the code behind the check is reached. */
TEST(test_server_ten_thousand_mutated_messages_survives) {
  enum { COUNT = 10000 };
  static const struct {
    const char *type, *device;
    size_t size;
    unsigned char begin[12];
    size_t one[4]; /* offsets at which to write 1.0 as a 32-bit float, ended by 0 */
  } seed[] = {{"TRANSFORM", "Patient", 48, {0x3F, 0x80}, {16, 32}},
              {"QTDATA", "Tracker", 150, {'P', 'a', 't', 'i', 'e', 'n', 't'}, {46, 96, 146}},
              {"POSITION", "Patient", 28, {0}, {24}},
              {"NDARRAY", "Patient", 28, {11, 1, 0, 3, 0x3F, 0xF0}, {0}},
              {"NDARRAY", "VOLUME", 12, {11, 1, 0, 1, 0x40, 0x59}, {0}},
              {"STRING", "VOLUME", 12, {0, 3, 0, 8, 'r', 'e', 's', 't', '+', '3', '5', '0'}, {0}},
              {"STRING", "SEND", 11, {0, 3, 0, 7, 's', 'u', 'r', 'f', 'a', 'c', 'e'}, {0}},
              {"IMAGE", "Camera", 200, {0}, {0}}};
  stage *s = stage_create();
  const int port = stage_run(s);
  const int regular = connect_peer(port);
  supine_stream_header heard;
  unsigned char content[4096];
  uint64_t dice = 20081226;
  for (int i = 0; i < COUNT; ++i) {
    const size_t which = (size_t)i % (sizeof seed / sizeof *seed);
    unsigned char body[256] = {0};
    unsigned char bytes[SUPINE_STREAM_HEADER + 256];
    memcpy(body, seed[which].begin, sizeof seed[which].begin);
    for (size_t k = 0; k < 4 && seed[which].one[k] > 0; ++k) {
      body[seed[which].one[k]] = 0x3F;
      body[seed[which].one[k] + 1] = 0x80;
    }
    size_t size =
        make_message(seed[which].type, seed[which].device, 1, body, seed[which].size, bytes);
    for (int change = 0; change < 1 + i % 4; ++change) {
      const double where = 0.5 * (1.0 + fixture_random(&dice)) * (double)size;
      bytes[(size_t)where] = (unsigned char)(127.5 * (1.0 + fixture_random(&dice)));
    }
    if (i % 2 == 0) {
      supine_stream_header header;
      supine_error error;
      if (supine_stream_header_read(bytes, &header, &error) == SUPINE_OK &&
          header.size <= size - SUPINE_STREAM_HEADER) {
        header.crc = supine_stream_crc64(0, bytes + SUPINE_STREAM_HEADER, (size_t)header.size);
        supine_stream_header_write(&header, bytes);
      }
    }
    /* Use one connection per message, so that an error in one message does not hide the next
     * message. */
    const int peer = connect_peer(port);
    /* sending fails if the server has already refused the header and closed the connection */
    (void)send_bytes(peer, bytes, size);
    (void)shutdown(peer, SHUT_WR);
    assert_true(closed_by_server(peer)); /* the server closes the connection after the message */
    (void)close(peer);
    if (i % 1000 == 0) {
      assert_true(send_text(regular, "VOLUME", "rest+30"));
      assert_true(send_pose(regular, poses[0], 5000 + (uint64_t)i));
      (void)receive_stamp(regular, 5000 + (uint64_t)i, &heard, content);
    }
  }
  assert_true(send_pose(regular, poses[0], 100000));
  (void)receive_stamp(regular, 100000, &heard, content);
  (void)close(regular);
  const supine_stream_counts counts = stage_end(s);
  assert_true(counts.malformed > 1000);
  assert_true(counts.lost > 10);
  assert_true(counts.skipped > 100);
  assert_true(counts.poses > 500);
  assert_true(counts.refused > 20);
  stage_destroy(s);
}

TEST(test_server_absurd_sizes_refused) {
  stage *s = stage_create();
  const int port = stage_run(s);
  unsigned char bytes[SUPINE_STREAM_HEADER];
  unsigned char piece[4096] = {0};
  supine_stream_header header = {.version = 1, .size = UINT64_MAX};
  strcpy(header.type, "TRANSFORM");
  strcpy(header.device, "Patient");
  supine_stream_header_write(&header, bytes);
  int peer = connect_peer(port);
  assert_true(send_bytes(peer, bytes, sizeof bytes));
  assert_true(closed_by_server(peer));
  (void)close(peer);
  /* The body of a TRANSFORM of 8 MiB is skipped, not stored. */
  header.size = 8u << 20;
  supine_stream_header_write(&header, bytes);
  peer = connect_peer(port);
  assert_true(send_bytes(peer, bytes, sizeof bytes));
  for (int i = 0; i < 2048; ++i) {
    assert_true(send_bytes(peer, piece, sizeof piece));
  }
  expect_answers(peer, 2, 1);
  header.size = 0; /* a TRANSFORM without a body */
  supine_stream_header_write(&header, bytes);
  assert_true(send_bytes(peer, bytes, sizeof bytes));
  expect_answers(peer, 2, 11);
  (void)close(peer);
  const supine_stream_counts counts = stage_end(s);
  assert_int_equal(counts.lost, 1);
  assert_int_equal(counts.skipped, 1);
  assert_int_equal(counts.malformed, 1);
  stage_destroy(s);
}

/* The server connects again to a tracker that has closed the connection. */
TEST(test_server_tracker_gone_reconnects) {
  supine_stream_address here;
  supine_error error;
  int port = 0;
  char target[32];
  assert_int_equal(supine_stream_address_read("0", true, &here, &error), SUPINE_OK);
  const int listener = supine_stream_address_listen(&here, &port, &error);
  assert_true(listener >= 0);
  (void)snprintf(target, sizeof target, "localhost:%d", port);
  stage *s = stage_create();
  s->options.listen = NULL;
  s->options.connect = target;
  assert_int_equal(stage_run(s), 0);
  for (uint64_t round = 0; round < 2; ++round) {
    struct pollfd waiting = {listener, POLLIN, 0};
    assert_int_equal(poll(&waiting, 1, 100000), 1);
    const int peer = accept(listener, NULL, NULL);
    const struct timeval limit = {100, 0};
    assert_true(peer >= 0);
    assert_int_equal(setsockopt(peer, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit), 0);
    expect_answers(peer, 3, 10 * (round + 1));
    (void)close(peer);
  }
  (void)close(listener);
  assert_int_equal(stage_end(s).peers, 2);
  stage_destroy(s);
}

/* With breathing, the server never stops sending. */
TEST(test_server_breathing_lungs_send_frames) {
  stage *s = stage_create();
  const supine_pv_breath breath = {60.0, 60.0, 0.5, 5.0, SUPINE_PV_COSINE};
  supine_stream_header header;
  unsigned char body[4096];
  supine_error error;
  assert_int_equal(
      supine_stream_volume_breathe(&s->volume, supine_breath_normal(), &breath, &error), SUPINE_OK);
  const int other = connect_peer(stage_run(s));
  const double supine[3] = {0, 1, 0};
  const double rest = pose_of(s, supine, 0.0).gains[0][0];
  const double deep = pose_of(s, supine, 60.0).gains[0][0];
  const double margin = 0.05 * fabs(deep - rest);
  double low = INFINITY;
  double high = -INFINITY;
  /* During breaths, the factor of the displacements reaches those of still poses at rest and at
   * peak inspiration, within 5 %, and does not go beyond. */
  for (int i = 0; low > fmin(rest, deep) + margin || high < fmax(rest, deep) - margin; ++i) {
    assert_true(i < 100000);
    assert_true(receive(other, &header, body));
    const double gain = (double)float_at(body + 4 + 4 * MODES);
    low = fmin(low, gain);
    high = fmax(high, gain);
    assert_true(low > fmin(rest, deep) - margin && high < fmax(rest, deep) + margin);
  }
  (void)close(other);
  stage_destroy(s);
}

/* Given a port alone, the server listens on 127.0.0.1 and on no other address of this machine; a
 * given address is used. */
TEST(test_server_port_alone_listens_on_loopback) {
  static const struct {
    const char *listen;
    uint32_t from;
    bool there;
  } tries[] = {{"0", INADDR_LOOPBACK, true},
               {"0", INADDR_LOOPBACK + 1, false},
               {"127.0.0.2:0", INADDR_LOOPBACK + 1, true},
               {"127.0.0.2:0", INADDR_LOOPBACK, false}};
  for (size_t i = 0; i < sizeof tries / sizeof *tries; ++i) {
    stage *s = stage_create();
    s->options.listen = tries[i].listen;
    const struct sockaddr_in place = {.sin_family = AF_INET,
                                      .sin_port = htons((uint16_t)stage_run(s)),
                                      .sin_addr = {htonl(tries[i].from)}};
    const int peer = socket(AF_INET, SOCK_STREAM, 0);
    const bool there = connect(peer, (const struct sockaddr *)&place, sizeof place) == 0;
    assert_true(there || errno == ECONNREFUSED);
    assert_int_equal(there, tries[i].there);
    (void)close(peer);
    stage_destroy(s);
  }
}

TEST(test_server_bad_address_refused) {
  stage *s = stage_create();
  supine_error error;
  supine_stream_server *server = NULL;
  static const char *const bad[] = {
      "", "x", "-1", "65536", "1:", ":1", "256.1.1.1:1", "host:1", "[]:1"};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
    s->options.listen = bad[i];
    assert_int_equal(supine_stream_server_create(s->basis, &s->options, &server, &error),
                     SUPINE_ERROR_ARGUMENT);
    assert_null(server);
  }
  char taken[16];
  s->options.listen = "0";
  (void)snprintf(taken, sizeof taken, "%d", stage_run(s));
  supine_stream_options options = s->options;
  options.listen = taken;
  assert_int_equal(supine_stream_server_create(s->basis, &options, &server, &error),
                   SUPINE_ERROR_WRITE);
  stage_destroy(s);
}

/* A frame larger than the socket's buffer arrives with every byte once and in order. */
TEST(test_server_small_socket_buffer_frame_whole) {
  static const size_t sizes[3] = {3001, 1, 2500007};
  const size_t size = sizes[0] + sizes[1] + sizes[2];
  unsigned char *bytes = fixture_allocate(size, 1);
  unsigned char *got = fixture_allocate(size + 1, 1);
  for (size_t i = 0; i < size; ++i) {
    bytes[i] = (unsigned char)(i * 2654435761u >> 13);
  }
  static const int rooms[2] = {4096, 4096000}; /* sizes of the socket's send buffer, bytes */
  for (size_t r = 0; r < 2; ++r) {
    supine_stream_peer peer = {0};
    int ends[2];
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, ends), 0);
    assert_int_equal(setsockopt(ends[0], SOL_SOCKET, SO_SNDBUF, &rooms[r], sizeof rooms[r]), 0);
    peer.socket = ends[0];
    size_t begin = 0;
    for (; peer.packet.count < 3; begin += sizes[peer.packet.count++]) {
      peer.packet.piece[peer.packet.count] =
          (struct iovec){bytes + begin, sizes[peer.packet.count]};
    }
    size_t arrived = 0;
    supine_stream_outcome outcome = SUPINE_STREAM_MORE;
    for (int pass = 0; arrived < size && pass < 100000; ++pass) {
      if (outcome == SUPINE_STREAM_MORE) {
        outcome = supine_stream_peer_send(&peer);
      }
      assert_int_not_equal(outcome, SUPINE_STREAM_LOST);
      assert_int_equal(outcome == SUPINE_STREAM_DONE, peer.packet.first == peer.packet.count);
      const ssize_t more = recv(ends[1], got + arrived, size + 1 - arrived, MSG_DONTWAIT);
      arrived += more > 0 ? (size_t)more : 0;
    }
    assert_int_equal(arrived, size);
    assert_int_equal(outcome, SUPINE_STREAM_DONE);
    assert_memory_equal(got, bytes, size);
    assert_int_equal(recv(ends[1], got, 1, MSG_DONTWAIT), -1);
    (void)close(ends[1]);
    peer.packet.piece[--peer.packet.first] = (struct iovec){bytes, 1};
    assert_int_equal(supine_stream_peer_send(&peer), SUPINE_STREAM_LOST);
    (void)close(ends[0]);
  }
  free(bytes);
  free(got);
}
