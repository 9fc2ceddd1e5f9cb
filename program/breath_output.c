/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Where the frames of a breath go: one VTP file over time or a series of them, or safetensors. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/folder.h"
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
  supine_mesh mesh; /* mesh of the frame: its own vertices, the basis' triangles */
  supine_mesh_save_options save;
  supine_mesh_field fields[FIELDS];
  float *normals; /* [N, 3] */
  char *path;
  supine_mesh_series *series; /* NULL: the output is not one file */
  supine_folder folder; /* of a file a frame, with the PVD file beside it, or NULL: it is inside */
  float *positions;     /* positions of all frames [T, N, 3], mm */
  size_t next;
  char comment[512];
};

static char *join(const char *first, const char *second) {
  char *text = malloc(strlen(first) + strlen(second) + 1);
  if (text != NULL) {
    (void)stpcpy(stpcpy(text, first), second);
  }
  return text;
}

static supine_status no_memory(const char *path, supine_error *error) {
  return supine_error_set(error, SUPINE_ERROR_MEMORY, "%s: out of memory", path);
}

/* What VTP files have of each frame: the first one's, or all of them. */
static void fill_save(breath_output *made) {
  const breath_content *content = &made->content;
  const supine_tensor *lung = supine_basis_tensor(content->basis, "lung");
  made->fields[0] = (supine_mesh_field){"gravity_LPS", 3, content->course->gravity};
  made->fields[1] = (supine_mesh_field){"volume_mL", content->course->lungs, content->volumes};
  made->fields[2] = (supine_mesh_field){"TimeValue", 1, content->course->time};
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

static supine_status open_series(breath_output *made, supine_error *error) {
  const size_t count = 3 * made->content.rest->vertex_count;
  const breath_course *course = made->content.course;
  made->mesh = *made->content.rest;
  made->mesh.vertices = malloc(count * sizeof *made->mesh.vertices);
  made->normals = malloc(count * sizeof *made->normals);
  if (made->mesh.vertices == NULL || made->normals == NULL) {
    return no_memory(made->path, error);
  }
  memcpy(made->mesh.vertices, made->content.rest->vertices, count * sizeof *made->mesh.vertices);
  fill_save(made);
  if (supine_text_ends_in(made->path, ".vtp")) {
    made->save.field_count = FIELDS - 1; /* the file holds the time of each frame */
    return supine_mesh_series_open(made->path, &made->mesh, &made->save, course->count,
                                   course->time, &made->series, error);
  }
  if (!supine_text_ends_in(made->path, ".pvd")) {
    return supine_folder_open(made->path, NULL, &made->folder, error);
  }
  char *stem = strndup(made->path, strlen(made->path) - strlen(".pvd"));
  if (stem == NULL) {
    return no_memory(made->path, error);
  }
  const supine_status status = supine_folder_open(stem, made->path, &made->folder, error);
  free(stem);
  return status;
}

static supine_status open_tensors(breath_output *made, supine_error *error) {
  const size_t frame = 3 * made->content.rest->vertex_count;
  const size_t frames = made->content.course->count;
  if (frame <= SIZE_MAX / sizeof(float) / frames) {
    made->positions = malloc(frames * frame * sizeof *made->positions);
  }
  if (made->positions == NULL) {
    return supine_error_set(
        error, SUPINE_ERROR_MEMORY,
        "%s: no memory for %zu frames of %zu vertices (%.1f GB): take fewer, or "
        "write a series",
        made->path, frames, frame / 3, 4e-9 * (double)frame * (double)frames);
  }
  return supine_output_try(made->path, error); /* before the work */
}

supine_status supine_command_breath_output_open(const char *path, const breath_content *content,
                                                breath_output **output, supine_error *error) {
  breath_output *made = calloc(1, sizeof *made);
  *output = NULL;
  if (made == NULL) {
    return no_memory(path, error);
  }
  made->content = *content;
  made->path = join(path, "");
  supine_status status = SUPINE_OK;
  if (made->path == NULL) {
    status = no_memory(path, error);
  } else {
    status = supine_text_ends_in(path, ".safetensors") ? open_tensors(made, error)
                                                       : open_series(made, error);
  }
  if (status != SUPINE_OK) {
    supine_command_breath_output_close(made);
    return status;
  }
  *output = made;
  return SUPINE_OK;
}

/* Bytes per vertex, measured on synthetic lungs of 40,000 vertices (tests/bench/bench_breath.py);
 * with triangles where each frame stores them. */
double supine_command_breath_output_size(const char *path, const breath_content *content) {
  const double each = supine_text_ends_in(path, ".safetensors") ? 12.0
                      : supine_text_ends_in(path, ".vtp")       ? 23.0
                                                                : 29.0;
  return each * (double)content->rest->vertex_count * (double)content->course->count;
}

void supine_command_breath_output_close(breath_output *output) {
  if (output == NULL) {
    return;
  }
  supine_mesh_series_close(output->series);
  supine_folder_close(&output->folder);
  free(output->path);
  free(output->mesh.vertices);
  free(output->normals);
  free(output->positions);
  free(output);
}

enum { FRAME_NAME_SIZE = 32 };

static void frame_name(size_t frame, char name[FRAME_NAME_SIZE]) {
  (void)snprintf(name, FRAME_NAME_SIZE, "frame_%05zu.vtp", frame);
}

static supine_status add_file(breath_output *output, size_t frame, supine_error *error) {
  const breath_course *course = output->content.course;
  char name[FRAME_NAME_SIZE + 1];
  name[0] = '/';
  frame_name(frame, name + 1);
  char *path = join(output->folder.temporary, name);
  if (path == NULL) {
    return no_memory(output->path, error);
  }
  output->fields[0].values = course->gravity + 3 * frame;
  output->fields[1].values = output->content.volumes + course->lungs * frame;
  output->fields[2].values = course->time + frame;
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
  supine_normals(output->content.basis, xyz, output->normals);
  return output->series != NULL ? supine_mesh_series_add(output->series, error)
                                : add_file(output, frame, error);
}

/* The list of the frames; `folder` before each name, "" where they lie beside it. */
static supine_status write_index(const breath_output *output, const char *path, const char *folder,
                                 supine_error *error) {
  supine_output file = {0};
  const supine_status status = supine_output_open(path, &file, error);
  if (status != SUPINE_OK) {
    return status;
  }
  (void)fputs("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
              "<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n"
              "<Collection>\n",
              file.file);
  for (size_t t = 0; t < output->content.course->count; ++t) {
    char name[FRAME_NAME_SIZE];
    frame_name(t, name);
    (void)fprintf(file.file, "<DataSet timestep=\"%.9g\" part=\"0\" file=\"",
                  output->content.course->time[t]);
    supine_template_escape(folder, file.file);
    (void)fprintf(file.file, "%s%s\"/>\n", folder[0] == '\0' ? "" : "/", name);
  }
  (void)fputs("</Collection>\n</VTKFile>\n", file.file);
  return supine_output_commit(&file, error);
}

/* Time, volumes and gravity of each frame, beside its surface. */
static supine_status write_table(const breath_output *output, supine_error *error) {
  const breath_course *course = output->content.course;
  const double *volumes = output->content.volumes;
  supine_output file = {0};
  char *path = join(output->folder.temporary, "/breath.csv");
  if (path == NULL) {
    return no_memory(output->path, error);
  }
  supine_status status = supine_output_open(path, &file, error);
  free(path);
  if (status != SUPINE_OK) {
    return status;
  }
  (void)fputs("frame,time_s", file.file);
  for (size_t lung = 0; lung < course->lungs; ++lung) {
    (void)fprintf(file.file, ",volume_%zu_mL", lung);
  }
  (void)fputs(",gravity_x,gravity_y,gravity_z\n", file.file);
  for (size_t t = 0; t < course->count; ++t) {
    const double *g = course->gravity + 3 * t;
    (void)fprintf(file.file, "%zu,%.9g", t, course->time[t]);
    for (size_t lung = 0; lung < course->lungs; ++lung) {
      (void)fprintf(file.file, ",%.9g", volumes[t * course->lungs + lung]);
    }
    (void)fprintf(file.file, ",%.9g,%.9g,%.9g\n", g[0], g[1], g[2]);
  }
  return supine_output_commit(&file, error);
}

static supine_status commit_series(breath_output *output, supine_error *error) {
  supine_status status = write_table(output, error);
  if (status == SUPINE_OK && output->folder.index == NULL) {
    char *inside = join(output->folder.temporary, "/breath.pvd");
    status =
        inside == NULL ? no_memory(output->path, error) : write_index(output, inside, "", error);
    free(inside);
  }
  if (status != SUPINE_OK) {
    return status;
  }
  status = supine_folder_rename(&output->folder, error);
  if (status == SUPINE_OK && output->folder.index != NULL) {
    const char *slash = strrchr(output->folder.path, '/');
    status = write_index(output, output->folder.index,
                         slash == NULL ? output->folder.path : slash + 1, error);
  }
  if (status == SUPINE_OK) {
    supine_folder_keep(&output->folder);
  }
  return status;
}

static supine_status commit_tensors(const breath_output *output, supine_error *error) {
  const breath_content *content = &output->content;
  const size_t t = content->course->count;
  const size_t n = content->rest->vertex_count;
  const supine_tensor tensors[] = {
      {"positions", SUPINE_F32, 3, {t, n, 3}, output->positions},
      {"triangles", SUPINE_U32, 2, {content->rest->triangle_count, 3}, content->rest->triangles},
      {"time", SUPINE_F64, 1, {t}, content->course->time},
      {"volume", SUPINE_F64, 2, {t, content->course->lungs}, content->volumes},
      {"gravity", SUPINE_F64, 2, {t, 3}, content->course->gravity}};
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
                                   : commit_series(output, error);
}
