/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Every command. */
#ifndef SUPINE_COMMAND_LIST_H
#define SUPINE_COMMAND_LIST_H

#include "program/options/option.h"

extern const supine_command supine_command_phantom, supine_command_precompute, supine_command_info,
    supine_command_deform, supine_command_compare, supine_command_render, supine_command_breathe,
    supine_command_export, supine_command_solve, supine_command_pv, supine_command_stream,
    supine_command_fit, supine_command_validate, supine_command_embed, supine_command_locate;

/* All commands, in the order of the program's help, ended by NULL. */
extern const supine_command *const supine_command_list[];

#endif
