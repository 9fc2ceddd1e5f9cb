/* SPDX-License-Identifier: MIT */
/* Make a basis from the surfaces of one or two lungs:
 *
 *     precompute lungs.safetensors left.ply right.ply */
#include <stdio.h>

#include <supine/precompute.h>

/* Print the progress. Return 0 to go on; other numbers stop the work. */
static int progress(void *context, double fraction) {
  fprintf(context, "\r%3.0f %%", 100 * fraction);
  return 0;
}

/* Print what was found in the surfaces, what was assumed, and the error of the basis. */
static void print(const supine_precompute_result *result) {
  for (size_t i = 0; i < result->findings->count; ++i) {
    const supine_finding *finding = &result->findings->list[i];
    fprintf(stderr, "%s: %s\n", finding->is_warning ? "warning" : "note", finding->text);
  }
  for (size_t i = 0; i < result->assumption_count; ++i) {
    printf("assumed: %s\n", result->assumptions[i]);
  }
  if (result->bytes != NULL) {
    printf("%zu vertices, %zu modes, error against the full solve %.3f mm RMS\n",
           result->report.vertex_count, result->report.mode_count, result->report.mm.rms);
  }
}

static int write_file(const char *path, const supine_precompute_result *result) {
  FILE *file = fopen(path, "wb");
  if (file == NULL) {
    return -1;
  }
  const size_t written = fwrite(result->bytes, 1, result->size, file);
  return fclose(file) == 0 && written == result->size ? 0 : -1;
}

int main(int argc, char **argv) {
  if (argc < 3) {
    fprintf(stderr, "usage: precompute BASIS SURFACE...\n");
    return 1;
  }
  /* What is zero has its default: full inflation in the scan, the deep law, usual volumes. */
  const supine_precompute_options options = {
      .size = sizeof options,
      .lungs = {.paths = (const char *const *)argv + 2, .path_count = (size_t)argc - 2},
      .progress = progress,
      .context = stderr};
  supine_error error;
  supine_precompute_result *result = NULL;
  const supine_status status = supine_precompute_basis(&options, &result, &error);
  fprintf(stderr, "\n");
  if (result != NULL) { /* also after a failure: what was found */
    print(result);
  }
  int exit_code = 0;
  if (status != SUPINE_OK) {
    fprintf(stderr, "%s\n", error.message);
    exit_code = 2;
  } else if (write_file(argv[1], result) != 0) {
    perror(argv[1]);
    exit_code = 4;
  }
  supine_precompute_result_free(result);
  return exit_code;
}
