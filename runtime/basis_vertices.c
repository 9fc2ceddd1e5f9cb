/* SPDX-License-Identifier: MIT */
/* Check the normals, the rigid parts and the names of the vertices of a basis file. */
#include "base/arena.h"
#include "runtime/basis_check.h"

/* Check the optional tensors 'normals' and 'normal_weights'. Both or neither must exist. */
static supine_status check_normals(const supine_check *c, supine_basis *basis) {
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
    return supine_check_refuse(c, "the basis of vertex normals has %zu modes, not 1 to %d",
                               info->normal_count, SUPINE_NORMAL_MODES_MAX);
  }
  size_t weights[] = {info->lung_count, info->normal_count, 3, terms};
  REQUIRE(info->normal_weights, c, "normal_weights", SUPINE_F64, 4, weights);
  return SUPINE_OK;
}

static bool is_in_one_lung(const supine_basis *basis, const uint32_t range[2]) {
  for (size_t lung = 0; lung < basis->info.lung_count; ++lung) {
    if (range[0] >= basis->lung_begin[lung] && range[0] < range[1] &&
        range[1] <= basis->lung_begin[lung + 1]) {
      return true;
    }
  }
  return false;
}

/* Check the optional tensor 'rigid'. Each row must be a range of vertices of one lung. */
static supine_status check_rigid(const supine_check *c, supine_basis *basis) {
  const supine_tensor *rigid = supine_safetensors_find(c->file, "rigid");
  if (rigid == NULL) {
    return SUPINE_OK;
  }
  bool well = rigid->dtype == SUPINE_U32 && rigid->rank == 2 && rigid->shape[1] == 2;
  const size_t rows = well ? rigid->shape[0] : 0;
  for (size_t i = 0; i < rows; ++i) {
    well = well && is_in_one_lung(basis, (const uint32_t *)rigid->data + 2 * i);
  }
  if (!well) {
    return supine_check_refuse(
        c, "each row of tensor 'rigid' must be a U32 range of one lung's vertices");
  }
  basis->rigid = rigid->data;
  basis->rigid_count = rigid->shape[0];
  return SUPINE_OK;
}

/* Check the optional tensors 'part' and 'names': the name of each vertex is a line of the text. */
static supine_status check_names(const supine_check *c, supine_basis *basis) {
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
      return supine_check_refuse(c, "vertex %zu has name %u, but tensor 'names' has %zu", i,
                                 line[i], lines);
    }
  }
  return SUPINE_OK;
}

supine_status supine_check_vertices(const supine_check *c, supine_basis *basis) {
  SUPINE_TRY(check_normals(c, basis));
  SUPINE_TRY(check_rigid(c, basis));
  return check_names(c, basis);
}
