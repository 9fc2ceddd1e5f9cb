/* SPDX-License-Identifier: MIT */
/** @file
 * The run-time library: open a basis file, then deform its lungs for any direction of gravity and
 * any volume.
 *
 *     u_i = s * (sum over k of w_k(g) c_ik) * d_i          w_k(g) = sum over lm of modes[k, lm]
 * Y_lm(g)
 *
 * Nothing allocates, reads files or locks after opening; any number of threads may use one basis.
 * Gravity is a direction in body axes (DICOM LPS) that points where things fall: supine (0,1,0),
 * prone (0,-1,0), left lateral (1,0,0), right lateral (-1,0,0), upright (0,0,-1). */
#ifndef SUPINE_RUNTIME_H
#define SUPINE_RUNTIME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Most modes (columns of coefficients) that a basis file may have. */
enum { SUPINE_MODES_MAX = 256 };
/** Most lungs in one file. */
enum { SUPINE_LUNGS_MAX = 16 };

typedef struct supine_basis supine_basis;

/** What a basis holds. */
typedef struct supine_basis_info {
  size_t vertex_count;
  size_t triangle_count;
  size_t mode_count; /**< K */
  size_t band;       /**< L */
  size_t lung_count; /**< G; the vertices of lung j are lung_begin[j] <= i < lung_begin[j + 1] */
  const size_t *lung_begin; /**< [G + 1] */
  bool vector;     /**< three coefficients per vertex and mode instead of one and a direction */
  bool has_volume; /**< the surface is closed: volumes can be asked for */
} supine_basis_info;

/** Opens and fully validates a basis file, or one in memory (which must outlive the basis).
 * @retval SUPINE_ERROR_READ    missing or unreadable
 * @retval SUPINE_ERROR_FORMAT  truncated, corrupted, or not a basis file (detail in `error`)
 * @retval SUPINE_ERROR_MEMORY */
SUPINE_API supine_status supine_basis_open(const char *path, supine_basis **basis,
                                           supine_error *error);
SUPINE_API supine_status supine_basis_open_memory(const void *bytes, size_t size,
                                                  supine_basis **basis, supine_error *error);
/** Releases a basis; NULL is legal. */
SUPINE_API void supine_basis_close(supine_basis *basis);

SUPINE_API const supine_basis_info *supine_basis_get_info(const supine_basis *basis);
/** A metadata string ("format", "error_rms_percent", ...), or NULL. */
SUPINE_API const char *supine_basis_metadata(const supine_basis *basis, const char *key);
/** Rest positions [N, 3], mm, LPS. */
SUPINE_API const float *supine_basis_vertices(const supine_basis *basis);
/** Triangles [M, 3]. */
SUPINE_API const uint32_t *supine_basis_triangles(const supine_basis *basis);

/** Weights w [K] of the modes for gravity along `gravity` (any length but 0).
 * Cost: K (L+1)^2 multiplications, once a frame.
 * @retval SUPINE_ERROR_ARGUMENT  gravity is zero or not finite */
SUPINE_API supine_status supine_basis_weights(const supine_basis *basis, const double gravity[3],
                                              double *weights);

/** Volume in mL that lung `lung` gains over rest at breath scale `scale`: a cubic in the scale,
 * with no pass over the vertices. Requires has_volume. */
SUPINE_API double supine_basis_lung_volume(const supine_basis *basis, size_t lung,
                                           const double *weights, double scale);

/** The scale at which the lungs together gain `volume` mL (negative: lose).
 * @param scale  one number for all lungs
 * @retval SUPINE_ERROR_OPEN_SURFACE  the file has no volume forms
 * @retval SUPINE_ERROR_NUMERICAL     no scale reaches that volume before the surface folds */
SUPINE_API supine_status supine_basis_scale(const supine_basis *basis, const double *weights,
                                            double volume, double *scale, supine_error *error);

/** The same for one lung. */
SUPINE_API supine_status supine_basis_lung_scale(const supine_basis *basis, size_t lung,
                                                 const double *weights, double volume,
                                                 double *scale, supine_error *error);

/** Deformed positions of vertices begin <= i < end into xyz[0 .. 3 (end - begin)).
 * @param scales  [G] breath scale of each lung
 * Cost per vertex: K + 3 multiplications and K + 2 additions. */
SUPINE_API void supine_deform_range(const supine_basis *basis, const double *weights,
                                    const double *scales, size_t begin, size_t end, float *xyz);

/** Deformed positions of every vertex, xyz [N, 3], mm, LPS, in the caller's thread. */
SUPINE_API void supine_deform(const supine_basis *basis, const double *weights,
                              const double *scales, float *xyz);

#ifdef __cplusplus
}
#endif
#endif
