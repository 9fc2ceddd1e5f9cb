/* SPDX-License-Identifier: MIT */
/* Compress and write the arrays of a VTP file in VTK's format. */
#include <stdlib.h>

#include <libdeflate.h>

#include "sh/base/parallel.h"

#include "mesh/io/vtp.h"

/* Bytes compressed together, a multiple of every item's size, and libdeflate's level: 2 takes
 * half as long again for 5 % less. */
enum { BLOCK = 3 << 18, LEVEL = 1 };

static size_t room_of_block(void) {
  return libdeflate_zlib_compress_bound(NULL, BLOCK);
}

static void put_point(const vtp *file, size_t i, unsigned char **at) {
  float position[3];
  supine_mesh_writer_position(&file->writer, i, position);
  supine_mesh_put_f32(at, position, 3);
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

static void put_displacement(const vtp *file, size_t i, unsigned char **at) {
  float displacement[4];
  supine_mesh_writer_displacement(&file->writer, i, displacement);
  supine_mesh_put_f32(at, displacement, 3);
}

static void put_magnitude(const vtp *file, size_t i, unsigned char **at) {
  float displacement[4];
  supine_mesh_writer_displacement(&file->writer, i, displacement);
  supine_mesh_put_f32(at, displacement + 3, 1);
}

static void put_expected_error(const vtp *file, size_t i, unsigned char **at) {
  supine_mesh_put_f32(at, file->writer.expected_error + i, 1);
}

static void put_normal(const vtp *file, size_t i, unsigned char **at) {
  float normal[3];
  supine_mesh_writer_normal(&file->writer, i, normal);
  supine_mesh_put_f32(at, normal, 3);
}

static void put_lung(const vtp *file, size_t i, unsigned char **at) {
  *(*at)++ = file->writer.lung[i];
}

supine_status supine_mesh_vtp_begin(vtp *file) {
  const mesh_writer *writer = &file->writer;
  const size_t points = writer->mesh->vertex_count;
  const size_t triangles = writer->mesh->triangle_count;
  vtp_array *to = file->arrays;
  *to++ = (vtp_array){"Float32", "Points", 3, 12, points, false, put_point};
  *to++ = (vtp_array){"Int32", "connectivity", 1, 12, triangles, true, put_connectivity};
  *to++ = (vtp_array){"Int32", "offsets", 1, 4, triangles, true, put_offset};
  if (writer->rest != NULL) {
    *to++ = (vtp_array){"Float32", "displacement", 3, 12, points, false, put_displacement};
    *to++ = (vtp_array){"Float32", "displacement_magnitude", 1, 4, points, false, put_magnitude};
  }
  if (writer->expected_error != NULL) {
    *to++ = (vtp_array){"Float32", "expected_error_mm", 1, 4, points, false, put_expected_error};
  }
  if (writer->normals != NULL) {
    *to++ = (vtp_array){"Float32", "Normals", 3, 12, points, false, put_normal};
  }
  if (writer->lung != NULL) {
    *to++ = (vtp_array){"UInt8", "lung", 1, 1, points, true, put_lung};
  }
  file->array_count = (size_t)(to - file->arrays);
  file->offsets = calloc(file->frames * file->array_count, sizeof *file->offsets);
  const size_t blocks = 12 * (points > triangles ? points : triangles) / BLOCK + 1;
  file->threads = supine_thread_count();
  file->raw = malloc(file->threads * BLOCK);
  file->packed = malloc(blocks * room_of_block());
  file->sizes = calloc(blocks + 3, sizeof *file->sizes);
  if (file->offsets == NULL || file->raw == NULL || file->packed == NULL || file->sizes == NULL) {
    supine_mesh_vtp_end(file);
    return SUPINE_ERROR_MEMORY;
  }
  return SUPINE_OK;
}

void supine_mesh_vtp_end(vtp *file) {
  free(file->offsets);
  free(file->raw);
  free(file->packed);
  free(file->sizes);
  file->offsets = file->sizes = NULL;
  file->raw = file->packed = NULL;
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

/* Fill and compress blocks of an array, each into its own place in file->packed. */
static void pack_blocks(void *context, size_t begin, size_t end, size_t thread) {
  vtp *file = context;
  const vtp_array *array = file->packing;
  const size_t each = BLOCK / array->item;
  unsigned char *raw = file->raw + thread * BLOCK;
  for (size_t i = begin; i < end; ++i) {
    const size_t left = array->count - i * each;
    const size_t items = left < each ? left : each;
    unsigned char *at = raw;
    for (size_t k = 0; k < items; ++k) {
      array->put(file, i * each + k, &at);
    }
    struct libdeflate_compressor *compressor = libdeflate_alloc_compressor(LEVEL);
    file->sizes[3 + i] = /* 0: out of memory */
        compressor == NULL
            ? 0
            : libdeflate_zlib_compress(compressor, raw, (size_t)(at - raw),
                                       file->packed + i * room_of_block(), room_of_block());
    libdeflate_free_compressor(compressor);
  }
}

/* Write the number of blocks, their size, that of a shorter last one, their compressed sizes;
 * then the blocks. */
static supine_status put_array(vtp *file, const vtp_array *array, FILE *out) {
  const size_t bytes = array->item * array->count;
  const size_t blocks = (bytes + BLOCK - 1) / BLOCK;
  supine_status status = SUPINE_OK;
  file->packing = array;
  supine_parallel_for(blocks, 1, file->threads, pack_blocks, file);
  file->sizes[0] = blocks;
  file->sizes[1] = BLOCK;
  file->sizes[2] = bytes % BLOCK;
  put_sizes(out, file->sizes, blocks + 3);
  file->written += 8 * (blocks + 3);
  for (size_t i = 0; i < blocks; ++i) {
    (void)fwrite(file->packed + i * room_of_block(), 1, file->sizes[3 + i], out);
    file->written += file->sizes[3 + i];
    status = file->sizes[3 + i] > 0 ? status : SUPINE_ERROR_MEMORY;
  }
  return status;
}

supine_status supine_mesh_vtp_frame(vtp *file, FILE *out) {
  const size_t frame = file->next++;
  supine_status status = SUPINE_OK;
  for (size_t i = 0; i < file->array_count && status == SUPINE_OK; ++i) {
    uint64_t *offset = &file->offsets[frame * file->array_count + i];
    if (frame > 0 && file->arrays[i].still) {
      *offset = file->offsets[i];
    } else {
      *offset = file->written;
      status = put_array(file, &file->arrays[i], out);
    }
  }
  return status;
}
