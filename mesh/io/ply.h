/* SPDX-License-Identifier: MIT */
/* The header of a PLY file. */
#ifndef SUPINE_MESH_PLY_H
#define SUPINE_MESH_PLY_H

#include "mesh/io/read.h"

enum { PLY_ELEMENTS_MAX = 32, PLY_PROPERTIES_MAX = 256 };

typedef enum ply_encoding { PLY_ASCII, PLY_LITTLE, PLY_BIG } ply_encoding;

typedef struct ply_type {
  const char *name;
  unsigned size;  /* bytes */
  bool is_signed; /* for integers: may be negative */
  bool is_real;
} ply_type;

/* The first three are coordinates of a vertex. */
typedef enum ply_role {
  PLY_X,
  PLY_Y,
  PLY_Z,
  PLY_CORNERS,
  PLY_NOTHING /* of no use to a surface */
} ply_role;

typedef struct ply_property {
  const ply_type *count; /* NULL: not a list */
  const ply_type *type;
  ply_role role;
} ply_property;

typedef enum ply_kind { PLY_VERTICES, PLY_FACES, PLY_STRIPS, PLY_OTHER } ply_kind;

typedef struct ply_element {
  ply_kind kind;
  uint64_t count;
  size_t first_property;
  size_t property_count;
} ply_element;

typedef struct ply_header {
  ply_encoding encoding;
  size_t size;      /* bytes, up to the line end after end_header */
  unsigned present; /* a bit for each role in an element with items */
  size_t element_count;
  size_t property_count;
  ply_element elements[PLY_ELEMENTS_MAX];
  ply_property properties[PLY_PROPERTIES_MAX];
} ply_header;

/** Read the header at the start of `file`.
 * @retval SUPINE_ERROR_FORMAT */
supine_status supine_mesh_ply_header_read(const mesh_file *file, ply_header *header,
                                          supine_error *error);

#endif
