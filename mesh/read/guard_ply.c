/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Does a PLY file's body hold what its header promises? */
#include "mesh/read/ply.h"

/* A list's length; false where negative. */
static bool read_length(const unsigned char *at, const ply_type *type, ply_encoding encoding,
                        uint64_t *length) {
  *length = 0;
  for (unsigned k = 0; k < type->size; ++k) {
    const unsigned place = encoding == PLY_LITTLE ? k : type->size - 1 - k;
    *length |= (uint64_t)at[k] << (8 * place);
  }
  return !type->is_signed || (*length >> (8 * type->size - 1)) == 0;
}

static bool skip_bytes(mesh_text *text, uint64_t count, uint64_t size) {
  const uint64_t left = (uint64_t)(text->end - text->at);
  if (count > left / size) {
    return false;
  }
  text->at += count * size;
  return true;
}

static bool skip_binary_item(mesh_text *text, const ply_header *header,
                             const ply_element *element) {
  for (size_t p = 0; p < element->property_count; ++p) {
    const ply_property *property = &header->properties[element->first_property + p];
    uint64_t length = 1;
    if (property->count != NULL) {
      const unsigned char *at = text->at;
      if (!skip_bytes(text, 1, property->count->size) ||
          !read_length(at, property->count, header->encoding, &length)) {
        return false;
      }
    }
    if (!skip_bytes(text, length, property->type->size)) {
      return false;
    }
  }
  return true;
}

static bool skip_value(mesh_text *line, const ply_type *type) {
  mesh_text word;
  uint64_t value = 0;
  if (type->is_real) {
    return supine_mesh_text_skip_numbers(line, 1);
  }
  if (!supine_mesh_text_word(line, &word)) {
    return false;
  }
  word.at += type->is_signed && *word.at == '-';
  return supine_mesh_text_count(word, &value);
}

/* One line an item: importers count lines. */
static bool skip_ascii_item(mesh_text *text, const ply_header *header, const ply_element *element) {
  mesh_text line;
  if (!supine_mesh_text_line(text, &line)) {
    return false;
  }
  for (size_t p = 0; p < element->property_count; ++p) {
    const ply_property *property = &header->properties[element->first_property + p];
    uint64_t length = 1;
    mesh_text word;
    if (property->count != NULL &&
        (!supine_mesh_text_word(&line, &word) || !supine_mesh_text_count(word, &length))) {
      return false;
    }
    for (; length > 0; --length) {
      if (!skip_value(&line, property->type)) {
        return false;
      }
    }
  }
  return true;
}

/* Returns the first item that is cut short or illegal, the element's count where there is none. */
static uint64_t skip_element(mesh_text *text, const ply_header *header,
                             const ply_element *element) {
  if (header->encoding != PLY_ASCII && !element->has_list) {
    uint64_t size = 0;
    for (size_t p = 0; p < element->property_count; ++p) {
      size += header->properties[element->first_property + p].type->size;
    }
    const uint64_t left = (uint64_t)(text->end - text->at);
    return skip_bytes(text, element->count, size) ? element->count : left / size;
  }
  for (uint64_t i = 0; i < element->count; ++i) {
    if (header->encoding == PLY_ASCII ? !skip_ascii_item(text, header, element)
                                      : !skip_binary_item(text, header, element)) {
      return i;
    }
  }
  return element->count;
}

/* Are there x, y, z and faces with corners? */
static bool holds_surface(const ply_header *header) {
  size_t roles = 0;
  for (size_t e = 0; e < header->element_count; ++e) {
    const ply_element *element = &header->elements[e];
    for (size_t p = 0; element->count > 0 && p < element->property_count; ++p) {
      roles += header->properties[element->first_property + p].role != NULL;
    }
  }
  return roles >= 4;
}

supine_status supine_mesh_guard_ply(mesh_file *file, supine_error *error) {
  ply_header header;
  const supine_status status = supine_mesh_ply_header_read(file, &header, error);
  if (status != SUPINE_OK) {
    return status;
  }
  supine_mesh_space_note(file, header.size);
  mesh_text text = {file->bytes + header.size, file->bytes + file->size};
  for (size_t e = 0; e < header.element_count; ++e) {
    ply_element *element = &header.elements[e];
    if (element->property_count == 0) { /* would take no bytes, whatever the count */
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: element %zu of the PLY header has no property", file->path,
                              e + 1);
    }
    element->body.at = text.at;
    const uint64_t whole = skip_element(&text, &header, element);
    element->body.end = text.at;
    if (whole < element->count) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: truncated or malformed at %s %llu of the %llu that the PLY "
                              "header promises",
                              file->path, element->role == NULL ? "item" : element->role,
                              (unsigned long long)whole, (unsigned long long)element->count);
    }
  }
  if (!holds_surface(&header)) {
    return supine_error_set(error, SUPINE_ERROR_MESH,
                            "%s: no triangles: the PLY header has no faces with vertex_indices, or "
                            "no vertices with x, y and z",
                            file->path);
  }
  file->whole = header.encoding != PLY_ASCII;
  return header.encoding == PLY_ASCII && !supine_mesh_guard_text(file, error)
             ? SUPINE_ERROR_FORMAT
             : supine_mesh_ply_rewrite(file, &header, error);
}
