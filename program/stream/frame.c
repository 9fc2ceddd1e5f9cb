/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Compute the positions of a frame, and build its messages. */
#define _DEFAULT_SOURCE /* declares madvise */ // NOLINT(*-reserved-identifier,cert-*)
#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <meshoptimizer.h>

#include "base/arena.h"
#include "base/library.h"
#include "base/parallel.h"
#include "program/stream/frame.h"

/* clang-format off */
#define FUNCTIONS(EACH)                                                                            \
  EACH(meshopt_, optimizeVertexCacheStrip) EACH(meshopt_, stripify) EACH(meshopt_, stripifyBound)
/* clang-format on */
static struct { FUNCTIONS(SUPINE_LIBRARY_MEMBER) } meshopt;

enum {
  BATCH = 2048,      /* number of vertices computed together, so that they stay in the L1 cache */
  GRAIN = 32 * BATCH /* smallest number of vertices for which a thread is worth starting */
};

struct supine_stream_frames {
  const supine_basis *basis;
  const supine_basis_info *info;
  char device[21];
  bool ras;
  uint64_t newest_number;
  uint32_t *strips;   /* for each triangle strip: number of corners, then corners; big-endian */
  size_t strips_size; /* size of `strips`, bytes */
  size_t strips_count;
  supine_arena arena;
  supine_stream_frame *unused; /* list of frames that can be reused */
};

const char *const supine_stream_content_names[] = {"weights", "points", "surface", "nothing", NULL};

/* Convert the triangles to strips. Corners i, i + 1 and i + 2 of a strip form a triangle, whose
 * orientation is reversed if i is odd. Triangles with two equal corners are not drawn; they only
 * connect the others in one strip. */
static supine_status make_strips(supine_stream_frames *f, supine_error *error) {
  static const uint32_t restart = UINT32_MAX; /* separates strips in the output of stripify() */
  const size_t corners = 3 * f->info->triangle_count;
  SUPINE_TRY(SUPINE_LIBRARY_LOAD(SUPINE_MESHOPT, FUNCTIONS, &meshopt, error));
  SUPINE_ARENA arena = {0};
  uint32_t *order = supine_arena_take(&arena, corners, sizeof *order);
  f->strips = supine_arena_take(&f->arena, meshopt.stripifyBound(corners) + 1, sizeof *f->strips);
  if (order == NULL || f->strips == NULL) {
    return supine_error_memory(error, "%zu triangles", corners / 3);
  }
  meshopt.optimizeVertexCacheStrip(order, supine_basis_triangles(f->basis), corners,
                                   f->info->vertex_count);
  const size_t end =
      1 + meshopt.stripify(f->strips + 1, order, corners, f->info->vertex_count, restart);
  for (size_t i = 1, head = 0; i <= end; ++i) {
    if (i == end || f->strips[i] == restart) {
      f->strips[head] = htonl((uint32_t)(i - head - 1));
      head = i;
      ++f->strips_count;
    } else {
      f->strips[i] = htonl(f->strips[i]);
    }
  }
  f->strips_size = end * sizeof *f->strips;
  return SUPINE_OK;
}

supine_status supine_stream_frames_create(const supine_basis *basis, const char *device, bool ras,
                                          supine_stream_frames **frames, supine_error *error) {
  supine_stream_frames *f = calloc(1, sizeof *f);
  if (f == NULL) {
    return supine_error_memory(error, "frames");
  }
  f->basis = basis;
  f->info = supine_basis_get_info(basis);
  strncpy(f->device, device, sizeof f->device - 1);
  f->ras = ras;
  /* Compute the strips now. For a million triangles this takes 0.1 s, and every peer would have to
   * wait if it were done at the first request for a surface. */
  const supine_status status = make_strips(f, error);
  if (status != SUPINE_OK) {
    supine_stream_frames_destroy(f);
    return status;
  }
  *frames = f;
  return SUPINE_OK;
}

void supine_stream_frames_destroy(supine_stream_frames *frames) {
  if (frames == NULL) {
    return;
  }
  supine_arena_free(&frames->arena);
  free(frames);
}

supine_stream_frame *supine_stream_frame_acquire(supine_stream_frames *frames,
                                                 const supine_stream_snapshot *snapshot) {
  supine_stream_frame *frame = frames->unused;
  if (frame != NULL) {
    frames->unused = frame->next;
  } else {
    const size_t count = frames->info->vertex_count;
    frame = supine_arena_zeros(&frames->arena, 1, sizeof *frame);
    float *points = supine_arena_take(&frames->arena, 16 * count + SUPINE_STREAM_ATTRIBUTE, 1);
    if (frame == NULL || points == NULL) {
      return NULL;
    }
    frame->points = points;
    frame->errors = (unsigned char *)(points + 3 * count);
  }
  frame->users = 1;
  frame->number = ++frames->newest_number;
  frame->snapshot = *snapshot;
  return frame;
}

void supine_stream_frame_release(supine_stream_frames *frames, supine_stream_frame *frame) {
  if (frame != NULL && --frame->users == 0) {
    frame->has_points = false;
    frame->next = frames->unused;
    frames->unused = frame;
  }
}

/* Convert points in LPS to big-endian floats, in place; also to RAS if `f->ras` is true. */
static void encode_points(const supine_stream_frames *f, size_t count, float *xyz) {
  if (f->ras) {
    for (size_t i = 0; i < count; ++i) {
      xyz[3 * i] = -xyz[3 * i];
      xyz[3 * i + 1] = -xyz[3 * i + 1];
    }
  }
  supine_stream_encode_floats(3 * count, xyz);
}

/* Compute positions and their errors from the fit to observed points; return false on failure. */
static bool compute_located_points(supine_stream_frames *f, supine_stream_frame *frame) {
  const size_t count = f->info->vertex_count;
  float *sigma = (void *)(frame->errors + supine_stream_attribute_head(count, frame->errors));
  if (supine_locate_positions(frame->snapshot.location, f->basis, frame->points, sigma, NULL) !=
      SUPINE_OK) {
    return false;
  }
  encode_points(f, count, frame->points);
  supine_stream_encode_floats(count, sigma);
  return true;
}

/* Data of the threads that compute points, each of them for a range of the vertices. */
typedef struct points_work {
  const supine_stream_frames *frames;
  const supine_stream_frame *frame;
} points_work;

static void compute_range(void *context, size_t begin, size_t end, size_t thread) {
  (void)thread;
  const points_work *p = context;
  for (; begin < end; begin += BATCH) {
    const size_t next = begin + BATCH < end ? begin + BATCH : end;
    float *xyz = p->frame->points + 3 * begin;
    (void)supine_deform_range(p->frames->basis, &p->frame->snapshot.pose, begin, next, xyz);
    encode_points(p->frames, next - begin, xyz);
  }
}

/* Compute a frame's points from the fit in snapshot.location, or else from snapshot.pose. */
static void compute_points(supine_stream_frames *f, supine_stream_frame *frame) {
  points_work p = {f, frame};
  if (frame->snapshot.location != NULL && compute_located_points(f, frame)) {
    return;
  }
  frame->snapshot.location = NULL;
  supine_parallel_for(f->info->vertex_count, GRAIN, 0, compute_range, &p);
}

/* Write the NDARRAY of mode weights, of each lung if they differ, and of displacement factors;
 * return its size in bytes. */
static size_t put_weights(const supine_stream_frames *f, const supine_stream_snapshot *snapshot,
                          unsigned char *bytes) {
  const size_t lungs = f->info->lung_count;
  const size_t modes = f->info->mode_count * (f->info->order > 0 ? lungs : 1);
  const size_t count = modes + 3 * lungs;
  /* Type 10 (32-bit floats), one dimension, and its size in two bytes. */
  const unsigned char head[4] = {10, 1, (unsigned char)(count >> 8), (unsigned char)count};
  float values[SUPINE_MODES_MAX + 3 * SUPINE_LUNGS_MAX];
  for (size_t i = 0; i < count; ++i) {
    values[i] = (float)(i < modes ? snapshot->pose.weights[i]
                                  : snapshot->pose.gains[(i - modes) / 3][(i - modes) % 3]);
  }
  supine_stream_encode_floats(count, values);
  memcpy(bytes, head, sizeof head);
  memcpy(bytes + sizeof head, values, 4 * count);
  return sizeof head + 4 * count;
}

static void add_piece(supine_stream_packet *packet, void *bytes, size_t size) {
  packet->piece[packet->count++] = (struct iovec){bytes, size};
  packet->size += size;
}

void supine_stream_frame_pack(supine_stream_frames *frames, supine_stream_frame *frame,
                              supine_stream_content content, bool triangles,
                              supine_stream_packet *packet) {
  const bool weights = content == SUPINE_STREAM_WEIGHTS;
  if (!weights && !frame->has_points) {
    compute_points(frames, frame);
    frame->has_points = true;
  }
  const bool located = !weights && frame->snapshot.location != NULL;
  unsigned char *body = packet->front + SUPINE_STREAM_HEADER;
  const size_t size = weights ? put_weights(frames, &frame->snapshot, body)
                              : supine_stream_polydata_head(frames->info->vertex_count,
                                                            triangles ? frames->strips_count : 0,
                                                            triangles ? frames->strips_size : 0,
                                                            located ? 1 : 0, body);
  packet->first = packet->count = 0;
  packet->size = 0;
  add_piece(packet, packet->front, SUPINE_STREAM_HEADER + size);
  if (!weights) {
    add_piece(packet, frame->points, 12 * frames->info->vertex_count);
  }
  if (!weights && triangles) {
    add_piece(packet, frames->strips, frames->strips_size);
  }
  if (located) {
    add_piece(packet, frame->errors, SUPINE_STREAM_ATTRIBUTE + 4 * frames->info->vertex_count);
  }
  uint64_t crc = supine_stream_crc64(0, body, size);
  for (int i = 1; i < packet->count; ++i) {
    crc = supine_stream_crc64(crc, packet->piece[i].iov_base, packet->piece[i].iov_len);
  }
  supine_stream_header header = {.version = 1,
                                 .stamp = frame->snapshot.stamp,
                                 .size = packet->size - SUPINE_STREAM_HEADER,
                                 .crc = crc};
  (void)snprintf(header.type, sizeof header.type, "%s", weights ? "NDARRAY" : "POLYDATA");
  memcpy(header.device, frames->device, sizeof header.device);
  supine_stream_header_write(&header, packet->front);
}
