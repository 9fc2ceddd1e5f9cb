/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Every command. */
#ifndef SUPINE_COMMAND_LIST_H
#define SUPINE_COMMAND_LIST_H

#include "program/options/option.h"

/* The commands, in the order of the program's help. Each is supine_command_NAME in NAME.c. */
#define SUPINE_COMMANDS(COMMAND)                                                                   \
  COMMAND(phantom)                                                                                 \
  COMMAND(precompute)                                                                              \
  COMMAND(fit)                                                                                     \
  COMMAND(validate)                                                                                \
  COMMAND(embed)                                                                                   \
  COMMAND(locate)                                                                                  \
  COMMAND(info)                                                                                    \
  COMMAND(deform)                                                                                  \
  COMMAND(compare)                                                                                 \
  COMMAND(render)                                                                                  \
  COMMAND(breathe)                                                                                 \
  COMMAND(export)                                                                                  \
  COMMAND(solve)                                                                                   \
  COMMAND(pv)                                                                                      \
  COMMAND(stream)

#define SUPINE_COMMAND_DECLARE(name) extern const supine_command supine_command_##name;
SUPINE_COMMANDS(SUPINE_COMMAND_DECLARE)
#undef SUPINE_COMMAND_DECLARE

/* All commands, in this order, ended by NULL. */
extern const supine_command *const supine_command_list[];

#endif
