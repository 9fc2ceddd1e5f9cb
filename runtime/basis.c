/* SPDX-License-Identifier: MIT */
/* Open basis files, and prepare them for evaluation. */
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "runtime/basis_check.h"
#include "runtime/clusters.h"

/* Check the metadata "format", "version" and "kind", and the checksum. */
static supine_status check_metadata(const supine_check *c, supine_basis_info *info) {
  const char *format = supine_safetensors_metadata(c->file, "format");
  const char *version = supine_safetensors_metadata(c->file, "version");
  const char *kind = supine_safetensors_metadata(c->file, "kind");
  if (format == NULL || strcmp(format, "supine-basis") != 0) {
    return supine_error_set(c->error, SUPINE_ERROR_FORMAT,
                            "%s: a safetensors file, but not a Supine basis: give a basis, made "
                            "from the surface of lungs",
                            c->name);
  }
  if (version == NULL || strcmp(version, "4") != 0) {
    return supine_check_refuse(
        c, "the file format has version %.16s, but this library reads version 4",
        version == NULL ? "unknown" : version);
  }
  if (kind == NULL || (strcmp(kind, "scalar") != 0 && strcmp(kind, "vector") != 0)) {
    return supine_check_refuse(c, "metadata 'kind' is neither scalar nor vector");
  }
  info->vector = strcmp(kind, "vector") == 0;
  return supine_safetensors_verify(c->file, c->error);
}

/* Identify what determines the meaning of a pose: the modes and the coefficients of the volumes. */
static void identify(supine_basis *basis) {
  static const char *const names[] = {"modes",           "volume_linear",   "volume_quadratic",
                                      "volume_cubic",    "simulated_range", "simulated_limits",
                                      "simulated_shares"};
  for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
    const supine_tensor *tensor = supine_safetensors_find(basis->file, names[i]);
    basis->info.identity += supine_safetensors_checksum(tensor, tensor == NULL ? 0 : 1, NULL, 0);
  }
}

/* Choose the instruction set, and pack the tensors for evaluation. For SUPINE_STORAGE_AUTO, choose
 * the smallest storage whose position error is at most error_limit_mm. */
static supine_status prepare(const supine_check *c, supine_basis *basis,
                             const supine_basis_options *options) {
  static const double error_limit_mm = 0.005;
  supine_storage storage = options->storage;
  supine_simd simd = options->simd;
  if ((int)storage < 0 || storage >= SUPINE_STORAGE_COUNT || (int)simd < 0 ||
      simd >= SUPINE_SIMD_COUNT) {
    return supine_error_set(
        c->error, SUPINE_ERROR_ARGUMENT,
        "storage %d or instruction set %d is unknown: use values of supine_storage and supine_simd",
        (int)storage, (int)simd);
  }
  basis->kernels = supine_kernels_choose(&simd);
  if (basis->kernels == NULL) {
    return supine_error_set(
        c->error, SUPINE_ERROR_UNSUPPORTED,
        options->simd == SUPINE_SIMD_AUTO
            ? "SUPINE_SIMD names no instruction set of this processor or "
              "build: set it to portable, avx2 or avx512, or unset it"
            : "this processor or build lacks the instruction set: choose SUPINE_SIMD_AUTO");
  }
  basis->info.simd = simd;
  const bool clusters = basis->info.cluster_count > 0;
  const bool choose = storage == SUPINE_STORAGE_AUTO && !clusters;
  if (choose || storage == SUPINE_STORAGE_MIXED) {
    const bool thirds = supine_tiles_thirds(SUPINE_STORAGE_MIXED, basis->info.mode_count) > 0;
    storage = thirds ? SUPINE_STORAGE_MIXED : SUPINE_STORAGE_INT16;
  }
  for (;;) {
    if (clusters) {
      SUPINE_TRY(supine_clusters_pack(basis));
    } else {
      SUPINE_TRY(supine_basis_pack(basis, storage));
    }
    basis->info.storage_error = supine_basis_storage_error(basis);
    if (!choose || storage == SUPINE_STORAGE_EXACT || basis->info.storage_error <= error_limit_mm) {
      break;
    }
    storage = storage == SUPINE_STORAGE_MIXED ? SUPINE_STORAGE_INT16 : SUPINE_STORAGE_EXACT;
  }
  if (options->without_normals) {
    basis->info.normal_count = 0;
    basis->info.normals = NULL;
    basis->info.normal_weights = NULL;
  }
  if (basis->info.normal_count > 0) {
    SUPINE_TRY(supine_basis_pack_normals(basis));
  }
  const double bytes = basis->info.bytes_per_vertex + 3 * sizeof(float);
  basis->stream = (double)basis->info.vertex_count * bytes > STREAM_BYTES;
  basis->prefetch = basis->stream ? supine_kernels_prefetch_choose() : SUPINE_PREFETCH_NONE;
  return SUPINE_OK;
}

/* Copy the caller's options. Members that the struct of an older program lacks become 0. */
static supine_status take_options(const supine_basis_options *options, supine_basis_options *taken,
                                  supine_error *error) {
  const size_t oldest = offsetof(supine_basis_options, simd) + sizeof options->simd;
  *taken = (supine_basis_options){.size = sizeof *taken};
  if (options != NULL && options->size < oldest) {
    return supine_error_set(
        error, SUPINE_ERROR_ARGUMENT,
        "the size of the options is %zu: set it to sizeof(supine_basis_options)", options->size);
  }
  if (options != NULL) {
    memcpy(taken, options, options->size < sizeof *taken ? options->size : sizeof *taken);
  }
  return (taken->allocator.allocate == NULL) == (taken->allocator.release == NULL)
             ? SUPINE_OK
             : supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                "the allocator has only one function: set both or neither");
}

/* Close a basis; for SUPINE_FREED_BY. */
static void close_basis(supine_basis **basis) {
  supine_basis_close(*basis);
}

/* Open the `size` bytes of a file, or the file `name` if `bytes` is NULL. */
static supine_status open_file(const char *name, const void *bytes, size_t size,
                               const supine_basis_options *options, supine_basis **result,
                               supine_error *error) {
  supine_basis_options taken;
  supine_safetensors *file = NULL;
  *result = NULL;
  SUPINE_TRY(take_options(options, &taken, error));
  SUPINE_TRY(supine_safetensors_open_with(name, bytes, size, &taken.allocator, &file, error));
  SUPINE_FREED_BY(close_basis)
  supine_basis *basis = supine_safetensors_allocate(file, sizeof *basis);
  if (basis == NULL) {
    supine_safetensors_close(file);
    return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", name);
  }
  memset(basis, 0, sizeof *basis);
  basis->file = file;
  basis->allow_folds = taken.allow_folds;
  const supine_check c = {file, name, error};
  SUPINE_TRY(check_metadata(&c, &basis->info));
  SUPINE_TRY(supine_check_numbers(&c));
  SUPINE_TRY(supine_check_shape(&c, basis));
  SUPINE_TRY(supine_check_volumes(&c, basis));
  SUPINE_TRY(supine_check_vertices(&c, basis));
  SUPINE_TRY(supine_check_errors(&c, basis));
  identify(basis);
  supine_status status = prepare(&c, basis, &taken);
  char detail[256];
  if (status == SUPINE_OK && !supine_basis_is_plausible(basis, detail, sizeof detail)) {
    status = supine_check_refuse(&c, "%s", detail);
  }
  if (status == SUPINE_OK) {
    *result = basis;
    basis = NULL;
  }
  return status == SUPINE_ERROR_MEMORY ? supine_error_set(error, status, "%s: out of memory", name)
                                       : status;
}

supine_status supine_basis_open_with(const char *path, const supine_basis_options *options,
                                     supine_basis **basis, supine_error *error) {
  return open_file(path, NULL, 0, options, basis, error);
}

supine_status supine_basis_open_memory_with(const void *bytes, size_t size,
                                            const supine_basis_options *options,
                                            supine_basis **basis, supine_error *error) {
  return open_file("basis in memory", bytes != NULL ? bytes : "", size, options, basis, error);
}

supine_status supine_basis_open(const char *path, supine_basis **basis, supine_error *error) {
  return supine_basis_open_with(path, NULL, basis, error);
}

supine_status supine_basis_open_memory(const void *bytes, size_t size, supine_basis **basis,
                                       supine_error *error) {
  return supine_basis_open_memory_with(bytes, size, NULL, basis, error);
}

void supine_basis_close(supine_basis *basis) {
  if (basis == NULL) {
    return;
  }
  supine_safetensors *file = basis->file; /* its allocator frees the rest */
  supine_safetensors_release(file, basis->tiles.bytes);
  supine_safetensors_release(file, basis->lit.bytes);
  supine_safetensors_release(file, basis);
  supine_safetensors_close(file);
}

const supine_basis_info *supine_basis_get_info(const supine_basis *basis) {
  return &basis->info;
}

const char *supine_basis_metadata(const supine_basis *basis, const char *key) {
  return supine_safetensors_metadata(basis->file, key);
}

const supine_metadata *supine_basis_all_metadata(const supine_basis *basis, size_t *count) {
  return supine_safetensors_all_metadata(basis->file, count);
}

const supine_tensor *supine_basis_tensor(const supine_basis *basis, const char *name) {
  return supine_safetensors_find(basis->file, name);
}

const float *supine_basis_vertices(const supine_basis *basis) {
  return basis->info.vertices;
}

const uint32_t *supine_basis_triangles(const supine_basis *basis) {
  return basis->info.triangles;
}

const char *supine_version(void) {
  return SUPINE_VERSION;
}
