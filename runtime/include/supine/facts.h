/* SPDX-License-Identifier: MIT */
/** @file
 * What a basis assumes and what it was given: one list for all programs that show it.
 *
 * Each fact has a name, a value with its unit and range, or words, and a source. Facts that are
 * assumed, simulated or collapsed are those that a view of the lungs must name
 * (supine_basis_caveats).
 *
 * Stability: growing. A minor version may change functions and structs without a replacement;
 * CHANGELOG.md names the change. */
#ifndef SUPINE_FACTS_H
#define SUPINE_FACTS_H

#include <stdbool.h>
#include <stddef.h>

#include <supine/runtime.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Where a fact comes from. */
typedef enum supine_fact_source {
  SUPINE_SOURCE_GIVEN = 0, /**< by whoever made the basis */
  SUPINE_SOURCE_MEASURED,  /**< in the scan, or on other people (supine_fact.origin says which) */
  SUPINE_SOURCE_FITTED,    /**< to scans or landmarks of the patient */
  SUPINE_SOURCE_SIMULATED, /**< by another simulator */
  SUPINE_SOURCE_ASSUMED,   /**< from other people, or by default */
  SUPINE_SOURCE_COMPUTED,  /**< by the model from other facts */
  SUPINE_SOURCE_COLLAPSED, /**< computed for a healthy lung, and multiplied by a share */
  SUPINE_SOURCE_COUNT
} supine_fact_source;

/** Return the word for a source, such as "assumed"; "unknown" if it is out of range. */
SUPINE_API const char *supine_fact_source_name(supine_fact_source source);

/** A fact. Strings that are not in the struct live as long as the basis. */
typedef struct supine_fact {
  double value;       /**< the number, or NaN */
  double low, high;   /**< one standard deviation to either side, or NaN */
  const char *name;   /**< such as "volume at rest, supine" */
  const char *unit;   /**< of `value`, such as "mL" */
  const char *origin; /**< continues the word for `source`: "from healthy people"; may be "" */
  supine_fact_source source;
  char text[164]; /**< words before the number, or ""; such as "supine at full inflation" */
} supine_fact;

enum { SUPINE_FACTS_MAX = 16 + SUPINE_LUNGS_MAX };

/** List what a basis assumes and what it was given.
 *
 * The volume at rest is that supine, of all lungs. Its range, and that of an assumed full
 * inflation, is one standard deviation of the logarithm to either side: v e^-s to v e^s, s the
 * metadata "resting_spread". Cost: two poses.
 * @param facts  written
 * @return number of facts */
SUPINE_API size_t supine_basis_facts(const supine_basis *basis,
                                     supine_fact facts[SUPINE_FACTS_MAX]);

/** Print the value and the source of a fact, without its name: "2885 mL (2442 to 3408), assumed
 * from healthy people".
 * @param size  size of `text` in bytes; 320 are enough; longer text is cut off
 * @return the length of the whole text, without its NUL */
SUPINE_API size_t supine_fact_print(const supine_fact *fact, char *text, size_t size);

/** Return whether views must name a fact: it is assumed, simulated or collapsed. */
SUPINE_API bool supine_fact_is_caveat(const supine_fact *fact);

/** Print all facts that views must name as one line: "left lung: collapsed to 50 % of its healthy
 * volume; assumed: volume at rest, supine 2885 mL (2442 to 3408), law deep". Collapsed lungs come
 * first. Parameters and result: as supine_fact_print, but 1200 bytes are enough. */
SUPINE_API size_t supine_basis_caveats(const supine_basis *basis, char *text, size_t size);

/** Return the volume of a lung in a pose as a fact, mL. It is measured if the lung holds what it
 * holds in the scan; simulated in another simulator's fields; collapsed if the file holds this lung
 * as collapsed; assumed, with a range, if the state counts from an assumed volume; given if the
 * state names this lung with a volume in mL; and computed otherwise, such as the part of this lung
 * of a given total. The value is NaN if the basis has no volumes.
 * @param state  the state of the pose
 * @param lung   index of the lung */
SUPINE_API supine_fact supine_basis_lung_volume(const supine_basis *basis,
                                                const supine_state *state, const supine_pose *pose,
                                                size_t lung);

#ifdef __cplusplus
}
#endif
#endif
