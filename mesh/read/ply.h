/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The header of a PLY file. */
#ifndef SUPINE_MESH_PLY_H
#define SUPINE_MESH_PLY_H

#include "mesh/read/read.h"

enum { PLY_ELEMENTS_MAX = 32, PLY_PROPERTIES_MAX = 256 };

typedef enum ply_encoding { PLY_ASCII, PLY_LITTLE, PLY_BIG } ply_encoding;

typedef struct ply_type {
  const char *name;
  unsigned size;  /* bytes */
  bool is_signed; /* of integers: may be negative */
  bool is_real;
} ply_type;

typedef struct ply_property {
  const ply_type *count; /* NULL: not a list */
  const ply_type *type;
  const char *role; /* a literal: "x", "y", "z", "vertex_indices"; NULL for what no surface needs */
} ply_property;

typedef struct ply_element {
  const char *role; /* a literal: "vertex", "face", "tristrips", or NULL */
  uint64_t count;
  size_t first_property;
  size_t property_count;
  bool has_list;
  mesh_text body; /* its bytes in the file; set while the body is checked */
} ply_element;

typedef struct ply_header {
  ply_encoding encoding;
  size_t size; /* bytes, with the line end after end_header */
  size_t element_count;
  size_t property_count;
  ply_element elements[PLY_ELEMENTS_MAX];
  ply_property properties[PLY_PROPERTIES_MAX];
} ply_header;

/** Reads the header at the start of `file`. @retval SUPINE_ERROR_FORMAT */
supine_status supine_mesh_ply_header_read(const mesh_file *file, ply_header *header,
                                          supine_error *error);

/** Rewrites `file` so that importers cannot stumble over it: the elements that make a surface and
 * no others, under a header without comments and names of no concern. */
supine_status supine_mesh_ply_rewrite(mesh_file *file, const ply_header *header,
                                      supine_error *error);

#endif
