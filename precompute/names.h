/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file Names of the values of options, which the program and supine_precompute_names share. */
#ifndef SUPINE_PRECOMPUTE_NAMES_H
#define SUPINE_PRECOMPUTE_NAMES_H

/** Names of supine_precompute_sex and of supine_precompute_storage, ended by NULL. */
extern const char *const supine_precompute_sexes[], *const supine_precompute_storages[];

#endif
