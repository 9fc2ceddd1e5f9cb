/* SPDX-License-Identifier: MIT */
/* VTK XML PolyData: the XML around the arrays, and a file of one surface. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/io/vtp.h"

/* Write an element whose length does not depend on its array's offset. */
static void write_array(const vtp *file, size_t number, FILE *out) {
  const vtp_array *array = &file->arrays[number];
  for (size_t frame = 0; frame < file->frames; ++frame) {
    char offset[32];
    const int length =
        snprintf(offset, sizeof offset, "%llu\"",
                 (unsigned long long)file->offsets[frame * file->array_count + number]);
    (void)fprintf(out, "<DataArray type=\"%s\" Name=\"%s\" NumberOfComponents=\"%u\"", array->type,
                  array->name, array->components);
    if (file->times != NULL) {
      (void)fprintf(out, " TimeStep=\"%zu\"", frame);
    }
    (void)fprintf(out, " format=\"appended\" offset=\"%s%*s/>\n", offset, 21 - length, "");
  }
}

/* Write the axes as the array SPACE for 3D Slicer, and as a comment for readers of text. "--" is
 * not allowed in an XML comment. */
static void write_notes(const mesh_writer *writer, FILE *out) {
  (void)fprintf(out, "<!-- SPACE=%s %s ", writer->space, writer->unit);
  for (const char *c = writer->comment; *c != '\0'; ++c) {
    (void)fputc((unsigned char)*c < 0x80 ? *c : '?', out); /* may end within a character */
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

/* Write one tuple for each frame. */
static void write_numbers(const vtp *file, const supine_mesh_field *field, FILE *out) {
  (void)fprintf(out,
                "<DataArray type=\"Float64\" Name=\"%s\" NumberOfComponents=\"%zu\" "
                "NumberOfTuples=\"%zu\" format=\"ascii\">",
                field->name, field->count, file->frames);
  for (size_t i = 0; i < file->frames * field->count; ++i) {
    (void)fprintf(out, "%s%.17g", i > 0 ? " " : "", field->values[i]);
  }
  (void)fputs("</DataArray>\n", out);
}

static void write_field_data(const vtp *file, FILE *out) {
  const mesh_writer *writer = &file->writer;
  char units[64];
  (void)snprintf(units, sizeof units, "%s, mL, s", writer->unit);
  (void)fputs("<FieldData>\n", out);
  write_text("SPACE", writer->space, out);
  write_text("units", units, out);
  if (file->times != NULL) { /* with one frame, "TimeValue" would be read as its time */
    write_numbers(file, &(supine_mesh_field){"time_s", 1, file->times}, out);
  }
  for (size_t i = 0; i < writer->field_count; ++i) {
    write_numbers(file, &writer->fields[i], out);
  }
  (void)fputs("</FieldData>\n", out);
}

void supine_mesh_vtp_head(const vtp *file, FILE *out) {
  const mesh_writer *writer = &file->writer;
  (void)fputs("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n", out);
  write_notes(writer, out);
  (void)fputs("<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
              "header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n<PolyData",
              out);
  for (size_t frame = 0; file->times != NULL && frame < file->frames; ++frame) {
    (void)fprintf(out, "%s%.9g%s", frame == 0 ? " TimeValues=\"" : " ", file->times[frame],
                  frame + 1 == file->frames ? "\"" : "");
  }
  (void)fputs(">\n", out);
  write_field_data(file, out);
  (void)fprintf(out,
                "<Piece NumberOfPoints=\"%zu\" NumberOfVerts=\"0\" NumberOfLines=\"0\" "
                "NumberOfStrips=\"0\" NumberOfPolys=\"%zu\">\n<Points>\n",
                writer->mesh->vertex_count, writer->mesh->triangle_count);
  write_array(file, 0, out);
  (void)fputs("</Points>\n<Polys>\n", out);
  write_array(file, 1, out);
  write_array(file, 2, out);
  (void)fprintf(out, "</Polys>\n<PointData%s>\n",
                writer->normals != NULL ? " Normals=\"Normals\"" : "");
  for (size_t i = VTP_FIRST_OF_POINTS; i < file->array_count; ++i) {
    write_array(file, i, out);
  }
  (void)fputs("</PointData>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_", out);
}

void supine_mesh_vtp_foot(FILE *out) {
  (void)fputs("\n</AppendedData>\n</VTKFile>\n", out);
}

/* Compress the arrays into memory first: their offsets precede them. */
supine_status supine_mesh_save_vtp(const mesh_writer *writer) {
  vtp file = {.writer = *writer, .frames = 1};
  char *bytes = NULL;
  size_t size = 0;
  supine_status status = supine_mesh_vtp_begin(&file);
  if (status != SUPINE_OK) {
    return status;
  }
  FILE *memory = open_memstream(&bytes, &size);
  status = memory == NULL ? SUPINE_ERROR_MEMORY : supine_mesh_vtp_frame(&file, memory);
  if (memory != NULL && fclose(memory) != 0) {
    status = SUPINE_ERROR_MEMORY;
  }
  if (status == SUPINE_OK) {
    supine_mesh_vtp_head(&file, writer->out);
    (void)fwrite(bytes, 1, size, writer->out);
    supine_mesh_vtp_foot(writer->out);
  }
  free(bytes);
  supine_mesh_vtp_end(&file);
  return status;
}
