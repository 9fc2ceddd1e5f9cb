/* SPDX-License-Identifier: GPL-3.0-or-later */
/* The names that a file of 'supine embed' has for what is inside. */
#ifndef SUPINE_COMMAND_NAMES_H
#define SUPINE_COMMAND_NAMES_H

#include <supine/runtime.h>

typedef struct supine_command_names {
  size_t count;         /* names */
  char **text;          /* [count] */
  const uint32_t *part; /* [N] which name each vertex goes by */
  size_t *order;        /* [N] vertices by name, as they were given */
  char *space;
} supine_command_names;

/* SUPINE_ERROR_FORMAT where the basis has no names, or malformed ones. */
supine_status supine_command_names_open(const supine_basis *basis, supine_command_names *names,
                                        supine_error *error);
void supine_command_names_close(supine_command_names *names);

/* Return the lung of a vertex. */
size_t supine_command_lung_of(const supine_basis_info *info, size_t vertex);

#endif
