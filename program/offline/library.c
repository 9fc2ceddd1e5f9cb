/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The offline library: read options as the program does, make a basis, and return what was found.
 */
#include <cblas.h>
#include <gsl/gsl_errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <supine/precompute.h>

#include "base/arena.h"
#include "program/offline/basis.h"
#include "program/options/command.h"
#include "runtime/safetensors/platform.h"

typedef struct job {
  const supine_precompute_input *input;
  supine_precompute_result *result;
  supine_mesh *surfaces;     /* [input->surface_count], or NULL */
  double done_before, share; /* fraction of the work before the step in progress, and its share */
} job;

static bool tell(void *context, double fraction) {
  const job *j = context;
  const double done = j->done_before + j->share * fraction;
  return j->input->progress == NULL || j->input->progress(j->input->context, done) == 0;
}

static supine_status run(void *chosen, const supine_arguments *given, supine_error *error) {
  static const double loading = 0.3; /* share of the work that reads a label map, assumed */
  supine_offline_request *wanted = chosen;
  job j = *(const job *)given->context;
  supine_precompute_result *result = j.result;
  SUPINE_FREED_BY(supine_precompute_prepared_free) supine_prepared prepared = {.fit = ""};
  SUPINE_FREED_BY(supine_file_close)
  FILE *report = fmemopen(result->report, sizeof result->report, "w");
  if (report == NULL || wanted->directions > 0) {
    return report == NULL ? supine_error_memory(error, "a report")
                          : supine_error_set(error, SUPINE_ERROR_ARGUMENT,
                                             "--directions makes no basis: leave it out");
  }
  j.share = loading;
  wanted->model.source.surfaces = j.surfaces;
  wanted->model.source.labels.progress = wanted->basis.progress = tell;
  wanted->model.source.labels.progress_context = wanted->basis.progress_context = &j;
  wanted->basis.made_by = given->made_by;
  SUPINE_TRY(supine_offline_check(wanted, error));
  supine_status status =
      supine_precompute_prepare(&wanted->model, given->operand, given->count, &prepared, error);
  j.done_before = loading;
  j.share = 1.0 - loading;
  if (status == SUPINE_OK) {
    status = supine_offline_write(wanted, &prepared, report, error);
  }
  (void)strcpy(result->findings, prepared.source.findings.text);
  (void)strcpy(result->assumed, prepared.assumed);
  return status;
}

/* Run the options, and then read the bytes of the basis if its path is not the caller's. */
static supine_status make(job *j, const char *path, supine_error *error) {
  static const supine_command library = {.options = supine_offline_options,
                                         SUPINE_SURFACES,
                                         .request_size = sizeof(supine_offline_request),
                                         .uses_blas = true,
                                         .begin = supine_offline_begin,
                                         .run = run};
  enum { NAME = 32 };
  const supine_precompute_input *input = j->input;
  const size_t count = input->option_count + input->path_count + input->surface_count;
  SUPINE_ARENA arena = {0};
  const char **words = supine_arena_zeros(&arena, count + 5, sizeof *words);
  char(*names)[NAME] = supine_arena_take(&arena, input->surface_count + 1, sizeof *names);
  supine_mesh *surfaces = supine_arena_take(&arena, input->surface_count + 1, sizeof *surfaces);
  SUPINE_TRY(supine_arena_check(&arena, error, "%zu words", count));
  size_t n = 0;
  words[n++] = "precompute";
  for (size_t i = 0; i < input->option_count; ++i) {
    words[n++] = input->options[i];
  }
  words[n++] = "--output";
  words[n++] = path;
  words[n++] = "--";
  for (size_t i = 0; i < input->path_count; ++i) {
    words[n++] = input->paths[i];
  }
  for (size_t i = 0; i < input->surface_count; ++i) {
    const supine_precompute_surface *given = &input->surfaces[i];
    surfaces[i] = (supine_mesh){given->vertex_count, (double *)given->vertices,
                                given->triangle_count, (uint32_t *)given->triangles};
    (void)snprintf(names[i], NAME, "surface %zu", i + 1);
    words[n++] = names[i];
  }
  j->surfaces = input->surface_count > 0 ? surfaces : NULL;
  SUPINE_TRY(supine_options_run_words(&library, (int)n, (char **)words, j, error));
  supine_platform_file file = {0};
  SUPINE_TRY(input->output == NULL ? supine_platform_map(path, &file, error) : SUPINE_OK);
  j->result->bytes = file.bytes;
  j->result->size = file.size;
  return SUPINE_OK;
}

supine_status supine_precompute_basis(const supine_precompute_input *input,
                                      supine_precompute_result *result, supine_error *error) {
  const char *temporary = getenv("TMPDIR"); /* NOLINT(concurrency-mt-unsafe) */
  char folder[512];
  char path[sizeof folder + 32];
  job j = {.input = input, .result = result};
  *result = (supine_precompute_result){.bytes = NULL};
  SUPINE_REFUSE_IF(input->path_count > 0 && input->surface_count > 0, error, SUPINE_ERROR_ARGUMENT,
                   "give files or arrays, not both");
  (void)snprintf(folder, sizeof folder, "%s/supine-XXXXXX", temporary != NULL ? temporary : "/tmp");
  SUPINE_REFUSE_IF(input->output == NULL && mkdtemp(folder) == NULL, error, SUPINE_ERROR_WRITE,
                   "%s: cannot write: set TMPDIR to another folder", folder);
  (void)snprintf(path, sizeof path, "%s/basis.safetensors", folder);
  gsl_error_handler_t *handler = gsl_set_error_handler_off();
  const int threads = openblas_get_num_threads();
  openblas_set_num_threads(1);
  const supine_status status = make(&j, input->output != NULL ? input->output : path, error);
  openblas_set_num_threads(threads);
  (void)gsl_set_error_handler(handler);
  if (input->output == NULL) {
    (void)unlink(path);
    (void)rmdir(folder);
  }
  return status;
}

void supine_precompute_result_free(supine_precompute_result *result) {
  supine_platform_unmap(&(supine_platform_file){result->bytes, result->size});
  *result = (supine_precompute_result){.bytes = NULL};
}
