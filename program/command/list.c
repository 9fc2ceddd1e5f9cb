/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Every command, in the order of the program's help. */
#include "program/command/list.h"

const supine_command *const supine_command_list[] = {
    &supine_command_phantom, &supine_command_precompute,
    &supine_command_fit,     &supine_command_validate,
    &supine_command_embed,   &supine_command_locate,
    &supine_command_info,    &supine_command_deform,
    &supine_command_compare, &supine_command_render,
    &supine_command_breathe, &supine_command_export,
    &supine_command_solve,   &supine_command_pv,
    &supine_command_stream,  NULL};
