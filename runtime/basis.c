/* SPDX-License-Identifier: MIT */
/* Opening a basis file: every tensor is checked before anything uses it. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <supine/sh.h>

#include "runtime/internal.h"
#include "runtime/safetensors/platform.h"

/* The file that is being checked, and where its name and a failure go. */
typedef struct check {
  const supine_safetensors *file;
  const char *name;
  supine_error *error;
} check;

static supine_status SUPINE_PRINTF(2, 3) refuse(const check *c, const char *format, ...) {
  char detail[256];
  va_list arguments;
  va_start(arguments, format);
  (void)vsnprintf(detail, sizeof detail, format, arguments);
  va_end(arguments);
  return supine_error_set(c->error, SUPINE_ERROR_FORMAT, "%s: %s", c->name, detail);
}

/* The tensor `name` when it is there, of that type and rank; otherwise NULL, with the reason. */
static const supine_tensor *want(const check *c, const char *name, supine_dtype dtype,
                                 size_t rank) {
  const supine_tensor *tensor = supine_safetensors_find(c->file, name);
  if (tensor == NULL || tensor->dtype != dtype || tensor->rank != rank) {
    (void)refuse(c, "tensor '%s' is missing, or not of the type and rank of a basis file", name);
    return NULL;
  }
  return tensor;
}

/* The same with every axis given. */
static const void *want_shape(const check *c, const char *name, supine_dtype dtype, size_t rank,
                              const size_t *shape) {
  const supine_tensor *tensor = want(c, name, dtype, rank);
  for (size_t i = 0; tensor != NULL && i < rank; ++i) {
    if (tensor->shape[i] != shape[i]) {
      (void)refuse(c, "axis %zu of tensor '%s' is %zu instead of %zu", i, name, tensor->shape[i],
                   shape[i]);
      return NULL;
    }
  }
  return tensor == NULL ? NULL : tensor->data;
}

/* No lung has a number of 2^30 or more in any unit here; with all below it, sums over 256 modes of
 * the products of three stay finite. Without a branch an element, so that it runs at the speed of
 * memory: the exponent decides, also for what is infinite or NaN. */
static bool finite_floats(const float *values, size_t count) {
  size_t bad = 0;
  for (size_t i = 0; i < count; ++i) {
    uint32_t bits = 0;
    memcpy(&bits, &values[i], sizeof bits);
    bad += (bits & 0x7F800000U) >= (127U + 30U) << 23;
  }
  return bad == 0;
}

static bool finite_doubles(const double *values, size_t count) {
  for (size_t i = 0; i < count; ++i) {
    if (!(fabs(values[i]) < 0x1p30)) {
      return false;
    }
  }
  return true;
}

/* kind, format, version; sets info.vector. */
static supine_status check_metadata(const check *c, supine_basis_info *info) {
  const char *format = supine_safetensors_metadata(c->file, "format");
  const char *version = supine_safetensors_metadata(c->file, "version");
  const char *kind = supine_safetensors_metadata(c->file, "kind");
  if (format == NULL || strcmp(format, "supine-basis") != 0) {
    return refuse(c, "a safetensors file, but not a Supine basis: make one with 'supine "
                     "precompute'");
  }
  if (version == NULL || strlen(version) != 1 || strchr("123", version[0]) == NULL) {
    return refuse(c, "basis version %.16s; this program reads versions 1 to 3",
                  version == NULL ? "unknown" : version);
  }
  info->volume_axes = version[0] == '3' ? 3 : 1;
  if (kind == NULL || (strcmp(kind, "scalar") != 0 && strcmp(kind, "vector") != 0)) {
    return refuse(c, "the kind in the file is neither scalar nor vector");
  }
  info->vector = strcmp(kind, "vector") == 0;
  return supine_safetensors_verify(c->file, c->error);
}

static supine_status check_surface(const check *c, supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  const supine_tensor *vertices = want(c, "vertices", SUPINE_F32, 2);
  const supine_tensor *triangles = want(c, "triangles", SUPINE_U32, 2);
  if (vertices == NULL || triangles == NULL) {
    return SUPINE_ERROR_FORMAT;
  }
  info->vertex_count = vertices->shape[0];
  info->triangle_count = triangles->shape[0];
  if (vertices->shape[1] != 3 || triangles->shape[1] != 3 || info->vertex_count == 0 ||
      info->vertex_count > UINT32_MAX) {
    return refuse(c, "vertices and triangles must be [N, 3], N from 1 to 4294967295");
  }
  basis->info.vertices = vertices->data;
  basis->info.triangles = triangles->data;
  uint32_t highest = 0;
  for (size_t i = 0; i < 3 * info->triangle_count; ++i) {
    highest = basis->info.triangles[i] > highest ? basis->info.triangles[i] : highest;
  }
  if (highest >= info->vertex_count) {
    return refuse(c, "a triangle names vertex %u of %zu", highest, info->vertex_count);
  }
  return finite_floats(basis->info.vertices, 3 * info->vertex_count)
             ? SUPINE_OK
             : refuse(c, "a vertex is not finite, or 2^30 and more");
}

static supine_status check_field(const check *c, supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  const size_t n = info->vertex_count;
  const size_t rank = info->vector ? 3 : 2;
  const supine_tensor *coefficients = want(c, "coefficients", SUPINE_F32, rank);
  if (coefficients == NULL) {
    return SUPINE_ERROR_FORMAT;
  }
  const size_t modes = coefficients->shape[rank - 1];
  if (coefficients->shape[0] != n || (info->vector && coefficients->shape[1] != 3) || modes < 1 ||
      modes > SUPINE_MODES_MAX) {
    return refuse(c, "coefficients must be [N, K] or [N, 3, K], N = %zu, K from 1 to %d", n,
                  SUPINE_MODES_MAX);
  }
  info->mode_count = modes;
  basis->info.coefficients = coefficients->data;
  if (!finite_floats(basis->info.coefficients, n * modes * (info->vector ? 3 : 1))) {
    return refuse(c, "a coefficient is not finite, or 2^30 and more");
  }
  if (info->vector) {
    return SUPINE_OK;
  }
  basis->info.direction = want_shape(c, "direction", SUPINE_F32, 2, (size_t[]){n, 3});
  if (basis->info.direction == NULL) {
    return SUPINE_ERROR_FORMAT;
  }
  return finite_floats(basis->info.direction, 3 * n)
             ? SUPINE_OK
             : refuse(c, "a direction is not finite, or 2^30 and more");
}

static supine_status check_modes(const check *c, supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  const supine_tensor *modes = want(c, "modes", SUPINE_F64, 2);
  if (modes == NULL) {
    return SUPINE_ERROR_FORMAT;
  }
  while (info->band < SUPINE_SH_BAND_MAX && supine_sh_count(info->band) < modes->shape[1]) {
    ++info->band;
  }
  if (modes->shape[0] != info->mode_count || modes->shape[1] != supine_sh_count(info->band)) {
    return refuse(c, "modes must be [K, (L + 1)^2], K = %zu, L from 0 to %d", info->mode_count,
                  SUPINE_SH_BAND_MAX);
  }
  basis->info.modes = modes->data;
  return finite_doubles(basis->info.modes, info->mode_count * modes->shape[1])
             ? SUPINE_OK
             : refuse(c, "a mode is not finite, or 2^30 and more");
}

/* "left,right" of the metadata; what it does not name is numbered. */
static void name_lungs(const supine_safetensors *file, supine_basis *basis) {
  const char *at = supine_safetensors_metadata(file, "lungs");
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    const size_t length = at == NULL ? 0 : strcspn(at, ",");
    if (length > 0) {
      (void)snprintf(basis->names[lung], LUNG_NAME_SIZE, "%.*s", (int)length, at);
    } else {
      (void)snprintf(basis->names[lung], LUNG_NAME_SIZE, "%zu", lung);
    }
    at = at == NULL || at[length] == '\0' ? NULL : at + length + 1;
    basis->name_of[lung] = basis->names[lung];
  }
  basis->info.lung_names = basis->name_of;
}

static void bound_lungs(supine_basis *basis) {
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    if (basis->lung_begin[lung] == basis->lung_begin[lung + 1]) {
      continue;
    }
    float(*box)[3] = basis->bounds[lung];
    const float *p = basis->info.vertices + 3 * basis->lung_begin[lung];
    memcpy(box[0], p, sizeof box[0]);
    memcpy(box[1], p, sizeof box[1]);
    for (size_t i = basis->lung_begin[lung]; i < basis->lung_begin[lung + 1]; ++i, p += 3) {
      for (size_t axis = 0; axis < 3; ++axis) {
        box[0][axis] = p[axis] < box[0][axis] ? p[axis] : box[0][axis];
        box[1][axis] = p[axis] > box[1][axis] ? p[axis] : box[1][axis];
      }
    }
  }
  basis->info.bounds = basis->bounds[0][0];
}

/* How many lungs the metadata names. */
static size_t named_lungs(const check *c) {
  const char *names = supine_safetensors_metadata(c->file, "lungs");
  size_t count = names != NULL;
  for (; names != NULL && *names != '\0'; ++names) {
    count += *names == ',';
  }
  return count < SUPINE_LUNGS_MAX ? count : SUPINE_LUNGS_MAX;
}

/* Lungs come one after the other: 0 ... 0 1 ... 1 2 ... Those that the metadata names may be empty:
 * what is carried along inside may lie in one lung alone. */
static supine_status check_lungs(const check *c, supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  const size_t n = info->vertex_count;
  const unsigned char *lung = want_shape(c, "lung", SUPINE_U8, 1, &n);
  if (lung == NULL) {
    return SUPINE_ERROR_FORMAT;
  }
  const size_t named = named_lungs(c);
  size_t at = 0;
  size_t count = 0;
  while (at < n && count < SUPINE_LUNGS_MAX &&
         (lung[at] == count || (lung[at] > count && lung[at] < named))) {
    while (count <= lung[at]) {
      basis->lung_begin[count++] = at;
    }
    while (at < n && lung[at] + 1U == count) {
      ++at;
    }
  }
  if (at != n) {
    return refuse(c, "vertex %zu is of lung %u: vertices must be grouped by lung, 0 to at most %d",
                  at, lung[at], SUPINE_LUNGS_MAX - 1);
  }
  while (count < named) {
    basis->lung_begin[count++] = n;
  }
  basis->lung_begin[count] = n;
  info->lung_count = count;
  info->lung_begin = basis->lung_begin;
  name_lungs(c->file, basis);
  bound_lungs(basis);
  return SUPINE_OK;
}

static supine_status check_volume(const check *c, supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  const size_t g = info->lung_count;
  const size_t k = info->mode_count;
  const size_t axes = info->volume_axes;
  const size_t together[] = {g, k, k, k};
  const size_t by_axis[] = {g, axes, k, k};
  static const char *const names[] = {"volume_linear", "volume_quadratic", "volume_cubic"};
  const double **const forms[] = {&info->volume_linear, &info->volume_quadratic,
                                  &info->volume_cubic};
  size_t present = 0;
  for (size_t i = 0; i < 3; ++i) {
    present += supine_safetensors_find(c->file, names[i]) != NULL;
  }
  if (present == 0) {
    return SUPINE_OK;
  }
  size_t count = g;
  for (size_t i = 0; i < 3; ++i) {
    const bool axis = axes == 3 && i < 2;
    *forms[i] = want_shape(c, names[i], SUPINE_F64, i + 2 + axis, axis ? by_axis : together);
    if (*forms[i] == NULL) {
      return SUPINE_ERROR_FORMAT;
    }
    count *= k;
    if (!finite_doubles(*forms[i], axis ? axes * count : count)) {
      return refuse(c, "%s is not finite, or 2^30 and more", names[i]);
    }
  }
  info->has_volume = true;
  return SUPINE_OK;
}

/* Read `count` numbers, separated by commas, of a metadata string; false where it has others. */
static bool read_numbers(const char *text, size_t count, double *values) {
  for (size_t i = 0; i < count; ++i) {
    char *end = NULL;
    values[i] = strtod(text, &end);
    if (end == text || *end != (i + 1 < count ? ',' : '\0') || !isfinite(values[i])) {
      return false;
    }
    text = end + 1;
  }
  return true;
}

/* Compute the volume in mL that each lung of the reference surface encloses. */
static void measure_lungs(supine_basis *basis) {
  const supine_basis_info *info = &basis->info;
  for (size_t t = 0; t < info->triangle_count;) {
    size_t lung = 0;
    while (info->triangles[3 * t] >= info->lung_begin[lung + 1]) {
      ++lung;
    }
    const float *origin = info->vertices + 3 * info->lung_begin[lung];
    double volume = basis->reference_volume[lung];
    for (; t < info->triangle_count && info->triangles[3 * t] >= info->lung_begin[lung] &&
           info->triangles[3 * t] < info->lung_begin[lung + 1];
         ++t) {
      double p[3][3];
      for (size_t i = 0; i < 9; ++i) {
        const size_t corner = info->triangles[3 * t + i / 3];
        p[i / 3][i % 3] = (double)info->vertices[3 * corner + i % 3] - (double)origin[i % 3];
      }
      for (size_t i = 0; i < 3; ++i) {
        const size_t j = (i + 1) % 3;
        const size_t k = (i + 2) % 3;
        volume += 1e-3 / 6 * p[0][i] * (p[1][j] * p[2][k] - p[1][k] * p[2][j]);
      }
    }
    basis->reference_volume[lung] = volume;
  }
}

/* The volume of the reference, by lung. Content has not the lungs' surface: its file states them.
 */
static supine_status check_reference(const check *c, supine_basis *basis) {
  const char *stated = supine_safetensors_metadata(c->file, "reference_volume_ml");
  basis->info.reference_volume = basis->reference_volume;
  if (!basis->info.has_volume) {
    return SUPINE_OK;
  }
  if (supine_safetensors_metadata(c->file, "content") == NULL || stated == NULL) {
    measure_lungs(basis);
    return SUPINE_OK;
  }
  return read_numbers(stated, basis->info.lung_count, basis->reference_volume)
             ? SUPINE_OK
             : refuse(c, "reference_volume_ml has no number for each lung: %.32s", stated);
}

/* The scan's state: a file of fields, or of a scan taken as it is, has its surface as reference. */
static supine_status check_scan(const check *c, supine_basis *basis) {
  const char *volume = supine_safetensors_metadata(c->file, "scan_volume_ml");
  const char *gravity = supine_safetensors_metadata(c->file, "scan_gravity");
  const char *scanned = supine_safetensors_metadata(c->file, "scanned");
  const char *upright = supine_safetensors_metadata(c->file, "full_upright_gain");
  const char *route = supine_safetensors_metadata(c->file, "route");
  const char *bend = supine_safetensors_metadata(c->file, "bend");
  double by_lung[SUPINE_LUNGS_MAX] = {0};
  const size_t count = volume != NULL && strchr(volume, ',') != NULL ? basis->info.lung_count : 1;
  if (volume != NULL && !read_numbers(volume, count, by_lung)) {
    return refuse(c, "scan_volume_ml is no number: %.32s", volume);
  }
  for (size_t i = 0; i < count; ++i) {
    basis->scan_volume += by_lung[i];
  }
  basis->scan_gravity[1] = 1;
  if (gravity != NULL && !read_numbers(gravity, 3, basis->scan_gravity)) {
    return refuse(c, "scan_gravity is not three numbers: %.48s", gravity);
  }
  if (upright != NULL && !read_numbers(upright, 1, &basis->upright_gain)) {
    return refuse(c, "full_upright_gain is no number: %.16s", upright);
  }
  if (bend != NULL && (!read_numbers(bend, 3, basis->info.bend) || !basis->rest_by_lung)) {
    return refuse(c, "bend is not three numbers, or volumes at rest are not by lung: %.48s", bend);
  }
  basis->info.is_fields = route != NULL && strcmp(route, "fields") == 0;
  basis->info.has_full = basis->info.has_rest || (scanned != NULL && strcmp(scanned, "full") == 0);
  return SUPINE_OK;
}

/* Volumes at rest: by lung, or of all lungs together in files of version 1 and 2. */
static supine_status check_rest(const check *c, supine_basis *basis) {
  const supine_tensor *tensor = supine_safetensors_find(c->file, "resting_volume");
  if (tensor == NULL) {
    return SUPINE_OK;
  }
  const size_t shape[2] = {basis->info.lung_count, RESTING_TERMS};
  basis->rest_by_lung = tensor->rank == 2;
  const size_t rank = basis->rest_by_lung ? 2 : 1;
  basis->resting = want_shape(c, "resting_volume", SUPINE_F64, rank, shape + 2 - rank);
  if (basis->resting == NULL) {
    return SUPINE_ERROR_FORMAT;
  }
  basis->info.has_rest = true;
  return finite_doubles(basis->resting, rank == 2 ? shape[0] * shape[1] : shape[1])
             ? SUPINE_OK
             : refuse(c, "resting_volume is not finite, or 2^30 and more");
}

/* Normals are optional: the modes and their weights, or neither. */
static supine_status check_normals(const check *c, supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  const size_t axes = info->volume_axes;
  const size_t terms = supine_basis_normal_terms(basis);
  if (supine_safetensors_find(c->file, "normals") == NULL &&
      supine_safetensors_find(c->file, "normal_weights") == NULL) {
    return SUPINE_OK;
  }
  const supine_tensor *normals = want(c, "normals", SUPINE_I16, 3);
  if (normals == NULL) {
    return SUPINE_ERROR_FORMAT;
  }
  const size_t count = normals->shape[2];
  if (normals->shape[0] != info->vertex_count || normals->shape[1] != 3 || count < 1 ||
      count > SUPINE_NORMAL_MODES_MAX) {
    return refuse(c, "normals must be [N, 3, Q], N = %zu, Q from 1 to %d", info->vertex_count,
                  SUPINE_NORMAL_MODES_MAX);
  }
  info->normals = normals->data;
  info->normal_weights = want_shape(c, "normal_weights", SUPINE_F64, axes == 3 ? 4 : 3,
                                    axes == 3 ? (size_t[]){info->lung_count, count, 3, terms}
                                              : (size_t[]){info->lung_count, count, terms});
  if (info->normal_weights == NULL) {
    return SUPINE_ERROR_FORMAT;
  }
  info->normal_count = count;
  return finite_doubles(info->normal_weights, info->lung_count * count * axes * terms)
             ? SUPINE_OK
             : refuse(c, "normal_weights is not finite");
}

/* Chooses the code and packs: AUTO is the smallest storage that is accurate enough. */
static supine_status prepare(const check *c, supine_basis *basis,
                             const supine_basis_options *options) {
  static const double error_limit = 0.005; /* mm */
  supine_storage storage = options->storage;
  supine_simd simd = options->simd;
  if ((int)storage < 0 || storage >= SUPINE_STORAGE_COUNT || (int)simd < 0 ||
      simd >= SUPINE_SIMD_COUNT) {
    return supine_error_set(c->error, SUPINE_ERROR_ARGUMENT, "unknown storage or code: %d, %d",
                            (int)storage, (int)simd);
  }
  basis->kernels = supine_kernels_choose(&simd);
  if (basis->kernels == NULL) {
    return supine_error_set(c->error, SUPINE_ERROR_UNSUPPORTED,
                            "this processor or build lacks the instructions asked for");
  }
  basis->info.simd = simd;
  const bool choose = storage == SUPINE_STORAGE_AUTO;
  if (choose || storage == SUPINE_STORAGE_MIXED) { /* the smallest first */
    const bool thirds = supine_tiles_thirds(SUPINE_STORAGE_MIXED, basis->info.mode_count) > 0;
    storage = thirds ? SUPINE_STORAGE_MIXED : SUPINE_STORAGE_INT16;
  }
  supine_status status = SUPINE_OK;
  for (;;) {
    status = supine_basis_pack(basis, storage);
    if (status != SUPINE_OK) {
      break;
    }
    basis->info.storage_error = supine_basis_storage_error(basis);
    if (!choose || storage == SUPINE_STORAGE_EXACT || basis->info.storage_error <= error_limit) {
      break;
    }
    storage = storage == SUPINE_STORAGE_MIXED ? SUPINE_STORAGE_INT16 : SUPINE_STORAGE_EXACT;
  }
  if (options->without_normals) {
    basis->info.normal_count = 0;
    basis->info.normals = NULL;
    basis->info.normal_weights = NULL;
  }
  if (status == SUPINE_OK && basis->info.normal_count > 0) {
    status = supine_basis_pack_normals(basis);
  }
  if (status != SUPINE_OK) {
    return supine_error_set(c->error, status, "%s: out of memory", c->name);
  }
  const double bytes = basis->info.bytes_per_vertex + 3 * sizeof(float);
  basis->stream = (double)basis->info.vertex_count * bytes > STREAM_BYTES;
  basis->prefetch = basis->stream ? supine_kernels_prefetch_choose() : SUPINE_PREFETCH_NONE;
  return SUPINE_OK;
}

/* Options of a program that knew fewer of them: the others are zero. */
static supine_status take_options(const check *c, const supine_basis_options *options,
                                  supine_basis_options *taken) {
  const size_t oldest = offsetof(supine_basis_options, simd) + sizeof options->simd;
  *taken = (supine_basis_options){.size = sizeof *taken};
  if (options == NULL) {
    return SUPINE_OK;
  }
  if (options->size < oldest) {
    return supine_error_set(c->error, SUPINE_ERROR_ARGUMENT,
                            "options of %zu bytes: set their size to sizeof(supine_basis_options)",
                            options->size);
  }
  memcpy(taken, options, options->size < sizeof *taken ? options->size : sizeof *taken);
  return SUPINE_OK;
}

/* Takes the file, whatever comes of it. */
/* Rigid parts are optional: ranges of vertices, each in one lung. */
static supine_status check_rigid(const check *c, supine_basis *basis) {
  const supine_tensor *rigid = supine_safetensors_find(c->file, "rigid");
  if (rigid == NULL) {
    return SUPINE_OK;
  }
  bool well = rigid->dtype == SUPINE_U32 && rigid->rank == 2 && rigid->shape[1] == 2;
  for (size_t i = 0; well && i < rigid->shape[0]; ++i) {
    const uint32_t *range = (const uint32_t *)rigid->data + 2 * i;
    well = false;
    for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
      well = well || (range[0] >= basis->lung_begin[lung] && range[0] < range[1] &&
                      range[1] <= basis->lung_begin[lung + 1]);
    }
  }
  if (!well) {
    return refuse(c, "rigid must be ranges of vertices, [R, 2], each in one lung");
  }
  basis->rigid = rigid->data;
  basis->rigid_count = rigid->shape[0];
  return SUPINE_OK;
}

static supine_status open_file(supine_safetensors *file, const char *name,
                               const supine_basis_options *options, supine_basis **result,
                               supine_error *error) {
  supine_basis_options taken;
  const check c = {file, name, error};
  supine_status status = SUPINE_ERROR_MEMORY;
  supine_basis *basis = calloc(1, sizeof *basis);
  *result = NULL;
  if (basis == NULL) {
    supine_safetensors_close(file);
    return supine_error_set(error, status, "%s: out of memory", name);
  }
  basis->file = file;
  status = check_metadata(&c, &basis->info);
  static supine_status (*const steps[])(const check *, supine_basis *) = {
      check_surface,   check_field, check_modes, check_lungs,   check_volume,
      check_reference, check_rest,  check_scan,  check_normals, check_rigid};
  for (size_t i = 0; status == SUPINE_OK && i < sizeof steps / sizeof *steps; ++i) {
    status = steps[i](&c, basis);
  }
  if (status == SUPINE_OK) {
    status = take_options(&c, options, &taken);
  }
  if (status == SUPINE_OK) {
    status = prepare(&c, basis, &taken);
  }
  if (status != SUPINE_OK) {
    supine_basis_close(basis);
    return status;
  }
  *result = basis;
  return SUPINE_OK;
}

supine_status supine_basis_open_with(const char *path, const supine_basis_options *options,
                                     supine_basis **basis, supine_error *error) {
  supine_safetensors *file = NULL;
  *basis = NULL;
  const supine_status status = supine_safetensors_open(path, &file, error);
  return status != SUPINE_OK ? status : open_file(file, path, options, basis, error);
}

supine_status supine_basis_open_memory_with(const void *bytes, size_t size,
                                            const supine_basis_options *options,
                                            supine_basis **basis, supine_error *error) {
  static const char name[] = "basis in memory";
  supine_safetensors *file = NULL;
  *basis = NULL;
  const supine_status status = supine_safetensors_open_memory(bytes, size, name, &file, error);
  return status != SUPINE_OK ? status : open_file(file, name, options, basis, error);
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
  supine_safetensors_close(basis->file);
  supine_platform_free(basis->tiles.bytes);
  supine_platform_free(basis->lit.bytes);
  free(basis);
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
