/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file The keys of patient.json: one table, by which the file is written and read. */
#ifndef SUPINE_PATIENT_KEYS_H
#define SUPINE_PATIENT_KEYS_H

#include "precompute/patient/patient_file.h"

enum { SUPINE_PATIENT_VERSION = 5 };

#define SUPINE_PATIENT_FORMAT "supine-patient"

/** Type of a member in memory, and its form in JSON. */
typedef enum supine_patient_kind {
  SUPINE_PATIENT_OBJECT,     /**< no member: an object, whose keys have rows of their own */
  SUPINE_PATIENT_LIST,       /**< struct[*length], at most [count]: an array of objects */
  SUPINE_PATIENT_STRING,     /**< char[SUPINE_PATIENT_TEXT]: a string */
  SUPINE_PATIENT_STATE,      /**< supine_state with a posture: a string */
  SUPINE_PATIENT_NUMBERS,    /**< double[count]: an array of numbers, or a number if `count` is 1 */
  SUPINE_PATIENT_SIZE,       /**< size_t: an integer */
  SUPINE_PATIENT_BOOL,       /**< bool: a boolean */
  SUPINE_PATIENT_LAW_WORD,   /**< supine_patient_law: one of `count` words */
  SUPINE_PATIENT_BOOL_WORD,  /**< bool: one of two words */
  SUPINE_PATIENT_SIZE_WORD,  /**< size_t: one of `count` words */
  SUPINE_PATIENT_LUNGS_WORD, /**< int: "right" is -1, "both" is 0 and "left" is 1 */
} supine_patient_kind;

/** When a key is in the file. Numbers that are not finite are always left out. */
typedef enum supine_patient_presence {
  SUPINE_PATIENT_REQUIRED,    /**< always, or as long as its object is in the file */
  SUPINE_PATIENT_OPTIONAL,    /**< written always; a missing value is 0 */
  SUPINE_PATIENT_IF_POSITIVE, /**< if a number is above 0; missing numbers are 0 */
  SUPINE_PATIENT_IF_FLAG,     /**< if the bool at `flag` is true; reading sets it */
  SUPINE_PATIENT_IF_COUNTED,  /**< if the size_t at `length` is not 0 */
  SUPINE_PATIENT_WRITTEN      /**< written for people, and not read */
} supine_patient_presence;

/** A key and the member that it holds. Offsets, in bytes, are from the start of the struct. */
typedef struct supine_patient_key {
  const char *object; /**< key of the object that contains it, or "" */
  const char *key;
  supine_patient_kind kind;
  supine_patient_presence presence;
  size_t offset;
  size_t count;                              /**< of the kind's numbers, words or elements */
  const char *const *words;                  /**< [count] */
  size_t flag, length;                       /**< offsets */
  size_t size;                               /**< of an element of a list, bytes */
  const struct supine_patient_keys *members; /**< of an element of a list */
} supine_patient_key;

/** Keys of the members of a struct, in the order of the file. */
typedef struct supine_patient_keys {
  size_t count;
  const supine_patient_key *key;
} supine_patient_keys;

/** Keys of supine_patient_record: of the law and the scans, then of the fit. */
extern const supine_patient_keys supine_patient_law_keys, supine_patient_fit_keys;

#endif
