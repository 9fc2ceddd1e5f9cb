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

/** What the caller can do about a failure or a warning, where the answer is an argument: of this
 * library, or of the one that made the file. Libraries do not know what a host calls its arguments:
 * a host has a table of its own words, which it shows after the message. Those of `supine` are in
 * program/options/remedy.c. The later ones come from the offline library. */
typedef enum supine_remedy {
  SUPINE_REMEDY_NONE = 0, /**< the message says all */
  /* From the runtime library. */
  SUPINE_REMEDY_BASIS_WITH_REST, /**< use a basis whose scan has a known state */
  SUPINE_REMEDY_ALLOW_FOLDS,     /**< compute states that lungs cannot hold */
  SUPINE_REMEDY_LOCATE_VOLUME,   /**< give the volume of the located lungs */
  /* Coordinates. */
  SUPINE_REMEDY_AXES,           /**< give the axes, for example `value` */
  SUPINE_REMEDY_AXES_ADD,       /**< give the axes `value` */
  SUPINE_REMEDY_AXES_IF_RIGHT,  /**< give the axes `value` if they are the right ones */
  SUPINE_REMEDY_UNIT,           /**< give the unit of the file */
  SUPINE_REMEDY_UNIT_ADD,       /**< give the unit `value` */
  SUPINE_REMEDY_UNIT_OR_ACCEPT, /**< give the unit `value`, or give mm to accept any size */
  SUPINE_REMEDY_SIZE_ACCEPT,    /**< give the unit mm to accept any size */
  SUPINE_REMEDY_POINTS_CLAMP,   /**< move points outside the lungs like their surface */
  /* Label maps and lungs. */
  SUPINE_REMEDY_LABELS,          /**< give the labels of the lungs */
  SUPINE_REMEDY_LABELS_ONE_LUNG, /**< correct the labels, or give those of the `value` lung alone */
  SUPINE_REMEDY_LABELS_CHECK,    /**< check the labels */
  SUPINE_REMEDY_LABELS_SIDE,     /**< give the label of one side */
  SUPINE_REMEDY_LABELS_EXCHANGE, /**< exchange the labels of the sides, or correct the axes */
  SUPINE_REMEDY_LABELS_OR_AXES,  /**< correct the labels, or give the axes `value` */
  SUPINE_REMEDY_LABELS_AXES_OR_KEEP, /**< the same, or confirm the axes of the header */
  SUPINE_REMEDY_CLOSE,               /**< close narrow channels */
  SUPINE_REMEDY_MAP_UNIT,            /**< leave the unit of a label map out, or give mm */
  SUPINE_REMEDY_MAP_OPTIONS,         /**< leave out what is for label maps */
  SUPINE_REMEDY_EDGE,                /**< change the length of the surface's edges */
  SUPINE_REMEDY_LUNGS_SEPARATE,      /**< separate the labels, or give the midline of one lung */
  SUPINE_REMEDY_MIDLINE,             /**< give the midline `value` to make it the other lung */
  /* The law and the state of the scan. */
  SUPINE_REMEDY_FORCE,             /**< change base or gain of the force */
  SUPINE_REMEDY_CONSTANTS,         /**< change the constants of the displacement */
  SUPINE_REMEDY_REACH,             /**< give the reach, or leave out softening */
  SUPINE_REMEDY_SCAN_STATE,        /**< change the state of the scan */
  SUPINE_REMEDY_SCAN_OR_REST,      /**< change the state of the scan or the volumes at rest */
  SUPINE_REMEDY_SCAN_FULLER,       /**< the same, or use the scan unchanged */
  SUPINE_REMEDY_SCAN_FULL_OR_REST, /**< change the full volume, the scan's state or the rest */
  SUPINE_REMEDY_SCAN_NOT_FULL,     /**< state that the scan was not at full inflation */
  SUPINE_REMEDY_SCAN_OR_REST_GIVE, /**< the same, or change the volumes at rest */
  SUPINE_REMEDY_SCAN_EMPTIER,      /**< check the volumes at rest, or state that it was emptier */
  SUPINE_REMEDY_SCAN_OVER_REST,    /**< state that the scan was fuller than rest */
  SUPINE_REMEDY_SCAN_GIVE,         /**< give the state of the scan */
  SUPINE_REMEDY_SCAN_ASSUMED,      /**< the state of the scan changes what is assumed */
  SUPINE_REMEDY_REST_OR_AS_IS,     /**< give the volumes at rest, or use the scan unchanged */
  SUPINE_REMEDY_FULL_AND_SCAN,     /**< give the full volume with the state of a scan at rest */
  SUPINE_REMEDY_LAW_OR_SCAN,       /**< leave the state of the scan out, or use the law `deep` */
  SUPINE_REMEDY_BAND_OUT,          /**< leave the band out */
  SUPINE_REMEDY_HARMONICS,         /**< store modes, or lower the band */
  /* A patient's law, validation and content. */
  SUPINE_REMEDY_LAW_DEEP,          /**< fit the law `deep` */
  SUPINE_REMEDY_FIT_LANDMARKS,     /**< fit the patient's law to landmarks too */
  SUPINE_REMEDY_SCAN_MOTION,       /**< fit a motion between the scans */
  SUPINE_REMEDY_SCANS_EXCHANGE,    /**< exchange the states of the scans, or reverse the points */
  SUPINE_REMEDY_SCANS_VOLUMES,     /**< give the volumes of both scans */
  SUPINE_REMEDY_REST_CHECK,        /**< check the state at rest of the patient's scan */
  SUPINE_REMEDY_OTHER_STATE,       /**< give the other state of the validation */
  SUPINE_REMEDY_POINTS_REVERSE,    /**< exchange first and second points */
  SUPINE_REMEDY_BASIS_OF_STATE,    /**< make a new basis, with the state of the scan */
  SUPINE_REMEDY_GRID,              /**< embed a grid in the basis */
  SUPINE_REMEDY_DENSITY,           /**< leave the change of density out */
  SUPINE_REMEDY_EXPANDABILITY_OUT, /**< leave the expandability out */
  SUPINE_REMEDY_COUNT              /**< sentinel: the number of remedies above */
} supine_remedy;

enum { SUPINE_REMEDY_VALUE_MAX = 32 };

/** Details of a failure, such as the file and the vertex. The caller owns the struct and passes it
 * as the last argument, which may be NULL. */
typedef struct supine_error {
  supine_status status;
  char message[512]; /**< one line, NUL-terminated, no trailing newline */
  supine_remedy remedy;
  char value[SUPINE_REMEDY_VALUE_MAX]; /**< suggested value of the argument, such as "LPS"; "" if
                                          the remedy has none */
} supine_error;

/** Set the status and the message of `error`, without a remedy, unless it is NULL. A long message
 * is cut off.
 * Control characters, which texts of files may have, are escaped as \\xHH.
 * @param format  printf format of the message
 * @return `status` */
SUPINE_API supine_status supine_error_set(supine_error *error, supine_status status,
                                          const char *format, ...) SUPINE_PRINTF(3, 4);

/** Add a remedy to an error that was set, unless it is NULL.
 * @param value  value of the argument; "" or NULL for none */
SUPINE_API void supine_error_advise(supine_error *error, supine_remedy remedy, const char *value);

/** Set an error to its cause, with a text before the message: "TEXTMESSAGE". Keep the remedy.
 * @param cause   error of a function that was called, not `error` itself
 * @param format  printf format of the text, such as "%s: " of a file
 * @return the status of the cause */
SUPINE_API supine_status supine_error_wrap(supine_error *error, const supine_error *cause,
                                           const char *format, ...) SUPINE_PRINTF(3, 4);

#ifdef __cplusplus
}
#endif
#endif
