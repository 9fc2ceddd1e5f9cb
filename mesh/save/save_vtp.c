/* SPDX-License-Identifier: GPL-3.0-or-later */
/* VTK XML PolyData with its arrays appended raw, each behind its size in bytes as a UInt64. */
#include <string.h>

#include "mesh/save/save.h"

/* One array's place in the file. */
typedef struct vtp_array {
  const char *type;
  const char *name;
  unsigned components;
  size_t bytes;
} vtp_array;

static void write_array(FILE *out, const vtp_array *array, size_t *offset) {
  (void)fprintf(out,
                "<DataArray type=\"%s\" Name=\"%s\" NumberOfComponents=\"%u\" format=\"appended\" "
                "offset=\"%zu\"/>\n",
                array->type, array->name, array->components, *offset);
  *offset += 8 + array->bytes;
}

static void write_size(FILE *out, size_t bytes) {
  const uint32_t halves[2] = {(uint32_t)bytes, (uint32_t)((uint64_t)bytes >> 32)};
  unsigned char size[8];
  unsigned char *at = size;
  supine_mesh_put_u32(&at, halves, 2);
  (void)fwrite(size, 1, sizeof size, out);
}

static void write_f32(FILE *out, const float *values, size_t count) {
  unsigned char bytes[4 * sizeof(float)];
  unsigned char *at = bytes;
  supine_mesh_put_f32(&at, values, count);
  (void)fwrite(bytes, 1, (size_t)(at - bytes), out);
}

/* 3D Slicer looks for the axes in this array; a reader of text, in the comment. "--" may not stand
 * in an XML comment. */
static void write_notes(const mesh_writer *writer) {
  (void)fprintf(writer->out, "<!-- SPACE=%s mm ", writer->space);
  for (const char *c = writer->comment; *c != '\0'; ++c) {
    (void)fputc((unsigned char)*c < 0x80 ? *c : '?', writer->out); /* may be cut in a letter */
    if (c[0] == '-' && (c[1] == '-' || c[1] == '\0')) {
      (void)fputc(' ', writer->out);
    }
  }
  (void)fputs(" -->\n", writer->out);
}

static void write_head(const mesh_writer *writer, const vtp_array *arrays, size_t point_arrays) {
  FILE *out = writer->out;
  size_t offset = 0;
  (void)fputs("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n", out);
  write_notes(writer);
  (void)fprintf(out,
                "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
                "header_type=\"UInt64\">\n<PolyData>\n<FieldData>\n"
                "<Array type=\"String\" Name=\"SPACE\" NumberOfTuples=\"1\" format=\"ascii\">"
                "%d %d %d 0</Array>\n</FieldData>\n"
                "<Piece NumberOfPoints=\"%zu\" NumberOfVerts=\"0\" NumberOfLines=\"0\" "
                "NumberOfStrips=\"0\" NumberOfPolys=\"%zu\">\n<Points>\n",
                writer->space[0], writer->space[1], writer->space[2], writer->mesh->vertex_count,
                writer->mesh->triangle_count);
  write_array(out, &arrays[0], &offset);
  (void)fputs("</Points>\n<Polys>\n", out);
  write_array(out, &arrays[1], &offset);
  write_array(out, &arrays[2], &offset);
  (void)fputs("</Polys>\n<PointData>\n", out);
  for (size_t i = 0; i < point_arrays; ++i) {
    write_array(out, &arrays[3 + i], &offset);
  }
  (void)fputs("</PointData>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_", out);
}

void supine_mesh_save_vtp(const mesh_writer *writer) {
  const supine_mesh *mesh = writer->mesh;
  const size_t points = mesh->vertex_count;
  const size_t triangles = mesh->triangle_count;
  const vtp_array arrays[] = {{"Float32", "Points", 3, 12 * points},
                              {"Int32", "connectivity", 1, 12 * triangles},
                              {"Int32", "offsets", 1, 4 * triangles},
                              {"Float32", "displacement", 3, 12 * points},
                              {"Float32", "displacement_magnitude", 1, 4 * points}};
  FILE *out = writer->out;
  write_head(writer, arrays, writer->rest != NULL ? 2 : 0);

  write_size(out, arrays[0].bytes);
  for (size_t i = 0; i < points; ++i) {
    float position[3];
    supine_mesh_writer_position(writer, i, position);
    write_f32(out, position, 3);
  }
  write_size(out, arrays[1].bytes);
  for (size_t t = 0; t < triangles; ++t) {
    unsigned char bytes[12];
    unsigned char *at = bytes;
    supine_mesh_put_u32(&at, mesh->triangles + 3 * t, 3);
    (void)fwrite(bytes, 1, sizeof bytes, out);
  }
  write_size(out, arrays[2].bytes);
  for (size_t t = 0; t < triangles; ++t) {
    const uint32_t stop = (uint32_t)(3 * (t + 1));
    unsigned char bytes[4];
    unsigned char *at = bytes;
    supine_mesh_put_u32(&at, &stop, 1);
    (void)fwrite(bytes, 1, sizeof bytes, out);
  }
  float displacement[4];
  if (writer->rest != NULL) {
    write_size(out, arrays[3].bytes);
    for (size_t i = 0; i < points; ++i) {
      supine_mesh_writer_displacement(writer, i, displacement);
      write_f32(out, displacement, 3);
    }
    write_size(out, arrays[4].bytes);
    for (size_t i = 0; i < points; ++i) {
      supine_mesh_writer_displacement(writer, i, displacement);
      write_f32(out, displacement + 3, 1);
    }
  }
  (void)fputs("\n</AppendedData>\n</VTKFile>\n", out);
}
