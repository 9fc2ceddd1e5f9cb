/* SPDX-License-Identifier: MIT */
/** @file Make remedies of errors and findings. */
#ifndef SUPINE_REMEDY_H
#define SUPINE_REMEDY_H

#include <stddef.h>

#include <supine/status.h>

/** Make a remedy of a kind. A value that is too long is left out.
 * @param value  "" for none
 * @param when   "" for always */
static inline supine_remedy supine_remedy_make(supine_remedy_kind kind, const char *argument,
                                               const char *value, const char *when) {
  supine_remedy remedy = {.kind = kind, .argument = argument, .when = when};
  size_t length = 0;
  while (value[length] != '\0') {
    ++length;
  }
  if (length < sizeof remedy.value) {
    for (size_t i = 0; i < length; ++i) {
      remedy.value[i] = value[i];
    }
  }
  return remedy;
}

static inline supine_remedy supine_remedy_give(const char *argument, const char *value,
                                               const char *when) {
  return supine_remedy_make(SUPINE_REMEDY_GIVE, argument, value, when);
}

static inline supine_remedy supine_remedy_such_as(const char *argument, const char *value,
                                                  const char *when) {
  return supine_remedy_make(SUPINE_REMEDY_SUCH_AS, argument, value, when);
}

static inline supine_remedy supine_remedy_set(const char *argument, const char *when) {
  return supine_remedy_make(SUPINE_REMEDY_SET, argument, "", when);
}

static inline supine_remedy supine_remedy_change(const char *argument, const char *when) {
  return supine_remedy_make(SUPINE_REMEDY_CHANGE, argument, "", when);
}

static inline supine_remedy supine_remedy_omit(const char *argument) {
  return supine_remedy_make(SUPINE_REMEDY_OMIT, argument, "", "");
}

/** Advise to allow a state that lungs cannot hold. */
static inline supine_remedy supine_remedy_allow_folds(void) {
  return supine_remedy_set("allow_folds", "to compute it all the same");
}

/** As SUPINE_REFUSE_IF, with `advice`, an array [SUPINE_REMEDIES_MAX] of remedies. */
#define SUPINE_REFUSE_ADVISE(condition, error, advice, ...)                                        \
  do {                                                                                             \
    if (condition) {                                                                               \
      return supine_error_advised(error, advice, supine_error_set(error, __VA_ARGS__));            \
    }                                                                                              \
  } while (0)

/** Add remedies to an error that was set; return `status`. */
static inline supine_status supine_error_advised(supine_error *error, const supine_remedy *advice,
                                                 supine_status status) {
  supine_error_advise(error, advice);
  return status;
}

#endif
