/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Volumes as people say them: rest, full, rest+500, or mL relative to the scan. */
#ifndef SUPINE_OPTIONS_VOLUME_H
#define SUPINE_OPTIONS_VOLUME_H

#include <supine/runtime.h>
#include <supine/state.h>

#include "program/options/command.h"

/* A table of options that fills a supine_volume_options: --volume and --allow-folds. */
extern const supine_option supine_options_volume[];

/* --allow-folds alone, into a bool. */
extern const supine_option supine_options_folds[];

typedef struct supine_volume_options {
  const char *text; /* as given, or NULL */
  bool allow_folds;
} supine_volume_options;

#define SUPINE_VOLUME_HELP                                                                         \
  "rest (default: the end of a quiet expiration in that posture), full, rest+500, rest-200, or a " \
  "number: mL relative to the scan, all lungs together. Where a basis knows no rest "              \
  "(--scanned none), its surface is the rest, and the default is 500 mL above it"

/* Reads "rest", "full", "rest+500", "-300"; false where it is anything else. */
bool supine_options_volume_parse(const char *text, supine_volume *volume);

/* What a command takes without --volume: rest where it is known, else 500 mL. */
supine_volume supine_options_volume_default(const supine_basis *basis);

/* mL beyond the file's surface, for gravity along a unit vector. */
double supine_options_volume_of(const supine_basis *basis, const supine_volume *volume,
                                const double gravity[3]);

/* Volumes of the lungs of the file's surface, mL [lung_count]. */
void supine_options_volume_reference(const supine_basis *basis, double *volumes);

/* Whether a closed lung can look like this: where rest is known, volumes below tissue alone or a
 * fifth above full, and surfaces that fold, are SUPINE_ERROR_NUMERICAL unless folds are allowed;
 * elsewhere, and then, it is said. */
supine_status supine_options_volume_check(const supine_basis *basis, const char *command,
                                          bool allow_folds, const double *weights,
                                          const double *scales, supine_error *error);

/* Breath scales [lung_count] for --volume, also "left=rest,right=rest+200" for every lung of the
 * file, checked; an exit code after a message. */
int supine_options_volume_scales(const supine_basis *basis, const char *command,
                                 const supine_volume_options *wanted, const double gravity[3],
                                 const double *weights, double *scales);

#endif
