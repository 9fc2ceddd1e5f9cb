/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Expandability from a property of a PLY file's vertices, which importers of surfaces drop. */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "precompute/tissue/expandability.h"

enum { PROPERTIES_MAX = 64, NAME_SIZE = 64, LINE_SIZE = 512 };

typedef enum encoding { ASCII, LITTLE, BIG } encoding;

typedef struct value_type {
  const char *names[2];
  size_t size;
  bool real, is_signed;
} value_type;

static const value_type types[] = {
    {{"char", "int8"}, 1, false, true},    {{"uchar", "uint8"}, 1, false, false},
    {{"short", "int16"}, 2, false, true},  {{"ushort", "uint16"}, 2, false, false},
    {{"int", "int32"}, 4, false, true},    {{"uint", "uint32"}, 4, false, false},
    {{"float", "float32"}, 4, true, true}, {{"double", "float64"}, 8, true, true}};

/* The file, and where its vertices hold x, y, z and the property. */
typedef struct ply_file {
  const char *path;
  const char *property;
  FILE *file;
  encoding encoding;
  unsigned long long vertex_count;
  size_t property_count;
  const value_type *type[PROPERTIES_MAX];
  size_t wanted[4];
  supine_error *error;
} ply_file;

static supine_status bad(const ply_file *in, const char *what) {
  return supine_error_set(in->error, SUPINE_ERROR_FORMAT, "%s: %s", in->path, what);
}

static const value_type *find_type(const char *name) {
  for (size_t i = 0; i < sizeof types / sizeof *types; ++i) {
    if (strcmp(name, types[i].names[0]) == 0 || strcmp(name, types[i].names[1]) == 0) {
      return &types[i];
    }
  }
  return NULL;
}

static supine_status take_property(ply_file *in, const char *type, const char *name) {
  const char *const names[4] = {"x", "y", "z", in->property};
  const value_type *found = find_type(type);
  if (found == NULL) {
    return bad(in, "a list, or a type that no PLY file has, among the vertices' properties");
  }
  if (in->property_count == PROPERTIES_MAX) {
    return bad(in, "too many vertex properties");
  }
  for (size_t w = 0; w < 4; ++w) {
    if (strcmp(name, names[w]) == 0) {
      in->wanted[w] = in->property_count;
    }
  }
  in->type[in->property_count++] = found;
  return SUPINE_OK;
}

static bool take_format(ply_file *in, const char *name) {
  static const char *const names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
  for (int i = 0; i < 3; ++i) {
    if (strcmp(name, names[i]) == 0) {
      in->encoding = (encoding)i;
      return true;
    }
  }
  return false;
}

/* One line of the header. `element`: 0 before the first, 1 in the vertices, 2 after them. */
static supine_status take_line(ply_file *in, char *line, int *element) {
  char *rest = NULL;
  const char *word = strtok_r(line, " \t\r\n", &rest);
  const char *first = word == NULL ? NULL : strtok_r(NULL, " \t\r\n", &rest);
  const char *second = first == NULL ? NULL : strtok_r(NULL, " \t\r\n", &rest);
  if (word == NULL || second == NULL) {
    return SUPINE_OK;
  }
  if (strcmp(word, "format") == 0) {
    return take_format(in, first) ? SUPINE_OK : bad(in, "a format that no PLY file has");
  }
  if (strcmp(word, "element") == 0) {
    if (*element == 0 && strcmp(first, "vertex") != 0) {
      return bad(in, "its vertices are not the first element");
    }
    if (*element == 0) {
      char *end = NULL;
      in->vertex_count = strtoull(second, &end, 10);
      if (*end != '\0' || in->vertex_count > UINT32_MAX) {
        return bad(in, "a number of vertices out of range");
      }
    }
    ++*element;
    return SUPINE_OK;
  }
  return strcmp(word, "property") == 0 && *element == 1 ? take_property(in, first, second)
                                                        : SUPINE_OK;
}

static supine_status read_header(ply_file *in) {
  char line[LINE_SIZE];
  int element = 0;
  for (size_t w = 0; w < 4; ++w) {
    in->wanted[w] = PROPERTIES_MAX;
  }
  if (fgets(line, sizeof line, in->file) == NULL || strncmp(line, "ply", 3) != 0) {
    return bad(in, "not a PLY file");
  }
  for (;;) {
    if (fgets(line, sizeof line, in->file) == NULL) {
      return bad(in, "its header does not end");
    }
    if (strncmp(line, "end_header", strlen("end_header")) == 0) {
      break;
    }
    const supine_status status = take_line(in, line, &element);
    if (status != SUPINE_OK) {
      return status;
    }
  }
  if (in->wanted[3] == PROPERTIES_MAX) {
    return supine_error_set(in->error, SUPINE_ERROR_FORMAT,
                            "%s: its vertices have no property '%.60s'", in->path, in->property);
  }
  return in->wanted[0] < PROPERTIES_MAX && in->wanted[1] < PROPERTIES_MAX &&
                 in->wanted[2] < PROPERTIES_MAX
             ? SUPINE_OK
             : bad(in, "its vertices lack x, y or z");
}

/* A number of the given type from its bytes, the least significant first. */
static double decode(const value_type *type, const unsigned char *bytes) {
  uint64_t bits = 0;
  for (size_t b = type->size; b-- > 0;) {
    bits = bits << 8 | bytes[b];
  }
  if (type->real && type->size == 8) {
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
  }
  if (type->real) {
    const uint32_t half = (uint32_t)bits;
    float value;
    memcpy(&value, &half, sizeof value);
    return (double)value;
  }
  const double top = ldexp(1.0, 8 * (int)type->size);
  return type->is_signed && (double)bits >= 0.5 * top ? (double)bits - top : (double)bits;
}

static bool read_value(const ply_file *in, const value_type *type, double *value) {
  if (in->encoding == ASCII) {
    char word[NAME_SIZE];
    char *end = NULL;
    if (fscanf(in->file, "%63s", word) != 1) {
      return false;
    }
    *value = strtod(word, &end);
    return end != word && *end == '\0';
  }
  unsigned char raw[8];
  unsigned char bytes[8];
  if (fread(raw, 1, type->size, in->file) != type->size) {
    return false;
  }
  for (size_t b = 0; b < type->size; ++b) {
    bytes[b] = raw[in->encoding == LITTLE ? b : type->size - 1 - b];
  }
  *value = decode(type, bytes);
  return true;
}

/* x, y, z and the property of the next vertex. */
static bool read_vertex(const ply_file *in, double found[4]) {
  for (size_t p = 0; p < in->property_count; ++p) {
    double value = 0.0;
    if (!read_value(in, in->type[p], &value)) {
      return false;
    }
    for (size_t w = 0; w < 4; ++w) {
      if (in->wanted[w] == p) {
        found[w] = value;
      }
    }
  }
  return true;
}

typedef struct placed {
  double x;
  size_t vertex;
} placed;

static int compare_placed(const void *a, const void *b) {
  const double x = ((const placed *)a)->x;
  const double y = ((const placed *)b)->x;
  return (x > y) - (x < y);
}

/* Gives `value` to the model's vertices within `reach` of p that have none yet. */
static void assign(const supine_lungs *lungs, const placed *order, const double p[3], double reach,
                   double value, double *a) {
  size_t low = 0;
  size_t high = lungs->mesh.vertex_count;
  while (low < high) {
    const size_t middle = low + (high - low) / 2;
    if (order[middle].x < p[0] - reach) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  for (; low < lungs->mesh.vertex_count && order[low].x <= p[0] + reach; ++low) {
    const size_t i = order[low].vertex;
    const double *q = lungs->mesh.vertices + 3 * i;
    if (a[i] == 0.0 && fabs(q[1] - p[1]) <= reach && fabs(q[2] - p[2]) <= reach) {
      a[i] = value;
    }
  }
}

static supine_status read_vertices(const ply_file *in, const supine_lungs *lungs,
                                   const placed *order, const double scale[3], double *a) {
  double reach = 0.0; /* positions went through single precision */
  for (size_t k = 0; k < 3; ++k) {
    reach = fmax(reach, 1e-6 * fmax(fabs(lungs->minimum[k]), fabs(lungs->maximum[k])));
  }
  for (unsigned long long v = 0; v < in->vertex_count; ++v) {
    double found[4] = {0.0};
    if (!read_vertex(in, found)) {
      return supine_error_set(in->error, SUPINE_ERROR_FORMAT,
                              "%s: truncated or malformed at vertex %llu of %llu", in->path, v,
                              in->vertex_count);
    }
    if (!(found[3] > 0.0) || !isfinite(found[3]) || !isfinite(1.0 / found[3])) {
      return supine_error_set(in->error, SUPINE_ERROR_FORMAT,
                              "%s: %.60s of vertex %llu is %g: expandability must be positive and "
                              "finite",
                              in->path, in->property, v, found[3]);
    }
    const double p[3] = {scale[0] * found[0], scale[1] * found[1], scale[2] * found[2]};
    assign(lungs, order, p, reach, found[3], a);
  }
  return SUPINE_OK;
}

supine_status supine_tissue_expandability_load_ply(const char *path, const char *property,
                                                   supine_axes axes, double millimetres_per_unit,
                                                   const supine_lungs *lungs, double *a,
                                                   supine_error *error) {
  const size_t n = lungs->mesh.vertex_count;
  const double unit = millimetres_per_unit > 0.0 ? millimetres_per_unit : 1.0;
  const double turn = axes == SUPINE_AXES_RAS ? -unit : unit; /* x and y point the other way */
  const double scale[3] = {turn, turn, unit};
  ply_file in = {.path = path, .property = property, .error = error};
  in.file = fopen(path, "rbe");
  if (in.file == NULL) {
    return supine_error_set(error, SUPINE_ERROR_READ, "%s: %s", path,
                            strerror(errno)); /* NOLINT(concurrency-mt-unsafe) */
  }
  placed *order = malloc(n * sizeof *order);
  if (order == NULL) {
    (void)fclose(in.file);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "no memory for %zu vertices", n);
  }
  supine_status status = read_header(&in);
  if (status == SUPINE_OK) {
    for (size_t i = 0; i < n; ++i) {
      order[i] = (placed){lungs->mesh.vertices[3 * i], i};
    }
    qsort(order, n, sizeof *order, compare_placed);
    status = read_vertices(&in, lungs, order, scale, a);
  }
  free(order);
  (void)fclose(in.file);
  return status;
}
