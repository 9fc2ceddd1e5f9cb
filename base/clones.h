/* SPDX-License-Identifier: MIT */
/** @file Compile a function for several vector units; the loader chooses the version to run. */
#ifndef SUPINE_CLONES_H
#define SUPINE_CLONES_H

#if defined(__linux__)
#include <features.h> /* defines __GLIBC__ */
#endif

/** Mark a function to be compiled in several versions, one for each architecture level. Versions
 * for named processor models would run on the processors of one manufacturer only. */
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && __GNUC__ >= 12 &&            \
    !defined(SUPINE_NO_CLONES)
#define SUPINE_CLONES __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))
#else
#define SUPINE_CLONES
#endif

#endif
