/* SPDX-License-Identifier: MIT */
/** @file
 * The run-time library: open a basis file, then deform its lungs for any gravity and any volume.
 *
 *     x_ij   = p_ij + A_j (sum over k of w_k(g) c_ik) d_ij
 *     w_k(g) = sum over l, m of modes[k, lm] Y_lm(g)
 *
 * x_ij is coordinate j (x, y, z) of vertex i in mm, p_ij its reference position, d_ij its direction
 * and c_ik its coefficient of mode k. The weights w_k depend on gravity g, the gains A_j of each
 * lung on its volume. A program parses or fills in a supine_state (posture and volume), gets its
 * weights and gains from supine_basis_pose, and the positions from supine_deform. In shapes, N is
 * the number of vertices, M of triangles, G of lungs, K of modes, Q of modes of the normals, and L
 * the highest band of the harmonics.
 *
 * After opening, no function allocates, reads files or locks; any number of threads may use one
 * basis. Gravity is a direction in body axes (DICOM LPS) that points where things fall: supine
 * (0,1,0), prone (0,-1,0), left lateral (1,0,0), right lateral (-1,0,0), upright (0,0,-1).
 *
 * A compiled program works with newer libraries: supine_basis_info only grows at its end,
 * supine_basis_options begins with its size, and no other struct changes. */
#ifndef SUPINE_RUNTIME_H
#define SUPINE_RUNTIME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <supine/safetensors.h>
#include <supine/state.h>
#include <supine/status.h>
#include <supine/version.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Largest number of modes of a basis. */
enum { SUPINE_MODES_MAX = 256 };
/** Largest number of lungs of a basis. */
enum { SUPINE_LUNGS_MAX = 16 };
/** Largest number of modes of the normals. */
enum { SUPINE_NORMAL_MODES_MAX = 64 };

/** An open basis. */
typedef struct supine_basis supine_basis;

/** How an open basis keeps coefficients, directions and reference positions in memory. */
typedef enum supine_storage {
  SUPINE_STORAGE_AUTO = 0, /**< the smallest storage with an error of at most 0.005 mm */
  SUPINE_STORAGE_EXACT,    /**< float32, as in the file */
  SUPINE_STORAGE_INT16,    /**< 16-bit coefficients with a scale for each mode; coordinates of
                              directions and reference positions of 21 or 22 bits */
  SUPINE_STORAGE_MIXED, /**< INT16, but the last 3 floor(K / 8) of the K modes have coefficients of
                           10 or 11 bits; the same as INT16 if K is below 8 */
  SUPINE_STORAGE_COUNT
} supine_storage;

/** The instruction set of the evaluation. All sets give the same positions within
 * supine_basis_error. */
typedef enum supine_simd {
  SUPINE_SIMD_AUTO = 0, /**< the widest instruction set that this processor has */
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
  bool without_normals; /**< do not load normals; saves 4 Q bytes per vertex for Q modes of the
                           normals */
} supine_basis_options;

/** The content of an open basis. The basis owns the struct and all arrays. */
typedef struct supine_basis_info {
  size_t vertex_count;
  size_t triangle_count;
  size_t mode_count;        /**< number K of modes */
  size_t band;              /**< highest band L of the harmonics */
  size_t lung_count;        /**< number G of lungs */
  const size_t *lung_begin; /**< [G + 1] first vertex of each lung, and N at the end */
  bool vector; /**< each vertex has three coefficients for each mode and no direction; false: one
                  coefficient for each mode and a direction */
  bool has_volume;         /**< the surface is closed, and states may have volumes */
  supine_storage storage;  /**< the storage in use, never AUTO */
  supine_simd simd;        /**< the instruction set in use, never AUTO */
  double bytes_per_vertex; /**< bytes that an evaluation reads for each vertex */
  /** Bound on the error of storage and rounding, mm: the largest over 26 directions of gravity (the
   * faces, edges and corners of a cube) 500 mL above the reference surface or, on an open surface,
   * where the largest displacement is 20 mm. supine_basis_error returns the bound for any pose. */
  double storage_error;
  const char *const *lung_names;  /**< [G] such as "left"; "0", "1", ... for lungs without a name */
  const float *bounds;            /**< [G, 2, 3] lowest and highest corner of each lung's box, mm */
  const float *vertices;          /**< [N, 3] reference positions p, mm, LPS */
  const uint32_t *triangles;      /**< [M, 3] vertices of each triangle */
  const float *direction;         /**< [N, 3] directions d, mm; NULL if `vector` */
  const float *coefficients;      /**< [N, K] coefficients c; [N, 3, K] in mm if `vector` */
  const double *modes;            /**< [K, (L + 1)^2] coefficients of the weights in harmonics */
  const double *volume_linear;    /**< [G, A, K] linear volume forms, mL (supine_volume_contract),
                                     A: volume_axes; NULL without volumes */
  const double *volume_quadratic; /**< [G, A, K, K] quadratic volume forms, mL; or NULL */
  const double *volume_cubic;     /**< [G, K, K, K] cubic volume forms, mL; or NULL */
  /** The memory that an evaluation reads: tiles of 16 vertices, each of 16 times bytes_per_vertex.
   * Use it only to measure memory traffic, as the layout changes between versions. */
  const void *packed;
  size_t normal_count;    /**< number Q of modes of the normals; 0 without normals */
  const int16_t *normals; /**< [N, 3, Q] modes n of the normals (supine_deform_lit) */
  /** [G, Q, 3, T] V of supine_basis_normal_weights, where T is 1 + 2 K + K (K + 1) / 2; in files
   * of versions 1 and 2 [G, Q, (K + 1)(K + 2) / 2]. */
  const double *normal_weights;
  const double *reference_volume; /**< [G] volume of each lung of the reference surface, gas and
                                       tissue, mL; 0 without volumes */
  bool has_rest;                  /**< the file has the volume at rest for every posture */
  bool has_full;                  /**< the reference surface is at full inflation */
  bool is_fields; /**< the file was made from another simulator's fields, which gain 1 reproduces */
  size_t volume_axes; /**< number A of axes with their own gain: 3; 1 in versions 1 and 2 */
  double bend[3];     /**< bend of the path between full inflation and rest on each axis
                         (supine_volume_bend); 0 for a straight path */
} supine_basis_info;

/** Weights and gains of one state. */
typedef struct supine_pose {
  double weights[SUPINE_MODES_MAX];  /**< weight w_k of each mode */
  double gains[SUPINE_LUNGS_MAX][3]; /**< gains A_j of each lung; all 0: the reference surface */
} supine_pose;

/** Open a basis from a file, or from `size` bytes in memory, which must outlive the basis: check
 * all of it, and pack it for evaluation.
 * @param options  NULL for the defaults
 * @param basis    written; NULL on failure
 * @retval SUPINE_ERROR_READ         the file is missing or unreadable
 * @retval SUPINE_ERROR_FORMAT       the file is truncated, corrupted or not a basis file
 * @retval SUPINE_ERROR_ARGUMENT     an option is out of range, or the size is not set
 * @retval SUPINE_ERROR_UNSUPPORTED  the processor or the library lacks the instruction set
 * @retval SUPINE_ERROR_MEMORY       an allocation failed
 * Cost: a few passes over the file. Memory: bytes_per_vertex for each vertex, 12 bytes for each
 * vertex and three modes of the normals, and the mapped file. */
SUPINE_API supine_status supine_basis_open_with(const char *path,
                                                const supine_basis_options *options,
                                                supine_basis **basis, supine_error *error);
SUPINE_API supine_status supine_basis_open_memory_with(const void *bytes, size_t size,
                                                       const supine_basis_options *options,
                                                       supine_basis **basis, supine_error *error);
/** Open a basis with the default options. Statuses: as supine_basis_open_with. */
SUPINE_API supine_status supine_basis_open(const char *path, supine_basis **basis,
                                           supine_error *error);
SUPINE_API supine_status supine_basis_open_memory(const void *bytes, size_t size,
                                                  supine_basis **basis, supine_error *error);
/** Close a basis; NULL is legal. */
SUPINE_API void supine_basis_close(supine_basis *basis);

/** Return the content of a basis; it is valid until the basis is closed. */
SUPINE_API const supine_basis_info *supine_basis_get_info(const supine_basis *basis);
/** Return the metadata string of a key, such as "format" or "error_rms_percent"; NULL if none. */
SUPINE_API const char *supine_basis_metadata(const supine_basis *basis, const char *key);
/** Return all metadata, in the order of the file.
 * @param count  number of strings, written */
SUPINE_API const supine_metadata *supine_basis_all_metadata(const supine_basis *basis,
                                                            size_t *count);
/** Return the tensor of the file with a name, such as "error_modes"; NULL if there is none. */
SUPINE_API const supine_tensor *supine_basis_tensor(const supine_basis *basis, const char *name);
/** Return the reference positions [N, 3], mm, LPS. */
SUPINE_API const float *supine_basis_vertices(const supine_basis *basis);
/** Return the triangles [M, 3], each as the indices of three vertices. */
SUPINE_API const uint32_t *supine_basis_triangles(const supine_basis *basis);

/** Compute the weights of the modes for a direction of gravity.
 * @param gravity  [3], any length but 0
 * @param weights  [K] w, written
 * @retval SUPINE_ERROR_ARGUMENT  gravity is zero or not finite
 * Cost: K (L + 1)^2 multiplications, once a frame. */
SUPINE_API supine_status supine_basis_weights(const supine_basis *basis, const double gravity[3],
                                              double *weights);

/** Compute the weights and gains of a state. The lungs of the pose hold exactly the volume of the
 * state, without a pass over the vertices.
 *
 * A total volume is divided among the lungs. Above rest, every lung is the same fraction of the way
 * from its own volume at rest to its own volume at full inflation [MilicEmili1966]; below rest, all
 * lungs hold the same fraction of their volumes at rest. The gains of a lung lie on a path from
 * full inflation through rest (supine_volume_bend). Files of versions 1 and 2 have one gain for all
 * lungs and axes.
 *
 * SUPINE_VOLUME_DEFAULT is rest if the basis has it; else gain 1 if the basis was made from another
 * simulator's fields; else 500 mL above the scan.
 * @param state  its gravity has any length but 0
 * @param pose   written
 * @retval SUPINE_ERROR_ARGUMENT      gravity is zero or not finite, the basis lacks the volume that
 *                                    the state counts from, or the state does not name every lung
 *                                    of the basis once
 * @retval SUPINE_ERROR_OPEN_SURFACE  the surface is open and has no volumes
 * @retval SUPINE_ERROR_NUMERICAL     the surface folds before it holds that volume; single
 *                                    triangles that turn over earlier are not detected
 *
 * Cost: K (L + 1)^2 multiplications for the weights, G K^3 for the gains, once a frame.
 *
 * [MilicEmili1966]  Milic-Emili, Henderson, Dolovich, Trop, Kaneko, J. Appl. Physiol. 21, 1966,
 *                   749-759 */
SUPINE_API supine_status supine_basis_pose(const supine_basis *basis, const supine_state *state,
                                           supine_pose *pose, supine_error *error);

/** Compute the gains of a state for the weights that `pose` already has, for example in a breath.
 * They must be the weights of the state's gravity. Statuses: as supine_basis_pose. */
SUPINE_API supine_status supine_basis_gains(const supine_basis *basis, const supine_state *state,
                                            supine_pose *pose, supine_error *error);

/** Return the volume that SUPINE_VOLUME_DEFAULT means for this basis (supine_basis_pose). If it
 * means gain 1, return SUPINE_VOLUME_DEFAULT itself. */
SUPINE_API supine_volume supine_basis_default_volume(const supine_basis *basis);

/** Set every gain of a pose to one number, regardless of volumes: for open surfaces and fields. */
SUPINE_API void supine_pose_fill(supine_pose *pose, double gain);

/** Return the state of the scan: its posture, and SUPINE_VOLUME_SCAN as its volume. */
SUPINE_API supine_state supine_basis_scan(const supine_basis *basis);

/** Compute the volume of each lung in a pose, if supine_basis_info.has_volume is true.
 * @param volumes  [G] gas and tissue, mL, written */
SUPINE_API void supine_basis_volumes(const supine_basis *basis, const supine_pose *pose,
                                     double *volumes);

/** Return a bound on the error of storage and rounding in a pose, mm: on the distance of every
 * deformed vertex from the position that exact arithmetic gives for the numbers of the file. */
SUPINE_API double supine_basis_error(const supine_basis *basis, const supine_pose *pose);

/** Compute the deformed position of every vertex, in the caller's thread.
 *
 *     x_ij = p_ij + A_j (w . c_i) d_ij        A: the gains of the lung of vertex i
 *
 * Rigid parts (ranges of vertices in the tensor "rigid", U32 [R, 2]) move by the rigid motion that
 * fits these positions best, as in all functions below for positions and displacements.
 *
 * @param xyz  [N, 3] mm, LPS, written; aligned as a float
 * Cost per vertex: K + 6 multiplications and K + 2 additions (16 modes: 22 and 18). If positions
 * and basis are larger than the cache, positions are written with stores that bypass the cache,
 * fastest if `xyz` is aligned to 64 bytes. */
SUPINE_API void supine_deform(const supine_basis *basis, const supine_pose *pose, float *xyz);

/** Compute supine_deform for vertices begin <= i < end, so that several threads can share the work.
 * Ranges that begin at multiples of 16 are fastest.
 * @param xyz  [end - begin, 3] mm, written */
SUPINE_API void supine_deform_range(const supine_basis *basis, const supine_pose *pose,
                                    size_t begin, size_t end, float *xyz);

/** Compute supine_deform_range for many poses. Each vertex is read from memory only once.
 * @param poses  [count]
 * @param xyz    [count, end - begin, 3] mm, written */
SUPINE_API void supine_deform_batch(const supine_basis *basis, size_t count,
                                    const supine_pose *poses, size_t begin, size_t end, float *xyz);

/** Compute the displacements A_j (w . c_i) d_ij of vertices begin <= i < end from the reference
 * surface. Except in rigid parts, they are linear in the gains: the difference between the gains of
 * two poses gives the displacements from one pose to the other (supine_step).
 * @param xyz  [end - begin, 3] mm, written */
SUPINE_API void supine_displace_range(const supine_basis *basis, const supine_pose *pose,
                                      size_t begin, size_t end, float *xyz);

/** Add one step of a breath in a fixed posture, three additions a vertex [Santhanam2008] (III-B):
 *
 *     xyz += step
 *
 * @param count  number of vertices
 * @param step   [count, 3] displacements of the step, mm: supine_displace_range for the difference
 *               of the gains; their negatives undo the step
 * @param xyz    [count, 3] mm, changed; must not overlap `step`
 * Each step rounds a coordinate by at most 2^-24 of its value. These errors add up, so begin each
 * breath from supine_deform.
 *
 * [Santhanam2008]  full reference in supine/breath.h */
SUPINE_API void supine_step(size_t count, const float *step, float *xyz);

/** Compute the weights v of the normals' modes for each lung. Component c of a normal is quadratic
 * in the weights w, and linear in each of the gains a and b of the two axes after c (cyclically):
 *
 *     v_j = sum over c of V_jc . (1, a w_k, b w_k, a b w_k w_l (k <= l))
 *
 * Files of versions 1 and 2 have one gain a: v_j = V_j . (1, a w_k, a^2 w_k w_l (k <= l)).
 * @param normal_weights  [G, Q] v, written
 * Cost: 1.5 G Q K^2 multiplications, once a frame. */
SUPINE_API void supine_basis_normal_weights(const supine_basis *basis, const supine_pose *pose,
                                            double *normal_weights);

/** Compute the positions of supine_deform and unit normals, without a pass over the triangles:
 *
 *     n_i = sum over j of v_j n_ij, normalised
 *
 * The file states the angle between these normals and those of supine_normals, measured on held-out
 * states: its mean and its 99.9th percentile are metadata "normals_mean_degrees" and
 * "normals_p999_degrees". They hold in the range of volumes "normals_range_ml" or, without rest, in
 * the range of largest displacements "normals_range_mm"; the angle is larger outside.
 *
 * @param xyz      [N, 3] mm, written; NULL for the normals alone
 * @param normals  [N, 3], written; 0 for a vertex without triangles
 * @retval SUPINE_ERROR_UNSUPPORTED  the file has no normals, or it was opened without_normals
 * Cost per vertex in addition to its position: 3 Q + 8 multiplications, and as many additions. */
SUPINE_API supine_status supine_deform_lit(const supine_basis *basis, const supine_pose *pose,
                                           float *xyz, float *normals);

/** Compute supine_deform_lit for vertices begin <= i < end into arrays [end - begin, 3], so that
 * several threads can share the work. Statuses: as supine_deform_lit. */
SUPINE_API supine_status supine_deform_lit_range(const supine_basis *basis, const supine_pose *pose,
                                                 size_t begin, size_t end, float *xyz,
                                                 float *normals);

/** Compute the unit normals of a deformed surface from its triangles: at each vertex the mean of
 * its triangles' normals, weighted by area.
 * @param xyz      [N, 3] positions of all vertices, mm
 * @param normals  [N, 3], written; 0 for a vertex without a triangle of positive area
 * Cost: one pass over the triangles, in the caller's thread. */
SUPINE_API void supine_normals(const supine_basis *basis, const float *xyz, float *normals);

/** Largest number of modes that supine.glsl evaluates, and the number of floats before the
 * coefficients in the attributes of a vertex. */
enum { SUPINE_GL_MODES = 16, SUPINE_GL_FLOATS = 7 };

/** Fill a vertex buffer for supine.glsl with vertices begin <= i < end, each of which has
 *
 *     reference     vec4 at byte 0: reference position, mm, and the index of the lung as w
 *     direction     vec3 at byte 16, mm
 *     coefficients  (K + 3) / 4 vec4s from byte 28; the last may have fewer than four numbers
 *
 * @param attributes  [end - begin, SUPINE_GL_FLOATS + K], written; 44 bytes a vertex if K is 4
 * @retval SUPINE_ERROR_UNSUPPORTED  more than SUPINE_GL_MODES modes, or a vector field */
SUPINE_API supine_status supine_gl_pack(const supine_basis *basis, size_t begin, size_t end,
                                        float *attributes);

/** Compute the uniforms supine_weights [V] and supine_gains of supine.glsl, with V = (K + 3) / 4.
 * @param weights  [4 V], written
 * @param gains    [G, 3], written
 * @retval SUPINE_ERROR_UNSUPPORTED  as supine_gl_pack */
SUPINE_API supine_status supine_gl_weights(const supine_basis *basis, const supine_pose *pose,
                                           float *weights, float *gains);

/** Pack the normals' modes of vertices begin <= i < end for supine.glsl: three modes to a word, in
 * W = (Q + 2) / 3 attributes of type uvec3. W is SUPINE_WORDS of supine.glsl.
 * @param words  [end - begin, W, 3], written, for glVertexAttribIPointer; 24 bytes each if Q is 6
 * @retval SUPINE_ERROR_UNSUPPORTED  the basis has no normals, or was opened without_normals */
SUPINE_API supine_status supine_gl_pack_normals(const supine_basis *basis, size_t begin, size_t end,
                                                uint32_t *words);

/** Compute the uniform supine_normal_weights of supine.glsl, with W of supine_gl_pack_normals.
 * @param uniforms  [G, W, 3], written, for glUniform3fv(location, G * W, uniforms)
 * @retval SUPINE_ERROR_UNSUPPORTED  as supine_gl_pack_normals */
SUPINE_API supine_status supine_gl_normal_weights(const supine_basis *basis,
                                                  const supine_pose *pose, float *uniforms);

#ifdef __cplusplus
}
#endif
#endif
