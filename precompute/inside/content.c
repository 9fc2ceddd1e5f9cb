/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read the points and meshes inside the lungs that are to move with the lungs. */
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/text.h"

#include "mesh/compact.h"
#include "mesh/io/points.h"
#include "precompute/inside/content.h"

/* Make room for more points, triangles and bytes of names. */
static supine_status reserve(supine_inside_content *content, size_t points, size_t triangles,
                             size_t names, const char *path, supine_error *error) {
  const size_t used = content->names != NULL ? strlen(content->names) : 0;
  const size_t sizes[] = {3 * (content->count + points) * sizeof *content->points,
                          (content->count + points) * sizeof *content->part,
                          (content->count + points) * sizeof *content->rigid,
                          3 * (content->triangle_count + triangles) * sizeof *content->triangles,
                          used + names};
  void *const arrays[] = {&content->points, &content->part, &content->rigid, &content->triangles,
                          &content->names};
  for (size_t i = 0; i < sizeof arrays / sizeof *arrays; ++i) {
    void *array;
    memcpy(&array, arrays[i], sizeof array);
    void *grown = realloc(array, sizes[i] + 1);
    if (grown == NULL) {
      return supine_error_memory(error, "%s", path);
    }
    memcpy(arrays[i], &grown, sizeof grown);
  }
  content->names[used] = '\0';
  memset(content->rigid + content->count, 0, points * sizeof *content->rigid);
  return SUPINE_OK;
}

/* Append the name of a part to content->names at `end`. Return the new end. */
static char *add_name(supine_inside_content *content, const char *name, size_t length, char *end) {
  if (content->part_count++ > 0) {
    *end++ = '\n';
  }
  for (size_t i = 0; i < length; ++i) { /* line feeds separate the names */
    end[i] = (char)((unsigned char)name[i] < ' ' ? ' ' : name[i]);
  }
  end[length] = '\0';
  return end + length;
}

supine_status supine_inside_content_points(const char *path,
                                           const supine_mesh_load_options *options,
                                           supine_inside_content *content, supine_error *error) {
  SUPINE_FREED_BY(supine_io_points_free) supine_io_points read = {0};
  size_t length = 0;
  SUPINE_TRY(supine_io_points_read(path, options, &read, error));
  for (size_t i = 0; i < read.count; ++i) {
    length += strlen(read.names[i]) + 1;
  }
  SUPINE_TRY(reserve(content, read.count, 0, length, path, error));
  char *end = content->names + strlen(content->names);
  memcpy(content->points + 3 * content->count, read.at, 3 * read.count * sizeof *read.at);
  for (size_t i = 0; i < read.count; ++i) {
    content->part[content->count++] = (uint32_t)content->part_count;
    end = add_name(content, read.names[i], strlen(read.names[i]), end);
  }
  return SUPINE_OK;
}

/* Return where the mesh name ("airways") starts in "/scans/airways.ply", and set its length. */
static const char *part_name(const char *path, size_t *length) {
  const char *name = supine_text_file_name(path);
  const char *dot = strrchr(name, '.');
  *length = dot != NULL && dot > name ? (size_t)(dot - name) : strlen(name);
  return name;
}

static supine_status add_surface(const char *name, size_t length, const supine_mesh *mesh,
                                 supine_inside_content *content, supine_error *error) {
  SUPINE_REFUSE_IF(!supine_text_is_utf8(name), error, SUPINE_ERROR_FORMAT,
                   "%s: the name of this part is not UTF-8: rename the file or the label", name);
  SUPINE_TRY(reserve(content, mesh->vertex_count, mesh->triangle_count, length + 1, name, error));
  uint32_t *joined = content->triangles + 3 * content->triangle_count;
  for (size_t i = 0; i < 3 * mesh->triangle_count; ++i) {
    joined[i] = mesh->triangles[i] + (uint32_t)content->count;
  }
  memcpy(content->points + 3 * content->count, mesh->vertices,
         3 * mesh->vertex_count * sizeof *mesh->vertices);
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    content->part[content->count + i] = (uint32_t)content->part_count;
  }
  content->count += mesh->vertex_count;
  content->triangle_count += mesh->triangle_count;
  (void)add_name(content, name, length, content->names + strlen(content->names));
  return SUPINE_OK;
}

supine_status supine_inside_content_surface(const char *name, const supine_mesh *mesh,
                                            supine_inside_content *content, supine_error *error) {
  return add_surface(name, strlen(name), mesh, content, error);
}

supine_status supine_inside_content_mesh(const char *path, const supine_mesh_load_options *options,
                                         supine_inside_content *content, supine_error *error) {
  SUPINE_FREED_BY(supine_mesh_free) supine_mesh mesh = {0};
  size_t length = 0;
  const char *name = part_name(path, &length);
  SUPINE_TRY(supine_mesh_load(path, options, &mesh, NULL, error));
  return add_surface(name, length, &mesh, content, error);
}

/* Move the points of a part, which `mesh` has, so that those of each rigid piece follow each other,
 * and those that deform come last.
 * @param first  of the points and corners of the part */
static supine_status sort_pieces(supine_inside_content *content, const supine_mesh *mesh,
                                 const uint32_t *piece, uint32_t pieces, size_t first,
                                 uint32_t *corners) {
  SUPINE_ARENA arena = {0};
  const size_t n = mesh->vertex_count;
  double *points = supine_arena_take(&arena, 3 * n, sizeof *points);
  uint32_t *to = supine_arena_take(&arena, n, sizeof *to); /* new index of each point */
  uint32_t next = 0;
  SUPINE_TRY(supine_arena_status(&arena));
  memcpy(points, mesh->vertices, 3 * n * sizeof *points);
  for (uint32_t k = 1; k <= pieces + 1; ++k) {
    for (size_t i = 0; i < n; ++i) {
      if (piece[i] == k % (pieces + 1)) {
        const size_t at = first + next;
        memcpy(content->points + 3 * at, points + 3 * i, 3 * sizeof *points);
        content->rigid[at] = piece[i] > 0 ? (uint32_t)content->rigid_count + piece[i] : 0;
        to[i] = next++;
      }
    }
  }
  for (size_t i = 0; i < 3 * mesh->triangle_count; ++i) {
    corners[i] = (uint32_t)first + to[mesh->triangles[i]];
  }
  content->rigid_count += pieces;
  return SUPINE_OK;
}

/* Make the compact components of a part rigid, which has the points from `begin` to `end` and
 * `triangle_count` triangles. */
static supine_status find_pieces(supine_inside_content *content, size_t begin, size_t end,
                                 uint32_t *triangles, size_t triangle_count) {
  SUPINE_ARENA arena = {0};
  supine_mesh mesh = {end - begin, content->points + 3 * begin, triangle_count,
                      supine_arena_take(&arena, 3 * triangle_count, sizeof *triangles)};
  uint32_t *piece = supine_arena_take(&arena, end - begin, sizeof *piece);
  uint32_t pieces = 0;
  SUPINE_TRY(supine_arena_status(&arena));
  for (size_t i = 0; i < 3 * triangle_count; ++i) {
    mesh.triangles[i] = triangles[i] - (uint32_t)begin;
  }
  SUPINE_TRY(supine_mesh_find_compact(&mesh, piece, &pieces));
  if (pieces == 0) {
    return SUPINE_OK;
  }
  return sort_pieces(content, &mesh, piece, pieces, begin, triangles);
}

supine_status supine_inside_content_find_compact(supine_inside_content *content,
                                                 supine_error *error) {
  size_t first = 0; /* triangle; those of a part follow each other */
  for (size_t begin = 0, end = 0; begin < content->count; begin = end) {
    size_t next = first;
    while (end < content->count && content->part[end] == content->part[begin]) {
      ++end;
    }
    while (next < content->triangle_count && content->triangles[3 * next] < end) {
      ++next;
    }
    uint32_t *triangles = content->triangles + 3 * first;
    if (next > first && find_pieces(content, begin, end, triangles, next - first) != SUPINE_OK) {
      return supine_error_memory(error, "%zu points", content->count);
    }
    first = next;
  }
  return SUPINE_OK;
}

/* Make the part of an index a rigid piece. */
static void make_rigid(supine_inside_content *content, size_t part) {
  ++content->rigid_count;
  for (size_t i = 0; i < content->count; ++i) {
    if (content->part[i] == part) {
      content->rigid[i] = (uint32_t)content->rigid_count;
    }
  }
}

supine_status supine_inside_content_make_rigid(supine_inside_content *content, const char *names,
                                               supine_error *error) {
  for (const char *at = names;; ++at) {
    const size_t length = strcspn(at, ",");
    const char *part = content->names;
    bool found = false;
    for (size_t i = 0; i < content->part_count; ++i, part += strcspn(part, "\n") + 1) {
      const bool same = strncmp(part, at, length) == 0 && strchr("\n", part[length]) != NULL;
      if (same || strcmp(names, "all") == 0) {
        make_rigid(content, i);
        found = true;
      }
    }
    SUPINE_REFUSE_IF(!found, error, SUPINE_ERROR_ARGUMENT,
                     "rigid: no part is named '%.*s': give a mesh's file name without its "
                     "ending, or a label of the image",
                     (int)length, at);
    at += length;
    if (*at == '\0') {
      return SUPINE_OK;
    }
  }
}

/* Compare two names, each of which ends at a newline or at the end of the text. */
static int compare_names(const void *first, const void *second) {
  const char *a = *(const char *const *)first;
  const char *b = *(const char *const *)second;
  const size_t length[2] = {strcspn(a, "\n"), strcspn(b, "\n")};
  const int order = memcmp(a, b, length[0] < length[1] ? length[0] : length[1]);
  return order != 0 ? order : (length[0] > length[1]) - (length[0] < length[1]);
}

supine_status supine_inside_content_check_names(const supine_inside_content *content,
                                                supine_error *error) {
  SUPINE_ARENA arena = {0};
  const char **names = supine_arena_take(&arena, content->part_count, sizeof *names);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu names", content->part_count));
  const char *name = content->names;
  for (size_t i = 0; i < content->part_count; ++i, name += strcspn(name, "\n") + 1) {
    names[i] = name;
  }
  qsort(names, content->part_count, sizeof *names, compare_names);
  for (size_t i = 1; i < content->part_count; ++i) {
    SUPINE_REFUSE_IF(compare_names(&names[i - 1], &names[i]) == 0, error, SUPINE_ERROR_FORMAT,
                     "two parts are named '%.*s': give each a name of its own",
                     (int)strcspn(names[i], "\n"), names[i]);
  }
  return SUPINE_OK;
}

void supine_inside_content_free(supine_inside_content *content) {
  free(content->rigid);
  free(content->points);
  free(content->part);
  free(content->triangles);
  free(content->names);
  *content = (supine_inside_content){0};
}
