/* SPDX-License-Identifier: MIT */
/** @file
 * Status codes and error details, shared by every Supine library.
 *
 * Stability: stable. A change before 1.0 needs a new minor version, and CHANGELOG.md says how to
 * move over. */
#ifndef SUPINE_STATUS_H
#define SUPINE_STATUS_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Mark the symbols that the shared library exports. SUPINE_EXPORTS is defined while the DLL for
 * Windows is built. */
#if defined(_WIN32) && defined(SUPINE_EXPORTS)
#define SUPINE_API __declspec(dllexport)
#elif defined(__GNUC__) && !defined(_WIN32)
#define SUPINE_API __attribute__((visibility("default")))
#else
#define SUPINE_API
#endif
#if defined(__MINGW32__) && !defined(__clang__)
#define SUPINE_PRINTF(text, first) __attribute__((format(gnu_printf, text, first)))
#elif defined(__GNUC__)
#define SUPINE_PRINTF(text, first) __attribute__((format(printf, text, first)))
#else
#define SUPINE_PRINTF(text, first)
#endif

/** The result of a function; zero is success. */
typedef enum supine_status {
  SUPINE_OK = 0,
  SUPINE_ERROR_ARGUMENT,     /**< an argument is outside its documented range */
  SUPINE_ERROR_MEMORY,       /**< an allocation failed */
  SUPINE_ERROR_READ,         /**< a file is missing or cannot be read */
  SUPINE_ERROR_FORMAT,       /**< the content of a file violates its format */
  SUPINE_ERROR_MESH,         /**< a mesh is unfit for the computation */
  SUPINE_ERROR_OPEN_SURFACE, /**< a volume is needed, but the surface is open */
  SUPINE_ERROR_UNSUPPORTED,  /**< this build, processor or file lacks the feature */
  SUPINE_ERROR_WRITE,        /**< an output cannot be written */
  SUPINE_ERROR_NUMERICAL,    /**< a computation did not converge or has no solution */
  SUPINE_ERROR_INTERRUPTED,  /**< the caller's progress function asked to stop */
  SUPINE_STATUS_COUNT        /**< sentinel: the number of codes above */
} supine_status;

/** Return a phrase for a status; never NULL, even for values outside the enumeration. */
SUPINE_API const char *supine_status_string(supine_status status);

/** What to do with an argument. */
typedef enum supine_remedy_kind {
  SUPINE_REMEDY_NONE = 0, /**< the message says all */
  SUPINE_REMEDY_GIVE,     /**< give it `value`, or any if that is "" */
  SUPINE_REMEDY_SUCH_AS,  /**< give it a value, for example `value` */
  SUPINE_REMEDY_SET,      /**< set it, as it is true or false */
  SUPINE_REMEDY_CHANGE,   /**< give it another value */
  SUPINE_REMEDY_OMIT      /**< leave it out */
} supine_remedy_kind;

enum { SUPINE_REMEDY_VALUE_MAX = 32, SUPINE_REMEDIES_MAX = 3 };

/** What the caller can do about a failure or a warning, where the answer is an argument. Libraries
 * do not know how a host writes its arguments: supine_remedies_add has the words of each. */
typedef struct supine_remedy {
  supine_remedy_kind kind;
  const char *argument;                /**< its name, such as "held_out"; a static text */
  char value[SUPINE_REMEDY_VALUE_MAX]; /**< such as "LPS"; "" for none */
  const char *when; /**< when or why, such as "if the header is wrong"; "" for none; static */
} supine_remedy;

/** How arguments are written. */
typedef enum supine_words {
  SUPINE_WORDS_COMMAND = 0, /**< --held-out 5 */
  SUPINE_WORDS_PYTHON,      /**< held_out=5 */
  SUPINE_WORDS_JAVASCRIPT   /**< heldOut: 5 */
} supine_words;

/** Details of a failure, such as the file and the vertex. The caller owns the struct and passes it
 * as the last argument, which may be NULL. */
typedef struct supine_error {
  supine_status status;
  char message[512];                           /**< one line, NUL-terminated, no trailing newline */
  supine_remedy remedies[SUPINE_REMEDIES_MAX]; /**< alternatives; the first NONE ends them */
} supine_error;

/** Set the status and the message of `error`, without remedies, unless it is NULL. A long message
 * is cut off.
 * Control characters, which texts of files may have, are escaped as \\xHH.
 * @param format  printf format of the message
 * @return `status` */
SUPINE_API supine_status supine_error_set(supine_error *error, supine_status status,
                                          const char *format, ...) SUPINE_PRINTF(3, 4);

/** Set the remedies of an error that was set, unless it is NULL. */
SUPINE_API void supine_error_advise(supine_error *error,
                                    const supine_remedy remedies[SUPINE_REMEDIES_MAX]);

/** Add to a message what to do, in the words of a host: "; give --axes LPS".
 * @param text  [size] the message of an error or a finding; 1024 bytes are enough */
SUPINE_API void supine_remedies_add(const supine_remedy remedies[SUPINE_REMEDIES_MAX],
                                    supine_words words, char *text, size_t size);

/** Set an error to its cause, with a text before the message: "TEXTMESSAGE". Keep the remedies.
 * @param cause   error of a function that was called, not `error` itself
 * @param format  printf format of the text, such as "%s: " of a file
 * @return the status of the cause */
SUPINE_API supine_status supine_error_wrap(supine_error *error, const supine_error *cause,
                                           const char *format, ...) SUPINE_PRINTF(3, 4);

#ifdef __cplusplus
}
#endif
#endif
