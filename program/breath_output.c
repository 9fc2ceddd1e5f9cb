/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write the frames of a breath: VTP over time, a series of VTP files, or safetensors. */
#include <errno.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sh/base/output.h"
#include "sh/base/text.h"
#include <supine/safetensors.h>

#include "precompute/writer.h"

#include "program/breath_output.h"
#include "program/export/template.h"

/* Quantum of positions, mm: half of it is less than the storage error (supine_basis_info). */
static const double rounding = 1.0 / 256.0;

enum { FIELDS = 3 };

struct breath_output {
  breath_content content;
  const char *path;
  supine_mesh mesh; /* of the frame: its own vertices, the triangles of the basis */
  supine_mesh_save_options save;
  supine_mesh_field fields[FIELDS];
  float *normals;             /* [N, 3] */
  supine_mesh_series *series; /* of a .vtp file; else NULL */
  char *folder;               /* of a .pvd file until it is complete; else NULL */
  float *positions;           /* [T, N, 3] mm, of a .safetensors file; else NULL */
  size_t next;                /* number of the next frame */
  char comment[512];
};

static supine_status no_memory(const char *path, supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
}

/* Describe the content of VTP files; the fields point to the first frame. */
static void fill_save(breath_output *made) {
  const breath_content *content = &made->content;
  const supine_tensor *lung = supine_basis_tensor(content->frames->basis, "lung");
  made->fields[0] = (supine_mesh_field){"gravity_LPS", 3, content->frames->gravity};
  made->fields[1] =
      (supine_mesh_field){"volume_mL", content->frames->lungs, content->frames->volumes};
  made->fields[2] = (supine_mesh_field){"TimeValue", 1, content->frames->time};
  made->save = *content->frame;
  made->save.rest = content->origin;
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
  const breath_frames *frames = made->content.frames;
  made->mesh = *made->content.rest;
  made->mesh.vertices = malloc(count * sizeof *made->mesh.vertices);
  made->normals = malloc(count * sizeof *made->normals);
  if (made->mesh.vertices == NULL || made->normals == NULL) {
    return no_memory(made->path, error);
  }
  memcpy(made->mesh.vertices, made->content.rest->vertices, count * sizeof *made->mesh.vertices);
  fill_save(made);
  if (supine_text_ends_in_any_case(made->path, ".vtp")) {
    made->save.field_count = FIELDS - 1; /* the file holds the time of each frame */
    return supine_mesh_series_open(made->path, &made->mesh, &made->save, frames->count,
                                   frames->time, &made->series, error);
  }
  char *folder = strndup(made->path, strlen(made->path) - strlen(".pvd"));
  if (folder == NULL) {
    return no_memory(made->path, error);
  }
  (void)rmdir(folder); /* one that is not empty stays */
  if (mkdir(folder, 0777) != 0) {
    (void)supine_error_set(error, SUPINE_ERROR_WRITE,
                           "%s: cannot create this folder for the frames (%s): remove it, or "
                           "choose another name",
                           folder, strerror(errno));
    free(folder);
    return SUPINE_ERROR_WRITE;
  }
  made->folder = folder;
  return SUPINE_OK;
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
        "%s: no memory for %zu frames of %zu vertices (%.1f GB): take fewer, or "
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

/* Return the path of a frame's file in a folder; NULL: no memory. */
static char *frame_path(const char *folder, size_t frame) {
  char *path = NULL;
  return asprintf(&path, "%s/frame_%05zu.vtp", folder, frame) < 0 ? NULL : path;
}

void supine_command_breath_output_close(breath_output *output) {
  if (output == NULL) {
    return;
  }
  for (size_t t = 0; output->folder != NULL && t < output->next; ++t) {
    char *path = frame_path(output->folder, t);
    if (path != NULL) {
      (void)unlink(path);
    }
    free(path);
  }
  if (output->folder != NULL) {
    (void)rmdir(output->folder);
  }
  supine_mesh_series_close(output->series);
  free(output->folder);
  free(output->mesh.vertices);
  free(output->normals);
  free(output->positions);
  free(output);
}

static supine_status add_file(breath_output *output, size_t frame, supine_error *error) {
  const breath_frames *frames = output->content.frames;
  char *path = frame_path(output->folder, frame);
  if (path == NULL) {
    return no_memory(output->path, error);
  }
  output->fields[0].values = frames->gravity + 3 * frame;
  output->fields[1].values = frames->volumes + frames->lungs * frame;
  output->fields[2].values = frames->time + frame;
  const supine_status status = supine_mesh_save(path, &output->mesh, &output->save, error);
  free(path);
  return status;
}

supine_status supine_command_breath_output_add(breath_output *output, const float *xyz,
                                               supine_error *error) {
  const size_t count = 3 * output->content.rest->vertex_count;
  const size_t frame = output->next++;
  if (output->positions != NULL) {
    memcpy(output->positions + frame * count, xyz, count * sizeof *xyz);
    return SUPINE_OK;
  }
  for (size_t i = 0; i < count; ++i) {
    output->mesh.vertices[i] = (double)xyz[i];
  }
  supine_normals(output->content.frames->basis, xyz, output->normals);
  return output->series != NULL ? supine_mesh_series_add(output->series, error)
                                : add_file(output, frame, error);
}

/* Write the index of the frames, with their times in seconds. */
static supine_status write_index(breath_output *output, supine_error *error) {
  const char *slash = strrchr(output->folder, '/');
  supine_output file = {0};
  supine_status status = supine_output_open(output->path, &file, error);
  if (status != SUPINE_OK) {
    return status;
  }
  (void)fputs("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
              "<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n"
              "<Collection>\n",
              file.file);
  for (size_t t = 0; t < output->content.frames->count; ++t) {
    char *path = frame_path(slash == NULL ? output->folder : slash + 1, t);
    if (path == NULL) {
      status = no_memory(output->path, error);
      break;
    }
    (void)fprintf(file.file, "<DataSet timestep=\"%.9g\" part=\"0\" file=\"",
                  output->content.frames->time[t]);
    supine_template_escape(path, file.file);
    (void)fputs("\"/>\n", file.file);
    free(path);
  }
  (void)fputs("</Collection>\n</VTKFile>\n", file.file);
  if (status != SUPINE_OK) {
    supine_output_abandon(&file);
    return status;
  }
  status = supine_output_commit(&file, error);
  if (status == SUPINE_OK) {
    free(output->folder);
    output->folder = NULL;
  }
  return status;
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
         : output->series != NULL  ? supine_mesh_series_commit(output->series, error)
                                   : write_index(output, error);
}
