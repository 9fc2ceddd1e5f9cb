/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Read the content that a basis moves. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/io/points.h"
#include "precompute/inside/content.h"

static supine_status no_memory(const char *path, supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
}

/* Make room for more points, at least doubling it so that appending is cheap. */
static bool reserve(supine_inside_content *content, size_t *capacity, size_t more) {
  if (content->count + more <= *capacity) {
    return true;
  }
  const size_t wanted = 2 * (content->count + more);
  double *points = realloc(content->points, 3 * wanted * sizeof *points);
  content->points = points != NULL ? points : content->points;
  uint32_t *part = realloc(content->part, wanted * sizeof *part);
  content->part = part != NULL ? part : content->part;
  if (points == NULL || part == NULL) {
    return false;
  }
  *capacity = wanted;
  return true;
}

static bool add_name(supine_inside_content *content, const char *name, size_t length, size_t *used,
                     size_t *capacity) {
  if (*used + length + 2 > *capacity) {
    const size_t wanted = 2 * (*used + length + 2);
    char *names = realloc(content->names, wanted);
    if (names == NULL) {
      return false;
    }
    content->names = names;
    *capacity = wanted;
  }
  if (content->part_count > 0) {
    content->names[(*used)++] = '\n';
  }
  memcpy(content->names + *used, name, length);
  *used += length;
  content->names[*used] = '\0';
  ++content->part_count;
  return true;
}

supine_status supine_inside_content_points(const char *path,
                                           const supine_mesh_load_options *options,
                                           supine_inside_content *content, supine_error *error) {
  size_t capacity = content->count;
  size_t used = content->names != NULL ? strlen(content->names) : 0;
  size_t room = used;
  supine_mesh_points read = {0};
  supine_status status = supine_mesh_points_read(path, options, &read, error);
  if (status != SUPINE_OK) {
    return status;
  }
  if (!reserve(content, &capacity, read.count)) {
    status = no_memory(path, error);
  }
  for (size_t i = 0; i < read.count && status == SUPINE_OK; ++i) {
    const uint32_t part = (uint32_t)content->part_count;
    if (!add_name(content, read.names[i], strlen(read.names[i]), &used, &room)) {
      status = no_memory(path, error);
      break;
    }
    memcpy(content->points + 3 * content->count, read.at + 3 * i, 3 * sizeof *read.at);
    content->part[content->count++] = part;
  }
  supine_mesh_points_free(&read);
  return status;
}

/* Find "airways" in "/scans/airways.ply". */
static const char *part_name(const char *path, size_t *length) {
  const char *slash = strrchr(path, '/');
  const char *name = slash != NULL ? slash + 1 : path;
  const char *dot = strrchr(name, '.');
  *length = dot != NULL && dot > name ? (size_t)(dot - name) : strlen(name);
  return name;
}

static supine_status add_surface(const char *name, size_t length, const supine_mesh *mesh,
                                 supine_inside_content *content, supine_error *error) {
  size_t capacity = content->count;
  size_t used = content->names != NULL ? strlen(content->names) : 0;
  size_t room = used;
  const uint32_t part = (uint32_t)content->part_count;
  const size_t triangles = content->triangle_count + mesh->triangle_count;
  uint32_t *joined = realloc(content->triangles, 3 * triangles * sizeof *joined);
  content->triangles = joined != NULL ? joined : content->triangles;
  if (joined == NULL || !reserve(content, &capacity, mesh->vertex_count) ||
      !add_name(content, name, length, &used, &room)) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%.*s: out of memory", (int)length, name);
  }
  for (size_t i = 0; i < 3 * mesh->triangle_count; ++i) {
    joined[3 * content->triangle_count + i] = mesh->triangles[i] + (uint32_t)content->count;
  }
  memcpy(content->points + 3 * content->count, mesh->vertices,
         3 * mesh->vertex_count * sizeof *mesh->vertices);
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    content->part[content->count + i] = part;
  }
  content->count += mesh->vertex_count;
  content->triangle_count = triangles;
  return SUPINE_OK;
}

supine_status supine_inside_content_surface(const char *name, const supine_mesh *mesh,
                                            supine_inside_content *content, supine_error *error) {
  return add_surface(name, strlen(name), mesh, content, error);
}

supine_status supine_inside_content_mesh(const char *path, const supine_mesh_load_options *options,
                                         supine_inside_content *content, supine_error *error) {
  supine_mesh mesh = {0};
  supine_status status = supine_mesh_load(path, options, &mesh, NULL, error);
  if (status == SUPINE_OK) {
    size_t length = 0;
    const char *name = part_name(path, &length);
    status = add_surface(name, length, &mesh, content, error);
  }
  supine_mesh_free(&mesh);
  return status;
}

supine_status supine_inside_content_make_rigid(supine_inside_content *content, const char *names,
                                               supine_error *error) {
  content->rigid = calloc(content->part_count + 1, sizeof *content->rigid);
  if (content->rigid == NULL) {
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "out of memory");
  }
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
    if (!found) {
      return supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                              "--rigid: no part is named '%.*s': give the name of a mesh's file, "
                              "or a label as in --labels",
                              (int)length, at);
    }
    at += length;
    if (*at == '\0') {
      return SUPINE_OK;
    }
  }
}

void supine_inside_content_free(supine_inside_content *content) {
  free(content->rigid);
  free(content->points);
  free(content->part);
  free(content->triangles);
  free(content->names);
  *content = (supine_inside_content){0};
}
