/* SPDX-License-Identifier: MIT */
/* Write VTK XML PolyData with appended raw arrays, for one surface, or for frames, which are
 * surfaces with the same triangles, one after the other. Nothing is compressed: zlib took two
 * thirds of the time. The size of each array is thus known before it is written, and with it its
 * offset, which the header of the file states. */
#include <string.h>

#include "base/arena.h"
#include "base/number.h"
#include "base/output.h"

#include "mesh/io/save.h"

enum { VTP_FIRST_OF_POINTS = 3, VTP_ARRAYS = VTP_FIRST_OF_POINTS + 4 + SUPINE_MESH_SCALARS };

/* Numbers of one point or triangle. */
typedef union vtp_item {
  float number[4];
  uint32_t index[3];
} vtp_item;

/* Compute the numbers of point or triangle i. */
typedef void vtp_find(const mesh_writer *writer, size_t i, vtp_item *item);

typedef struct vtp_array {
  const char *type;
  const char *name;
  unsigned components;
  size_t item_size; /* size of the data of one point or triangle, bytes: 1, 4 or 12 */
  size_t count;
  bool constant;  /* whether the array is equal in all frames and written once */
  vtp_find *find; /* NULL for the array `values`, which is written as it is */
  const void *values;
} vtp_array;

typedef struct vtp {
  mesh_writer writer;
  vtp_array arrays[VTP_ARRAYS]; /* points, connectivity, offsets, then point data */
  size_t array_count;
  const supine_mesh_frames *frames;
} vtp;

static void find_position(const mesh_writer *writer, size_t i, vtp_item *item) {
  supine_io_writer_position(writer, i, item->number);
}

static void find_corners(const mesh_writer *writer, size_t i, vtp_item *item) {
  supine_io_writer_triangle(writer, i, item->index);
}

static void find_stop(const mesh_writer *writer, size_t i, vtp_item *item) {
  (void)writer;
  item->index[0] = 3 * ((uint32_t)i + 1);
}

static void find_displacement(const mesh_writer *writer, size_t i, vtp_item *item) {
  supine_io_writer_displacement(writer, i, item->number);
}

static void find_magnitude(const mesh_writer *writer, size_t i, vtp_item *item) {
  supine_io_writer_displacement(writer, i, item->number);
  item->number[0] = item->number[3];
}

static void find_normal(const mesh_writer *writer, size_t i, vtp_item *item) {
  supine_io_writer_normal(writer, i, item->number);
}

static vtp vtp_begin(const mesh_writer *writer, const supine_mesh_frames *frames) {
  const size_t points = writer->mesh->vertex_count;
  const size_t triangles = writer->mesh->triangle_count;
  const supine_mesh_save_options *options = &writer->options;
  vtp file = {.writer = *writer, .frames = frames};
  vtp_array *to = file.arrays;
  *to++ = (vtp_array){"Float32", "Points", 3, 12, points, false, find_position, NULL};
  *to++ = (vtp_array){"Int32", "connectivity", 1, 12, triangles, true, find_corners, NULL};
  *to++ = (vtp_array){"Int32", "offsets", 1, 4, triangles, true, find_stop, NULL};
  if (options->from != NULL) {
    *to++ = (vtp_array){"Float32", "displacement", 3, 12, points, false, find_displacement, NULL};
    *to++ =
        (vtp_array){"Float32", "displacement_magnitude", 1, 4, points, false, find_magnitude, NULL};
  }
  for (size_t k = 0; k < SUPINE_MESH_SCALARS; ++k) {
    const supine_mesh_scalar *scalar = &options->scalars[k];
    if (scalar->values != NULL) {
      *to++ = (vtp_array){"Float32", scalar->name, 1, 4, points, false, NULL, scalar->values};
    }
  }
  if (options->normals != NULL) {
    *to++ = (vtp_array){"Float32", "Normals", 3, 12, points, false, find_normal, NULL};
  }
  if (options->lung != NULL) {
    *to++ = (vtp_array){"UInt8", "lung", 1, 1, points, true, NULL, options->lung};
  }
  file.array_count = (size_t)(to - file.arrays);
  return file;
}

static bool is_written(const vtp_array *array, size_t frame) {
  return frame == 0 || !array->constant;
}

/* Return the size of an array with the integer before it, which states the array's size; bytes. */
static uint64_t bytes_of(const vtp_array *array) {
  return sizeof(uint64_t) + array->item_size * array->count;
}

/* Return the bytes from the end of the header to the array `number` of a frame. */
static uint64_t offset_of(const vtp *file, size_t number, size_t frame) {
  uint64_t first = 0; /* bytes of frame 0, and of each other frame */
  uint64_t other = 0;
  uint64_t before = 0; /* bytes of the frame that precede the array */
  frame = file->arrays[number].constant ? 0 : frame;
  for (size_t i = 0; i < file->array_count; ++i) {
    const vtp_array *array = &file->arrays[i];
    first += bytes_of(array);
    other += array->constant ? 0 : bytes_of(array);
    before += i < number && is_written(array, frame) ? bytes_of(array) : 0;
  }
  return (frame > 0 ? first + (frame - 1) * other : 0) + before;
}

/* Write the items of an array in groups, because a call of fwrite for each would take longer than
 * the rest. Each item overwrites the unused end of the one before it. */
static void put_items(const vtp *file, const vtp_array *array) {
  enum { GROUP = 1024 };
  char bytes[GROUP * sizeof(vtp_item)];
  for (size_t begin = 0; begin < array->count; begin += GROUP) {
    const size_t left = array->count - begin;
    const size_t items = left < GROUP ? left : GROUP;
    for (size_t i = 0; i < items; ++i) {
      vtp_item item;
      array->find(&file->writer, begin + i, &item);
      memcpy(bytes + i * array->item_size, &item, sizeof item);
    }
    (void)fwrite(bytes, array->item_size, items, file->writer.out);
  }
}

/* Write an array: its size in bytes, and its numbers. */
static void put_array(const vtp *file, const vtp_array *array) {
  const uint64_t bytes = array->item_size * array->count;
  (void)fwrite(&bytes, sizeof bytes, 1, file->writer.out);
  if (array->find == NULL) {
    (void)fwrite(array->values, array->item_size, array->count, file->writer.out);
  } else {
    put_items(file, array);
  }
}

static void vtp_frame(const vtp *file, size_t frame) {
  for (size_t i = 0; i < file->array_count; ++i) {
    if (is_written(&file->arrays[i], frame)) {
      put_array(file, &file->arrays[i]);
    }
  }
}

/* Write the DataArray elements of an array, one for each frame. */
static void write_array(const vtp *file, size_t number) {
  const vtp_array *array = &file->arrays[number];
  FILE *out = file->writer.out;
  for (size_t frame = 0; frame < file->frames->count; ++frame) {
    (void)fprintf(out, "<DataArray type=\"%s\" Name=\"%s\" NumberOfComponents=\"%u\"", array->type,
                  array->name, array->components);
    if (file->frames->times != NULL) {
      (void)fprintf(out, " TimeStep=\"%zu\"", frame);
    }
    (void)fprintf(out, " format=\"appended\" offset=\"%llu\"/>\n",
                  (unsigned long long)offset_of(file, number, frame));
  }
}

/* Write the axes, the unit and the user's text as an XML comment. Put blanks between hyphens,
 * because an XML comment must not hold "--". Replace non-ASCII bytes by "?", because the text may
 * have been cut within a character. */
static void write_notes(const mesh_writer *writer) {
  FILE *out = writer->out;
  (void)fprintf(out, "<!-- SPACE=%s %s ", writer->space, writer->unit);
  for (const char *c = writer->comment; *c != '\0'; ++c) {
    (void)fputc((unsigned char)*c < 0x80 ? *c : '?', out);
    if (c[0] == '-' && (c[1] == '-' || c[1] == '\0')) {
      (void)fputc(' ', out);
    }
  }
  (void)fputs(" -->\n", out);
}

static void write_text(const char *name, const char *text, FILE *out) {
  (void)fprintf(out, "<Array type=\"String\" Name=\"%s\" NumberOfTuples=\"1\" format=\"ascii\">",
                name);
  for (; *text != '\0'; ++text) {
    (void)fprintf(out, "%d ", *text);
  }
  (void)fputs("0</Array>\n", out);
}

static void write_numbers(const vtp *file, const supine_mesh_field *field, FILE *out) {
  (void)fprintf(out,
                "<DataArray type=\"Float64\" Name=\"%s\" NumberOfComponents=\"%zu\" "
                "NumberOfTuples=\"%zu\" format=\"ascii\">",
                field->name, field->count, file->frames->count);
  for (size_t i = 0; i < file->frames->count * field->count; ++i) {
    (void)supine_print(out, "%s%.17g", i > 0 ? " " : "", field->values[i]);
  }
  (void)fputs("</DataArray>\n", out);
}

static void write_field_data(const vtp *file) {
  const mesh_writer *writer = &file->writer;
  FILE *out = writer->out;
  char units[64];
  (void)snprintf(units, sizeof units, "%s, mL, s", writer->unit);
  (void)fputs("<FieldData>\n", out);
  write_text("SPACE", writer->space, out);
  write_text("units", units, out);
  if (writer->comment[0] != '\0') {
    write_text("note", writer->comment, out);
  }
  if (file->frames->times != NULL) {
    write_numbers(file, &(supine_mesh_field){"time_s", 1, file->frames->times}, out);
  }
  for (size_t i = 0; i < writer->options.field_count; ++i) {
    write_numbers(file, &writer->options.fields[i], out);
  }
  (void)fputs("</FieldData>\n", out);
}

/* Write the header of the file, which is everything before the arrays. */
static void vtp_head(const vtp *file) {
  const mesh_writer *writer = &file->writer;
  FILE *out = writer->out;
  (void)fputs("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n", out);
  write_notes(writer);
  (void)fputs("<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
              "header_type=\"UInt64\">\n<PolyData",
              out);
  if (file->frames->times != NULL) {
    for (size_t frame = 0; frame < file->frames->count; ++frame) {
      (void)supine_print(out, "%s%.9g%s", frame == 0 ? " TimeValues=\"" : " ",
                         file->frames->times[frame], frame + 1 == file->frames->count ? "\"" : "");
    }
  }
  (void)fputs(">\n", out);
  write_field_data(file);
  (void)fprintf(out,
                "<Piece NumberOfPoints=\"%zu\" NumberOfVerts=\"0\" NumberOfLines=\"0\" "
                "NumberOfStrips=\"0\" NumberOfPolys=\"%zu\">\n<Points>\n",
                writer->mesh->vertex_count, writer->mesh->triangle_count);
  write_array(file, 0);
  (void)fputs("</Points>\n<Polys>\n", out);
  write_array(file, 1);
  write_array(file, 2);
  (void)fprintf(out, "</Polys>\n<PointData%s%s>\n",
                writer->options.from != NULL ? " Scalars=\"displacement_magnitude\"" : "",
                writer->options.normals != NULL ? " Normals=\"Normals\"" : "");
  for (size_t i = VTP_FIRST_OF_POINTS; i < file->array_count; ++i) {
    write_array(file, i);
  }
  (void)fputs("</PointData>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_", out);
}

static void vtp_foot(const vtp *file) {
  (void)fputs("\n</AppendedData>\n</VTKFile>\n", file->writer.out);
}

void supine_io_save_vtp(const mesh_writer *writer) {
  static const supine_mesh_frames one = {.count = 1};
  const vtp file = vtp_begin(writer, &one);
  vtp_head(&file);
  vtp_frame(&file, 0);
  vtp_foot(&file);
}

supine_status supine_mesh_save_frames(const char *path, const supine_mesh *mesh,
                                      const supine_mesh_save_options *options,
                                      const supine_mesh_frames *frames, supine_error *error) {
  SUPINE_FREED_BY(supine_output_abandon) supine_output output = {0};
  mesh_writer writer;
  SUPINE_TRY(supine_output_open(path, &output, error));
  supine_io_writer_begin(mesh, options, &writer);
  writer.out = output.file;
  const vtp file = vtp_begin(&writer, frames);
  vtp_head(&file);
  for (size_t frame = 0; frame < frames->count; ++frame) {
    SUPINE_TRY(frames->next(frames->context, frame, error));
    SUPINE_TRY(supine_io_writer_check(path, mesh, error));
    vtp_frame(&file, frame);
  }
  vtp_foot(&file);
  return supine_output_commit(&output, error);
}
