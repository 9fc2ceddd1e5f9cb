/* SPDX-License-Identifier: MIT */
/* Read vertices and faces of a PLY body, which may be shorter than its header says. */
#include <stdlib.h>

#include "mesh/io/ply.h"

typedef struct ply_reader {
  const mesh_file *file;
  ply_header header;
  mesh_text text; /* text not yet read; in ASCII, `line` is the unread part of the line */
  mesh_text line;
  size_t row_count;
  double *rows; /* [row_count, 3] x, y, z */
  mesh_faces faces;
  supine_error *error;
} ply_reader;

/* Decode a number of this type, least significant byte first. */
static double decode(const unsigned char bytes[8], const ply_type *type) {
  union {
    uint64_t bits;
    double real;
  } as64 = {0};
  for (unsigned k = type->size; k-- > 0;) {
    as64.bits = as64.bits << 8 | bytes[k];
  }
  if (type->is_real && type->size == 8) {
    return as64.real;
  }
  const union {
    uint32_t bits;
    float real;
  } as32 = {(uint32_t)as64.bits};
  if (type->is_real) {
    return (double)as32.real;
  }
  const uint64_t sign = UINT64_C(1) << (8 * type->size - 1);
  return type->is_signed && (as64.bits & sign) != 0 ? (double)as64.bits - 2.0 * (double)sign
                                                    : (double)as64.bits;
}

static bool take_binary(ply_reader *in, const ply_type *type, double *value) {
  if ((size_t)(in->text.end - in->text.at) < type->size) {
    return false;
  }
  unsigned char bytes[8];
  for (unsigned k = 0; k < type->size; ++k) {
    bytes[k] = in->text.at[in->header.encoding == PLY_LITTLE ? k : type->size - 1 - k];
  }
  in->text.at += type->size;
  *value = decode(bytes, type);
  return true;
}

static bool take_ascii(ply_reader *in, const ply_type *type, double *value) {
  mesh_text word = in->line;
  uint64_t count = 0;
  if (type->is_real) {
    return supine_mesh_text_number(&in->line, value);
  }
  if (!supine_mesh_text_word(&in->line, &word)) {
    return false;
  }
  const bool negative = type->is_signed && *word.at == '-';
  word.at += negative;
  const bool good = supine_mesh_text_count(word, &count);
  *value = negative ? -(double)count : (double)count;
  return good;
}

static bool take(ply_reader *in, const ply_type *type, double *value) {
  return in->header.encoding == PLY_ASCII ? take_ascii(in, type, value)
                                          : take_binary(in, type, value);
}

static supine_status cut_short(const ply_reader *in, const ply_element *element, uint64_t item) {
  static const char *const names[] = {"vertex", "face", "tristrips", "item"};
  return supine_error_set(
      in->error, SUPINE_ERROR_FORMAT,
      "%s: truncated or malformed at %s %llu of the %llu in the PLY header; save the mesh again",
      in->file->path, names[element->kind], (unsigned long long)item,
      (unsigned long long)element->count);
}

static supine_status take_list(ply_reader *in, const ply_element *element, uint64_t item,
                               const ply_property *property) {
  double corners[MESH_CORNERS_MAX];
  double length = 0.0;
  if (!take(in, property->count, &length)) {
    return cut_short(in, element, item);
  }
  if (length < 0.0) {
    return supine_error_set(in->error, SUPINE_ERROR_FORMAT,
                            "%s: the length of a list is %.0f; save the mesh again", in->file->path,
                            length);
  }
  const uint64_t count = (uint64_t)length; /* below 2^63: the file ends first */
  for (uint64_t k = 0; k < count; ++k) {
    double value = 0.0;
    if (!take(in, property->type, &value)) {
      return cut_short(in, element, item);
    }
    if (k < MESH_CORNERS_MAX) {
      corners[k] = value;
    }
  }
  return property->role == PLY_CORNERS && element->kind == PLY_FACES
             ? supine_mesh_faces_add(&in->faces, corners, (size_t)count, in->error)
             : SUPINE_OK;
}

static supine_status take_item(ply_reader *in, const ply_element *element, uint64_t item) {
  if (in->header.encoding == PLY_ASCII && !supine_mesh_text_line(&in->text, &in->line)) {
    return cut_short(in, element, item); /* an item takes one line */
  }
  for (size_t p = 0; p < element->property_count; ++p) {
    const ply_property *property = &in->header.properties[element->first_property + p];
    double value = 0.0;
    if (property->count != NULL) {
      const supine_status status = take_list(in, element, item, property);
      if (status != SUPINE_OK) {
        return status;
      }
    } else if (!take(in, property->type, &value)) {
      return cut_short(in, element, item);
    } else if (element->kind == PLY_VERTICES && property->role <= PLY_Z) {
      in->rows[3 * item + property->role] = (double)(float)value;
    }
  }
  return SUPINE_OK;
}

static supine_status take_items(ply_reader *in, const ply_element *element) {
  supine_status status = SUPINE_OK;
  for (uint64_t i = 0; status == SUPINE_OK && i < element->count; ++i) {
    status = take_item(in, element, i);
  }
  return status;
}

/* Allocate the rows that the header announces, at most as many as the file can hold. */
static supine_status take_vertices(ply_reader *in, const ply_element *element) {
  uint64_t least = 0; /* bytes per item */
  for (size_t p = 0; p < element->property_count; ++p) {
    const ply_property *property = &in->header.properties[element->first_property + p];
    least += in->header.encoding == PLY_ASCII ? 2 /* a digit and a blank */
             : property->count != NULL        ? property->count->size
                                              : property->type->size;
  }
  const uint64_t room = (uint64_t)(in->text.end - in->text.at) / least + 1;
  const uint64_t count = element->count < room ? element->count : room;
  if (count > MESH_VERTICES_MAX) {
    return supine_error_set(in->error, SUPINE_ERROR_FORMAT,
                            "%s: more than %d vertices; give a coarser mesh", in->file->path,
                            MESH_VERTICES_MAX);
  }
  in->row_count = (size_t)count;
  in->rows = malloc((size_t)count * 3 * sizeof *in->rows);
  return in->rows == NULL
             ? supine_error_set(in->error, SUPINE_ERROR_MEMORY, "%s: out of memory", in->file->path)
             : take_items(in, element);
}

/* Read the vertices, wherever they are: faces are checked and cut with them. The reader ends up
 * after them. */
static supine_status read_vertices(ply_reader *in) {
  supine_status status = SUPINE_OK;
  for (size_t e = 0; status == SUPINE_OK; ++e) {
    ply_element element = in->header.elements[e];
    if (element.kind == PLY_VERTICES) {
      return take_vertices(in, &element);
    }
    element.kind = PLY_OTHER;
    status = take_items(in, &element);
  }
  return status;
}

static supine_status read_faces(ply_reader *in, const unsigned char *after_vertices) {
  supine_status status = SUPINE_OK;
  for (size_t e = 0; status == SUPINE_OK && e < in->header.element_count; ++e) {
    const ply_element *element = &in->header.elements[e];
    if (element->kind == PLY_VERTICES) {
      in->text.at = after_vertices;
    } else {
      status = take_items(in, element);
    }
  }
  return status;
}

static supine_status begin(const mesh_file *file, ply_reader *in, supine_error *error) {
  *in = (ply_reader){.file = file, .error = error};
  const supine_status status = supine_mesh_ply_header_read(file, &in->header, error);
  if (status != SUPINE_OK) {
    return status;
  }
  in->text = (mesh_text){file->bytes + in->header.size, file->bytes + file->size};
  for (size_t e = 0; e < in->header.element_count; ++e) {
    if (in->header.elements[e].property_count == 0) { /* items without bytes, of any count */
      return supine_error_set(
          error, SUPINE_ERROR_FORMAT,
          "%s: element %zu of the PLY header has no property; save the mesh again", file->path,
          e + 1);
    }
    if (in->header.elements[e].kind == PLY_STRIPS && in->header.elements[e].count > 0) {
      return supine_error_set(error, SUPINE_ERROR_FORMAT,
                              "%s: strips of triangles (tristrips) are not read; save triangles",
                              file->path);
    }
  }
  return in->header.encoding == PLY_ASCII && !supine_mesh_guard_text(file, error)
             ? SUPINE_ERROR_FORMAT
             : SUPINE_OK;
}

static bool holds(const ply_header *header, ply_role role) {
  return (header->present >> role & 1U) != 0;
}

static bool holds_positions(const ply_header *header) {
  return holds(header, PLY_X) && holds(header, PLY_Y) && holds(header, PLY_Z);
}

supine_status supine_mesh_read_ply(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                   supine_error *error) {
  ply_reader in;
  supine_status status = begin(file, &in, error);
  if (status != SUPINE_OK) {
    return status;
  }
  supine_mesh_space_note(file, in.header.size);
  if (!holds_positions(&in.header) || !holds(&in.header, PLY_CORNERS)) {
    return supine_error_set(error, SUPINE_ERROR_MESH,
                            "%s: no triangles: the PLY header has no faces with vertex_indices, or "
                            "no vertices with x, y and z",
                            file->path);
  }
  const unsigned char *body = in.text.at;
  in.faces = (mesh_faces){.path = file->path, .mesh = mesh};
  status = read_vertices(&in);
  mesh->vertices = in.rows;
  mesh->vertex_count = in.row_count;
  if (status == SUPINE_OK) {
    const unsigned char *after_vertices = in.text.at;
    in.text.at = body;
    status = read_faces(&in, after_vertices);
  }
  *dropped = in.faces.dropped;
  return status;
}
