/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Where the frames of a breath go: a series for ParaView, or one safetensors file. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "sh/base/folder.h"
#include "sh/base/output.h"
#include <supine/safetensors.h>

#include "precompute/writer/safetensors_write.h"

#include "runtime/command/breath_output.h"
#include "runtime/template/template.h"

struct breath_output {
  const supine_mesh *rest;
  supine_mesh_save_options save;
  const breath_course *course;
  char *path;
  supine_folder folder; /* of the series, with the PVD file beside it, or NULL: it is inside */
  double *vertices;     /* [N, 3] */
  float *positions;     /* [T, N, 3] */
  size_t next;
};

static bool ends_in(const char *text, const char *suffix) {
  const size_t length = strlen(text);
  const size_t end = strlen(suffix);
  return length > end && strcmp(text + length - end, suffix) == 0;
}

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

static supine_status open_series(breath_output *made, supine_error *error) {
  made->vertices = malloc(3 * made->rest->vertex_count * sizeof *made->vertices);
  if (made->vertices == NULL) {
    return no_memory(made->path, error);
  }
  if (!ends_in(made->path, ".pvd")) {
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
  const size_t frame = 3 * made->rest->vertex_count;
  if (frame <= SIZE_MAX / sizeof(float) / made->course->count) {
    made->positions = malloc(made->course->count * frame * sizeof *made->positions);
  }
  if (made->positions == NULL) {
    return supine_error_set(
        error, SUPINE_ERROR_MEMORY,
        "%s: no memory for %zu frames of %zu vertices (%.1f GB): take fewer, or "
        "write a series",
        made->path, made->course->count, made->rest->vertex_count,
        4e-9 * (double)frame * (double)made->course->count);
  }
  return supine_output_try(made->path, error); /* before the work */
}

supine_status supine_command_breath_output_open(const char *path, const supine_mesh *rest,
                                                const supine_mesh_save_options *frame,
                                                const breath_course *course, breath_output **output,
                                                supine_error *error) {
  breath_output *made = calloc(1, sizeof *made);
  *output = NULL;
  if (made == NULL) {
    return no_memory(path, error);
  }
  made->rest = rest;
  made->save = *frame;
  made->save.rest = rest->vertices;
  made->course = course;
  made->path = join(path, "");
  supine_status status = SUPINE_OK;
  if (made->path == NULL) {
    status = no_memory(path, error);
  } else {
    status = ends_in(path, ".safetensors") ? open_tensors(made, error) : open_series(made, error);
  }
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
  supine_folder_close(&output->folder);
  free(output->path);
  free(output->vertices);
  free(output->positions);
  free(output);
}

enum { FRAME_NAME_SIZE = 32 };

static void frame_name(size_t frame, char name[FRAME_NAME_SIZE]) {
  (void)snprintf(name, FRAME_NAME_SIZE, "frame_%05zu.vtp", frame);
}

supine_status supine_command_breath_output_add(breath_output *output, const float *xyz,
                                               supine_error *error) {
  const size_t count = 3 * output->rest->vertex_count;
  const size_t frame = output->next++;
  if (output->positions != NULL) {
    memcpy(output->positions + frame * count, xyz, count * sizeof *xyz);
    return SUPINE_OK;
  }
  char name[FRAME_NAME_SIZE + 1];
  name[0] = '/';
  frame_name(frame, name + 1);
  char *path = join(output->folder.temporary, name);
  if (path == NULL) {
    return no_memory(output->path, error);
  }
  for (size_t i = 0; i < count; ++i) {
    output->vertices[i] = (double)xyz[i];
  }
  supine_mesh mesh = *output->rest;
  mesh.vertices = output->vertices;
  const supine_status status = supine_mesh_save(path, &mesh, &output->save, error);
  free(path);
  return status;
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
  for (size_t t = 0; t < output->course->count; ++t) {
    char name[FRAME_NAME_SIZE];
    frame_name(t, name);
    (void)fprintf(file.file, "<DataSet timestep=\"%.9g\" part=\"0\" file=\"",
                  output->course->time[t]);
    supine_template_escape(folder, file.file);
    (void)fprintf(file.file, "%s%s\"/>\n", folder[0] == '\0' ? "" : "/", name);
  }
  (void)fputs("</Collection>\n</VTKFile>\n", file.file);
  return supine_output_commit(&file, error);
}

/* Time, volumes and gravity of each frame, beside its surface. */
static supine_status write_table(const breath_output *output, const double *volumes,
                                 supine_error *error) {
  const breath_course *course = output->course;
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

static supine_status commit_series(breath_output *output, const double *volumes,
                                   supine_error *error) {
  supine_status status = write_table(output, volumes, error);
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

static supine_status commit_tensors(const breath_output *output, const double *volumes,
                                    const char *made_by, supine_error *error) {
  const size_t t = output->course->count;
  const size_t n = output->rest->vertex_count;
  const supine_tensor tensors[] = {
      {"positions", SUPINE_F32, 3, {t, n, 3}, output->positions},
      {"triangles", SUPINE_U32, 2, {output->rest->triangle_count, 3}, output->rest->triangles},
      {"time", SUPINE_F64, 1, {t}, output->course->time},
      {"volume", SUPINE_F64, 2, {t, output->course->lungs}, volumes},
      {"gravity", SUPINE_F64, 2, {t, 3}, output->course->gravity}};
  const supine_metadata metadata[] = {{"format", "supine-breath"},
                                      {"version", "1"},
                                      {"units", "mm, s, mL above rest"},
                                      {"axes", "LPS"},
                                      {"made_by", made_by}};
  return supine_writer_safetensors_write(output->path, tensors, sizeof tensors / sizeof *tensors,
                                         metadata, sizeof metadata / sizeof *metadata, error);
}

supine_status supine_command_breath_output_commit(breath_output *output, const double *volumes,
                                                  const char *made_by, supine_error *error) {
  return output->positions != NULL ? commit_tensors(output, volumes, made_by, error)
                                   : commit_series(output, volumes, error);
}
