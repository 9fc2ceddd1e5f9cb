/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the frames of a breath: VTP over time, or safetensors. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/text.h"
#include <supine/safetensors.h>

#include "precompute/writer.h"

#include "program/breath_output.h"

/* Step to which positions are rounded, mm: half of it is less than the storage error
 * (supine_basis_info). */
static const double rounding = 1.0 / 256.0;

enum { FIELDS = 2 };

struct breath_output {
  breath_content content;
  const char *path;
  supine_mesh mesh; /* current frame: own vertices, triangles of the basis */
  supine_mesh_save_options save;
  supine_mesh_field fields[FIELDS];
  float *normals;             /* [N, 3] */
  supine_mesh_series *series; /* NULL unless the output is a .vtp file */
  float *positions;           /* [T, N, 3] mm; NULL unless the output is a .safetensors file */
  size_t next;                /* index of the next frame in `positions` */
  char comment[512];
};

static supine_status no_memory(const char *path, supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
}

/* Describe the content of a VTP file. */
static void fill_save(breath_output *made) {
  const breath_content *content = &made->content;
  const supine_tensor *lung = supine_basis_tensor(content->frames->basis, "lung");
  made->fields[0] = (supine_mesh_field){"gravity_LPS", 3, content->frames->gravity};
  made->fields[1] =
      (supine_mesh_field){"volume_mL", content->frames->lungs, content->frames->volumes};
  made->save = *content->frame;
  made->save.from = content->origin;
  (void)snprintf(made->comment, sizeof made->comment,
                 "displacement from %s; volumes are gas and "
                 "tissue of each lung; %s",
                 content->origin_name, content->made_by);
  made->save.comment = made->comment;
  made->save.normals = made->normals;
  made->save.lung = lung == NULL ? NULL : lung->data;
  made->save.fields = made->fields;
  made->save.field_count = FIELDS;
  made->save.rounding = rounding;
}

static supine_status open_vtp(breath_output *made, supine_error *error) {
  const size_t count = 3 * made->content.rest->vertex_count;
  made->mesh = *made->content.rest;
  made->mesh.vertices = malloc(count * sizeof *made->mesh.vertices);
  made->normals = malloc(count * sizeof *made->normals);
  if (made->mesh.vertices == NULL || made->normals == NULL) {
    return no_memory(made->path, error);
  }
  memcpy(made->mesh.vertices, made->content.rest->vertices, count * sizeof *made->mesh.vertices);
  fill_save(made);
  return supine_mesh_series_open(made->path, &made->mesh, &made->save, made->content.frames->count,
                                 made->content.frames->time, &made->series, error);
}

static supine_status open_tensors(breath_output *made, supine_error *error) {
  const size_t frame = 3 * made->content.rest->vertex_count;
  const size_t count = made->content.frames->count;
  if (frame <= SIZE_MAX / sizeof(float) / count) {
    made->positions = malloc(count * frame * sizeof *made->positions);
  }
  if (made->positions == NULL) {
    return supine_error_set(
        error, SUPINE_ERROR_MEMORY,
        "%s: no memory for %zu frames of %zu vertices (%.1f GB): lower --seconds or --fps, or "
        "write a .vtp file",
        made->path, count, frame / 3, 4e-9 * (double)frame * (double)count);
  }
  return SUPINE_OK;
}

supine_status supine_command_breath_output_open(const char *path, const breath_content *content,
                                                breath_output **output, supine_error *error) {
  breath_output *made = calloc(1, sizeof *made);
  *output = NULL;
  if (made == NULL) {
    return no_memory(path, error);
  }
  made->content = *content;
  made->path = path;
  const supine_status status = supine_text_ends_in_any_case(path, ".safetensors")
                                   ? open_tensors(made, error)
                                   : open_vtp(made, error);
  if (status != SUPINE_OK) {
    supine_command_breath_output_close(made);
    return status;
  }
  *output = made;
  return SUPINE_OK;
}

void supine_command_breath_output_close(breath_output *output) {
  if (output == NULL) {
    return;
  }
  supine_mesh_series_close(output->series);
  free(output->mesh.vertices);
  free(output->normals);
  free(output->positions);
  free(output);
}

supine_status supine_command_breath_output_add(breath_output *output, const float *xyz,
                                               supine_error *error) {
  const size_t count = 3 * output->content.rest->vertex_count;
  if (output->positions != NULL) {
    memcpy(output->positions + output->next++ * count, xyz, count * sizeof *xyz);
    return SUPINE_OK;
  }
  for (size_t i = 0; i < count; ++i) {
    output->mesh.vertices[i] = (double)xyz[i];
  }
  supine_normals(output->content.frames->basis, xyz, output->normals);
  return supine_mesh_series_add(output->series, error);
}

static supine_status commit_tensors(const breath_output *output, supine_error *error) {
  const breath_content *content = &output->content;
  const size_t t = content->frames->count;
  const size_t n = content->rest->vertex_count;
  const supine_tensor tensors[] = {
      {"positions", SUPINE_F32, 3, {t, n, 3}, output->positions},
      {"triangles", SUPINE_U32, 2, {content->rest->triangle_count, 3}, content->rest->triangles},
      {"time", SUPINE_F64, 1, {t}, content->frames->time},
      {"volume", SUPINE_F64, 2, {t, content->frames->lungs}, content->frames->volumes},
      {"gravity", SUPINE_F64, 2, {t, 3}, content->frames->gravity}};
  const supine_metadata metadata[] = {{"format", "supine-breath"},
                                      {"version", "1"},
                                      {"units", "mm, s, mL (gas and tissue of each lung)"},
                                      {"axes", "LPS"},
                                      {"made_by", content->made_by}};
  return supine_writer_safetensors_write(output->path, tensors, sizeof tensors / sizeof *tensors,
                                         metadata, sizeof metadata / sizeof *metadata, error);
}

supine_status supine_command_breath_output_commit(breath_output *output, supine_error *error) {
  return output->positions != NULL ? commit_tensors(output, error)
                                   : supine_mesh_series_commit(output->series, error);
}
