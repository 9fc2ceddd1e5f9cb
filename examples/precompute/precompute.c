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

int main(int argc, char **argv) {
  if (argc < 3) {
    fprintf(stderr, "usage: precompute BASIS SURFACE...\n");
    return 1;
  }
  supine_error error;
  supine_precompute_result result;
  const supine_precompute_input input = {.paths = (const char *const *)argv + 2,
                                         .path_count = (size_t)argc - 2,
                                         .output = argv[1],
                                         .progress = progress,
                                         .context = stderr};
  const supine_status status = supine_precompute_basis(&input, &result, &error);
  fprintf(stderr, "\n%s", result.findings); /* warnings and notes about the surfaces, also on failure */
  if (status == SUPINE_OK) {
    printf("%s\nassumed: %s\n", result.report, result.assumed);
  } else {
    fprintf(stderr, "%s\n", error.message);
  }
  supine_precompute_result_free(&result);
  return status == SUPINE_OK ? 0 : 2;
}
