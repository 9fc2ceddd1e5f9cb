/* SPDX-License-Identifier: MIT */
/* Write VTK XML PolyData with compressed appended arrays, for one surface, or for a series of
 * frames, which are surfaces with the same triangles. The arrays of a series are written frame by
 * frame. Then the header of the file is written a second time, with the offsets of the arrays. */
#include <stdlib.h>

#include <libdeflate.h>

#include "base/arena.h"
#include "base/output.h"
#include "base/parallel.h"

#include "mesh/io/save.h"

enum { VTP_ARRAYS = 9, VTP_FIRST_OF_POINTS = 3 };

typedef struct vtp vtp;

/* Write the bytes of item `i` of an array to *at, and advance *at. */
typedef void vtp_put(const vtp *file, size_t i, unsigned char **at);
/* Compute the numbers of item `i`. */
typedef void vtp_numbers(const mesh_writer *writer, size_t i, float *numbers);

typedef struct vtp_array {
  const char *type;
  const char *name;
  unsigned components;
  size_t item_size; /* size of the data of one point or triangle, bytes: 1, 4 or 12 */
  size_t count;
  bool constant;        /* whether the array is equal in all frames and written once */
  vtp_put *put;         /* NULL for the numbers that `numbers` computes, */
  vtp_numbers *numbers; /* without the first `skip` */
  size_t skip;          /* for put_scalar, the index of the scalar */
} vtp_array;

struct vtp {
  supine_arena arena;
  mesh_writer writer;
  vtp_array arrays[VTP_ARRAYS]; /* points, connectivity, offsets, then point data */
  size_t array_count;
  size_t frames;
  const double *times; /* [frames] in s; NULL for one surface without a time */
  uint64_t *offsets;   /* [frames, array_count] bytes from the end of the header to each array */
  size_t next_frame;
  uint64_t bytes_written;
  size_t threads;
  unsigned char *raw;    /* [threads, BLOCK] uncompressed bytes of one block for each thread */
  unsigned char *packed; /* compressed blocks of one array */
  uint64_t *sizes; /* header of one array: three numbers, then the compressed size of each block */
  const vtp_array *packing; /* array being compressed */
};

/* BLOCK: bytes that are compressed together, a multiple of every item_size. LEVEL: level of
 * libdeflate; level 2 takes 1.5 times as long and makes files 5 % smaller. */
enum { BLOCK = 3 << 18, LEVEL = 1 };

static size_t room_of_block(void) {
  return libdeflate_zlib_compress_bound(NULL, BLOCK);
}

static void put_connectivity(const vtp *file, size_t i, unsigned char **at) {
  uint32_t corner[3];
  supine_mesh_writer_triangle(&file->writer, i, corner);
  supine_mesh_put_u32(at, corner, 3);
}

static void put_offset(const vtp *file, size_t i, unsigned char **at) {
  (void)file;
  const uint32_t stop = 3 * ((uint32_t)i + 1);
  supine_mesh_put_u32(at, &stop, 1);
}

static void put_scalar(const vtp *file, size_t i, unsigned char **at) {
  supine_mesh_put_f32(at, file->writer.options.scalars[file->packing->skip].values + i, 1);
}

static void put_lung(const vtp *file, size_t i, unsigned char **at) {
  *(*at)++ = file->writer.options.lung[i];
}

static void vtp_end(vtp *file) {
  supine_arena_free(&file->arena);
}

static supine_status vtp_begin(vtp *file) {
  const mesh_writer *writer = &file->writer;
  const size_t points = writer->mesh->vertex_count;
  const size_t triangles = writer->mesh->triangle_count;
  vtp_array *to = file->arrays;
  *to++ =
      (vtp_array){"Float32", "Points", 3, 12, points, false, NULL, supine_mesh_writer_position, 0};
  *to++ = (vtp_array){"Int32", "connectivity", 1, 12, triangles, true, put_connectivity, NULL, 0};
  *to++ = (vtp_array){"Int32", "offsets", 1, 4, triangles, true, put_offset, NULL, 0};
  if (writer->options.from != NULL) {
    vtp_numbers *const numbers = supine_mesh_writer_displacement;
    *to++ = (vtp_array){"Float32", "displacement", 3, 12, points, false, NULL, numbers, 0};
    *to++ = (vtp_array){"Float32", "displacement_magnitude", 1, 4, points, false, NULL, numbers, 3};
  }
  for (size_t k = 0; k < SUPINE_MESH_SCALARS; ++k) {
    const supine_mesh_scalar *scalar = &writer->options.scalars[k];
    if (scalar->values != NULL) {
      *to++ = (vtp_array){"Float32", scalar->name, 1, 4, points, false, put_scalar, NULL, k};
    }
  }
  if (writer->options.normals != NULL) {
    *to++ =
        (vtp_array){"Float32", "Normals", 3, 12, points, false, NULL, supine_mesh_writer_normal, 0};
  }
  if (writer->options.lung != NULL) {
    *to++ = (vtp_array){"UInt8", "lung", 1, 1, points, true, put_lung, NULL, 0};
  }
  file->array_count = (size_t)(to - file->arrays);
  file->offsets =
      supine_arena_zeros(&file->arena, file->frames * file->array_count, sizeof *file->offsets);
  const size_t blocks = 12 * (points > triangles ? points : triangles) / BLOCK + 1;
  file->threads = supine_thread_count();
  file->raw = supine_arena_take(&file->arena, file->threads, BLOCK);
  file->packed = supine_arena_take(&file->arena, blocks, room_of_block());
  file->sizes = supine_arena_zeros(&file->arena, blocks + 3, sizeof *file->sizes);
  return file->arena.failed ? SUPINE_ERROR_MEMORY : SUPINE_OK;
}

static void put_sizes(FILE *out, const uint64_t *sizes, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    const uint32_t halves[2] = {(uint32_t)sizes[i], (uint32_t)(sizes[i] >> 32)};
    unsigned char bytes[8];
    unsigned char *at = bytes;
    supine_mesh_put_u32(&at, halves, 2);
    (void)fwrite(bytes, 1, sizeof bytes, out);
  }
}

/* Fill and compress blocks begin <= i < end of file->packing. A compressed size of 0 means out of
 * memory. */
static void pack_blocks(void *context, size_t begin, size_t end, size_t thread) {
  vtp *file = context;
  const vtp_array *array = file->packing;
  const size_t each = BLOCK / array->item_size;
  unsigned char *raw = file->raw + thread * BLOCK;
  for (size_t i = begin; i < end; ++i) {
    const size_t remaining = array->count - i * each;
    const size_t items = remaining < each ? remaining : each;
    unsigned char *at = raw;
    for (size_t k = 0; k < items; ++k) {
      float numbers[4];
      if (array->put != NULL) {
        array->put(file, i * each + k, &at);
      } else {
        array->numbers(&file->writer, i * each + k, numbers);
        supine_mesh_put_f32(&at, numbers + array->skip, array->components);
      }
    }
    struct libdeflate_compressor *compressor = libdeflate_alloc_compressor(LEVEL);
    file->sizes[3 + i] =
        compressor == NULL
            ? 0
            : libdeflate_zlib_compress(compressor, raw, (size_t)(at - raw),
                                       file->packed + i * room_of_block(), room_of_block());
    libdeflate_free_compressor(compressor);
  }
}

/* Write an array: the number of blocks, the size of a block, the size of the last block if it is
 * shorter (else 0), the compressed size of each block, and the blocks. */
static supine_status put_array(vtp *file, const vtp_array *array, FILE *out) {
  const size_t bytes = array->item_size * array->count;
  const size_t blocks = (bytes + BLOCK - 1) / BLOCK;
  supine_status status = SUPINE_OK;
  file->packing = array;
  supine_parallel_for(blocks, 1, file->threads, pack_blocks, file);
  file->sizes[0] = blocks;
  file->sizes[1] = BLOCK;
  file->sizes[2] = bytes % BLOCK;
  put_sizes(out, file->sizes, blocks + 3);
  file->bytes_written += 8 * (blocks + 3);
  for (size_t i = 0; i < blocks; ++i) {
    (void)fwrite(file->packed + i * room_of_block(), 1, file->sizes[3 + i], out);
    file->bytes_written += file->sizes[3 + i];
    status = file->sizes[3 + i] > 0 ? status : SUPINE_ERROR_MEMORY;
  }
  return status;
}

static supine_status vtp_frame(vtp *file, FILE *out) {
  const size_t frame = file->next_frame++;
  for (size_t i = 0; i < file->array_count; ++i) {
    uint64_t *offset = &file->offsets[frame * file->array_count + i];
    if (frame > 0 && file->arrays[i].constant) {
      *offset = file->offsets[i];
    } else {
      *offset = file->bytes_written;
      SUPINE_TRY(put_array(file, &file->arrays[i], out));
    }
  }
  return SUPINE_OK;
}

/* Write the DataArray elements of an array, one for each frame. Offsets are padded to one length,
 * so that the header of the file can be written again with other offsets. */
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

/* Write the axes, the unit and the user's text as an XML comment. Put blanks between hyphens,
 * because an XML comment must not hold "--". Replace non-ASCII bytes by "?", because the text may
 * have been cut within a character. */
static void write_notes(const mesh_writer *writer, FILE *out) {
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
  if (writer->comment[0] != '\0') {
    write_text("note", writer->comment, out);
  }
  if (file->times != NULL) {
    write_numbers(file, &(supine_mesh_field){"time_s", 1, file->times}, out);
  }
  for (size_t i = 0; i < writer->options.field_count; ++i) {
    write_numbers(file, &writer->options.fields[i], out);
  }
  (void)fputs("</FieldData>\n", out);
}

/* Write the header of the file, which is everything before the arrays. Its length does not depend
 * on the offsets of the arrays. */
static void vtp_head(const vtp *file, FILE *out) {
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
  (void)fprintf(out, "</Polys>\n<PointData%s%s>\n",
                writer->options.from != NULL ? " Scalars=\"displacement_magnitude\"" : "",
                writer->options.normals != NULL ? " Normals=\"Normals\"" : "");
  for (size_t i = VTP_FIRST_OF_POINTS; i < file->array_count; ++i) {
    write_array(file, i, out);
  }
  (void)fputs("</PointData>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_", out);
}

static void vtp_foot(FILE *out) {
  (void)fputs("\n</AppendedData>\n</VTKFile>\n", out);
}

/* Compress the arrays into memory first, because the header of the file states their offsets. */
supine_status supine_mesh_save_vtp(const mesh_writer *writer) {
  SUPINE_FREED_BY(vtp_end) vtp file = {.writer = *writer, .frames = 1};
  char *bytes = NULL;
  size_t size = 0;
  SUPINE_TRY(vtp_begin(&file));
  FILE *memory = open_memstream(&bytes, &size);
  supine_status status = memory == NULL ? SUPINE_ERROR_MEMORY : vtp_frame(&file, memory);
  if (memory != NULL && fclose(memory) != 0) {
    status = SUPINE_ERROR_MEMORY;
  }
  if (status == SUPINE_OK) {
    vtp_head(&file, writer->out);
    (void)fwrite(bytes, 1, size, writer->out);
    vtp_foot(writer->out);
  }
  free(bytes);
  return status;
}

struct supine_mesh_series {
  supine_output output;
  vtp file;
};

supine_status supine_mesh_series_open(const char *path, const supine_mesh *mesh,
                                      const supine_mesh_save_options *options, size_t frames,
                                      const double *times, supine_mesh_series **series,
                                      supine_error *error) {
  *series = NULL;
  SUPINE_TRY(supine_mesh_writer_check(path, mesh, error));
  supine_mesh_series *made = calloc(1, sizeof *made);
  if (made == NULL) {
    return supine_error_memory(error, "writing %s", path);
  }
  supine_status status = supine_output_open(path, &made->output, error);
  if (status == SUPINE_OK && fseeko(made->output.file, 0, SEEK_SET) != 0) {
    status =
        supine_error_set(error, SUPINE_ERROR_WRITE,
                         "%s: a series cannot be written into a pipe or device: give a file", path);
  }
  supine_mesh_writer_begin(mesh, options, &made->file.writer);
  made->file.frames = frames;
  made->file.times = times;
  if (status == SUPINE_OK && vtp_begin(&made->file) != SUPINE_OK) {
    status = supine_error_memory(error, "writing %s", path);
  }
  if (status != SUPINE_OK) {
    supine_mesh_series_close(made);
    return status;
  }
  vtp_head(&made->file, made->output.file);
  *series = made;
  return SUPINE_OK;
}

supine_status supine_mesh_series_add(supine_mesh_series *series, supine_error *error) {
  const char *path = series->output.path;
  SUPINE_TRY(supine_mesh_writer_check(path, series->file.writer.mesh, error));
  return vtp_frame(&series->file, series->output.file) == SUPINE_OK
             ? SUPINE_OK
             : supine_error_memory(error, "writing %s", path);
}

supine_status supine_mesh_series_commit(supine_mesh_series *series, supine_error *error) {
  vtp_foot(series->output.file);
  (void)fseeko(series->output.file, 0, SEEK_SET);
  vtp_head(&series->file, series->output.file);
  return supine_output_commit(&series->output, error);
}

void supine_mesh_series_close(supine_mesh_series *series) {
  if (series != NULL) {
    supine_output_abandon(&series->output);
    vtp_end(&series->file);
    free(series);
  }
}
