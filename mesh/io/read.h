/* SPDX-License-Identifier: MIT */
/* What the files of this folder share; no other folder sees it. */
#ifndef SUPINE_MESH_INTERNAL_H
#define SUPINE_MESH_INTERNAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "mesh/mesh.h"

/* ---- text.c: lines and words of a file that may hold anything. ---- */

/** Bytes at <= p < end, not NUL-terminated. */
typedef struct mesh_text {
  const unsigned char *at;
  const unsigned char *end;
} mesh_text;

/** Takes the next line, without its LF or CRLF, off `text`; false where nothing is left. */
bool supine_mesh_text_line(mesh_text *text, mesh_text *line);
/** Takes the next word between blanks off `text`; false where there is none. */
bool supine_mesh_text_word(mesh_text *text, mesh_text *word);
/** Is the word `expected`, in any case? */
bool supine_mesh_text_is(mesh_text word, const char *expected);
/** Reads decimal digits alone; false for anything else or beyond 2^63. */
bool supine_mesh_text_count(mesh_text word, uint64_t *value);
/** Takes the next word off `text` as a decimal number, nan and inf among them; false where there is
 * none or it is something else. A byte of 0 must follow the file's last. */
bool supine_mesh_text_number(mesh_text *text, double *value);
/** Takes three numbers, to single precision. */
bool supine_mesh_text_position(mesh_text *text, double position[3]);

/* ---- file.c: a file's bytes. ---- */

typedef enum mesh_format {
  MESH_FORMAT_OTHER = 0, /**< an ending that assimp knows, but no check of ours */
  MESH_FORMAT_PLY,
  MESH_FORMAT_VTP,
  MESH_FORMAT_STL,
  MESH_FORMAT_OBJ
} mesh_format;

/** A file on its way in. */
typedef struct mesh_file {
  const char *path;
  mesh_format format;
  unsigned char *bytes; /**< all of PLY, STL and OBJ, the head of others; then a 0 */
  size_t size;
  bool tagged;       /**< a SPACE tag is there, */
  supine_axes space; /**< and names these axes; AUTO: none that are known */
  bool mentions_ras; /**< the word RAS stands in a comment */
} mesh_file;

/** Opens, tells the format from the ending (or, without a known one, the first bytes), reads. */
supine_status supine_mesh_file_read(const char *path, mesh_file *file, supine_error *error);
void supine_mesh_file_free(mesh_file *file);

/* ---- space.c ---- */

/** Looks for SPACE= with three letters and the word RAS in the first `size` bytes, and sets tagged,
 * space and mentions_ras. */
void supine_mesh_space_note(mesh_file *file, size_t size);

/* ---- faces.c: faces on their way into a mesh that has its vertices. ---- */

enum {
  MESH_CORNERS_MAX = 1024, /**< of a face: cutting it takes up to their cube in time */
  MESH_VERTICES_MAX = INT32_MAX,
  MESH_TRIANGLES_MAX = UINT32_MAX / 3
};

typedef struct mesh_faces {
  const char *path;
  supine_mesh *mesh;
  size_t capacity; /**< triangles that there is room for */
  size_t count;    /**< faces that came */
  size_t dropped;  /**< points and lines */
} mesh_faces;

/** Adds a face, cut into triangles. `count` may be beyond what `corners` holds where it is beyond
 * MESH_CORNERS_MAX. @retval SUPINE_ERROR_FORMAT  a corner that is no vertex, too many corners */
supine_status supine_mesh_faces_add(mesh_faces *faces, const double *corners, size_t count,
                                    supine_error *error);

/* ---- ply.c, stl.c, import.c (assimp: all else): a file's surface in its own units and
 * axes, not welded, in single precision. What stands in `mesh` after a failure is the caller's to
 * free; `dropped` counts points and lines. The SPACE tag is noted where the head has not shown it
 * yet. ---- */

supine_status supine_mesh_read_ply(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                   supine_error *error);
supine_status supine_mesh_read_vtp(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                   supine_error *error);
supine_status supine_mesh_read_stl(mesh_file *file, supine_mesh *mesh, supine_error *error);
supine_status supine_mesh_import(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                 supine_error *error);
/** Has assimp, where it is installed, an importer for this ending? */
bool supine_mesh_import_knows(const char *ending);

/* ---- guard_*.c: what importers stumble over ---- */

/** OBJ: coordinates that are no numbers, names of other files. @retval SUPINE_ERROR_FORMAT */
supine_status supine_mesh_guard_obj(mesh_file *file, supine_error *error);
/** Line ends and NUL bytes of a text; false: error set, SUPINE_ERROR_FORMAT. */
bool supine_mesh_guard_text(const mesh_file *file, supine_error *error);

/* ---- weld.c ---- */

/** Welds vertices of equal bits (the caller has made every -0 a 0), drops triangles with two
 * corners at one vertex, then vertices without a triangle. Works in place; counts are added to. */
supine_status supine_mesh_weld(supine_mesh *mesh, supine_mesh_report *report);

#endif
