/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Every command, in the order of the program's help. */
#include "program/command/list.h"

#define ROW(name) &supine_command_##name,

const supine_command *const supine_command_list[] = {SUPINE_COMMANDS(ROW) NULL};
