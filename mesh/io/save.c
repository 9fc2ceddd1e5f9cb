/* SPDX-License-Identifier: MIT */
/* Save a surface in the format of the name's ending. */
#include "base/arena.h"
#include "base/output.h"
#include "base/text.h"

#include "mesh/io/save.h"

static save_function *find_function(const char *path) {
#define ROW(name) {SUPINE_MESH_ENDING(name), supine_io_save_##name},
  static const struct {
    const char *ending;
    save_function *function;
  } known[] = {SUPINE_MESH_FORMATS(ROW, ROW)};
#undef ROW
  for (size_t i = 0; i < sizeof known / sizeof *known; ++i) {
    if (supine_text_ends_in(path, known[i].ending)) {
      return known[i].function;
    }
  }
  return NULL;
}

bool supine_mesh_save_supports(const char *path) {
  return find_function(path) != NULL;
}

supine_status supine_mesh_save(const char *path, const supine_mesh *mesh,
                               const supine_mesh_save_options *options, supine_error *error) {
  save_function *function = find_function(path);
  SUPINE_REFUSE_IF(function == NULL, error, SUPINE_ERROR_ARGUMENT,
                   "%s: unknown ending; end the name in " SUPINE_MESH_ENDINGS, path);
  SUPINE_TRY(supine_io_writer_check(path, mesh, error));
  SUPINE_FREED_BY(supine_output_abandon) supine_output output = {0};
  SUPINE_TRY(supine_output_open(path, &output, error));
  mesh_writer writer;
  supine_io_writer_begin(mesh, options, &writer);
  writer.out = output.file;
  function(&writer);
  return supine_output_commit(&output, error);
}
