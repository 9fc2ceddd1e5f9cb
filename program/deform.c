/* SPDX-License-Identifier: GPL-3.0-or-later */
/* supine deform: a basis, a direction of gravity and a volume in, a deformed surface out. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/mesh.h"
#include "sh/base/vec3.h"
#include <supine/runtime.h>

#include "program/deform_content.h"
#include "program/options/basis_input.h"
#include "program/options/orientation.h"
#include "program/options/volume.h"

static const char name[] = "deform";

typedef struct request {
  supine_orientation orientation;
  supine_volume_options volume;
  bool has_scale, as_scanned;
  double scale;
  supine_deform_content content;
} request;

static const supine_option table[] = {
    {"output", 'o', "FILE",
     ".ply, .obj, .stl or .vtp; PLY and VTP carry the displacement; what is inside also goes into "
     ".csv, images into .nrrd, .nii or .nii.gz",
     SUPINE_FILLS(request, content.path), .file = SUPINE_FILE_OUT,
     .endings = ".ply, .obj, .stl, .vtp, .csv, .nrrd, .nii or .nii.gz"},
    {.table = supine_options_volume, SUPINE_FILLS(request, volume)},
    {"scale", 0, "MM", "largest displacement instead, mm: for open surfaces",
     SUPINE_FILLS(request, scale), SUPINE_SAYS_GIVEN(request, has_scale), .wants = "millimetres",
     .rivals = "breath"},
    {.table = supine_options_as_scanned, SUPINE_FILLS(request, as_scanned)},
    {.table = supine_options_orientation, SUPINE_FILLS(request, orientation)},
    {.table = supine_command_deform_content_options, SUPINE_FILLS(request, content)},
    {.name = NULL}};

/* Positions at the given scales as doubles, for measuring and saving; normals [N, 3] where they are
 * not NULL. */
static supine_status deformed_mesh(const supine_basis *basis, const double *weights,
                                   const double *scales, supine_mesh *mesh, float *normals) {
  const size_t n = mesh->vertex_count;
  float *xyz = malloc(3 * n * sizeof *xyz);
  if (xyz == NULL) {
    return SUPINE_ERROR_MEMORY;
  }
  supine_deform(basis, weights, scales, xyz);
  if (normals != NULL) {
    supine_normals(basis, xyz, normals);
  }
  for (size_t i = 0; i < 3 * n; ++i) {
    mesh->vertices[i] = (double)xyz[i];
  }
  free(xyz);
  return SUPINE_OK;
}

static double largest_displacement(const supine_mesh *rest, const supine_mesh *mesh) {
  double largest = 0.0;
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    const double *a = rest->vertices + 3 * i;
    const double *b = mesh->vertices + 3 * i;
    largest = fmax(largest, supine_distance(b, a));
  }
  return largest;
}

/* Breath scales for what was asked: a largest displacement, or volumes. */
static int find_scales(const supine_basis *basis, const request *wanted, const double gravity[3],
                       const double *weights, const supine_mesh *rest, supine_mesh *mesh,
                       double *scales) {
  const size_t lungs = supine_basis_get_info(basis)->lung_count;
  if (!wanted->has_scale) {
    return supine_options_volume_scales(basis, name, &wanted->volume, gravity, weights, scales);
  }
  for (size_t j = 0; j < lungs; ++j) {
    scales[j] = 1.0;
  }
  supine_error error = {SUPINE_ERROR_MEMORY, "out of memory"};
  if (deformed_mesh(basis, weights, scales, mesh, NULL) != SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  const double largest = largest_displacement(rest, mesh);
  if (!(largest > 0.0)) {
    supine_options_say(name, "nothing moves in this direction: no scale gives %g mm",
                       wanted->scale);
    return SUPINE_EXIT_NUMERICAL;
  }
  for (size_t j = 0; j < lungs; ++j) {
    scales[j] = wanted->scale / largest;
  }
  return SUPINE_EXIT_OK;
}

/* Over 60 lines: what a surface needs is made in one place and freed in one. */
static int deform(const supine_basis *basis, const request *wanted, const double gravity[3]) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  double weights[SUPINE_MODES_MAX];
  double scales[SUPINE_LUNGS_MAX] = {0};
  supine_mesh rest = {0};
  supine_mesh mesh = {0};
  float *normals = NULL;
  supine_error error = {SUPINE_ERROR_MEMORY, "out of memory"};
  int result = SUPINE_EXIT_OK;
  if (supine_options_basis_rest_mesh(basis, &rest) != SUPINE_OK ||
      supine_options_basis_rest_mesh(basis, &mesh) != SUPINE_OK ||
      supine_basis_weights(basis, gravity, weights) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
    goto cleanup;
  }
  result = find_scales(basis, wanted, gravity, weights, &rest, &mesh, scales);
  if (result != SUPINE_EXIT_OK) {
    goto cleanup;
  }
  if (supine_command_deform_content_wanted(&wanted->content)) {
    result = supine_command_deform_content(&wanted->content, name, basis, weights, scales);
    goto cleanup;
  }
  supine_mesh_save_options save = {.rest = rest.vertices};
  result = supine_options_basis_frame(basis, name, wanted->as_scanned, &save);
  if (result != SUPINE_EXIT_OK) {
    goto cleanup;
  }
  const supine_tensor *lung = supine_basis_tensor(basis, "lung");
  double volumes[SUPINE_LUNGS_MAX];
  const supine_mesh_field fields[] = {{"gravity_LPS", 3, gravity},
                                      {"volume_mL", info->lung_count, volumes}};
  for (size_t i = 0; info->has_volume && i < info->lung_count; ++i) {
    volumes[i] = supine_basis_lung_volume(basis, i, weights, scales[i]);
  }
  normals = malloc(3 * mesh.vertex_count * sizeof *normals);
  if (normals == NULL || deformed_mesh(basis, weights, scales, &mesh, normals) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
    goto cleanup;
  }
  save.normals = mesh.triangle_count > 0 ? normals : NULL; /* points inside have none */
  save.lung = lung == NULL ? NULL : lung->data;
  save.fields = fields;
  save.field_count = info->has_volume ? 2 : 1;
  const double largest = largest_displacement(&rest, &mesh);
  const double gained = 1e-3 * (supine_mesh_volume(&mesh) - supine_mesh_volume(&rest));
  if (supine_mesh_save(wanted->content.path, &mesh, &save, &error) != SUPINE_OK) {
    result = supine_options_fail(name, &error);
    goto cleanup;
  }
  (void)printf("%s: gravity %.4g,%.4g,%.4g, largest displacement %.3f mm", wanted->content.path,
               gravity[0], gravity[1], gravity[2], largest);
  if (info->has_volume && supine_basis_metadata(basis, "content") == NULL) {
    (void)printf(", %+.2f mL%s", gained,
                 info->resting_volume != NULL ? " from full inflation" : "");
  }
  (void)putchar('\n');
  result = supine_options_finish(name);
cleanup:
  supine_mesh_free(&rest);
  supine_mesh_free(&mesh);
  free(normals);
  return result;
}

static int run(void *chosen, const supine_arguments *given) {
  const request *wanted = chosen;
  const supine_basis_options exact = {sizeof exact,
                                      .storage = SUPINE_STORAGE_EXACT}; /* one frame, for a file */
  supine_basis *basis = NULL;
  supine_error error;
  double gravity[3];
  int result = supine_command_deform_content_check(&wanted->content, name);
  if (result == SUPINE_EXIT_OK) {
    result = supine_options_orientation_finish(&wanted->orientation, name, gravity);
  }
  if (result != SUPINE_EXIT_OK) {
    return result;
  }
  if (supine_basis_open_with(given->operand[0], &exact, &basis, &error) != SUPINE_OK) {
    return supine_options_fail(name, &error);
  }
  result = deform(basis, wanted, gravity);
  supine_basis_close(basis);
  return result;
}

const supine_command supine_command_deform = {
    name,
    "deform a basis for a posture and a volume",
    .usage = "BASIS --posture NAME [--volume ML] -o FILE",
    .about = "Deforms the lungs of a basis file for any direction of gravity and any volume and "
             "writes the surface. This is what the run-time library does each frame.",
    .options = table,
    .notes = "Examples:\n"
             "  supine deform lungs.safetensors --posture prone --volume 500 -o prone.vtp\n"
             "  supine deform lungs.safetensors --gravity 0.6,0,-0.8 --volume left=100,right=250 "
             "-o out.ply\n"
             "  supine deform nodules.safetensors --posture prone -o nodules-prone.csv\n"
             "  supine deform grid.safetensors --posture prone --image ct.nii.gz -o prone.nii.gz",
    SUPINE_ONE_BASIS,
    .request_size = sizeof(request),
    .run = run};
