/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Run supine export on synthetic bases. */
#ifndef SUPINE_TEST_EXPORT_HELPERS_H
#define SUPINE_TEST_EXPORT_HELPERS_H

#include "tests/helpers/command_helpers.h"
#include "tests/helpers/runtime_fixture.h"

#define EXPORT_RUN(text, ...) COMMAND_RUN(&supine_command_export, KEPT_BOTH, text, __VA_ARGS__)

/* Write a synthetic basis to `folder`/`name`, and set `path` to its path. */
static inline void export_basis_make(const char *folder, const char *name, size_t modes,
                                     size_t band, bool vector, bool closed, char path[256]) {
  fixture *f = fixture_create(40, modes, band, 2, vector, closed, 5, 4711 + modes);
  (void)snprintf(path, 256, "%s/%s", folder, name);
  fixture_write(f, path);
  fixture_destroy(f);
}

#endif
