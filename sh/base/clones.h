/* SPDX-License-Identifier: MIT */
/** @file Compile versions of a function for wider vector units; the loader chooses one. */
#ifndef SUPINE_CLONES_H
#define SUPINE_CLONES_H

#if defined(__linux__)
#include <features.h> /* __GLIBC__ */
#endif

/** Mark a hot function. The targets are architecture levels, as processor names would match one
 * maker's models only. */
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && __GNUC__ >= 12 &&            \
    !defined(SUPINE_NO_CLONES)
#define SUPINE_CLONES __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))
#else
#define SUPINE_CLONES
#endif

#endif
