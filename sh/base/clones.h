/* SPDX-License-Identifier: MIT */
/** @file
 * Versions of a function for wider vector units, chosen when the program is loaded. */
#ifndef SUPINE_CLONES_H
#define SUPINE_CLONES_H

#if defined(__linux__)
#include <features.h> /* __GLIBC__ */
#endif

/** Marks a hot function. The names are levels of the architecture, not of a maker's processors:
 * those are matched by model and pass every other maker's by. */
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && __GNUC__ >= 12 &&            \
    !defined(SUPINE_NO_CLONES)
#define SUPINE_CLONES __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))
#else
#define SUPINE_CLONES
#endif

#endif
