/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write a deformed surface, and print its largest displacement and its volume. */
#include <math.h>
#include <string.h>

#include "base/arena.h"
#include "base/text.h"
#include "base/vec3.h"
#include "mesh/mesh.h"
#include "program/command/deform_content.h"
#include "program/options/facts.h"
#include "program/options/inside.h"

/* Return the volume of each lung with its range and source. */
static json_t *list_volumes(const supine_basis *basis, const supine_deformation *moved) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  json_t *lungs = json_object();
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    const supine_fact held = supine_basis_lung_volume(basis, &moved->state, &moved->pose, lung);
    (void)json_object_set_new(lungs, info->lung_names[lung],
                              supine_options_volume_json(&held, false));
  }
  return lungs;
}

/* Print the range of the volume of all lungs if it was assumed from other people. */
static void print_range(const supine_basis *basis, const supine_deformation *moved) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  double low = 0.0;
  double high = 0.0;
  bool assumed = false;
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    const supine_fact held = supine_basis_lung_volume(basis, &moved->state, &moved->pose, lung);
    low += isfinite(held.low) ? held.low : held.value;
    high += isfinite(held.high) ? held.high : held.value;
    assumed = assumed || isfinite(held.low);
  }
  if (assumed) {
    supine_options_line("; assumed from other people: %.0f to %.0f mL", low, high);
  }
  for (size_t lung = 0; lung < info->lung_count; ++lung) {
    const supine_fact held = supine_basis_lung_volume(basis, &moved->state, &moved->pose, lung);
    if (held.source == SUPINE_SOURCE_COLLAPSED) {
      supine_options_line("; the %s lung is collapsed: %.0f mL", held.name, held.value);
    }
  }
  SUPINE_ADD_RESULT(json_pack("{s:o}", "lungs_ml", list_volumes(basis, moved)));
}

/* Warn of each embedded part whose surface folds between the positions `from` and `to`. */
static supine_status tell_folds(const supine_basis *basis, const supine_mesh *from,
                                const supine_mesh *to, supine_error *error) {
  static const double visible = 0.002; /* share of turned triangles that is seen (mesh.h) */
  SUPINE_FREED_BY(supine_options_names_close) supine_options_names names = {0};
  SUPINE_ARENA arena = {0};
  SUPINE_TRY(supine_options_names_open(basis, &names, error));
  size_t *turned = supine_arena_zeros(&arena, names.count, sizeof *turned);
  size_t *count = supine_arena_zeros(&arena, names.count, sizeof *count);
  SUPINE_TRY(supine_arena_check(&arena, error, "the folds of %zu parts", names.count));
  for (size_t t = 0; t < from->triangle_count; ++t) {
    supine_mesh one = *from;
    one.triangles += 3 * t;
    one.triangle_count = 1;
    const uint32_t part = names.part[one.triangles[0]];
    ++count[part];
    turned[part] += supine_mesh_turned_over(&one, to->vertices) > 0.0;
  }
  for (size_t part = 0; part < names.count; ++part) {
    if ((double)turned[part] > visible * (double)count[part]) {
      supine_options_say("deform",
                         "warning: %s: its surface folds: %zu of its %zu triangles turn over: "
                         "choose a volume nearer to that of the scan",
                         names.text[part], turned[part], count[part]);
    }
  }
  return SUPINE_OK;
}

/* Move two meshes, and the normals of the second one, by the motions of a registration. */
static void register_mesh(const supine_motion motion[2], supine_mesh *from, supine_mesh *mesh,
                          float *normals) {
  supine_motion turn = motion[0];
  memset(turn.translation, 0, sizeof turn.translation);
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    double normal[3];
    supine_options_fiducials_move(&motion[0], mesh->vertices + 3 * i);
    supine_options_fiducials_move(&motion[1], from->vertices + 3 * i);
    for (size_t k = 0; k < 3; ++k) {
      normal[k] = (double)normals[3 * i + k];
    }
    supine_options_fiducials_move(&turn, normal);
    for (size_t k = 0; k < 3; ++k) {
      normals[3 * i + k] = (float)normal[k];
    }
  }
}

/* Add the deviation of a sample, if there is one, to a mesh and to a copy of its vertices. */
static void deviate_surface(const float *deviation, supine_mesh *mesh, float *xyz) {
  if (deviation == NULL) {
    return;
  }
  for (size_t i = 0; i < 3 * mesh->vertex_count; ++i) {
    xyz[i] += deviation[i];
    mesh->vertices[i] += (double)deviation[i];
  }
}

supine_status supine_command_deform_surface(const char *path, const supine_basis *basis,
                                            supine_deformation *moved, supine_error *error) {
  const supine_basis_info *info = supine_basis_get_info(basis);
  const supine_tensor *lung = supine_basis_tensor(basis, "lung");
  const double *gravity = moved->state.gravity;
  supine_mesh_save_options *save = &moved->save;
  double volumes[SUPINE_LUNGS_MAX];
  const supine_mesh_field fields[] = {{"gravity_LPS", 3, gravity},
                                      {"volume_mL", info->lung_count, volumes}};
  SUPINE_FREED_BY(supine_mesh_free) supine_mesh from = {0};
  SUPINE_FREED_BY(supine_mesh_free) supine_mesh mesh = {0};
  SUPINE_ARENA arena = {0};
  float *normals = supine_arena_take(&arena, info->vertex_count, 3 * sizeof *normals);
  float *xyz = supine_arena_take(&arena, info->vertex_count, 3 * sizeof *xyz);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu vertices", info->vertex_count));
  SUPINE_TRY(supine_posed_mesh(basis, &moved->from.pose, &from, error));
  SUPINE_TRY(supine_posed_mesh(basis, &moved->pose, &mesh, error));
  (void)supine_deform(basis, &moved->pose, xyz);
  deviate_surface(moved->deviation, &mesh, xyz);
  supine_normals(basis, xyz, normals);
  if (moved->subtract_hilum) {
    for (size_t i = 0; i < 3 * mesh.vertex_count; ++i) {
      mesh.vertices[i] -= moved->hilum.move[i % 3];
    }
  }
  if (moved->registered) {
    register_mesh(moved->motion, &from, &mesh, normals);
  }
  (void)supine_basis_volumes(basis, &moved->pose, volumes);
  save->from = from.vertices;
  save->normals = mesh.triangle_count > 0 ? normals : NULL;
  save->scalars[0] = (supine_mesh_scalar){"expected_error_mm", moved->errors.position.sigma};
  save->scalars[1] = (supine_mesh_scalar){"moved_error_mm", moved->errors.moved.sigma};
  save->scalars[2] = (supine_mesh_scalar){"another_day_error_mm", moved->errors.position.another};
  save->lung = lung == NULL ? NULL : lung->data;
  save->fields = fields;
  save->field_count = sizeof fields / sizeof *fields;
  SUPINE_TRY(supine_mesh_save(path, &mesh, save, error));
  double largest = 0.0;
  for (size_t i = 0; i < mesh.vertex_count; ++i) {
    largest = fmax(largest, supine_distance(mesh.vertices + 3 * i, from.vertices + 3 * i));
  }
  supine_options_line("%s: gravity %.4g,%.4g,%.4g, largest displacement %s mm from %s", path,
                      gravity[0], gravity[1], gravity[2], supine_text_distance(largest).text,
                      moved->from.name);
  SUPINE_ADD_RESULT(json_pack("{s:o, s:o, s:s, s:f}", "file", supine_options_json_text(path),
                              "gravity", supine_options_json_numbers(3, gravity),
                              "displacement_from", moved->from.name, "largest_displacement_mm",
                              largest));
  const bool content = supine_basis_metadata(basis, "content") != NULL;
  if (!content) {
    const double held = 1e-3 * supine_mesh_volume(&mesh);
    SUPINE_ADD_RESULT(json_pack("{s:f, s:f}", "volume_ml", held, "volume_change_ml",
                                held - 1e-3 * supine_mesh_volume(&from)));
    supine_options_line(", %.2f mL (%+.2f mL)", held, held - 1e-3 * supine_mesh_volume(&from));
    print_range(basis, moved);
  }
  supine_options_line("\n");
  return content && mesh.triangle_count > 0 ? tell_folds(basis, &from, &mesh, error) : SUPINE_OK;
}
