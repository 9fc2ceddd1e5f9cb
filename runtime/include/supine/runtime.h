/* SPDX-License-Identifier: MIT */
/** @file
 * The run-time library: open a basis file, then deform its lungs for any gravity and any volume.
 *
 *     x_ij   = p_ij + A_j (sum over k of w_k(g) c_ik) d_ij
 *     w_k(g) = sum over l, m of modes[k, lm] Y_lm(g)
 *
 * A basis of another simulator's fields over gravity and volume has weights of each lung: products
 * of Y_lm(g) and polynomials of the lung's volume (supine/sh.h, supine_basis_info.order).
 *
 *     x_ij       coordinate j (x, y, z) of vertex i, mm
 *     p_ij       its coordinate on the reference surface, mm
 *     A_j        gain: factor of the displacement of a lung along axis j, set by the lung's volume
 *     w_k        weight of mode k, a function of the direction of gravity g
 *     c_ik d_ij  coefficient of mode k at vertex i, times the vector along which the vertex moves;
 *                a vector field has c_ijk instead
 *     Y_lm       spherical harmonics (supine/sh.h)
 *
 * A program parses or fills in a supine_state (posture and volume), calls supine_basis_pose for the
 * weights and gains, and then supine_deform for the positions.
 *
 * In the shapes of arrays, N is the number of vertices, and M the number of triangles.
 *
 * After opening, no function allocates, reads files or locks; any number of threads may use one
 * basis. A thread that calls this library needs a stack of 128 kB, the default of musl. Gravity is
 * a direction in body axes (DICOM LPS) that points where things fall: supine (0,1,0), prone
 * (0,-1,0), left lateral (1,0,0), right lateral (-1,0,0), upright (0,0,-1).
 *
 * A compiled program works with newer versions of the shared library of the same name:
 * supine_basis_info only grows at its end, supine_basis_options begins with its size, and no other
 * struct changes.
 *
 * Stability: stable. A change before 1.0 needs a new minor version, and CHANGELOG.md says how to
 * move over. */
#ifndef SUPINE_RUNTIME_H
#define SUPINE_RUNTIME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <supine/findings.h>
#include <supine/safetensors.h>
#include <supine/state.h>
#include <supine/status.h>
#include <supine/version.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { SUPINE_MODES_MAX = 256 };
enum { SUPINE_LUNGS_MAX = 16 };
enum { SUPINE_NORMAL_MODES_MAX = 64 };
enum { SUPINE_CLUSTERS_MAX = 512 };

/** Numbers of a cluster for each mode (supine_basis_info.cluster_vectors). */
enum { SUPINE_CLUSTER_NUMBERS = 18 };

typedef struct supine_basis supine_basis;

/** How an open basis stores coefficients, directions of displacement and reference positions. */
typedef enum supine_storage {
  SUPINE_STORAGE_AUTO = 0, /**< the smallest storage with an error of at most 0.005 mm */
  SUPINE_STORAGE_EXACT,    /**< float32, as in the file */
  SUPINE_STORAGE_INT16,    /**< fixed point: 16 bits per coefficient, 21 or 22 per coordinate */
  SUPINE_STORAGE_MIXED,    /**< like INT16, but 10 or 11 bits per coefficient of the last modes */
  SUPINE_STORAGE_COUNT
} supine_storage;

/** The instruction set of the evaluation. Positions from different sets differ by at most twice
 * supine_basis_error. */
typedef enum supine_simd {
  /** The widest instruction set that this processor has. On x86-64 the environment variable
   * SUPINE_SIMD (portable, avx2 or avx512) can name a narrower one, to get the numbers of another
   * processor. */
  SUPINE_SIMD_AUTO = 0,
  SUPINE_SIMD_PORTABLE, /**< vectors of four numbers: SSE2, NEON, WebAssembly */
  SUPINE_SIMD_AVX2,     /**< AVX2 and FMA */
  SUPINE_SIMD_AVX512,   /**< AVX-512 F and BW */
  SUPINE_SIMD_COUNT
} supine_simd;

/** Options for opening a basis. Members after `size` that are 0 select the defaults. */
typedef struct supine_basis_options {
  size_t size; /**< sizeof(supine_basis_options) */
  supine_storage storage;
  supine_simd simd;
  bool without_normals; /**< do not load normals, which saves memory */
  bool allow_folds;     /**< compute poses that supine_basis_check refuses */
  /** Functions that allocate and free all memory of the basis but the mapped file, called only
   * while it is opened or closed. Both are NULL, or neither. */
  supine_allocator allocator;
} supine_basis_options;

/** The content of an open basis. The basis owns the struct and all arrays. */
typedef struct supine_basis_info {
  size_t vertex_count;
  size_t triangle_count;
  size_t mode_count;
  size_t band; /**< highest band of the spherical harmonics */
  size_t lung_count;
  const size_t *lung_begin; /**< [lung_count + 1] first vertex of each lung, then vertex_count */
  bool vector;     /**< each vertex has 3 coefficients per mode, instead of 1 along `direction` */
  bool has_volume; /**< the surface is closed, so that lungs have volumes */
  supine_storage storage;  /**< the storage in use, never AUTO */
  supine_simd simd;        /**< the instruction set in use, never AUTO */
  double bytes_per_vertex; /**< bytes that an evaluation reads for each vertex */
  /** Largest position error of any vertex from storage and rounding, mm: the largest
   * supine_basis_error for 26 directions of gravity, towards the faces, edges and corners of a
   * cube. The lungs hold 500 mL more than the reference surface; an open surface moves by at most
   * 20 mm; another simulator's fields are not scaled. */
  double storage_error;
  const char *const *lung_names; /**< [lung_count] such as "left", or an index such as "0" */
  const float *bounds;   /**< [lung_count, 2, 3] lowest and highest corner of each lung's box, mm */
  const float *vertices; /**< [vertex_count, 3] reference positions, mm, LPS */
  const uint32_t *triangles; /**< [triangle_count, 3] vertices of each triangle */
  const float *direction; /**< [vertex_count, 3] vectors along which vertices move, mm; or NULL */
  /** Coefficients of the modes at each vertex. If `vector` is false: [vertex_count, mode_count],
   * factors of `direction`. If it is true: [vertex_count, 3, mode_count] along x, y and z, mm. NULL
   * in a basis of clusters: supine_basis_coefficients computes them. */
  const float *coefficients;
  /** [mode_count, (band + 1)^2, order + 1] coefficients of the weight of each mode: of the
   * harmonics, times polynomials of the volume. */
  const double *modes;
  /** Coefficients of the polynomial that gives the volume of each lung from the weights and gains,
   * mL: L, Q and T of supine_volume_contract, each with the lung as an additional first axis. NULL
   * if the surface is open. */
  const double *volume_linear, *volume_quadratic, *volume_cubic;
  /** Memory that an evaluation reads, with the vertices in blocks of 16. Use it only to measure
   * memory traffic, as the layout changes between versions. */
  const void *packed;
  size_t normal_count; /**< vectors per vertex whose weighted sum is the normal; 0 if none */
  /** [vertex_count, 3, normal_count + 1] bytes of the vectors whose weighted and normalised sum is
   * the normal: vector j is 256 times byte j, and vector 0 has the last byte added; NULL if none.
   */
  const int8_t *normals;
  /** Coefficients of the polynomials that supine_basis_normal_weights evaluates. With K =
   * mode_count, the shape is [lung_count, normal_count, 3, 1 + 2 K + K (K + 1) / 2]. */
  const double *normal_weights;
  const double *reference_volume; /**< [lung_count] volume of reference surface, mL; 0 if open */
  bool has_rest;                  /**< the file has the volume at rest for every posture */
  bool has_full;                  /**< the reference surface is at full inflation */
  bool is_fields; /**< made from another simulator's displacements; factor 1 reproduces them */
  double bend[3]; /**< constant of the path along each axis (supine_volume_bend) */
  /** Hash of the modes, the coefficients of the volumes, and the names of the lungs. Bases that
   * share it have the same poses: a basis, and those that `supine embed` makes from it. */
  uint64_t identity;
  /** Highest degree of the polynomials of a lung's volume, in a basis of another simulator's fields
   * over gravity and volume; 0 in all others. Above 0, each lung has weights of its own. */
  size_t order;
  size_t cluster_count; /**< number of clusters of vertices that move alike; 0 if there are none */
  const uint16_t *cluster; /**< [vertex_count] cluster of each vertex, or NULL */
  /** [vertex_count, 2] scalars of each vertex, or NULL. */
  const int16_t *cluster_scalars;
  /** [cluster_count, mode_count, SUPINE_CLUSTER_NUMBERS] a vector m, the rows of a matrix B, and
   * two vectors P, mm. The coefficients of a vertex at p with the scalars a are m + B p + a_0 P_0 +
   * a_1 P_1. NULL if there are no clusters. */
  const float *cluster_vectors;
  /** [lung_count, 3] hilum in the scan, mm, about which a collapsed lung has shrunk there
   * (supine_basis_scan), or NULL if no lung of the file is collapsed. */
  const double *hilum;
} supine_basis_info;

/** The weights of modes and the gains of a state (supine_basis_pose). All zeros mean the reference
 * surface of any basis. */
typedef struct supine_pose {
  /** [mode_count] weights or, if supine_basis_info.order is above 0, [lung_count, mode_count]. */
  double weights[SUPINE_MODES_MAX];
  double gains[SUPINE_LUNGS_MAX][3]; /**< factor of each lung's displacement along x, y and z */
  /** supine_basis_info.identity of the basis that made the pose. For a basis with another identity,
   * functions that return a status return SUPINE_ERROR_ARGUMENT, and write nothing. The identity 0
   * is not checked: a program may set the weights of a pose itself. Weights and gains must be
   * finite and below 2^20; otherwise the status is SUPINE_ERROR_ARGUMENT too. */
  uint64_t basis;
  /** [lung_count] The deformed lung is stretched about its hilum by 1 + expansion. It is 0 but in
   * the scan of a lung that the file holds as collapsed (supine_basis_scan_pose). */
  double expansion[SUPINE_LUNGS_MAX];
} supine_pose;

/** Open a basis from a file. Check all of it, and pack it for evaluation. Cost: a few passes over
 * the file. Memory: the mapped file, and for each vertex supine_basis_info.bytes_per_vertex and
 * 12 ceil(normal_count / 3) bytes.
 * @param options  NULL for the defaults
 * @param basis    written; NULL on failure
 * @retval SUPINE_ERROR_READ         the file is missing or unreadable
 * @retval SUPINE_ERROR_FORMAT       the file is truncated, corrupted or not a basis file, or a
 *                                   number in it is not finite or cannot be that of lungs
 * @retval SUPINE_ERROR_ARGUMENT     an option is out of range, options->size is not set, or only
 * one function of the allocator is set
 * @retval SUPINE_ERROR_UNSUPPORTED  the processor or the library lacks the instruction set
 * @retval SUPINE_ERROR_MEMORY       an allocation failed */
SUPINE_API supine_status supine_basis_open_with(const char *path,
                                                const supine_basis_options *options,
                                                supine_basis **basis, supine_error *error);
/** Open a basis from the `size` bytes of a file in memory, which must outlive the basis. Other
 * parameters and statuses: as supine_basis_open_with. */
SUPINE_API supine_status supine_basis_open_memory_with(const void *bytes, size_t size,
                                                       const supine_basis_options *options,
                                                       supine_basis **basis, supine_error *error);
/** Open a basis with the default options, from a file or from `size` bytes in memory. Statuses: as
 * supine_basis_open_with. */
SUPINE_API supine_status supine_basis_open(const char *path, supine_basis **basis,
                                           supine_error *error);
SUPINE_API supine_status supine_basis_open_memory(const void *bytes, size_t size,
                                                  supine_basis **basis, supine_error *error);
/** Close a basis; NULL is legal. */
SUPINE_API void supine_basis_close(supine_basis *basis);

/** Return the content of a basis, which is valid until the basis is closed. */
SUPINE_API const supine_basis_info *supine_basis_get_info(const supine_basis *basis);
/** Return the metadata string of a key, such as "format"; NULL if there is none. */
SUPINE_API const char *supine_basis_metadata(const supine_basis *basis, const char *key);
/** Return all metadata, in the order of the file.
 * @param count  written: the number of metadata strings */
SUPINE_API const supine_metadata *supine_basis_all_metadata(const supine_basis *basis,
                                                            size_t *count);
/** Return a tensor of the file by its name, such as "error_modes"; NULL if there is none. */
SUPINE_API const supine_tensor *supine_basis_tensor(const supine_basis *basis, const char *name);
/** Return the reference positions [N, 3], mm, LPS. */
SUPINE_API const float *supine_basis_vertices(const supine_basis *basis);
/** Return the triangles [M, 3], each as three indices of vertices. */
SUPINE_API const uint32_t *supine_basis_triangles(const supine_basis *basis);

/** Compute the weights of the modes for a direction of gravity, once a frame. Cost:
 * mode_count (band + 1)^2 multiplications.
 * @param gravity  [3], any length but 0
 * @param weights  [mode_count] written, such as the weights of a pose that is zero otherwise
 * @retval SUPINE_ERROR_ARGUMENT     gravity is zero or not finite
 * @retval SUPINE_ERROR_UNSUPPORTED  the weights depend on the volume too (supine_basis_info.order):
 *                                   call supine_basis_pose */
SUPINE_API supine_status supine_basis_weights(const supine_basis *basis, const double gravity[3],
                                              double *weights);

/** Compute the pose of a state: the weights of the modes for its gravity, and the gains (factors of
 * the displacement of each lung along x, y and z) at which the lungs hold exactly its volume.
 *
 * A volume of all lungs is divided among them. Above rest, every lung is inflated by the same
 * fraction of the difference between its volumes at rest and at full inflation [MilicEmili1966].
 * Below rest, all lungs hold the same fraction of their volumes at rest. The three gains of a lung
 * then follow from its volume (supine_volume_bend). If another simulator's displacements depend on
 * volume, the total is divided as the simulator did, whatever it is relative to; in the posture of
 * the scan and at its volume, each lung has its own volume of the scan.
 *
 * SUPINE_VOLUME_DEFAULT means the volume at rest if the file has one. Otherwise, it means 500 mL
 * above the volume in the scan or, for a file made from another simulator's displacements, gains of
 * 1 if these depend on gravity alone. If they depend on volume too, it means the volume in the scan
 * or, if that was not simulated in all postures, the middle of the volumes that were
 * (supine_basis_default_volume).
 * Cost: mode_count (band + 1)^2 multiplications, and mode_count^3 for each lung, without a pass
 * over the vertices.
 * @param state  its gravity has any length but 0
 * @param pose   written
 * @retval SUPINE_ERROR_ARGUMENT      gravity is zero or not finite; a volume is not finite, or is
 *                                    relative to rest or to full inflation, which the file lacks;
 * or the lungs named in the state are not exactly those of the basis
 * @retval SUPINE_ERROR_OPEN_SURFACE  the surface is open and has no volumes
 * @retval SUPINE_ERROR_NUMERICAL     the volume is out of reach, or the lungs cannot hold it
 *                                    (supine_basis_check); the latter is not checked if the basis
 *                                    was opened with supine_basis_options.allow_folds
 *
 * [MilicEmili1966]  Milic-Emili, Henderson, Dolovich, Trop, Kaneko, J. Appl. Physiol. 21, 1966,
 *                   749-759 */
SUPINE_API supine_status supine_basis_pose(const supine_basis *basis, const supine_state *state,
                                           supine_pose *pose, supine_error *error);

/** Return the weights of the modes of a lung in a pose, [mode_count]: the same for all lungs,
 * unless supine_basis_info.order is above 0. */
SUPINE_API const double *supine_basis_lung_weights(const supine_basis *basis,
                                                   const supine_pose *pose, size_t lung);

/** Compute the coefficients of the modes at vertices begin <= i < end of a basis of vectors,
 * whether the file stores them or clusters.
 * @param coefficients  [end - begin, 3, mode_count] mm, written
 * @retval SUPINE_ERROR_ARGUMENT     the range does not lie within 0 to N
 * @retval SUPINE_ERROR_UNSUPPORTED  supine_basis_info.vector is false */
SUPINE_API supine_status supine_basis_coefficients(const supine_basis *basis, size_t begin,
                                                   size_t end, float *coefficients);

/** Check that lungs can hold the volumes of a pose: 10 to 120 % of full inflation, without folds in
 * more than 1 % of the triangles of a lung. The file holds the range of volumes of each lung in 26
 * directions of gravity; between them it is interpolated. Folds are not checked if a file lacks
 * these ranges, and volumes if it lacks the volume at rest. The state of the scan is taken. Limits:
 * supine_input_get. If the state names no volume, and the file lacks these ranges, check instead
 * that the gains are -5 to 5 (SUPINE_INPUT_GAIN). Cost: mode_count^3 for each lung.
 * @param state  the state of the pose; that of supine_basis_pose_gain has no volume
 * @retval SUPINE_ERROR_NUMERICAL  lungs cannot hold these volumes; `error` says which */
SUPINE_API supine_status supine_basis_check(const supine_basis *basis, const supine_state *state,
                                            const supine_pose *pose, supine_error *error);

/** Tell what supine_basis_check refuses in a pose, as a warning: what a host does after
 * supine_basis_pose or supine_basis_pose_gain with supine_basis_options.allow_folds.
 * @param findings  the warning is added, if lungs cannot hold the pose */
SUPINE_API void supine_basis_tell(const supine_basis *basis, const supine_state *state,
                                  const supine_pose *pose, supine_findings *findings);

/** Return the default volume of a basis (supine_basis_pose). If the default is to multiply
 * displacements by 1, whatever the volume, the kind of the result is SUPINE_VOLUME_DEFAULT. */
SUPINE_API supine_volume supine_basis_default_volume(const supine_basis *basis);

/** Compute the pose of a direction of gravity at which all displacements are multiplied by `gain`,
 * whatever volume that gives. Use this where the gains do not follow from a volume: for open
 * surfaces, or for displacements from another simulator, which a gain of 1 reproduces.
 *
 * The pose is checked by supine_basis_check, unless the basis was opened with
 * supine_basis_options.allow_folds. Cost: as supine_basis_pose.
 * @param gravity  [3], any length but 0
 * @param pose     written
 * @retval SUPINE_ERROR_ARGUMENT     gravity is zero or not finite, or the gain is not finite
 * @retval SUPINE_ERROR_NUMERICAL    the lungs cannot hold the volume, or the gain is too large
 * @retval SUPINE_ERROR_UNSUPPORTED  the displacements depend on the volume too
 *                                   (supine_basis_info.order) */
SUPINE_API supine_status supine_basis_pose_gain(const supine_basis *basis, const double gravity[3],
                                                double gain, supine_pose *pose,
                                                supine_error *error);

/** Set the gains of a pose for all lungs and axes to `gain`, and its expansions to 0. Nothing is
 * checked: supine_basis_pose_gain does. */
SUPINE_API void supine_pose_fill(supine_pose *pose, double gain);

/** Return the gravity and the volume in the scan. The volume is of the kind SUPINE_VOLUME_SCAN.
 *
 * A lung that the file holds as collapsed, with a share c of its volume (metadata `lung_share`), is
 * collapsed in all states but this one, which is the scan itself: there, its vertices lie at
 * h + (1 + e) (x - h), e = c^(-1/3) - 1 (metadata `lung_expansion`), where x is their position in
 * the collapsed lung at the inflation of the scan, and h the hilum in the scan (metadata
 * `lung_hilum_mm`). In every state, a lung is collapsed about its hilum in that state. Any
 * other volume relative to the scan is added to that of the lung that is collapsed at the inflation
 * of the scan. */
SUPINE_API supine_state supine_basis_scan(const supine_basis *basis);

/** Compute the pose of the lungs as they are in the scan. For displacements from another simulator
 * that is the given surface, without displacement, which they need not reach in any posture; for
 * all others it is the pose of supine_basis_scan.
 * @retval SUPINE_ERROR_NUMERICAL  the volume of the scan cannot be reached */
SUPINE_API supine_status supine_basis_scan_pose(const supine_basis *basis, supine_pose *pose,
                                                supine_error *error);

/** Compute the volume of each lung in a pose.
 * @param volumes  [lung_count] volumes of gas and tissue, mL, written
 * @retval SUPINE_ERROR_OPEN_SURFACE  the basis has no volumes (supine_basis_info.has_volume) */
SUPINE_API supine_status supine_basis_volumes(const supine_basis *basis, const supine_pose *pose,
                                              double *volumes);

/** Return a bound, mm, on the position error that storage and rounding cause in a pose: the
 * distance of any deformed vertex from the position that exact arithmetic computes from the
 * numbers of the file. Return infinity for a pose of another basis, or one that is not finite. */
SUPINE_API double supine_basis_error(const supine_basis *basis, const supine_pose *pose);

/** Compute the deformed position of every vertex, in the caller's thread.
 *
 *     x_ij = p_ij + A_j (w . c_i) d_ij
 *
 * p are the reference positions, A the gains, w the weights, c the coefficients, d the directions.
 * The optional tensor "rigid" of the file lists ranges of vertices of parts that keep their shape.
 * In this and all following functions, each such part moves by the rigid motion that fits the
 * positions x_ij best.
 * Cost per vertex: K + 6 multiplications and K + 2 additions for K modes. If the positions and the
 * basis exceed 4 MiB, positions are written with stores that bypass the caches. These are fastest
 * if `xyz` is aligned to 64 bytes.
 * @param xyz  [N, 3] mm, LPS, written; aligned like a float */
SUPINE_API supine_status supine_deform(const supine_basis *basis, const supine_pose *pose,
                                       float *xyz);

/** Compute supine_deform for vertices begin <= i < end, so that several threads can share the work.
 * Ranges that begin at multiples of 16 are fastest.
 * @param xyz  [end - begin, 3] mm, written
 * @retval SUPINE_ERROR_ARGUMENT  the range does not lie within 0 to N */
SUPINE_API supine_status supine_deform_range(const supine_basis *basis, const supine_pose *pose,
                                             size_t begin, size_t end, float *xyz);

/** Compute supine_deform_range into a buffer whose vertices hold more than positions, such as an
 * interleaved vertex buffer. Other bytes stay as they are.
 * @param stride     bytes from one vertex to the next, at least 12
 * @param positions  first position; three floats at each multiple of `stride`, written
 * @retval SUPINE_ERROR_ARGUMENT  as supine_deform_range, or `stride` is below 12 */
SUPINE_API supine_status supine_deform_strided(const supine_basis *basis, const supine_pose *pose,
                                               size_t begin, size_t end, size_t stride,
                                               void *positions);

/** Compute supine_deform_range for many poses. Each vertex is read from memory only once. Statuses:
 * as supine_deform_range, for any of the poses.
 * @param poses  [count]
 * @param xyz    [count, end - begin, 3] mm, written */
SUPINE_API supine_status supine_deform_batch(const supine_basis *basis, size_t count,
                                             const supine_pose *poses, size_t begin, size_t end,
                                             float *xyz);

/** Compute the displacements of vertices begin <= i < end from the reference surface. To find the
 * change of the displacements in one step of a breath (supine_step), pass the weights of the
 * posture and the change of the gains (factors of displacement). Rigid parts do not follow this
 * rule. Statuses: as supine_deform_range.
 * @param xyz  [end - begin, 3] mm, written */
SUPINE_API supine_status supine_displace_range(const supine_basis *basis, const supine_pose *pose,
                                               size_t begin, size_t end, float *xyz);

/** Add one step of a breath in a fixed posture, with three additions per vertex ([Santhanam2008]
 * III-B, see supine/breath.h):
 *
 *     xyz += step
 *
 * Each step rounds a coordinate by at most 2^-24 of its value. These errors add up, so begin each
 * breath with supine_deform. One step for a whole breath is right only for a law with straight
 * paths (`paper`): with the default law, the middle of a path of 500 mL lies 3 to 11 % of the chord
 * away from it. Use supine_deform there, or a step for each volume.
 * @param count  number of vertices
 * @param step   [count, 3] displacement of each vertex in this step, mm (supine_displace_range)
 * @param xyz    [count, 3] mm, changed; must not overlap `step` */
SUPINE_API void supine_step(size_t count, const float *step, float *xyz);

/** Compute, for each lung, the weights of the vectors whose weighted sum is the normal of a vertex
 * (supine_deform_lit). The weight v of a vector is a polynomial, summed over the axes x, y, z:
 *
 *     v = sum over axes of V_0 + a sum_k A_k w_k + b sum_k B_k w_k + a b sum_(k <= l) C_kl w_k w_l
 *
 *     V_0, A, B, C  coefficients for a lung, vector and axis (supine_basis_info.normal_weights)
 *     w_k           weight of mode k of the pose
 *     a, b          gains (factors of displacement) on the next two axes, in cyclic order
 *
 * Cost: 1.5 Q K^2 multiplications for each lung, once a frame, for K modes and Q vectors.
 * @param normal_weights  [lung_count, normal_count] v, written */
SUPINE_API supine_status supine_basis_normal_weights(const supine_basis *basis,
                                                     const supine_pose *pose,
                                                     double *normal_weights);

/** Compute the positions of supine_deform and unit normals. If the file has vectors of normals
 * (supine_basis_info.normal_count), this needs no pass over the triangles:
 *
 *     n_i = sum over j of v_j n_ij, normalised
 *
 * The vectors n_ij of vertex i are supine_basis_info.normals. Their weights v_j in this pose are
 * those of supine_basis_normal_weights. Cost of a normal: 3 Q + 8 multiplications for Q vectors,
 * and as many additions. Without these vectors, as in many bases of another simulator's fields and
 * after opening with without_normals, the normals are those of supine_normals: one pass over all
 * triangles for each call.
 *
 * The metadata of the file state how far these normals turn away from those of supine_normals:
 * "normals_mean_degrees" is the mean angle, "normals_p999_degrees" the 99.9th percentile. Both were
 * measured in held-out states. Angles are larger for volumes outside the range "normals_range_ml".
 * A file without a volume at rest has "normals_range_mm" instead, for the largest displacement.
 * @param xyz      [N, 3] mm, written; NULL to compute only normals
 * @param normals  [N, 3], written; 0 for a vertex without triangles */
SUPINE_API supine_status supine_deform_lit(const supine_basis *basis, const supine_pose *pose,
                                           float *xyz, float *normals);

/** Compute supine_deform_lit for vertices begin <= i < end into arrays [end - begin, 3], so that
 * several threads can share the work. Statuses: as supine_deform_lit. */
SUPINE_API supine_status supine_deform_lit_range(const supine_basis *basis, const supine_pose *pose,
                                                 size_t begin, size_t end, float *xyz,
                                                 float *normals);

/** Compute the unit normals of a deformed surface in one pass over its triangles, in the caller's
 * thread. The normal of a vertex is the mean of its triangles' normals, weighted by area.
 * @param xyz      [N, 3] positions of all vertices, mm
 * @param normals  [N, 3], written; 0 for a vertex without a triangle of positive area, or with a
 *                 triangle whose positions are not finite */
SUPINE_API void supine_normals(const supine_basis *basis, const float *xyz, float *normals);

/** Limits of supine.glsl: the largest number of modes, and the number of floats of a vertex before
 * its coefficients, for a basis whose supine_basis_info.vector is false or true. */
enum { SUPINE_GL_MODES = 16, SUPINE_GL_FLOATS = 7, SUPINE_GL_VECTOR_FLOATS = 4 };

/** Fill a vertex buffer for supine.glsl with vertices begin <= i < end. With K modes, a vertex has
 *
 *     reference     vec4 at byte 0: reference position, mm, and the index of the lung as w
 *     direction     vec3 at byte 16, mm; absent if supine_basis_info.vector is true
 *     coefficients  ceil(K / 4) vec4s from byte 28; the last may have fewer than four numbers. If
 *                   `vector` is true, K numbers each along x, y and z from byte 16, so that 16
 * modes need 12 vec4s
 * @param attributes  [end - begin, SUPINE_GL_FLOATS + K], or, if `vector` is true,
 *                    [end - begin, SUPINE_GL_VECTOR_FLOATS + 3 K], written; 44 or 64 bytes per
 *                    vertex if K is 4
 * @retval SUPINE_ERROR_UNSUPPORTED  the basis has more than SUPINE_GL_MODES modes, or clusters:
 *                                   call supine_gl_pack_clusters */
SUPINE_API supine_status supine_gl_pack(const supine_basis *basis, size_t begin, size_t end,
                                        float *attributes);

/** Compute the uniforms supine_weights and supine_gains of supine.glsl.
 * @param weights  [4 ceil(mode_count / 4)], written; [lung_count, 4 ceil(mode_count / 4)] if
 *                 supine_basis_info.order is above 0, which needs SUPINE_BY_LUNG in supine.glsl
 * @param gains    [lung_count, 3], written
 * @retval SUPINE_ERROR_UNSUPPORTED  the basis has clusters; or supine_pose.expansion is not 0,
 * which the shader lacks. Any number of modes is legal: a shader may read coefficients from a
 * texture */
SUPINE_API supine_status supine_gl_weights(const supine_basis *basis, const supine_pose *pose,
                                           float *weights, float *gains);

/** A vertex of a basis of clusters in a vertex buffer for supine.glsl: 20 bytes. */
typedef struct supine_gl_clustered_vertex {
  float reference[3]; /**< reference position, mm: a vec3 at byte 0 */
  int16_t scalars[2]; /**< a vec2 at byte 12, for glVertexAttribPointer, not normalised */
  uint16_t cluster;   /**< index of the cluster: a uint at byte 16, for glVertexAttribIPointer */
  uint16_t lung;      /**< index of the lung, which supine_normal needs: a uint at byte 18 */
} supine_gl_clustered_vertex;

/** Fill a vertex buffer for supine.glsl with vertices begin <= i < end of a basis of clusters,
 * which may have any number of modes.
 * @param vertices  [end - begin], written
 * @retval SUPINE_ERROR_UNSUPPORTED  supine_basis_info.cluster_count is 0: call supine_gl_pack */
SUPINE_API supine_status supine_gl_pack_clusters(const supine_basis *basis, size_t begin,
                                                 size_t end, supine_gl_clustered_vertex *vertices);

/** Floats of the frame of a cluster (supine_gl_frames). */
enum { SUPINE_GL_FRAME_FLOATS = 24 };

/** Compute the frames of the clusters in a pose: the texture supine_frames of supine.glsl, in which
 * a row of six texels belongs to each cluster. The texture has the format GL_RGBA32F, one level,
 * and the filters GL_NEAREST.
 * @param frames  [cluster_count, SUPINE_GL_FRAME_FLOATS], written, for glTexSubImage2D with the
 *                width 6 and the height cluster_count
 * @retval SUPINE_ERROR_UNSUPPORTED  as supine_gl_pack_clusters */
SUPINE_API supine_status supine_gl_frames(const supine_basis *basis, const supine_pose *pose,
                                          float *frames);

/** Pack the vectors whose weighted sum is the normal (supine_basis_info.normals) for supine.glsl,
 * of vertices begin <= i < end. Three vectors share the words of a uvec3, so that Q vectors need
 * W = ceil(Q / 3) attributes of type uvec3. W is SUPINE_WORDS of supine.glsl.
 * @param words  [end - begin, W, 3], written, for glVertexAttribIPointer; 24 bytes per vertex if Q
 *               is 6
 * @retval SUPINE_ERROR_UNSUPPORTED  the basis has no normals, or was opened without_normals */
SUPINE_API supine_status supine_gl_pack_normals(const supine_basis *basis, size_t begin, size_t end,
                                                uint32_t *words);

/** Compute the uniform supine_normal_weights of supine.glsl. W is the macro SUPINE_WORDS of
 * supine.glsl, the number of uvec3 attributes for normals.
 * @param uniforms  [lung_count, W, 3], written, for glUniform3fv with a count of lung_count * W
 * @retval SUPINE_ERROR_UNSUPPORTED  as supine_gl_pack_normals */
SUPINE_API supine_status supine_gl_normal_weights(const supine_basis *basis,
                                                  const supine_pose *pose, float *uniforms);

#ifdef __cplusplus
}
#endif
#endif
