/* SPDX-License-Identifier: MIT */
/** @file
 * The version. Before 1.0, a new minor version may change the interface; the name of the shared
 * library therefore contains the minor version. A new patch version never changes the interface.
 *
 * Stability: stable. A change before 1.0 needs a new minor version, and CHANGELOG.md says how to
 * move over. */
#ifndef SUPINE_VERSION_H
#define SUPINE_VERSION_H

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The version of these headers. */
#define SUPINE_VERSION "0.3.0"
#define SUPINE_VERSION_NUMBER 300 /**< 10000 major + 100 minor + patch */

/** Return the version of the linked or loaded library in the form of SUPINE_VERSION; never NULL. */
SUPINE_API const char *supine_version(void);

#ifdef __cplusplus
}
#endif
#endif
