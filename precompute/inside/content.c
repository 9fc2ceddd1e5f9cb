/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read the points and meshes inside the lungs that are to move with the lungs. */
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/text.h"

#include "mesh/io/points.h"
#include "mesh/compact.h"
#include "precompute/inside/content.h"

/* Make room for more points, triangles and bytes of names. */
static supine_status reserve(supine_inside_content *content, size_t points, size_t triangles,
                             size_t names, const char *path, supine_error *error) {
  const size_t used = content->names != NULL ? strlen(content->names) : 0;
  const size_t sizes[] = {3 * (content->count + points) * sizeof *content->points,
                          (content->count + points) * sizeof *content->part,
                          3 * (content->triangle_count + triangles) * sizeof *content->triangles,
                          used + names};
  void *const arrays[] = {&content->points, &content->part, &content->triangles, &content->names};
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

/* Make the list of rigid parts, unless it exists. */
static supine_status list_rigid(supine_inside_content *content, supine_error *error) {
  if (content->rigid == NULL) {
    content->rigid = calloc(content->part_count + 1, sizeof *content->rigid);
  }
  return content->rigid == NULL ? supine_error_memory(error, "%zu parts", content->part_count)
                                : SUPINE_OK;
}

supine_status supine_inside_content_find_compact(supine_inside_content *content,
                                                 supine_error *error) {
  size_t first = 0; /* triangle; those of a part follow each other */
  while (first < content->triangle_count) {
    const uint32_t part = content->part[content->triangles[3 * first]];
    size_t next = first;
    double volume = 0.0;
    double covariance[3][3];
    while (next < content->triangle_count &&
           content->part[content->triangles[3 * next]] == part) {
      ++next;
    }
    const supine_mesh mesh = {content->count, content->points, next - first,
                              content->triangles + 3 * first};
    SUPINE_TRY(supine_mesh_solid(&mesh, &volume, covariance));
    if (supine_mesh_is_compact(volume, (const double(*)[3])covariance)) {
      SUPINE_TRY(list_rigid(content, error));
      content->rigid[part] = true;
    }
    first = next;
  }
  return SUPINE_OK;
}

supine_status supine_inside_content_make_rigid(supine_inside_content *content, const char *names,
                                               supine_error *error) {
  SUPINE_TRY(list_rigid(content, error));
  for (const char *at = names;; ++at) {
    const size_t length = strcspn(at, ",");
    const char *part = content->names;
    bool found = false;
    for (size_t i = 0; i < content->part_count; ++i, part += strcspn(part, "\n") + 1) {
      const bool same = strncmp(part, at, length) == 0 && strchr("\n", part[length]) != NULL;
      if (same || strcmp(names, "all") == 0) {
        content->rigid[i] = found = true;
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
