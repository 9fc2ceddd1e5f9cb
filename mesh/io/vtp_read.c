/* SPDX-License-Identifier: MIT */
/* Read VTK XML PolyData as Supine, VTK and 3D Slicer write it: one piece, points and polygons in
 * arrays that are text, base64 or appended, raw or base64, plain or compressed by zlib. */
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <zlib.h>

#include "mesh/io/read.h"

typedef struct vtp_file {
  const mesh_file *file;
  const char *bytes, *end; /* `bytes` ends with a NUL, but may contain others */
  const char *appended;    /* first byte after the underscore; NULL: none */
  bool appended_raw, compressed;
  size_t header_size; /* 4 or 8 */
} vtp_file;

/* An element's attributes, name="value". */
typedef struct element {
  const char *at, *end; /* text between < and > */
  const char *body;     /* text after its > */
} element;

typedef struct array {
  unsigned char *bytes;
  size_t size;
} array;

static supine_status malformed(const vtp_file *v, const char *what, supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_FORMAT, "%s: %s", v->file->path, what);
}

/* Find the first element of this name between two places; false if there is none. */
static bool find_element(const char *from, const char *to, const char *name, element *found) {
  const size_t length = strlen(name);
  for (const char *at = from; at < to && (at = memchr(at, '<', (size_t)(to - at))) != NULL; ++at) {
    if ((size_t)(to - at) > length + 1 && strncmp(at + 1, name, length) == 0 &&
        (isspace((unsigned char)at[1 + length]) || strchr("/>", at[1 + length]) != NULL)) {
      const char *end = memchr(at, '>', (size_t)(to - at));
      if (end == NULL) {
        return false;
      }
      *found = (element){at + 1 + length, end, end + 1};
      return true;
    }
  }
  return false;
}

/* Copy the value of an attribute, cut off at `size`; false if there is none. */
static bool attribute(const element *e, const char *name, char *value, size_t size) {
  const size_t length = strlen(name);
  for (const char *at = e->at; at + length + 2 < e->end; ++at) {
    if (isspace((unsigned char)at[-1]) && strncmp(at, name, length) == 0 && at[length] == '=' &&
        (at[length + 1] == '"' || at[length + 1] == '\'')) {
      const char *from = at + length + 2;
      const char *to = memchr(from, at[length + 1], (size_t)(e->end - from));
      if (to == NULL) {
        return false;
      }
      (void)snprintf(value, size, "%.*s", (int)(to - from < 256 ? to - from : 256), from);
      return true;
    }
  }
  return false;
}

static bool is_attribute(const element *e, const char *name, const char *wanted) {
  char value[64];
  return attribute(e, name, value, sizeof value) && strcmp(value, wanted) == 0;
}

static uint64_t little(const unsigned char *bytes, size_t size) {
  uint64_t value = 0;
  for (size_t i = size; i-- > 0;) {
    value = value << 8 | bytes[i];
  }
  return value;
}

static int sextet(char c) {
  return c >= 'A' && c <= 'Z'   ? c - 'A'
         : c >= 'a' && c <= 'z' ? c - 'a' + 26
         : c >= '0' && c <= '9' ? c - '0' + 52
         : c == '+'             ? 62
         : c == '/'             ? 63
                                : -1;
}

/* Decode base64 up to `bytes` bytes or its end, and move *at after the last group. Return the
 * number of bytes. */
static size_t base64(const char **at, const char *end, unsigned char *bytes, size_t most) {
  size_t count = 0;
  while (count < most) {
    int group[4];
    int got = 0;
    for (; got < 4 && *at < end; ++*at) {
      if (isspace((unsigned char)**at)) {
        continue;
      }
      group[got] = **at == '=' ? 64 : sextet(**at);
      if (group[got] < 0) {
        return count;
      }
      ++got;
    }
    if (got < 4 || group[0] == 64 || group[1] == 64) {
      return count;
    }
    const unsigned word =
        (unsigned)(group[0] << 18 | group[1] << 12 | (group[2] & 63) << 6 | (group[3] & 63));
    const int valid = group[2] == 64 ? 1 : group[3] == 64 ? 2 : 3;
    for (int k = 0; k < valid && count < most; ++k) {
      bytes[count++] = (unsigned char)(word >> (16 - 8 * k));
    }
    if (valid < 3) {
      break; /* padding ends a stream */
    }
  }
  return count;
}

/* Read bytes from a stream, raw or base64. */
static bool take_bytes(const char **at, const char *end, bool raw, unsigned char *bytes,
                       size_t count) {
  if (!raw) {
    return base64(at, end, bytes, count) == count;
  }
  if ((size_t)(end - *at) < count) {
    return false;
  }
  memcpy(bytes, *at, count);
  *at += count;
  return true;
}

/* Read compressed blocks: their number, size, the last one's size, the compressed sizes; then
 * the blocks. In base64 the sizes and the blocks are separate streams. */
static bool take_blocks(const vtp_file *v, const char *at, bool raw, size_t wanted, array *out) {
  unsigned char sizes[3 * 8];
  const size_t h = v->header_size;
  const char *begin = at;
  bool good = false;
  if (!take_bytes(&at, v->end, raw, sizes, 3 * h)) {
    return false;
  }
  const uint64_t blocks = little(sizes, h);
  const uint64_t block = little(sizes + h, h);
  const uint64_t last = little(sizes + 2 * h, h);
  const uint64_t left = (uint64_t)(v->end - at);
  if (blocks == 0) {
    return wanted == 0;
  }
  if (blocks > left / h || block == 0 || last > block || (blocks - 1) > wanted / block ||
      (blocks - 1) * block + (last > 0 ? last : block) != wanted) {
    return false;
  }
  unsigned char *table = malloc((3 + blocks) * h);
  unsigned char *packed = malloc(left + 1);
  at = begin;
  if (table != NULL && packed != NULL && take_bytes(&at, v->end, raw, table, (3 + blocks) * h)) {
    uint64_t total = 0;
    good = true;
    for (uint64_t b = 0; b < blocks && good; ++b) {
      const uint64_t size = little(table + (3 + b) * h, h);
      good = size <= left - total;
      total += good ? size : 0;
    }
    good = good && take_bytes(&at, v->end, raw, packed, total);
    size_t from = 0;
    for (uint64_t b = 0; b < blocks && good; ++b) {
      const uint64_t size = little(table + (3 + b) * h, h);
      const uint64_t whole = b + 1 < blocks || last == 0 ? block : last;
      uLongf made = whole;
      good =
          uncompress(out->bytes + b * block, &made, packed + from, size) == Z_OK && made == whole;
      from += size;
    }
  }
  free(table);
  free(packed);
  return good;
}

/* Read an array of `count` numbers of `each` bytes, in binary or appended format, into `out`. */
static bool take_binary(const vtp_file *v, const element *e, size_t count, size_t each,
                        array *out) {
  char text[64];
  const bool appended = is_attribute(e, "format", "appended");
  const char *at = e->body;
  bool raw = false;
  if (appended) {
    char *stop = NULL;
    if (v->appended == NULL || !attribute(e, "offset", text, sizeof text)) {
      return false;
    }
    const unsigned long long offset = strtoull(text, &stop, 10);
    if (stop == text || offset > (unsigned long long)(v->end - v->appended)) {
      return false;
    }
    at = v->appended + offset;
    raw = v->appended_raw;
  }
  out->size = count * each;
  if (v->compressed) {
    return take_blocks(v, at, raw, out->size, out);
  }
  /* One size precedes the numbers in the same base64 stream. */
  unsigned char *whole = malloc(v->header_size + out->size + 1);
  const bool good = whole != NULL &&
                    take_bytes(&at, v->end, raw, whole, v->header_size + out->size) &&
                    little(whole, v->header_size) == out->size;
  if (good) {
    memcpy(out->bytes, whole + v->header_size, out->size);
  }
  free(whole);
  return good;
}

static double number_of(const char *type, const unsigned char *bytes, size_t each) {
  const uint64_t bits = little(bytes, each);
  if (strcmp(type, "Float32") == 0) {
    const uint32_t low = (uint32_t)bits;
    float value;
    memcpy(&value, &low, sizeof value);
    return (double)value;
  }
  if (strcmp(type, "Float64") == 0) {
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
  }
  const bool below = type[0] == 'I' && each < 8 && bits >> (8 * each - 1) != 0;
  return type[0] == 'I' && each == 8 ? (double)(int64_t)bits
         : below                     ? (double)bits - (double)(1ULL << (8 * each))
                                     : (double)bits;
}

static size_t size_of_type(const char *type) {
  static const struct {
    const char *name;
    size_t size;
  } known[] = {{"Float32", 4}, {"Float64", 8}, {"Int8", 1},   {"UInt8", 1}, {"Int16", 2},
               {"UInt16", 2},  {"Int32", 4},   {"UInt32", 4}, {"Int64", 8}, {"UInt64", 8}};
  for (size_t i = 0; i < sizeof known / sizeof *known; ++i) {
    if (strcmp(type, known[i].name) == 0) {
      return known[i].size;
    }
  }
  return 0;
}

/* Read `count` numbers of an array as doubles; NULL after an error. */
static double *take_numbers(const vtp_file *v, const element *e, size_t count,
                            supine_error *error) {
  char type[32] = "";
  (void)attribute(e, "type", type, sizeof type);
  const size_t each = size_of_type(type);
  /* zlib expands a byte to at most 1032 */
  if (each == 0 || count > 1032 * (size_t)(v->end - v->bytes) / 1) {
    (void)malformed(v, "an array of its points or polygons is not read", error);
    return NULL;
  }
  double *values = malloc((count + 1) * sizeof *values);
  array raw = {malloc(count * each + 1), 0};
  bool good = values != NULL && raw.bytes != NULL;
  if (!good) {
    (void)supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", v->file->path);
  } else if (is_attribute(e, "format", "ascii")) {
    mesh_text text = {(const unsigned char *)e->body, (const unsigned char *)v->end};
    for (size_t i = 0; i < count && good; ++i) {
      good = supine_mesh_text_number(&text, &values[i]);
    }
  } else {
    good = take_binary(v, e, count, each, &raw);
    for (size_t i = 0; i < count && good; ++i) {
      values[i] = number_of(type, raw.bytes + i * each, each);
    }
  }
  if (values != NULL && raw.bytes != NULL && !good) {
    (void)malformed(v, "an array is truncated or damaged; save it again", error);
  }
  free(raw.bytes);
  if (!good) {
    free(values);
    return NULL;
  }
  return values;
}

/* Bound an element's body by its end tag, and find an array in it by name, or the first. */
static bool find_array(const vtp_file *v, const element *piece, const char *within,
                       const char *name, element *found) {
  element e;
  element closing;
  char tag[32];
  (void)snprintf(tag, sizeof tag, "/%s", within);
  const char *limit = v->appended != NULL ? v->appended : v->end;
  if (!find_element(piece->body, limit, within, &e) ||
      !find_element(e.body, limit, tag, &closing)) {
    return false;
  }
  const char *at = e.body;
  while (find_element(at, closing.at, "DataArray", found)) {
    if (name == NULL || is_attribute(found, "Name", name)) {
      return true;
    }
    at = found->body;
  }
  return false;
}

static bool count_of(const element *piece, const char *name, size_t *count) {
  char text[32];
  char *end = NULL;
  *count = 0;
  if (!attribute(piece, name, text, sizeof text)) {
    return true;
  }
  const unsigned long long value = strtoull(text, &end, 10);
  *count = (size_t)value;
  return end != text && *end == '\0' && text[0] != '-' && value <= MESH_VERTICES_MAX;
}

/* Read the polygons, or strips of triangles, of a piece. */
static supine_status take_polygons(const vtp_file *v, const element *piece, mesh_faces *faces,
                                   size_t count, bool strips, supine_error *error) {
  const char *within = strips ? "Strips" : "Polys";
  element offsets;
  element connectivity;
  if (count == 0) {
    return SUPINE_OK;
  }
  if (!find_array(v, piece, within, "offsets", &offsets) ||
      !find_array(v, piece, within, "connectivity", &connectivity)) {
    return malformed(v, "its polygons have no offsets or connectivity", error);
  }
  double *ends = take_numbers(v, &offsets, count, error);
  if (ends == NULL) {
    return error != NULL ? error->status : SUPINE_ERROR_FORMAT;
  }
  const double total = ends[count - 1];
  double *corners = NULL;
  supine_status status = SUPINE_ERROR_FORMAT;
  if (!(total >= 0.0 && total <= 3.0 * MESH_TRIANGLES_MAX)) {
    (void)malformed(v, "the offsets of its polygons are invalid; save it again", error);
  } else if ((corners = take_numbers(v, &connectivity, (size_t)total, error)) != NULL) {
    status = SUPINE_OK;
  } else {
    status = error != NULL ? error->status : SUPINE_ERROR_FORMAT;
  }
  double from = 0.0;
  for (size_t p = 0; p < count && status == SUPINE_OK; ++p) {
    if (!(ends[p] >= from && ends[p] <= total)) {
      status = malformed(v, "the offsets of its polygons are invalid; save it again", error);
      break;
    }
    const double *of = corners + (size_t)from;
    const size_t size = (size_t)ends[p] - (size_t)from;
    for (size_t k = 0; strips && k + 2 < size && status == SUPINE_OK; ++k) {
      const double triangle[3] = {of[k], of[k + 1 + k % 2], of[k + 2 - k % 2]};
      status = supine_mesh_faces_add(faces, triangle, 3, error);
    }
    if (!strips) {
      status = supine_mesh_faces_add(faces, of, size, error);
    }
    from = ends[p];
  }
  free(ends);
  free(corners);
  return status;
}

/* Read the head: the array types and the piece. */
static supine_status read_head(vtp_file *v, element *piece, supine_error *error) {
  element root;
  element appended;
  element second;
  char compressor[64];
  if (!find_element(v->bytes, v->end, "VTKFile", &root) ||
      !is_attribute(&root, "type", "PolyData")) {
    return malformed(v, "no VTKFile of type PolyData", error);
  }
  if (is_attribute(&root, "byte_order", "BigEndian")) {
    return malformed(v, "big-endian VTP is not read; save it as PLY", error);
  }
  v->header_size = is_attribute(&root, "header_type", "UInt64") ? 8 : 4;
  v->compressed = attribute(&root, "compressor", compressor, sizeof compressor);
  if (v->compressed && strcmp(compressor, "vtkZLibDataCompressor") != 0) {
    return malformed(v, "it is not compressed by zlib; save it as PLY", error);
  }
  if (find_element(root.body, v->end, "AppendedData", &appended)) {
    const char *mark = memchr(appended.body, '_', (size_t)(v->end - appended.body));
    v->appended_raw = is_attribute(&appended, "encoding", "raw");
    v->appended = mark != NULL ? mark + 1 : NULL;
  }
  const char *limit = v->appended != NULL ? v->appended : v->end;
  if (!find_element(root.body, limit, "Piece", piece)) {
    return malformed(v, "no Piece", error);
  }
  if (find_element(piece->body, limit, "Piece", &second)) {
    return malformed(v, "it has several pieces; save it as one", error);
  }
  return SUPINE_OK;
}

/* Note the axes that 3D Slicer and Supine name in a string array SPACE. */
static void note_space(const vtp_file *v, const element *piece, mesh_file *file) {
  enum { SIZE = 4 }; /* including its NUL */
  const char *at = v->bytes;
  unsigned char letters[SIZE] = {0};
  array raw = {letters, SIZE};
  element e = {NULL, NULL, NULL};
  while (find_element(at, piece->at, "Array", &e) && !is_attribute(&e, "Name", "SPACE")) {
    at = e.body;
  }
  if (e.at == NULL || !is_attribute(&e, "Name", "SPACE")) {
    return;
  }
  if (is_attribute(&e, "format", "ascii")) {
    mesh_text text = {(const unsigned char *)e.body, (const unsigned char *)v->end};
    for (size_t i = 0; i < SIZE; ++i) {
      double code = 0.0;
      if (!supine_mesh_text_number(&text, &code) || !(code >= 0.0 && code < 128.0)) {
        return;
      }
      letters[i] = (unsigned char)code;
    }
  } else if (!take_binary(v, &e, SIZE, 1, &raw)) {
    return;
  }
  if (letters[3] == 0) {
    file->tagged = true;
    (void)supine_mesh_axes_parse((const char *)letters, &file->space);
  }
}

supine_status supine_mesh_read_vtp(mesh_file *file, supine_mesh *mesh, size_t *dropped,
                                   supine_error *error) {
  vtp_file v = {.file = file,
                .bytes = (const char *)file->bytes,
                .end = (const char *)file->bytes + file->size};
  element piece;
  element points;
  size_t count[3];
  supine_error local = {SUPINE_OK, ""};
  error = error == NULL ? &local : error;
  supine_status status = read_head(&v, &piece, error);
  if (status != SUPINE_OK) {
    return status;
  }
  note_space(&v, &piece, file);
  if (!count_of(&piece, "NumberOfPoints", &count[0]) ||
      !count_of(&piece, "NumberOfPolys", &count[1]) ||
      !count_of(&piece, "NumberOfStrips", &count[2])) {
    return malformed(&v, "its numbers of points and polygons are invalid; save it again", error);
  }
  if (count[0] > 0 && !find_array(&v, &piece, "Points", NULL, &points)) {
    return malformed(&v, "no array of points", error);
  }
  if (count[0] > 0) {
    mesh->vertices = take_numbers(&v, &points, 3 * count[0], error);
    if (mesh->vertices == NULL) {
      return error->status;
    }
    mesh->vertex_count = count[0];
  }
  for (size_t i = 0; i < 3 * count[0]; ++i) { /* to single precision, as in all formats */
    mesh->vertices[i] = (double)(float)mesh->vertices[i];
  }
  mesh_faces faces = {.path = file->path, .mesh = mesh};
  status = take_polygons(&v, &piece, &faces, count[1], false, error);
  if (status == SUPINE_OK) {
    status = take_polygons(&v, &piece, &faces, count[2], true, error);
  }
  *dropped = faces.dropped;
  return status;
}
