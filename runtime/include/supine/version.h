/* SPDX-License-Identifier: MIT */
/** @file
 * Which version this is. Before 1.0 a new minor version may change the interface, and the shared
 * library's name says which minor version it is; a new patch never does. */
#ifndef SUPINE_VERSION_H
#define SUPINE_VERSION_H

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** @{ Of these headers. */
#define SUPINE_VERSION "0.3.0"
#define SUPINE_VERSION_NUMBER 300 /**< 10000 major + 100 minor + patch */
/** @} */

/** Of the library that is linked or loaded, as SUPINE_VERSION; never NULL. */
SUPINE_API const char *supine_version(void);

#ifdef __cplusplus
}
#endif
#endif
