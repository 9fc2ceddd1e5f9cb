/* SPDX-License-Identifier: MIT */
/* Internal declarations of this folder. */
#ifndef SUPINE_MESH_INTERNAL_H
#define SUPINE_MESH_INTERNAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "mesh/mesh.h"

/* ---- text.c: lines and words of a file with any content. ---- */

/** Bytes at <= p < end, not NUL-terminated. */
typedef struct mesh_text {
  const unsigned char *at;
  const unsigned char *end;
} mesh_text;

/** Remove the next line, without its LF or CRLF, from `text`; false at the end. */
bool supine_mesh_text_line(mesh_text *text, mesh_text *line);
/** Remove the next word between blanks from `text`; false at the end. */
bool supine_mesh_text_word(mesh_text *text, mesh_text *word);
/** Report whether the word is `expected`, in any case. */
bool supine_mesh_text_is(mesh_text word, const char *expected);
/** Parse decimal digits only; false for anything else or beyond 2^63. */
bool supine_mesh_text_count(mesh_text word, uint64_t *value);
/** Remove the next word from `text` and parse it as a decimal number, nan or inf; false if there
 * is none or it is invalid. A 0 byte must follow the file's last. */
bool supine_mesh_text_number(mesh_text *text, double *value);
/** Parse three numbers, rounded to single precision. */
bool supine_mesh_text_position(mesh_text *text, double position[3]);

/* ---- file.c: a file's bytes. ---- */

typedef enum mesh_format {
  MESH_FORMAT_OTHER = 0, /**< an ending that assimp knows, without a guard of ours */
  MESH_FORMAT_PLY,
  MESH_FORMAT_VTP,
  MESH_FORMAT_STL,
  MESH_FORMAT_OBJ
} mesh_format;

/** A file being read. */
typedef struct mesh_file {
  const char *path;
  mesh_format format;
  unsigned char *bytes; /**< all of PLY, STL and OBJ, the head of others; then a 0 */
  size_t size;
  bool tagged;       /**< a SPACE tag is present */
  supine_axes space; /**< the axes it names; AUTO: unknown ones */
  bool mentions_ras; /**< a comment contains the word RAS */
} mesh_file;

/** Open and read the file; find its format by the ending, or else by the first bytes. */
supine_status supine_mesh_file_read(const char *path, mesh_file *file, supine_error *error);
void supine_mesh_file_free(mesh_file *file);

/* ---- space.c ---- */

/** Find SPACE= with three letters, and the word RAS, in the first `size` bytes; set tagged,
 * space and mentions_ras. */
void supine_mesh_space_note(mesh_file *file, size_t size);

/* ---- faces.c: faces added to a mesh that has its vertices. ---- */

enum {
  MESH_CORNERS_MAX = 1024, /**< of a face: cutting it takes time up to their cube */
  MESH_VERTICES_MAX = INT32_MAX,
  MESH_TRIANGLES_MAX = UINT32_MAX / 3
};

typedef struct mesh_faces {
  const char *path;
  supine_mesh *mesh;
  size_t capacity; /**< triangles allocated */
  size_t count;    /**< faces added */
  size_t dropped;  /**< points and lines skipped */
} mesh_faces;

/** Add a face, cut into triangles. If `count` exceeds MESH_CORNERS_MAX, `corners` may hold
 * fewer.
 * @retval SUPINE_ERROR_FORMAT  a corner that is not a vertex, too many corners */
supine_status supine_mesh_faces_add(mesh_faces *faces, const double *corners, size_t count,
                                    supine_error *error);

/* ---- ply.c, stl.c, import.c (assimp: all else): read a surface in the file's units and axes,
 * not welded, in single precision. The caller frees `mesh` even after a failure; `dropped`
 * counts points and lines. The SPACE tag is noted if the head did not show it. ---- */

supine_status supine_mesh_read_ply(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                   supine_error *error);
supine_status supine_mesh_read_vtp(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                   supine_error *error);
supine_status supine_mesh_read_stl(mesh_file *file, supine_mesh *mesh, supine_error *error);
supine_status supine_mesh_import(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                 supine_error *error);
/** Report whether assimp is installed and imports this ending. */
bool supine_mesh_import_knows(const char *ending);

/* ---- guard_*.c: refuse what importers mishandle ---- */

/** Check an OBJ file for coordinates that are not numbers, and remove names of other files.
 * @retval SUPINE_ERROR_FORMAT */
supine_status supine_mesh_guard_obj(mesh_file *file, supine_error *error);
/** Check line ends and NUL bytes of a text; false: error set, SUPINE_ERROR_FORMAT. */
bool supine_mesh_guard_text(const mesh_file *file, supine_error *error);

/* ---- weld.c ---- */

/** Weld vertices of equal bits (the caller turned -0 into 0), drop degenerate triangles, then
 * unused vertices. Works in place; adds to the counts. */
supine_status supine_mesh_weld(supine_mesh *mesh, supine_mesh_report *report);

#endif
