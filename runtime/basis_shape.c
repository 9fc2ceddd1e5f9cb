/* SPDX-License-Identifier: MIT */
/* Check the surface of a basis file, its coefficients and modes, and find the lungs. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <supine/sh.h>

#include "base/arena.h"
#include "runtime/basis_check.h"

static supine_status check_surface(const supine_check *c, supine_basis *basis) {
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
    return supine_check_refuse(c, "the number of vertices is %zu, not 1 to 4294967295",
                               info->vertex_count);
  }
  if (highest >= info->vertex_count) {
    return supine_check_refuse(c,
                               "a triangle refers to vertex %u, but the number of vertices is %zu",
                               highest, info->vertex_count);
  }
  return SUPINE_OK;
}

/* Check the tensors of a basis of clusters, whose coefficients are not stored. */
static supine_status check_clusters(const supine_check *c, supine_basis *basis) {
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
    return supine_check_refuse(c, "%zu clusters of a basis of kind %s, not 1 to %d of kind vector",
                               info->cluster_count, info->vector ? "vector" : "scalar",
                               SUPINE_CLUSTERS_MAX);
  }
  for (size_t i = 0; i < info->vertex_count; ++i) {
    if (info->cluster[i] >= info->cluster_count) {
      return supine_check_refuse(c, "vertex %zu is in cluster %u of %zu", i, info->cluster[i],
                                 info->cluster_count);
    }
  }
  return SUPINE_OK;
}

/* Check the tensors of the coefficients, and the number of modes. */
static supine_status check_field(const supine_check *c, supine_basis *basis) {
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
    return supine_check_refuse(c, "the number of modes is %zu, not 1 to %d", info->mode_count,
                               SUPINE_MODES_MAX);
  }
  if (!info->vector) {
    REQUIRE(info->direction, c, "direction", SUPINE_F32, 2, direction);
  }
  return SUPINE_OK;
}

static supine_status check_modes(const supine_check *c, supine_basis *basis) {
  supine_basis_info *info = &basis->info;
  size_t shape[] = {info->mode_count, ANY, ANY};
  REQUIRE(info->modes, c, "modes", SUPINE_F64, 3, shape);
  while (info->band < SUPINE_SH_BAND_MAX && supine_sh_count(info->band) < shape[1]) {
    ++info->band;
  }
  if (shape[1] != supine_sh_count(info->band)) {
    return supine_check_refuse(
        c, "tensor 'modes' has %zu harmonics, not (L + 1)^2 for an L from 0 to %d", shape[1],
        SUPINE_SH_BAND_MAX);
  }
  if (shape[2] < 1 || shape[2] > SUPINE_SH_ORDER_MAX + 1) {
    return supine_check_refuse(c, "tensor 'modes' has %zu polynomials of the volume, not 1 to %d",
                               shape[2], SUPINE_SH_ORDER_MAX + 1);
  }
  info->order = shape[2] - 1;
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
static size_t name_lungs(const supine_check *c, supine_basis *basis) {
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
static supine_status check_lungs(const supine_check *c, supine_basis *basis) {
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
    return supine_check_refuse(
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

/* Find the lung of each cluster. All vertices of a cluster must belong to one lung. */
static supine_status find_lungs_of_clusters(const supine_check *c, supine_basis *basis) {
  const supine_basis_info *info = &basis->info;
  memset(basis->cluster_lung, SUPINE_LUNGS_MAX, sizeof basis->cluster_lung);
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    for (size_t i = info->lung_begin[lung]; i < info->lung_begin[lung + 1]; ++i) {
      unsigned char *of = &basis->cluster_lung[info->cluster[i]];
      if (*of != SUPINE_LUNGS_MAX && *of != lung) {
        return supine_check_refuse(c, "cluster %u has vertices of two lungs", info->cluster[i]);
      }
      *of = (unsigned char)lung;
    }
  }
  return SUPINE_OK;
}

/* Check that a pose has room for the weights of every lung, and find the lungs of clusters. */
static supine_status check_weights(const supine_check *c, supine_basis *basis) {
  const supine_basis_info *info = &basis->info;
  if (info->cluster_count > 0) {
    SUPINE_TRY(find_lungs_of_clusters(c, basis));
  }
  if (supine_basis_weight_count(basis) > SUPINE_MODES_MAX) {
    return supine_check_refuse(c, "%zu modes for each of %zu lungs are more than %d weights",
                               info->mode_count, info->lung_count, SUPINE_MODES_MAX);
  }
  return SUPINE_OK;
}

supine_status supine_check_shape(const supine_check *c, supine_basis *basis) {
  SUPINE_TRY(check_surface(c, basis));
  SUPINE_TRY(check_field(c, basis));
  SUPINE_TRY(check_modes(c, basis));
  SUPINE_TRY(check_lungs(c, basis));
  return check_weights(c, basis);
}
