/* SPDX-License-Identifier: MIT */
/* Readers of surface files, and functions that they share. */
#ifndef SUPINE_MESH_READ_H
#define SUPINE_MESH_READ_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "mesh/mesh.h"

/* ---- tokens.c: split the text of a file, which may hold any bytes, into lines and words. ---- */

/** A text: the bytes from `at` up to `end`, not NUL-terminated. */
typedef struct mesh_text {
  const unsigned char *at;
  const unsigned char *end;
} mesh_text;

/** Remove the next line from `text`, and set `line` to it without LF or CRLF. Return false at the
 * end of the text. */
bool supine_io_text_line(mesh_text *text, mesh_text *line);
/** Remove the next word between blanks from `text`; return false at the end of the text. */
bool supine_io_text_word(mesh_text *text, mesh_text *word);
/** Return whether the word is `expected`, ignoring case. */
bool supine_io_text_is(mesh_text word, const char *expected);
/** Parse decimal digits; return false for anything else, or for a value near or above 2^63. */
bool supine_io_text_count(mesh_text word, uint64_t *value);
/** Remove the next word from `text` and parse it with strtod; return false if it is missing or
 * not a number. A NUL must follow the text. */
bool supine_io_text_number(mesh_text *text, double *value);
/** Remove the next three numbers from `text`, and round them to float; return false on failure. */
bool supine_io_text_position(mesh_text *text, double position[3]);

/** A number type of a binary file. */
typedef struct mesh_type {
  const char *name;
  unsigned size; /**< size of a number, bytes */
  bool is_signed;
  bool is_real;
} mesh_type;

/** Return the type that PLY or VTP calls `name`, ignoring case; NULL if there is none. */
const mesh_type *supine_io_type_find(mesh_text name);
/** Convert the bytes of a number to double. */
double supine_io_type_decode(const mesh_type *type, const unsigned char *bytes, bool big_endian);

/** Return the unsigned integer of at most four bytes, the least significant first. */
size_t supine_io_little_endian(const unsigned char *at, size_t bytes);

/* ---- xml.c: find elements and attributes in the text of an XML file, which a NUL follows. ---- */

typedef struct mesh_element {
  const char *at, *end; /**< begin and end of the element's attributes */
  const char *body;     /**< first byte after the > of the tag */
} mesh_element;

/** Find the first element called `name` between `from` and `to`, outside comments; return false if
 * there is none. */
bool supine_io_element_find(const char *from, const char *to, const char *name,
                            mesh_element *found);
/** Copy the value of an attribute, truncated to `size` bytes; return false if it is missing. */
bool supine_io_element_attribute(const mesh_element *e, const char *name, char *value, size_t size);

typedef struct mesh_file {
  const char *path;
  unsigned char *bytes; /**< content of the file, then a NUL */
  size_t size;
  bool tagged; /**< whether the file names its axes in a SPACE tag, as 3D Slicer writes it */
  bool turned; /**< output of a reader: whether it turned the axes, as the file's up axis says */
  double millimetres; /**< length of the unit that the file states, mm; 0 if it states none */
  supine_axes space;  /**< axes named by the SPACE tag; AUTO if there is none or it is unknown */
} mesh_file;

/** Refuse a text with a NUL byte, or with a CR that no LF follows: other readers would split its
 * lines differently. */
supine_status supine_io_guard_text(const mesh_file *file, supine_error *error);

/** Refuse a file that holds more or fewer of something than it counts: importers lose the rest. */
supine_status supine_io_compare_counts(const char *path, uint64_t counted, uint64_t held,
                                       const char *what, supine_error *error);

/* ---- units.c ---- */

/** Find the unit that the file states: AMF and 3MF name it, X3D states it in metres, and assimp
 * converts COLLADA to metres where it states another unit. Without one, `millimetres` stays 0. */
supine_status supine_io_find_unit(mesh_file *file, supine_error *error);

/* ---- faces.c: add faces to a mesh that already has its vertices. ---- */

enum {
  MESH_CORNERS_MAX = 1024, /**< most corners of a face, because the time to cut it is quadratic */
  MESH_VERTICES_MAX = INT32_MAX,
  MESH_TRIANGLES_MAX = UINT32_MAX / 3
};

typedef struct mesh_faces {
  const char *path;
  supine_mesh *mesh;
  size_t capacity; /**< number of triangles for which memory is allocated */
  size_t count;    /**< number of faces read, including points and lines */
  size_t dropped;  /**< number of points and lines skipped */
} mesh_faces;

/** Cut a face into triangles, and add them. A face of more than MESH_CORNERS_MAX corners is refused
 * without reading `corners`. */
supine_status supine_io_faces_add(mesh_faces *faces, const double *corners, size_t count,
                                  supine_error *error);

/* ---- ply.c, vtp_read.c, gltf.c, import.c: one function for each format. ---- */

/** Read a surface in the file's units and axes, in single precision, without welding its vertices.
 * The caller frees `mesh`, even after a failure. `dropped` is set to the number of faces that are
 * points or lines. If the format can hold the axes in a SPACE tag, they are stored in `file`. */
typedef supine_status mesh_reader(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                  supine_error *error);
mesh_reader supine_io_read_ply;
mesh_reader supine_io_read_vtp;
mesh_reader supine_io_read_stl;
mesh_reader supine_io_read_obj;
mesh_reader supine_io_read_off;
mesh_reader supine_io_read_ac;
mesh_reader supine_io_read_gltf;
/** Read any other format with the library assimp. */
mesh_reader supine_io_import;
/** Return whether assimp is installed and imports files whose names have this ending. */
bool supine_io_import_knows(const char *ending);

/* ---- weld.c ---- */

/** Weld vertices at equal positions, drop degenerate triangles, then drop unused vertices, all in
 * place. No coordinate may be -0. The numbers of dropped items are added to the report. */
supine_status supine_io_weld(supine_mesh *mesh, supine_mesh_report *report);

#endif
