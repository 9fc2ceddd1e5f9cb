/* SPDX-License-Identifier: MIT */
/** @file
 * Status codes and error details, shared by every Supine library.
 *
 * Stability: stable. A change before 1.0 needs a new minor version, and CHANGELOG.md says how to
 * move over. */
#ifndef SUPINE_STATUS_H
#define SUPINE_STATUS_H

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

/** Details of a failure, such as the file, the vertex and the remedy. The caller owns the struct
 * and passes it as the last argument, which may be NULL. */
typedef struct supine_error {
  supine_status status;
  char message[512]; /**< one line, NUL-terminated, no trailing newline */
} supine_error;

/** Set the status and the message of `error` unless it is NULL. A long message is cut off.
 * Control characters, which texts of files may have, are escaped as \\xHH.
 * @param format  printf format of the message
 * @return `status` */
SUPINE_API supine_status supine_error_set(supine_error *error, supine_status status,
                                          const char *format, ...) SUPINE_PRINTF(3, 4);

#ifdef __cplusplus
}
#endif
#endif
