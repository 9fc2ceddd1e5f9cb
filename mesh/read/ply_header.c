/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Reading a PLY file's header, and writing it again in its plainest form. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/read/ply.h"

static const ply_type *find_type(mesh_text word) {
  static const ply_type types[] = {
      {"char", 1, true, false},    {"int8", 1, true, false},    {"uchar", 1, false, false},
      {"uint8", 1, false, false},  {"short", 2, true, false},   {"int16", 2, true, false},
      {"ushort", 2, false, false}, {"uint16", 2, false, false}, {"int", 4, true, false},
      {"int32", 4, true, false},   {"uint", 4, false, false},   {"uint32", 4, false, false},
      {"float", 4, true, true},    {"float32", 4, true, true},  {"double", 8, true, true},
      {"float64", 8, true, true}};
  for (size_t i = 0; i < sizeof types / sizeof *types; ++i) {
    if (supine_mesh_text_is(word, types[i].name)) {
      return &types[i];
    }
  }
  return NULL;
}

static const char *find_role(mesh_text word, const char *const *roles) {
  for (; *roles != NULL; ++roles) {
    if (supine_mesh_text_is(word, *roles)) {
      return *roles;
    }
  }
  return NULL;
}

static const char *property_role(mesh_text name, const char *element, bool is_list) {
  static const char *const coordinates[] = {"x", "y", "z", NULL};
  static const char *const corners[] = {"vertex_indices", "vertex_index", NULL};
  if (element == NULL) {
    return NULL;
  }
  if (strcmp(element, "vertex") == 0) {
    return is_list ? NULL : find_role(name, coordinates);
  }
  return is_list && find_role(name, corners) != NULL ? corners[0] : NULL;
}

static bool read_format(mesh_text line, ply_header *header) {
  mesh_text word;
  if (!supine_mesh_text_word(&line, &word)) {
    return false;
  }
  header->encoding = supine_mesh_text_is(word, "ascii")                  ? PLY_ASCII
                     : supine_mesh_text_is(word, "binary_little_endian") ? PLY_LITTLE
                                                                         : PLY_BIG;
  return header->encoding != PLY_BIG || supine_mesh_text_is(word, "binary_big_endian");
}

static bool read_element(mesh_text line, ply_header *header) {
  static const char *const roles[] = {"vertex", "face", "tristrips", NULL};
  mesh_text name;
  mesh_text count;
  if (header->element_count == PLY_ELEMENTS_MAX || !supine_mesh_text_word(&line, &name) ||
      !supine_mesh_text_word(&line, &count)) {
    return false;
  }
  ply_element *element = &header->elements[header->element_count];
  *element =
      (ply_element){.role = find_role(name, roles), .first_property = header->property_count};
  for (size_t e = 0; element->role != NULL && e < header->element_count; ++e) {
    if (header->elements[e].role == element->role) { /* twice: which would it be? */
      return false;
    }
  }
  ++header->element_count;
  return supine_mesh_text_count(count, &element->count);
}

static bool read_property(mesh_text line, ply_header *header) {
  mesh_text word;
  if (header->property_count == PLY_PROPERTIES_MAX || header->element_count == 0 ||
      !supine_mesh_text_word(&line, &word)) {
    return false;
  }
  ply_element *element = &header->elements[header->element_count - 1];
  ply_property property = {0};
  if (supine_mesh_text_is(word, "list")) {
    if (!supine_mesh_text_word(&line, &word)) {
      return false;
    }
    property.count = find_type(word);
    if (property.count == NULL || property.count->is_real || !supine_mesh_text_word(&line, &word)) {
      return false;
    }
  }
  property.type = find_type(word);
  if (property.type == NULL || !supine_mesh_text_word(&line, &word)) {
    return false;
  }
  property.role = property_role(word, element->role, property.count != NULL);
  ++element->property_count;
  element->has_list = element->has_list || property.count != NULL;
  header->properties[header->property_count++] = property;
  return true;
}

static bool is_printable(mesh_text line) {
  for (; line.at < line.end; ++line.at) {
    if (*line.at < ' ' && *line.at != '\t') {
      return false;
    }
  }
  return true;
}

/* Comments and words of no known meaning pass. */
static bool read_line(mesh_text line, ply_header *header, bool *has_format) {
  mesh_text word;
  if (!is_printable(line)) {
    return false;
  }
  if (!supine_mesh_text_word(&line, &word)) {
    return true;
  }
  if (supine_mesh_text_is(word, "format")) {
    *has_format = read_format(line, header);
    return *has_format;
  }
  return supine_mesh_text_is(word, "element")    ? read_element(line, header)
         : supine_mesh_text_is(word, "property") ? read_property(line, header)
                                                 : true;
}

supine_status supine_mesh_ply_header_read(const mesh_file *file, ply_header *header,
                                          supine_error *error) {
  *header = (ply_header){0};
  mesh_text text = {file->bytes, file->bytes + file->size};
  mesh_text line;
  bool has_format = false;
  if (!supine_mesh_text_line(&text, &line) || !supine_mesh_text_is(line, "ply")) {
    return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: does not begin with \"ply\"",
                            file->path);
  }
  for (size_t number = 2; supine_mesh_text_line(&text, &line); ++number) {
    mesh_text rest = line;
    mesh_text word;
    if (supine_mesh_text_word(&rest, &word) && supine_mesh_text_is(word, "end_header")) {
      header->size = (size_t)(text.at - file->bytes);
      return has_format ? SUPINE_OK
                        : supine_error_set(error, SUPINE_ERROR_FORMAT,
                                           "%s: the PLY header has no format line", file->path);
    }
    if (!read_line(line, header, &has_format)) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: line %zu of the PLY header is malformed", file->path, number);
    }
  }
  return supine_error_set(error, SUPINE_ERROR_FORMAT,
                          "%s: the PLY header has no end_header: the file is truncated",
                          file->path);
}

static void write_element(FILE *out, const ply_header *header, const ply_element *element) {
  (void)fprintf(out, "element %s %llu\n", element->role, (unsigned long long)element->count);
  for (size_t p = 0; p < element->property_count; ++p) {
    const ply_property *property = &header->properties[element->first_property + p];
    const char *role = property->role == NULL ? "other" : property->role;
    if (property->count == NULL) {
      (void)fprintf(out, "property %s %s\n", property->type->name, role);
    } else {
      (void)fprintf(out, "property list %s %s %s\n", property->count->name, property->type->name,
                    role);
    }
  }
}

/* assimp 5.2 drops a binary body's first byte where it is LF, and mistakes elements that it does
 * not know; so a byte of a kind that it knows goes first. */
static void write_header(FILE *out, const ply_header *header) {
  static const char *const encodings[] = {"ascii", "binary_little_endian", "binary_big_endian"};
  const bool pad = header->encoding != PLY_ASCII;
  (void)fprintf(out, "ply\nformat %s 1.0\n%s", encodings[header->encoding],
                pad ? "element material 1\nproperty uchar other\n" : "");
  for (size_t e = 0; e < header->element_count; ++e) {
    if (header->elements[e].role != NULL) {
      write_element(out, header, &header->elements[e]);
    }
  }
  (void)fprintf(out, "end_header\n%s", pad ? "." : "");
}

supine_status supine_mesh_ply_rewrite(mesh_file *file, const ply_header *header,
                                      supine_error *error) {
  char *head = NULL;
  size_t length = 0;
  unsigned char *bytes = NULL;
  FILE *out = open_memstream(&head, &length);
  if (out == NULL) {
    goto cleanup;
  }
  write_header(out, header);
  if (fclose(out) != 0) {
    goto cleanup;
  }
  bytes = malloc(length + file->size);
  if (bytes == NULL) {
    goto cleanup;
  }
  memcpy(bytes, head, length);
  for (size_t e = 0; e < header->element_count; ++e) {
    const ply_element *element = &header->elements[e];
    const size_t size = (size_t)(element->body.end - element->body.at);
    if (element->role != NULL && size > 0) {
      memcpy(bytes + length, element->body.at, size);
      length += size;
    }
  }
  free(file->bytes);
  file->bytes = bytes;
  file->size = length;

cleanup:
  free(head);
  return bytes != NULL
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", file->path);
}
