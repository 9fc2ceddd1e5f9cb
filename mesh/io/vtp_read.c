/* SPDX-License-Identifier: MIT */
/* Read VTK XML PolyData as Supine, VTK and 3D Slicer write it: one piece, whose arrays are text,
 * base64, or appended (raw or base64), and uncompressed or compressed by zlib. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <zlib.h>

#include "base/arena.h"
#include "base/ascii.h"
#include "base/text.h"

#include "mesh/io/read.h"

typedef struct vtp_file {
  const mesh_file *file;
  const char *bytes, *end; /* content of the file, followed by a NUL at `end` */
  const char *appended;    /* first byte of the appended data; NULL if there are none */
  bool appended_raw, compressed;
  size_t header_size; /* size of each integer in an array's header, bytes: 4 or 8 */
} vtp_file;

static bool is_attribute(const mesh_element *e, const char *name, const char *wanted) {
  char value[64];
  return supine_io_element_attribute(e, name, value, sizeof value) && strcmp(value, wanted) == 0;
}

/* Read a little-endian number of `size` bytes. */
static uint64_t read_number(const unsigned char *bytes, size_t size) {
  uint64_t value = 0;
  for (size_t i = size; i-- > 0;) {
    value = value << 8 | bytes[i];
  }
  return value;
}

/* Unpack the bytes of an array into out [wanted]. An array that is not compressed holds its size in
 * bytes, then its numbers. A compressed array holds the number of blocks, the size of a block, the
 * size of the last block if it is shorter (else 0), the compressed size of each block, and the
 * blocks. */
static bool unpack(const vtp_file *v, const unsigned char *bytes, size_t size, size_t wanted,
                   unsigned char *out) {
  const size_t h = v->header_size;
  const unsigned char *end = bytes + size;
  if (!v->compressed) {
    if (size < h || read_number(bytes, h) != wanted || size - h < wanted) {
      return false;
    }
    memcpy(out, bytes + h, wanted);
    return true;
  }
  if (size < 3 * h) {
    return false;
  }
  const uint64_t blocks = read_number(bytes, h);
  const uint64_t block = read_number(bytes + h, h);
  const uint64_t last = read_number(bytes + 2 * h, h);
  if (blocks == 0) {
    return wanted == 0;
  }
  if (blocks > size / h - 3 || block == 0 || last > block || (blocks - 1) > wanted / block ||
      (blocks - 1) * block + (last > 0 ? last : block) != wanted) {
    return false;
  }
  const unsigned char *packed = bytes + (3 + blocks) * h;
  for (uint64_t b = 0; b < blocks; ++b) {
    const uint64_t here = read_number(bytes + (3 + b) * h, h);
    const uint64_t whole = b + 1 < blocks || last == 0 ? block : last;
    uLongf made = whole;
    if (here > (uint64_t)(end - packed) ||
        uncompress(out + b * block, &made, packed, here) != Z_OK || made != whole) {
      return false;
    }
    packed += here;
  }
  return true;
}

/* Read `wanted` bytes of an array in binary or appended format. */
static bool take_bytes(const vtp_file *v, const mesh_element *e, size_t wanted,
                       unsigned char *out) {
  const bool appended = is_attribute(e, "format", "appended");
  const char *at = e->body;
  if (appended) {
    char text[64];
    char *stop = NULL;
    if (v->appended == NULL || !supine_io_element_attribute(e, "offset", text, sizeof text)) {
      return false;
    }
    const unsigned long long offset = strtoull(text, &stop, 10);
    if (stop == text || offset > (unsigned long long)(v->end - v->appended)) {
      return false;
    }
    at = v->appended + offset;
    if (v->appended_raw) {
      return unpack(v, (const unsigned char *)at, (size_t)(v->end - at), wanted, out);
    }
  }
  SUPINE_ARENA arena = {0};
  unsigned char *decoded = supine_arena_take(&arena, (size_t)(v->end - at) / 4 * 3 + 1, 1);
  return decoded != NULL &&
         unpack(v, decoded, supine_text_decode_base64(at, v->end, decoded), wanted, out);
}

/* Free an array of numbers; for SUPINE_FREED_BY. */
static void free_numbers(double **numbers) {
  free(*numbers);
}

/* Read `count` numbers of an array; a string is read as the codes of its characters. The caller
 * frees the numbers, even after a failure. */
static supine_status take_numbers(const vtp_file *v, const mesh_element *e, size_t count,
                                  double **numbers, supine_error *error) {
  char name[32] = "";
  (void)supine_io_element_attribute(e, "type", name, sizeof name);
  const mesh_text word = {(const unsigned char *)name, (const unsigned char *)strchr(name, '\0')};
  static const mesh_type character = {"String", 1, false, false};
  const mesh_type *type =
      strcmp(name, character.name) == 0 ? &character : supine_io_type_find(word);
  *numbers = NULL;
  /* zlib expands a byte to at most 1032 bytes */
  SUPINE_REFUSE_IF(type == NULL || count > 1032 * (size_t)(v->end - v->bytes), error,
                   SUPINE_ERROR_FORMAT,
                   "%s: an array of its points or polygons has an unknown type or is too large; "
                   "write the file again",
                   v->file->path);
  SUPINE_ARENA arena = {0};
  unsigned char *bytes = supine_arena_take(&arena, count, type->size);
  double *values = malloc((count + 1) * sizeof *values);
  *numbers = values;
  if (values == NULL || arena.failed) {
    return supine_error_memory(error, "%zu numbers of %s", count, v->file->path);
  }
  const bool ascii = is_attribute(e, "format", "ascii");
  const char *tag = memchr(e->body, '<', (size_t)(v->end - e->body));
  mesh_text text = {(const unsigned char *)e->body,
                    (const unsigned char *)(tag != NULL ? tag : v->end)};
  bool good = ascii || take_bytes(v, e, count * type->size, bytes);
  if (ascii) {
    for (size_t i = 0; i < count && good; ++i) {
      good = supine_io_text_number(&text, &values[i]);
    }
    mesh_text more;
    good = good && !supine_io_text_word(&text, &more);
  } else if (good) {
    for (size_t i = 0; i < count; ++i) {
      values[i] = supine_io_type_decode(type, bytes + i * type->size, false);
    }
  }
  SUPINE_REFUSE_IF(
      !good, error, SUPINE_ERROR_FORMAT,
      "%s: an array is truncated or damaged, or longer than its counts; write the file again",
      v->file->path);
  return SUPINE_OK;
}

/* Find an array in a piece's child element whose name is `within`. The array has the name `name`;
 * if this is NULL, take the first array. */
static bool find_array(const vtp_file *v, const mesh_element *piece, const char *within,
                       const char *name, mesh_element *found) {
  mesh_element e;
  mesh_element closing;
  char tag[32];
  (void)snprintf(tag, sizeof tag, "/%s", within);
  const char *limit = v->appended != NULL ? v->appended : v->end;
  if (!supine_io_element_find(piece->body, limit, within, &e) ||
      !supine_io_element_find(e.body, limit, tag, &closing)) {
    return false;
  }
  const char *at = e.body;
  while (supine_io_element_find(at, closing.at, "DataArray", found)) {
    if (name == NULL || is_attribute(found, "Name", name)) {
      return true;
    }
    at = found->body;
  }
  return false;
}

static bool count_of(const mesh_element *piece, const char *name, size_t *count) {
  char text[32];
  char *end = NULL;
  *count = 0;
  if (!supine_io_element_attribute(piece, name, text, sizeof text)) {
    return true;
  }
  const unsigned long long value = strtoull(text, &end, 10);
  *count = (size_t)value;
  return end != text && *end == '\0' && text[0] != '-' && value <= MESH_VERTICES_MAX;
}

static supine_status take_polygons(const vtp_file *v, const mesh_element *piece, mesh_faces *faces,
                                   size_t count, supine_error *error) {
  mesh_element offsets;
  mesh_element connectivity;
  if (count == 0) {
    return SUPINE_OK;
  }
  const bool found = find_array(v, piece, "Polys", "offsets", &offsets) &&
                     find_array(v, piece, "Polys", "connectivity", &connectivity);
  SUPINE_REFUSE_IF(!found, error, SUPINE_ERROR_FORMAT,
                   "%s: its polygons have no offsets or connectivity; write the file again",
                   v->file->path);
  static const char wrong[] = "the offsets of its polygons are invalid; write the file again";
  SUPINE_FREED_BY(free_numbers) double *ends = NULL;
  SUPINE_FREED_BY(free_numbers) double *corners = NULL;
  SUPINE_TRY(take_numbers(v, &offsets, count, &ends, error));
  const double total = ends[count - 1];
  SUPINE_REFUSE_IF(!(total >= 0.0 && total <= 3.0 * MESH_TRIANGLES_MAX), error, SUPINE_ERROR_FORMAT,
                   "%s: %s", v->file->path, wrong);
  SUPINE_TRY(take_numbers(v, &connectivity, (size_t)total, &corners, error));
  double from = 0.0;
  for (size_t p = 0; p < count; ++p) {
    SUPINE_REFUSE_IF(!(ends[p] >= from && ends[p] <= total), error, SUPINE_ERROR_FORMAT, "%s: %s",
                     v->file->path, wrong);
    SUPINE_TRY(
        supine_io_faces_add(faces, corners + (size_t)from, (size_t)ends[p] - (size_t)from, error));
    from = ends[p];
  }
  return SUPINE_OK;
}

static supine_status read_head(vtp_file *v, mesh_element *piece, supine_error *error) {
  mesh_element root;
  mesh_element appended;
  mesh_element second;
  char compressor[64];
  const bool has_root = supine_io_element_find(v->bytes, v->end, "VTKFile", &root);
  SUPINE_REFUSE_IF(!has_root || !is_attribute(&root, "type", "PolyData"), error,
                   SUPINE_ERROR_FORMAT,
                   "%s: no VTKFile of type PolyData; save the surface as PolyData", v->file->path);
  SUPINE_REFUSE_IF(is_attribute(&root, "byte_order", "BigEndian"), error, SUPINE_ERROR_FORMAT,
                   "%s: big-endian VTP is not supported; save the surface as PLY", v->file->path);
  v->header_size = is_attribute(&root, "header_type", "UInt64") ? 8 : 4;
  v->compressed = supine_io_element_attribute(&root, "compressor", compressor, sizeof compressor);
  SUPINE_REFUSE_IF(v->compressed && strcmp(compressor, "vtkZLibDataCompressor") != 0, error,
                   SUPINE_ERROR_FORMAT, "%s: its compressor is not zlib; save the surface as PLY",
                   v->file->path);
  if (supine_io_element_find(root.body, v->end, "AppendedData", &appended)) {
    const char *mark = memchr(appended.body, '_', (size_t)(v->end - appended.body));
    v->appended_raw = is_attribute(&appended, "encoding", "raw");
    v->appended = mark != NULL ? mark + 1 : NULL;
  }
  const char *limit = v->appended != NULL ? v->appended : v->end;
  const bool has_piece = supine_io_element_find(root.body, limit, "Piece", piece);
  SUPINE_REFUSE_IF(!has_piece, error, SUPINE_ERROR_FORMAT,
                   "%s: no element Piece; write the file again", v->file->path);
  const bool has_second = supine_io_element_find(piece->body, limit, "Piece", &second);
  SUPINE_REFUSE_IF(has_second, error, SUPINE_ERROR_FORMAT,
                   "%s: it has several Piece elements; save the surface as one piece",
                   v->file->path);
  return SUPINE_OK;
}

/* Read the axes from the string array SPACE that 3D Slicer and Supine write. */
static void note_space(const vtp_file *v, const mesh_element *piece, mesh_file *file) {
  enum { SIZE = 4 }; /* three letters and a NUL */
  mesh_element e;
  for (const char *at = v->bytes; supine_io_element_find(at, piece->at, "Array", &e); at = e.body) {
    if (!is_attribute(&e, "Name", "SPACE")) {
      continue;
    }
    char letters[SIZE] = {'?'};
    SUPINE_FREED_BY(free_numbers) double *codes = NULL;
    if (take_numbers(v, &e, SIZE, &codes, NULL) == SUPINE_OK && codes[3] == 0.0) {
      for (size_t i = 0; i < SIZE; ++i) {
        letters[i] = codes[i] >= 0.0 && codes[i] < 128.0 ? (char)codes[i] : '?';
      }
      file->tagged = true;
      (void)supine_mesh_axes_parse(letters, &file->space);
    }
    return;
  }
}

supine_status supine_io_read_vtp(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                 supine_error *error) {
  vtp_file v = {.file = file,
                .bytes = (const char *)file->bytes,
                .end = (const char *)file->bytes + file->size};
  mesh_element piece;
  mesh_element points;
  size_t count[3];
  SUPINE_TRY(read_head(&v, &piece, error));
  note_space(&v, &piece, file);
  const bool counted = count_of(&piece, "NumberOfPoints", &count[0]) &&
                       count_of(&piece, "NumberOfPolys", &count[1]) &&
                       count_of(&piece, "NumberOfStrips", &count[2]);
  SUPINE_REFUSE_IF(!counted, error, SUPINE_ERROR_FORMAT,
                   "%s: its numbers of points and polygons are invalid; write the file again",
                   v.file->path);
  SUPINE_REFUSE_IF(count[2] > 0, error, SUPINE_ERROR_FORMAT,
                   "%s: it has strips of triangles; save single triangles", v.file->path);
  if (count[0] > 0) {
    const bool found = find_array(&v, &piece, "Points", NULL, &points);
    SUPINE_REFUSE_IF(!found, error, SUPINE_ERROR_FORMAT,
                     "%s: no array of points; write the file again", v.file->path);
    SUPINE_TRY(take_numbers(&v, &points, 3 * count[0], &mesh->vertices, error));
    mesh->vertex_count = count[0];
  }
  for (size_t i = 0; i < 3 * count[0]; ++i) {
    mesh->vertices[i] = (double)(float)mesh->vertices[i];
  }
  mesh_faces faces = {.path = file->path, .mesh = mesh};
  SUPINE_TRY(take_polygons(&v, &piece, &faces, count[1], error));
  *dropped = faces.dropped;
  return SUPINE_OK;
}
