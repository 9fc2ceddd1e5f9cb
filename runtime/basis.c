/* SPDX-License-Identifier: MIT */
/* Open basis files, and check every tensor before anything uses it. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <supine/sh.h>

#include "base/arena.h"
#include "base/number.h"
#include "runtime/checks.h"
#include "runtime/clusters.h"
#include "runtime/kriging.h"
#include "runtime/lung.h"
#include "runtime/safetensors/safetensors_file.h"
#include "runtime/simulated.h"

/* A file to check, and the name of the file in messages. */
typedef struct check {
  const supine_safetensors *file;
  const char *name;
  supine_error *error;
} check;

static supine_status SUPINE_PRINTF(2, 3) refuse(const check *c, const char *format, ...) {
  char detail[256];
  va_list arguments;
  va_start(arguments, format);
  (void)supine_print_text_list(detail, sizeof detail, format, arguments);
  va_end(arguments);
  const bool embedded = supine_safetensors_metadata(c->file, "content") != NULL;
  return supine_error_set(c->error, SUPINE_ERROR_FORMAT, "%s: %s: %s", c->name, detail,
                          embedded ? "embed its content again" : "make the basis again");
}

/* Return whether all numbers are finite and below 2^30 in magnitude, as all numbers of a valid file
 * are. Infinity and NaN have larger exponent bits, so that one comparison of bits suffices. */
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
  size_t bad = 0;
  for (size_t i = 0; i < count; ++i) {
    bad += fabs(values[i]) < 0x1p30 ? 0 : 1; /* the comparison is false for NaN */
  }
  return bad == 0;
}

/* Check all numbers of all tensors of the file, also of those that this library does not read. */
static supine_status check_numbers(const check *c, supine_basis *basis) {
  (void)basis;
  for (size_t i = 0; i < c->file->tensor_count; ++i) {
    const supine_tensor *tensor = &c->file->tensors[i];
    const size_t bytes = supine_safetensors_size(tensor);
    if ((tensor->dtype == SUPINE_F32 && !finite_floats(tensor->data, bytes / sizeof(float))) ||
        (tensor->dtype == SUPINE_F64 && !finite_doubles(tensor->data, bytes / sizeof(double)))) {
      return refuse(c, "tensor '%s' has a number that is not finite, or 2^30 or more",
                    tensor->name);
    }
  }
  return SUPINE_OK;
}

/* Length to pass to require() for an axis that may have any length. */
#define ANY SIZE_MAX

/* Find a tensor and check its type and shape. Replace each ANY in `shape` by the length of
 * that axis. Return the numbers of the tensor; if a check fails, set the error and return NULL. */
static const void *require(const check *c, const char *name, supine_dtype dtype, size_t rank,
                           size_t *shape) {
  const supine_tensor *tensor = supine_safetensors_find(c->file, name);
  if (tensor == NULL || tensor->dtype != dtype || tensor->rank != rank) {
    (void)refuse(c, "tensor '%s' is missing or has a wrong type or number of axes", name);
    return NULL;
  }
  for (size_t i = 0; i < rank; ++i) {
    shape[i] = shape[i] == ANY ? tensor->shape[i] : shape[i];
    if (tensor->shape[i] != shape[i]) {
      (void)refuse(c, "axis %zu of tensor '%s' has length %zu, not %zu", i, name, tensor->shape[i],
                   shape[i]);
      return NULL;
    }
  }
  return tensor->data;
}

/* Set a pointer to the numbers of a tensor by require(). If a check fails, return from the calling
 * function. */
#define REQUIRE(pointer, ...)                                                                      \
  do {                                                                                             \
    (pointer) = require(__VA_ARGS__);                                                              \
    if ((pointer) == NULL) {                                                                       \
      return SUPINE_ERROR_FORMAT;                                                                  \
    }                                                                                              \
  } while (0)

/* Check the metadata "format", "version" and "kind", and the checksum. */
static supine_status check_metadata(const check *c, supine_basis_info *info) {
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
    return refuse(c, "the file format has version %.16s, but this library reads version 4",
                  version == NULL ? "unknown" : version);
  }
  if (kind == NULL || (strcmp(kind, "scalar") != 0 && strcmp(kind, "vector") != 0)) {
    return refuse(c, "metadata 'kind' is neither scalar nor vector");
  }
  info->vector = strcmp(kind, "vector") == 0;
  return supine_safetensors_verify(c->file, c->error);
}

static supine_status check_surface(const check *c, supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  size_t vertices[2] = {ANY, 3};
  size_t triangles[2] = {ANY, 3};
  uint32_t highest = 0;
  REQUIRE(info->vertices, c, "vertices", SUPINE_F32, 2, vertices);
  REQUIRE(info->triangles, c, "triangles", SUPINE_U32, 2, triangles);
  info->vertex_count = vertices[0];
  info->triangle_count = triangles[0];
  for (size_t i = 0; i < 3 * info->triangle_count; ++i) {
    highest = info->triangles[i] > highest ? info->triangles[i] : highest;
  }
  if (info->vertex_count < 1 || info->vertex_count > UINT32_MAX) {
    return refuse(c, "the number of vertices is %zu, not 1 to 4294967295", info->vertex_count);
  }
  if (highest >= info->vertex_count) {
    return refuse(c, "a triangle refers to vertex %u, but the number of vertices is %zu", highest,
                  info->vertex_count);
  }
  return SUPINE_OK;
}

/* Check the tensors of a basis of clusters, whose coefficients are not stored. */
static supine_status check_clusters(const check *c, supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  size_t cluster[] = {info->vertex_count};
  size_t scalars[] = {info->vertex_count, 2};
  size_t vectors[] = {ANY, ANY, SUPINE_CLUSTER_NUMBERS};
  REQUIRE(info->cluster, c, "clusters", SUPINE_U16, 1, cluster);
  REQUIRE(info->cluster_scalars, c, "cluster_scalars", SUPINE_I16, 2, scalars);
  REQUIRE(info->cluster_vectors, c, "cluster_vectors", SUPINE_F32, 3, vectors);
  info->cluster_count = vectors[0];
  info->mode_count = vectors[1];
  if (!info->vector || info->cluster_count < 1 || info->cluster_count > SUPINE_CLUSTERS_MAX) {
    return refuse(c, "%zu clusters of a basis of kind %s, not 1 to %d of kind vector",
                  info->cluster_count, info->vector ? "vector" : "scalar", SUPINE_CLUSTERS_MAX);
  }
  for (size_t i = 0; i < info->vertex_count; ++i) {
    if (info->cluster[i] >= info->cluster_count) {
      return refuse(c, "vertex %zu is in cluster %u of %zu", i, info->cluster[i],
                    info->cluster_count);
    }
  }
  return SUPINE_OK;
}

/* Check the tensors of the coefficients, and the number of modes. */
static supine_status check_field(const check *c, supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  const size_t n = info->vertex_count;
  const size_t rank = info->vector ? 3 : 2;
  size_t shape[] = {n, info->vector ? 3 : ANY, ANY};
  size_t direction[] = {n, 3};
  if (supine_safetensors_find(c->file, "clusters") != NULL) {
    SUPINE_TRY(check_clusters(c, basis));
  } else {
    REQUIRE(info->coefficients, c, "coefficients", SUPINE_F32, rank, shape);
    info->mode_count = shape[rank - 1];
  }
  if (info->mode_count < 1 || info->mode_count > SUPINE_MODES_MAX) {
    return refuse(c, "the number of modes is %zu, not 1 to %d", info->mode_count, SUPINE_MODES_MAX);
  }
  if (!info->vector) {
    REQUIRE(info->direction, c, "direction", SUPINE_F32, 2, direction);
  }
  return SUPINE_OK;
}

static supine_status check_modes(const check *c, supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  size_t shape[] = {info->mode_count, ANY, ANY};
  REQUIRE(info->modes, c, "modes", SUPINE_F64, 3, shape);
  while (info->band < SUPINE_SH_BAND_MAX && supine_sh_count(info->band) < shape[1]) {
    ++info->band;
  }
  if (shape[1] != supine_sh_count(info->band)) {
    return refuse(c, "tensor 'modes' has %zu harmonics, not (L + 1)^2 for an L from 0 to %d",
                  shape[1], SUPINE_SH_BAND_MAX);
  }
  if (shape[2] < 1 || shape[2] > SUPINE_SH_ORDER_MAX + 1) {
    return refuse(c, "tensor 'modes' has %zu polynomials of the volume, not 1 to %d", shape[2],
                  SUPINE_SH_ORDER_MAX + 1);
  }
  info->order = shape[2] - 1;
  return SUPINE_OK;
}

/* Find the lung of each cluster. All vertices of a cluster must belong to one lung. */
static supine_status find_lungs_of_clusters(const check *c, supine_basis *basis) {
  const supine_basis_info *info = &basis->info;
  memset(basis->cluster_lung, SUPINE_LUNGS_MAX, sizeof basis->cluster_lung);
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    for (size_t i = info->lung_begin[lung]; i < info->lung_begin[lung + 1]; ++i) {
      unsigned char *of = &basis->cluster_lung[info->cluster[i]];
      if (*of != SUPINE_LUNGS_MAX && *of != lung) {
        return refuse(c, "cluster %u has vertices of two lungs", info->cluster[i]);
      }
      *of = (unsigned char)lung;
    }
  }
  return SUPINE_OK;
}

/* Check that a pose has room for the weights of every lung, and find the lungs of clusters. */
static supine_status check_weights(const check *c, supine_basis *basis) {
  const supine_basis_info *info = &basis->info;
  if (info->cluster_count > 0) {
    SUPINE_TRY(find_lungs_of_clusters(c, basis));
  }
  if (supine_basis_weight_count(basis) > SUPINE_MODES_MAX) {
    return refuse(c, "%zu modes for each of %zu lungs are more than %d weights", info->mode_count,
                  info->lung_count, SUPINE_MODES_MAX);
  }
  return SUPINE_OK;
}

static void bound_lungs(supine_basis *basis) {
  for (size_t axis = 0; axis < 3; ++axis) {
    basis->box[0][axis] = INFINITY;
    basis->box[1][axis] = -INFINITY;
  }
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    float(*box)[3] = basis->bounds[lung];
    const size_t begin = 3 * basis->lung_begin[lung];
    for (size_t i = begin; i < 3 * basis->lung_begin[lung + 1]; ++i) {
      const float x = basis->info.vertices[i];
      const size_t axis = (i - begin) % 3;
      box[0][axis] = i < begin + 3 || x < box[0][axis] ? x : box[0][axis];
      box[1][axis] = i < begin + 3 || x > box[1][axis] ? x : box[1][axis];
      basis->box[0][axis] = fmin(basis->box[0][axis], (double)x);
      basis->box[1][axis] = fmax(basis->box[1][axis], (double)x);
    }
  }
  basis->info.bounds = basis->bounds[0][0];
}

/* Read the names of the lungs from the metadata "lungs", such as "left,right". Name the remaining
 * lungs by their indices. Return the number of names in the metadata. */
static size_t name_lungs(const check *c, supine_basis *basis) {
  const char *at = supine_safetensors_metadata(c->file, "lungs");
  size_t named = 0;
  for (size_t lung = 0; lung < SUPINE_LUNGS_MAX; ++lung) {
    const size_t length = at == NULL ? 0 : strcspn(at, ",");
    named += at != NULL;
    basis->name_of[lung] = basis->names[lung];
    if (length > 0) {
      (void)snprintf(basis->names[lung], LUNG_NAME_SIZE, "%.*s", (int)length, at);
    } else {
      (void)snprintf(basis->names[lung], LUNG_NAME_SIZE, "%zu", lung);
    }
    at = at == NULL || at[length] == '\0' ? NULL : at + length + 1;
  }
  basis->info.lung_names = basis->name_of;
  return named;
}

/* Check that tensor 'lung' groups the vertices by lung (0 ... 0 1 ... 1 2 ...), and find where each
 * lung begins. A lung named in the metadata may have no vertices. */
static supine_status check_lungs(const check *c, supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  size_t n = info->vertex_count;
  const unsigned char *lung = NULL;
  REQUIRE(lung, c, "lung", SUPINE_U8, 1, &n);
  const size_t named = name_lungs(c, basis);
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
    return refuse(
        c,
        "vertex %zu belongs to lung %u, but vertices must be grouped by lung, from 0 to at most %d",
        at, lung[at], SUPINE_LUNGS_MAX - 1);
  }
  while (count < named) {
    basis->lung_begin[count++] = n;
  }
  basis->lung_begin[count] = n;
  info->lung_count = count;
  info->lung_begin = basis->lung_begin;
  bound_lungs(basis);
  return SUPINE_OK;
}

/* Check the tensors volume_linear, volume_quadratic and volume_cubic. Either all or none must
 * exist. */
static supine_status check_volume(const check *c, supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  const size_t g = info->lung_count;
  const size_t k = info->mode_count;
  size_t by_axis[] = {g, 3, k, k};
  size_t cubic[] = {g, k, k, k};
  static const char *const names[] = {"volume_linear", "volume_quadratic", "volume_cubic"};
  for (size_t i = 0; i < 3; ++i) {
    info->has_volume = info->has_volume || supine_safetensors_find(c->file, names[i]) != NULL;
  }
  if (!info->has_volume) {
    return SUPINE_OK;
  }
  REQUIRE(info->volume_linear, c, names[0], SUPINE_F64, 3, by_axis);
  REQUIRE(info->volume_quadratic, c, names[1], SUPINE_F64, 4, by_axis);
  REQUIRE(info->volume_cubic, c, names[2], SUPINE_F64, 4, cubic);
  return SUPINE_OK;
}

/* Parse the metadata `key`, which must hold `count` numbers separated by commas. Leave `values`
 * unchanged if the file has no such metadata. */
static supine_status read_numbers(const check *c, const char *key, size_t count, double *values) {
  const char *const text = supine_safetensors_metadata(c->file, key);
  const char *at = text;
  for (size_t i = 0; at != NULL && i < count; ++i) {
    char *end = NULL;
    values[i] = supine_number_parse(at, &end);
    if (end == at || *end != (i + 1 < count ? ',' : '\0') || !isfinite(values[i])) {
      return refuse(c, "metadata '%s' is not a list of %zu finite number%s: %.48s", key, count,
                    count == 1 ? "" : "s", text);
    }
    at = end + 1;
  }
  return SUPINE_OK;
}

/* For each lung, add the volume that the reference surface encloses, mL, to `reference_volume`. */
static void measure_lungs(supine_basis *basis) {
  const supine_basis_info *info = &basis->info;
  for (size_t t = 0; t < info->triangle_count;) {
    const size_t lung = supine_basis_lung_of(info, info->triangles[3 * t]);
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

/* Set the volume of the reference surface of each lung, mL. Measure the volume, unless the file was
 * made by 'supine embed': such a file lacks this surface and has the volume in its metadata. */
static supine_status check_reference(const check *c, supine_basis *basis) {
  basis->info.reference_volume = basis->reference_volume;
  if (!basis->info.has_volume) {
    return SUPINE_OK;
  }
  if (supine_safetensors_metadata(c->file, "content") == NULL ||
      supine_safetensors_metadata(c->file, "reference_volume_ml") == NULL) {
    measure_lungs(basis);
    return SUPINE_OK;
  }
  return read_numbers(c, "reference_volume_ml", basis->info.lung_count, basis->reference_volume);
}

/* Read the metadata about the scan and about full inflation. If the posture and volume in the scan
 * are missing, assume supine and the volume of the reference surface. */
static supine_status check_scan(const check *c, supine_basis *basis) {
  const char *volume = supine_safetensors_metadata(c->file, "scan_volume_ml");
  const char *scanned = supine_safetensors_metadata(c->file, "scanned");
  const char *route = supine_safetensors_metadata(c->file, "route");
  double by_lung[SUPINE_LUNGS_MAX] = {0};
  const size_t count = volume != NULL && strchr(volume, ',') != NULL ? basis->info.lung_count : 1;
  basis->scan_gravity[1] = 1;
  basis->info.is_fields = route != NULL && strcmp(route, "fields") == 0;
  basis->info.has_full = basis->info.has_rest || (scanned != NULL && strcmp(scanned, "full") == 0);
  if (read_numbers(c, "scan_volume_ml", count, by_lung) != SUPINE_OK ||
      read_numbers(c, "scan_gravity", 3, basis->scan_gravity) != SUPINE_OK ||
      read_numbers(c, "full_upright_gain", 1, &basis->upright_gain) != SUPINE_OK ||
      read_numbers(c, "bend", 3, basis->info.bend) != SUPINE_OK) {
    return SUPINE_ERROR_FORMAT;
  }
  for (size_t i = 0; i < count; ++i) {
    basis->scan_volume += by_lung[i];
  }
  if (supine_safetensors_metadata(c->file, "bend") != NULL && !basis->info.has_rest) {
    return refuse(c, "metadata 'bend' requires a tensor 'resting_volume'");
  }
  return SUPINE_OK;
}

/* Check the optional tensors 'resting_volume' and 'full_volume': spherical-harmonic coefficients of
 * the volumes of each lung at rest and, of simulated volumes, at full inflation. */
static supine_status check_rest(const check *c, supine_basis *basis) {
  size_t shape[2] = {basis->info.lung_count, RESTING_TERMS};
  if (supine_safetensors_find(c->file, "resting_volume") != NULL) {
    REQUIRE(basis->resting, c, "resting_volume", SUPINE_F64, 2, shape);
    basis->info.has_rest = true;
  }
  if (supine_safetensors_find(c->file, "full_volume") != NULL) {
    REQUIRE(basis->simulated.full, c, "full_volume", SUPINE_F64, 2, shape);
  }
  return SUPINE_OK;
}

/* Check the tensors and metadata of fields that depend on volume. Only they know full inflation by
 * a tensor of its own. */
static supine_status check_simulated(const check *c, supine_basis *basis) {
  const size_t lungs = basis->info.lung_count;
  supine_simulated *s = &basis->simulated;
  size_t range[] = {lungs, 2};
  size_t limits[] = {lungs, 2, ANY};
  size_t shares[] = {lungs, RESTING_TERMS, ANY};
  if (basis->info.order == 0) {
    return SUPINE_OK;
  }
  REQUIRE(s->range, c, "simulated_range", SUPINE_F64, 2, range);
  REQUIRE(s->limits, c, "simulated_limits", SUPINE_F64, 3, limits);
  REQUIRE(s->shares, c, "simulated_shares", SUPINE_F64, 3, shares);
  s->share_count = shares[2];
  s->limit_terms = limits[2];
  size_t band = 0;
  while (band < LIMIT_BAND_MAX && supine_sh_count(band) < s->limit_terms) {
    ++band;
  }
  if (supine_sh_count(band) != s->limit_terms) {
    return refuse(c, "tensor 'simulated_limits' has harmonics that are not complete");
  }
  basis->info.is_fields = true;
  basis->info.has_full = s->full != NULL;
  SUPINE_TRY(read_numbers(c, "simulated_total_ml", 2, s->total));
  bool rising = s->total[0] < s->total[1];
  for (size_t lung = 0; lung < lungs; ++lung) {
    rising = rising && s->range[2 * lung] < s->range[2 * lung + 1];
  }
  if (!rising || s->share_count < 1 || s->share_count > SUPINE_SH_ORDER_MAX + 1 ||
      !basis->info.has_volume) {
    return refuse(c, "the simulated volumes have no range, or the surface has no volume");
  }
  if (supine_safetensors_metadata(c->file, "scan_gravity") != NULL &&
      supine_simulated_find_offsets(basis, s->offset) != SUPINE_OK) {
    return refuse(c, "metadata 'scan_gravity' is not a direction");
  }
  return supine_simulated_find_default(basis, &s->usual);
}

/* Read the optional metadata about lungs that the file holds as collapsed: the factor on their
 * lengths in the scan minus 1, and the hilum about which they have shrunk, which moves. */
static supine_status check_collapse(const check *c, supine_basis *basis) {
  static const double most = 100;
  const size_t count = basis->info.lung_count;
  if (supine_safetensors_metadata(c->file, "lung_hilum_mm") == NULL) {
    return SUPINE_OK;
  }
  SUPINE_TRY(read_numbers(c, "lung_expansion", count, basis->scan_expansion));
  SUPINE_TRY(read_numbers(c, "lung_hilum_mm", 3 * count, basis->hilum[0]));
  bool good = supine_pose_is_finite(basis->hilum[0], 3 * count);
  for (size_t lung = 0; lung < count; ++lung) {
    good = good && basis->scan_expansion[lung] >= 0 && basis->scan_expansion[lung] <= most;
  }
  if (!good) {
    return refuse(c, "metadata 'lung_expansion' or 'lung_hilum_mm' is out of range");
  }
  basis->info.hilum = basis->hilum[0];
  if (supine_safetensors_find(c->file, "lungs_hilum") != NULL) {
    size_t shape[3] = {count, 3, basis->info.mode_count};
    REQUIRE(basis->hilum_modes, c, "lungs_hilum", SUPINE_F64, 3, shape);
    const size_t numbers = shape[0] * shape[1] * shape[2];
    if (!supine_pose_is_finite(basis->hilum_modes, numbers)) {
      return refuse(c, "tensor 'lungs_hilum' has numbers out of range");
    }
  }
  return SUPINE_OK;
}

/* Check the optional tensor 'volume_range': the volumes that each lung can hold. */
static supine_status check_range(const check *c, supine_basis *basis) {
  if (supine_safetensors_find(c->file, "volume_range") == NULL) {
    return SUPINE_OK;
  }
  size_t shape[3] = {SUPINE_RANGE_NODES, basis->info.lung_count, 2};
  REQUIRE(basis->volume_range, c, "volume_range", SUPINE_F64, 3, shape);
  return SUPINE_OK;
}

/* Check the optional tensors 'normals' and 'normal_weights'. Both or neither must exist. */
static supine_status check_normals(const check *c, supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  const size_t terms = supine_basis_normal_terms(basis);
  size_t shape[] = {info->vertex_count, 3, ANY};
  const supine_tensor *tensor = supine_safetensors_find(c->file, "normals");
  if (tensor == NULL && supine_safetensors_find(c->file, "normal_weights") == NULL) {
    return SUPINE_OK;
  }
  REQUIRE(info->normals, c, "normals", SUPINE_I8, 3, shape);
  info->normal_count = shape[2] > 0 ? shape[2] - 1 : 0;
  if (info->normal_count < 1 || info->normal_count > SUPINE_NORMAL_MODES_MAX) {
    return refuse(c, "the basis of vertex normals has %zu modes, not 1 to %d", info->normal_count,
                  SUPINE_NORMAL_MODES_MAX);
  }
  size_t weights[] = {info->lung_count, info->normal_count, 3, terms};
  REQUIRE(info->normal_weights, c, "normal_weights", SUPINE_F64, 4, weights);
  return SUPINE_OK;
}

/* Check the optional tensors of a fit of landmarks: 'landmarks' and 'error_share'. */
static supine_status check_landmarks(const check *c, supine_basis *basis) {
  size_t n = basis->info.vertex_count;
  size_t landmarks[2] = {ANY, 4};
  if (supine_safetensors_find(c->file, "error_share") == NULL) {
    return SUPINE_OK;
  }
  if (supine_safetensors_find(c->file, "landmarks") != NULL) {
    REQUIRE(basis->landmarks, c, "landmarks", SUPINE_F32, 2, landmarks);
    const char *text = supine_safetensors_metadata(c->file, "expected_error_share");
    basis->landmark_count = landmarks[0];
    basis->held_out = text == NULL ? 0 : supine_number_parse(text, NULL);
    if (basis->landmark_count > SUPINE_KRIGING_LANDMARKS_MAX || !(basis->held_out > 0)) {
      return refuse(c,
                    "it has %zu landmarks, more than %d, or no share at points that were held "
                    "out",
                    basis->landmark_count, (int)SUPINE_KRIGING_LANDMARKS_MAX);
    }
    for (size_t i = 0; i < 4 * basis->landmark_count; ++i) {
      if (!(fabsf(basis->landmarks[i]) < 1e6F)) {
        return refuse(c, "tensor 'landmarks' has %g in row %zu", (double)basis->landmarks[i],
                      i / 4);
      }
    }
  }
  REQUIRE(basis->error_share, c, "error_share", SUPINE_F32, 1, &n);
  for (size_t i = 0; i < n; ++i) {
    if (!(basis->error_share[i] >= 0 && basis->error_share[i] <= 1e6F)) {
      return refuse(c, "tensor 'error_share' has %g at vertex %zu, not 0 to 1e6",
                    (double)basis->error_share[i], i);
    }
  }
  return SUPINE_OK;
}

/* Check the optional tensor 'error_volume' of another simulator's fields over volume. */
static supine_status check_volume_errors(const check *c, supine_basis *basis) {
  size_t count = ANY;
  if (basis->info.order == 0 || supine_safetensors_find(c->file, "error_volume") == NULL) {
    return SUPINE_OK;
  }
  REQUIRE(basis->error_volume, c, "error_volume", SUPINE_F64, 1, &count);
  double least = count < 2 ? -1 : 0;
  for (size_t i = 0; i < count; ++i) {
    least = fmin(least, basis->error_volume[i]);
  }
  if (least < 0) {
    return refuse(c, "tensor 'error_volume' has less than two numbers, or one below 0");
  }
  basis->error_volume_count = count;
  return SUPINE_OK;
}

/* Check the optional tensors 'error_vertices' and 'error_gravity' of another simulator's fields. */
static supine_status check_vertex_errors(const check *c, supine_basis *basis) {
  size_t n = basis->info.vertex_count;
  if (!basis->info.is_fields || supine_safetensors_find(c->file, "error_vertices") == NULL) {
    return SUPINE_OK;
  }
  REQUIRE(basis->vertex_error, c, "error_vertices", SUPINE_F32, 1, &n);
  for (size_t i = 0; i < n; ++i) {
    if (!(basis->vertex_error[i] >= 0)) {
      return refuse(c, "tensor 'error_vertices' has %g mm at vertex %zu, below 0",
                    (double)basis->vertex_error[i], i);
    }
  }
  if (supine_safetensors_find(c->file, "error_gravity") == NULL) {
    return SUPINE_OK;
  }
  const size_t band = basis->info.band;
  size_t shape[] = {2 * band + 4, supine_sh_count(band + 1)};
  if (band > FIT_BAND_MAX) {
    return refuse(c, "tensor 'error_gravity' belongs to band %zu, above %d", band, FIT_BAND_MAX);
  }
  REQUIRE(basis->error_gravity, c, "error_gravity", SUPINE_F64, 2, shape);
  return check_volume_errors(c, basis);
}

/* Check the optional metadata with the constants of expected errors (expected.c). */
static supine_status check_errors(const check *c, supine_basis *basis) {
  static const char *const keys[] = {"expected_error_mm", "expected_error_from_mm",
                                     "resting_spread"};
  static const double most = 1e3;
  (void)basis;
  for (size_t i = 0; i < sizeof keys / sizeof *keys; ++i) {
    double value = 1;
    SUPINE_TRY(read_numbers(c, keys[i], 1, &value));
    if (!(value > 0 && value <= most)) {
      return refuse(c, "metadata '%s' is %g: it must be above 0 and at most %g", keys[i], value,
                    most);
    }
  }
  return SUPINE_OK;
}

/* Check the optional tensors 'part' and 'names': the name of each vertex is a line of the text. */
static supine_status check_names(const check *c, supine_basis *basis) {
  const supine_tensor *names = supine_safetensors_find(c->file, "names");
  const supine_tensor *part = supine_safetensors_find(c->file, "part");
  if (names == NULL || part == NULL) {
    return SUPINE_OK;
  }
  size_t size = ANY;
  size_t n = basis->info.vertex_count;
  const char *text = NULL;
  const uint32_t *line = NULL;
  size_t lines = 1;
  REQUIRE(text, c, "names", SUPINE_U8, 1, &size);
  REQUIRE(line, c, "part", SUPINE_U32, 1, &n);
  for (size_t i = 0; i < size; ++i) {
    lines += text[i] == '\n';
  }
  for (size_t i = 0; i < n; ++i) {
    if (line[i] >= lines) {
      return refuse(c, "vertex %zu has name %u, but tensor 'names' has %zu", i, line[i], lines);
    }
  }
  return SUPINE_OK;
}

/* Identify what determines the meaning of a pose: the modes and the coefficients of the volumes. */
static supine_status identify(const check *c, supine_basis *basis) {
  static const char *const names[] = {"modes",           "volume_linear",   "volume_quadratic",
                                      "volume_cubic",    "simulated_range", "simulated_limits",
                                      "simulated_shares"};
  for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
    const supine_tensor *tensor = supine_safetensors_find(c->file, names[i]);
    basis->info.identity += supine_safetensors_checksum(tensor, tensor == NULL ? 0 : 1, NULL, 0);
  }
  return SUPINE_OK;
}

/* Choose the instruction set, and pack the tensors for evaluation. For SUPINE_STORAGE_AUTO, choose
 * the smallest storage whose position error is at most error_limit_mm. */
static supine_status prepare(const check *c, supine_basis *basis,
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

/* Check the optional tensor 'rigid'. Each row must be a range of vertices of one lung. */
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
    return refuse(c, "each row of tensor 'rigid' must be a U32 range of one lung's vertices");
  }
  basis->rigid = rigid->data;
  basis->rigid_count = rigid->shape[0];
  return SUPINE_OK;
}

/* Check the optional tensors from which the expected errors of embedded points are computed: the
 * box around the lungs, and the mean products of the coefficients of their vertices. */
static supine_status check_expected(const check *c, supine_basis *basis) {
  const size_t k = basis->info.mode_count;
  size_t corners[] = {2, 3};
  size_t products[] = {basis->info.lung_count, 3, k, k};
  if (supine_safetensors_find(c->file, "lungs_squares") != NULL) {
    const double *box = NULL;
    REQUIRE(box, c, "lungs_box", SUPINE_F64, 2, corners);
    REQUIRE(basis->squares, c, "lungs_squares", SUPINE_F64, 4, products);
    memcpy(basis->box, box, sizeof basis->box);
  }
  basis->midline = 0.5 * (basis->box[0][0] + basis->box[1][0]);
  return read_numbers(c, "midline_mm", 1, &basis->midline);
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
  const check c = {file, name, error};
  SUPINE_TRY(check_metadata(&c, &basis->info));
  static supine_status (*const steps[])(const check *, supine_basis *) = {
      check_numbers, check_surface,   check_field,     check_modes,         check_lungs,
      check_weights, check_volume,    check_reference, check_rest,          check_range,
      check_scan,    check_simulated, check_normals,   check_rigid,         check_expected,
      check_errors,  check_collapse,  check_names,     check_vertex_errors, check_landmarks,
      identify};
  for (size_t i = 0; i < sizeof steps / sizeof *steps; ++i) {
    SUPINE_TRY(steps[i](&c, basis));
  }
  supine_status status = prepare(&c, basis, &taken);
  char detail[256];
  if (status == SUPINE_OK && !supine_basis_is_plausible(basis, detail, sizeof detail)) {
    status = refuse(&c, "%s", detail);
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
