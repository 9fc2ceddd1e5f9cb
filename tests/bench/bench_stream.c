/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Measure the latency from sending a pose to receiving its frame, between two processes over
 * loopback:
 *
 *     bench_stream SUPINE BASIS [SECONDS [WHAT...]]
 *
 * This program sends 66.66 poses a second, like a tracker, to a server on the same machine, and
 * receives frames of weights, points or surfaces (WHAT). Print a row for each kind, and below it a
 * row for a server that sends messages of the same size without any computation. A row has
 * - the numbers of poses sent and of frames received
 * - "old": the number of frames that arrived when a newer pose than theirs had been sent
 * - "oldest": the largest number of poses by which an arriving frame was behind the newest pose
 * - median, 99th percentile and maximum of the time from the first byte of a pose sent to the last
 *   byte of its frame received, ms
 * - memory of the server after 1 s and at the end, KiB
 * - "holds" if "oldest" is at most 1 and 99 % of the frames came in time, weights within 2 ms,
 *   points and surfaces within 15 ms; otherwise "misses" */
#include <arpa/inet.h>
#include <math.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "program/stream/message.h"

static const double interval = 1.0 / 66.66; /* time between poses, s */

enum { POSE_SIZE = SUPINE_STREAM_HEADER + 48 };

static int fail(const char *what) {
  perror(what);
  return 1;
}

/* Start the server, and open its output `lines`. Return its port, or 0 on failure. */
static int serve(const char *supine, const char *basis, const char *what, pid_t *server,
                 FILE **lines) {
  int ends[2];
  int port = 0;
  if (pipe(ends) != 0) {
    return 0;
  }
  *server = fork();
  if (*server == 0) {
    (void)dup2(ends[1], STDOUT_FILENO);
    (void)close(ends[0]);
    (void)execl(supine, supine, "stream", basis, "--listen", "0", "--send", what, "--volume",
                "rest+400", (char *)NULL);
    _exit(127);
  }
  (void)close(ends[1]);
  *lines = fdopen(ends[0], "r");
  char line[256];
  while (*lines != NULL && port == 0 && fgets(line, sizeof line, *lines) != NULL) {
    (void)sscanf(line, "listening on port %d", &port);
  }
  return port;
}

/* Start a server that answers each pose by `size` bytes without any computation, to measure the
 * shortest possible latency. Return the port, or 0 on failure. */
static int serve_bare(size_t size, pid_t *server) {
  struct sockaddr_in here = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
  socklen_t length = sizeof here;
  unsigned char pose[POSE_SIZE];
  unsigned char *message = calloc(size, 1);
  const int listener = socket(AF_INET, SOCK_STREAM, 0);
  if (message == NULL || bind(listener, (struct sockaddr *)&here, sizeof here) != 0 ||
      listen(listener, 1) != 0 || getsockname(listener, (struct sockaddr *)&here, &length) != 0) {
    return 0;
  }
  *server = fork();
  if (*server == 0) {
    const int s = accept(listener, NULL, NULL);
    while (recv(s, pose, sizeof pose, MSG_WAITALL) == (ssize_t)sizeof pose) {
      supine_stream_header header;
      supine_error error;
      (void)supine_stream_header_read(pose, &header, &error);
      header.size = size - SUPINE_STREAM_HEADER;
      supine_stream_header_write(&header, message);
      for (size_t sent = 0; sent < size;) {
        const ssize_t n = send(s, message + sent, size - sent, MSG_NOSIGNAL);
        sent = n > 0 ? sent + (size_t)n : size;
      }
    }
    _exit(0);
  }
  (void)close(listener);
  free(message);
  return ntohs(here.sin_port);
}

/* Return the resident memory of a process in KiB, -1 if it is unknown. */
static long memory_of(pid_t process) {
  char path[64];
  char line[256];
  long size = -1;
  (void)snprintf(path, sizeof path, "/proc/%d/status", (int)process);
  FILE *file = fopen(path, "r");
  while (file != NULL && fgets(line, sizeof line, file) != NULL) {
    (void)sscanf(line, "VmRSS: %ld", &size);
  }
  if (file != NULL) {
    (void)fclose(file);
  }
  return size;
}

static int dial(int port) {
  const int s = socket(AF_INET, SOCK_STREAM, 0);
  const int yes = 1;
  const struct sockaddr_in here = {.sin_family = AF_INET,
                                   .sin_port = htons((uint16_t)port),
                                   .sin_addr = {htonl(INADDR_LOOPBACK)}};
  if (s < 0 || connect(s, (const struct sockaddr *)&here, sizeof here) != 0 ||
      setsockopt(s, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes) != 0) {
    return -1;
  }
  return s;
}

/* Encode the pose of a body that turns about its long axis twice a minute. */
static void make_pose(double time, uint64_t stamp, unsigned char bytes[POSE_SIZE]) {
  const double angle = time * (2.0 * M_PI / 30.0);
  /* rotation matrix by columns: the body's left, back and head */
  float columns[12] = {
      (float)cos(angle), 0, (float)-sin(angle), (float)-sin(angle), 0, (float)-cos(angle), 0, 1, 0};
  unsigned char *body = bytes + SUPINE_STREAM_HEADER;
  supine_stream_encode_floats(12, columns);
  memcpy(body, columns, sizeof columns);
  supine_stream_header header = {
      .version = 1, .stamp = stamp, .size = 48, .crc = supine_stream_crc64(0, body, 48)};
  strcpy(header.type, "TRANSFORM");
  strcpy(header.device, "Patient");
  supine_stream_header_write(&header, bytes);
}

static int compare(const void *a, const void *b) {
  const double x = *(const double *)a;
  const double y = *(const double *)b;
  return (x > y) - (x < y);
}

typedef struct tally {
  double *sent;    /* [poses] times at which poses were sent, s; pose i has the time stamp i + 1 */
  double *latency; /* [frames] times from sending a pose to receiving its frame, s */
  size_t poses, frames;
  size_t old;    /* number of frames that arrived when a newer pose than theirs had been sent */
  size_t oldest; /* largest number of poses by which an arriving frame was behind */
  /* bytes of the current message: number received, and number to receive before it is processed */
  size_t arrived, needed;
  unsigned char head[SUPINE_STREAM_HEADER];
  supine_stream_header header;
} tally;

/* Receive what has arrived. Return false if the connection is closed or a message is invalid. */
static bool take(int s, tally *t) {
  static unsigned char bytes[1 << 20];
  for (;;) {
    const size_t left = t->needed - t->arrived;
    const bool head = t->needed == SUPINE_STREAM_HEADER;
    const ssize_t n = recv(s, head ? t->head + t->arrived : bytes,
                           left < sizeof bytes ? left : sizeof bytes, MSG_DONTWAIT);
    if (n <= 0) {
      return n < 0;
    }
    t->arrived += (size_t)n;
    if (t->arrived < t->needed) {
      continue;
    }
    t->arrived = 0;
    if (head) {
      supine_error error;
      if (supine_stream_header_read(t->head, &t->header, &error) != SUPINE_OK) {
        return false;
      }
      t->needed = SUPINE_STREAM_HEADER + (size_t)t->header.size;
      t->arrived = SUPINE_STREAM_HEADER;
      continue;
    }
    t->needed = SUPINE_STREAM_HEADER;
    if (t->header.stamp >= 1 && t->header.stamp <= t->poses) {
      t->latency[t->frames++] = supine_clock_seconds() - t->sent[t->header.stamp - 1];
      const size_t since = t->poses - (size_t)t->header.stamp;
      t->old += since > 0;
      t->oldest = since > t->oldest ? since : t->oldest;
    }
  }
}

/* Measure the latency of frames of kind `what`, and set `size` to the size of their messages. If
 * `*size` is above 0 on entry, measure the server without computation, with messages of this
 * size. */
static int measure(const char *supine, const char *basis, const char *what, double seconds,
                   size_t *size) {
  pid_t server = 0;
  FILE *lines = NULL;
  char line[256];
  const int port =
      *size > 0 ? serve_bare(*size, &server) : serve(supine, basis, what, &server, &lines);
  const int s = port == 0 ? -1 : dial(port);
  const size_t count = (size_t)(seconds / interval);
  tally t = {.sent = calloc(count, sizeof(double)),
             .latency = calloc(count + 1, sizeof(double)),
             .needed = SUPINE_STREAM_HEADER};
  if (s < 0 || t.sent == NULL || t.latency == NULL) {
    return fail("cannot start the server or connect to it, or out of memory");
  }
  const double begun = supine_clock_seconds();
  long before = -1;
  bool alive = true;
  while (alive && t.poses < count) {
    const double now = supine_clock_seconds();
    const double due = begun + interval * (double)t.poses;
    if (now >= due) {
      unsigned char pose[POSE_SIZE];
      make_pose(now - begun, t.poses + 1, pose);
      t.sent[t.poses++] = supine_clock_seconds();
      alive = send(s, pose, sizeof pose, MSG_NOSIGNAL) == (ssize_t)sizeof pose;
      before = before < 0 && now - begun > 1.0 ? memory_of(server) : before;
      continue;
    }
    struct pollfd waiting = {s, POLLIN, 0};
    const struct timespec rest = {0, (long)(1e9 * (due - now))};
    if (ppoll(&waiting, 1, &rest, NULL) > 0) {
      alive = take(s, &t);
    }
  }
  struct pollfd waiting = {s, POLLIN, 0};
  while (alive && poll(&waiting, 1, 200) > 0) {
    alive = take(s, &t);
  }
  const long after = memory_of(server);
  (void)close(s);
  (void)kill(server, SIGTERM);
  qsort(t.latency, t.frames, sizeof(double), compare);
  const double within = t.latency[(size_t)(0.99 * (double)t.frames)];
  const double limit = strcmp(what, "weights") == 0 ? 2e-3 : 15e-3;
  (void)printf("%-8s %8zu %8zu %6zu %6zu %10.3f %10.3f %10.3f %10ld %10ld  %s\n", what, t.poses,
               t.frames, t.old, t.oldest, 1e3 * t.latency[t.frames / 2], 1e3 * within,
               1e3 * t.latency[t.frames == 0 ? 0 : t.frames - 1], before, after,
               t.frames > 0 && t.oldest <= 1 && within <= limit ? "holds" : "misses");
  while (lines != NULL && fgets(line, sizeof line, lines) != NULL) {
    if (strstr(line, "pose received to") != NULL) {
      (void)printf("         %s", line);
    }
  }
  (void)waitpid(server, NULL, 0);
  if (lines != NULL) {
    (void)fclose(lines);
  }
  *size = SUPINE_STREAM_HEADER + (size_t)t.header.size;
  (void)fflush(stdout);
  free(t.sent);
  free(t.latency);
  return alive ? 0 : fail("the server closed the connection");
}

int main(int count, char **word) {
  static char *all[] = {"weights", "points", "surface"};
  if (count < 3) {
    (void)fprintf(stderr, "usage: bench_stream SUPINE BASIS [SECONDS [WHAT...]]\n");
    return 1;
  }
  const double seconds = count > 3 ? strtod(word[3], NULL) : 60.0;
  char **what = count > 4 ? word + 4 : all;
  const int kinds = count > 4 ? count - 4 : 3;
  (void)printf(
      "what        poses   frames    old oldest  median ms    99 %% ms   worst ms  KiB 1 s "
      "   KiB end\n");
  for (int i = 0; i < kinds; ++i) {
    size_t size = 0;
    if (measure(word[1], word[2], what[i], seconds, &size) != 0 ||
        measure(word[1], word[2], "bare", seconds, &size) != 0) {
      return 1;
    }
  }
  return 0;
}
