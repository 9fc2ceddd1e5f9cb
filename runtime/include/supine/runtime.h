/* SPDX-License-Identifier: MIT */
/** @file
 * The run-time library: open a basis file, then deform its lungs for any direction of gravity and
 * any volume.
 *
 *     x_ij = p_ij + A_j (sum over k of w_k(g) c_ik) d_ij      w_k(g) = sum over lm of modes[k, lm]
 * Y_lm(g)
 *
 * for axis j = x, y, z; the gains A_j of each lung follow from its volume. A program parses or
 * fills a supine_state (posture and volume), asks supine_basis_pose for its weights and gains, and
 * supine_deform for the positions.
 *
 * Nothing allocates, reads files or locks after opening; any number of threads may use one basis.
 * Gravity is a direction in body axes (DICOM LPS) that points where things fall: supine (0,1,0),
 * prone (0,-1,0), left lateral (1,0,0), right lateral (-1,0,0), upright (0,0,-1).
 *
 * Structs grow without breaking a program that was compiled before: those that the library owns
 * and shows (supine_basis_info) at their end, and options begin with their own size. All others
 * stay as they are. */
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

/** Most modes (columns of coefficients) that a basis file may have. */
enum { SUPINE_MODES_MAX = 256 };
/** Most lungs in one file. */
enum { SUPINE_LUNGS_MAX = 16 };
/** Most modes of the normals. */
enum { SUPINE_NORMAL_MODES_MAX = 64 };

typedef struct supine_basis supine_basis;

/** How an open basis keeps its numbers in memory. The file always has float32. */
typedef enum supine_storage {
  SUPINE_STORAGE_AUTO = 0, /**< the smallest of MIXED, INT16 and EXACT that errs by 0.005 mm at most
                                (see storage_error) */
  SUPINE_STORAGE_EXACT,    /**< everything as in the file */
  SUPINE_STORAGE_INT16,    /**< 16-bit coefficients, a scale for each mode; compact directions and
                                rest positions */
  SUPINE_STORAGE_MIXED,    /**< INT16, but the last three in eight modes at 10 or 11 bits; INT16
                                itself where there are fewer than eight modes */
  SUPINE_STORAGE_COUNT
} supine_storage;

/** Which code evaluates. All give the same positions within supine_basis_error. */
typedef enum supine_simd {
  SUPINE_SIMD_AUTO = 0, /**< the widest that this processor has */
  SUPINE_SIMD_PORTABLE, /**< vectors of four numbers: SSE2, NEON, WebAssembly */
  SUPINE_SIMD_AVX2,     /**< AVX2 and FMA */
  SUPINE_SIMD_AVX512,   /**< AVX-512 F and BW */
  SUPINE_SIMD_COUNT
} supine_simd;

/** How to open a basis; zeros after the size are the defaults. */
typedef struct supine_basis_options {
  size_t size; /**< sizeof(supine_basis_options) */
  supine_storage storage;
  supine_simd simd;
  bool without_normals; /**< as if the file had none: saves 6 bytes a vertex and normal mode */
} supine_basis_options;

/** What a basis holds, owned by it and as in the file: nothing is copied. */
typedef struct supine_basis_info {
  size_t vertex_count;
  size_t triangle_count;
  size_t mode_count; /**< K */
  size_t band;       /**< L */
  size_t lung_count; /**< G; the vertices of lung j are lung_begin[j] <= i < lung_begin[j + 1] */
  const size_t *lung_begin; /**< [G + 1] */
  bool vector;     /**< three coefficients per vertex and mode instead of one and a direction */
  bool has_volume; /**< the surface is closed: volumes can be asked for */
  supine_storage storage;  /**< as chosen, never AUTO */
  supine_simd simd;        /**< as chosen, never AUTO */
  double bytes_per_vertex; /**< that an evaluation reads */
  /** Bound, in mm, on the error of storage and rounding at a breath of 500 mL (on an open surface:
   * where the largest displacement is 20 mm), over the 26 directions of the faces, edges and
   * corners of a cube. supine_basis_error gives it for any other. */
  double storage_error;
  const char *const *lung_names; /**< [G] "left", ...; numbers from 0 where the file names none */
  const float *bounds;   /**< [G, 2, 3] lowest and highest corner of each lung's box at rest, mm */
  const float *vertices; /**< [N, 3] rest positions, mm, LPS */
  const uint32_t *triangles;      /**< [M, 3] */
  const float *direction;         /**< [N, 3] d_i, mm; NULL where the kind is vector */
  const float *coefficients;      /**< [N, K] c_ik, or [N, 3, K], mm, where the kind is vector */
  const double *modes;            /**< [K, (L+1)^2] */
  const double *volume_linear;    /**< [G, A, K] the volumes' forms, mL, see
                                       supine_volume_contract; A: volume_axes; these three NULL
                                       where has_volume is false */
  const double *volume_quadratic; /**< [G, A, K, K] */
  const double *volume_cubic;     /**< [G, K, K, K] */
  /** What an evaluation reads, bytes_per_vertex for each vertex in whole runs of 16 vertices: for
   * measuring what its traffic costs. What it means changes between versions. */
  const void *packed;
  /** Q, modes of the normals (supine_deform_lit); 0 where the file has none. */
  size_t normal_count;
  const int16_t *normals;         /**< [N, 3, Q] n */
  const double *normal_weights;   /**< [G, Q, 3, T] V, T = 1 + 2 K + K (K + 1) / 2; in files of
                                       versions 1 and 2 [G, Q, (K + 1)(K + 2) / 2] */
  const double *reference_volume; /**< [G] mL that each lung of the reference surface holds, gas and
                                       tissue; 0 where has_volume is false */
  bool has_rest;                  /**< the volume at rest is known in every posture */
  bool has_full;                  /**< the reference surface is full inflation */
  bool is_fields; /**< made from another simulator's fields: gain 1 gives them back */
  size_t
      volume_axes; /**< A: 3; 1 in files of versions 1 and 2, whose gains are equal on all axes */
  double bend[3];  /**< of the path between full inflation and rest, see supine_volume_bend */
} supine_basis_info;

/** Weights and gains of one state. */
typedef struct supine_pose {
  double weights[SUPINE_MODES_MAX];  /**< w_k */
  double gains[SUPINE_LUNGS_MAX][3]; /**< A_j of each lung, x, y, z; 0: the reference surface */
} supine_pose;

/** Opens and fully validates a basis file, or one in memory (which must outlive the basis), and
 * packs it for evaluation. `options` may be NULL.
 * @retval SUPINE_ERROR_READ    missing or unreadable
 * @retval SUPINE_ERROR_FORMAT  truncated, corrupted, or not a basis file (detail in `error`)
 * @retval SUPINE_ERROR_ARGUMENT     an option out of range, or options without their size
 * @retval SUPINE_ERROR_UNSUPPORTED  this processor, or this build, lacks the code asked for
 * @retval SUPINE_ERROR_MEMORY
 * Cost: a few passes over the file; memory of bytes_per_vertex besides the mapped file. */
SUPINE_API supine_status supine_basis_open_with(const char *path,
                                                const supine_basis_options *options,
                                                supine_basis **basis, supine_error *error);
SUPINE_API supine_status supine_basis_open_memory_with(const void *bytes, size_t size,
                                                       const supine_basis_options *options,
                                                       supine_basis **basis, supine_error *error);
/** The same with default options. */
SUPINE_API supine_status supine_basis_open(const char *path, supine_basis **basis,
                                           supine_error *error);
SUPINE_API supine_status supine_basis_open_memory(const void *bytes, size_t size,
                                                  supine_basis **basis, supine_error *error);
/** Releases a basis; NULL is legal. */
SUPINE_API void supine_basis_close(supine_basis *basis);

SUPINE_API const supine_basis_info *supine_basis_get_info(const supine_basis *basis);
/** A metadata string ("format", "error_rms_percent", ...), or NULL. */
SUPINE_API const char *supine_basis_metadata(const supine_basis *basis, const char *key);
/** All of them, in the file's order.
 * @param count  written */
SUPINE_API const supine_metadata *supine_basis_all_metadata(const supine_basis *basis,
                                                            size_t *count);
/** Any tensor of the file ("error_modes", ...), or NULL. */
SUPINE_API const supine_tensor *supine_basis_tensor(const supine_basis *basis, const char *name);
/** Rest positions [N, 3], mm, LPS. */
SUPINE_API const float *supine_basis_vertices(const supine_basis *basis);
/** Triangles [M, 3]. */
SUPINE_API const uint32_t *supine_basis_triangles(const supine_basis *basis);

/** Weights w [K] of the modes for gravity along `gravity` (any length but 0).
 * Cost: K (L+1)^2 multiplications, once a frame.
 * @retval SUPINE_ERROR_ARGUMENT  gravity is zero or not finite */
SUPINE_API supine_status supine_basis_weights(const supine_basis *basis, const double gravity[3],
                                              double *weights);

/** Weights and gains of a state.
 *
 * A total volume is shared out among the lungs: each fills on the straight line between its rest
 * and its full volume [MilicEmili1966], all at the same part of the way; below rest all shrink in
 * proportion. Its gains lie on a path from full inflation through rest (supine_volume_bend). Files
 * of versions 1 and 2 have one gain for all lungs and axes instead. Volumes are met exactly,
 * without a pass over the vertices.
 *
 * SUPINE_VOLUME_DEFAULT is rest where it is known; the fields as given (gain 1) where the basis was
 * made from fields; else 500 mL above the scan.
 * @param state  gravity of any length but 0
 * @retval SUPINE_ERROR_ARGUMENT      gravity is zero or not finite; rest or full where the basis
 * knows none; a lung that it does not have
 * @retval SUPINE_ERROR_OPEN_SURFACE  a volume of an open surface
 * @retval SUPINE_ERROR_NUMERICAL     the surface folds before it holds that volume. Triangles may
 * turn over earlier: that takes a look at the positions Cost: K (L+1)^2 multiplications for the
 * weights, G K^3 for the gains, once a frame. */
SUPINE_API supine_status supine_basis_pose(const supine_basis *basis, const supine_state *state,
                                           supine_pose *pose, supine_error *error);

/** The gains alone, for weights that `pose` already has: a breath in one posture. */
SUPINE_API supine_status supine_basis_gains(const supine_basis *basis, const supine_state *state,
                                            supine_pose *pose, supine_error *error);

/** The volume that SUPINE_VOLUME_DEFAULT stands for; itself where that is the fields as given. */
SUPINE_API supine_volume supine_basis_default_volume(const supine_basis *basis);

/** Set every gain to one number, which is free of volumes: for open surfaces and fields. */
SUPINE_API void supine_pose_fill(supine_pose *pose, double gain);

/** The state of the scan: its posture, SUPINE_VOLUME_SCAN. */
SUPINE_API supine_state supine_basis_scan(const supine_basis *basis);

/** Volumes of the lungs in a pose, gas and tissue, mL. Requires has_volume.
 * @param volumes  [G], written */
SUPINE_API void supine_basis_volumes(const supine_basis *basis, const supine_pose *pose,
                                     double *volumes);

/** Bound, in mm, on the distance of any deformed vertex from exact arithmetic on the numbers of the
 * file: what storage and rounding may cost in this pose. */
SUPINE_API double supine_basis_error(const supine_basis *basis, const supine_pose *pose);

/** Deformed positions of every vertex, in the caller's thread.
 *
 *     x_ij = p_ij + A_j (w . c_i) d_ij        A: the gains of the lung of i
 *
 * Rigid parts (tensor `rigid` U32 [R, 2], ranges of vertices) are moved by the rigid motion that
 * fits this best. Every function that places vertices has them so.
 *
 * @param xyz  [N, 3], written, mm, LPS; any alignment of a float
 * Cost per vertex: K + 6 multiplications and K + 2 additions (16 modes: 22 and 18). Where positions
 * outgrow the cache they are stored past it, fastest where `xyz` is aligned to 64 bytes. */
SUPINE_API void supine_deform(const supine_basis *basis, const supine_pose *pose, float *xyz);

/** supine_deform of vertices begin <= i < end into xyz [end - begin, 3]: a thread's share. Shares
 * that begin at multiples of 16 are fastest. */
SUPINE_API void supine_deform_range(const supine_basis *basis, const supine_pose *pose,
                                    size_t begin, size_t end, float *xyz);

/** supine_deform_range into three arrays [end - begin]. */
SUPINE_API void supine_deform_separate(const supine_basis *basis, const supine_pose *pose,
                                       size_t begin, size_t end, float *x, float *y, float *z);

/** supine_deform_range for many poses at once, at about the speed of a matrix product: each vertex
 * is read once.
 *
 * @param poses  [count]
 * @param xyz    [count, end - begin, 3], written */
SUPINE_API void supine_deform_batch(const supine_basis *basis, size_t count,
                                    const supine_pose *poses, size_t begin, size_t end, float *xyz);

/** Displacements A_j (w . c_i) d_ij of vertices begin <= i < end, mm, without the reference
 * positions: what supine_step adds. Every vertex's displacement is linear in the gains. */
SUPINE_API void supine_displace_range(const supine_basis *basis, const supine_pose *pose,
                                      size_t begin, size_t end, float *xyz);

/** One step of a breath at a frozen orientation, three additions a vertex [Santhanam2008] (III-B):
 *
 *     xyz += step
 *
 * @param count  vertices
 * @param step   [count, 3] displacement of one step, of supine_displace_range with the gains of
 * one step; subtract a step by displacing with its negative
 * @param xyz    [count, 3], positions before and after; must not overlap `step`
 * Rounding accumulates: at most 2^-24 of the coordinate a step. Begin each breath from
 * supine_deform. */
SUPINE_API void supine_step(size_t count, const float *step, float *xyz);

/** Weights v [G, Q] of the normals' modes for each lung, from the three components c of a normal,
 * which are quadratic in the weights w and the gains a, b of the two axes after c (cyclically):
 *
 *     v_j = sum over c of V_jc . (1, a w_k, b w_k, a b w_k w_l (k <= l))
 *
 * In files of versions 1 and 2, whose gains are equal: V_j . (1, a w_k, a^2 w_k w_l).
 * Cost: 1.5 G Q K^2 multiplications, once a frame. */
SUPINE_API void supine_basis_normal_weights(const supine_basis *basis, const supine_pose *pose,
                                            double *normal_weights);

/** Deformed positions, as supine_deform gives them, and unit normals, without a look at triangles:
 *
 *     n_i = sum over j of v_j n_ij, normalised
 *
 * How far these are from supine_normals' the file says, over postures and volumes that took no part
 * in making them: metadata "normals_mean_degrees" and "normals_p999_degrees", volumes
 * "normals_range_ml". Beyond those volumes they are farther.
 *
 * @param xyz      [N, 3], written; NULL: the normals alone
 * @param normals  [N, 3], written; 0 where a vertex has no triangle
 * Cost per vertex beside the position's: 3 Q + 8 multiplications, and as many additions.
 * @retval SUPINE_ERROR_UNSUPPORTED  the file has no normals, or it was opened without_normals */
SUPINE_API supine_status supine_deform_lit(const supine_basis *basis, const supine_pose *pose,
                                           float *xyz, float *normals);

/** supine_deform_lit of vertices begin <= i < end into arrays [end - begin, 3]: a thread's share.
 */
SUPINE_API supine_status supine_deform_lit_range(const supine_basis *basis, const supine_pose *pose,
                                                 size_t begin, size_t end, float *xyz,
                                                 float *normals);

/** supine_deform_batch with normals [count, end - begin, 3]. */
SUPINE_API supine_status supine_deform_lit_batch(const supine_basis *basis, size_t count,
                                                 const supine_pose *pose, size_t begin, size_t end,
                                                 float *xyz, float *normals);

/** Unit normals of a deformed surface at its vertices, exactly: the mean of the triangles' normals,
 * weighted by their areas.
 *
 * @param xyz      [N, 3] positions of every vertex
 * @param normals  [N, 3], written; 0 where a vertex has no triangle of positive area
 * Cost: one pass over the triangles, in the caller's thread. */
SUPINE_API void supine_normals(const supine_basis *basis, const float *xyz, float *normals);

/** Most modes that the GPU form has room for, and floats of one vertex's attributes before its
 * coefficients. */
enum { SUPINE_GL_MODES = 16, SUPINE_GL_FLOATS = 7 };

/** Attributes of vertices begin <= i < end for supine.glsl, as one vertex buffer has them:
 *
 *     rest vec4 (offset 0; w is the lung's number), direction vec3 (offset 16),
 *     coefficients (offset 28): (K + 3) / 4 vec4s, the last of which may have fewer numbers
 *
 * @param attributes  [end - begin, SUPINE_GL_FLOATS + K], written; 44 bytes a vertex of 4 modes
 * @retval SUPINE_ERROR_UNSUPPORTED  more than SUPINE_GL_MODES modes, or a vector field */
SUPINE_API supine_status supine_gl_pack(const supine_basis *basis, size_t begin, size_t end,
                                        float *attributes);

/** The uniforms supine_weights and supine_gains of supine.glsl, whose SUPINE_VECTORS is
 * V = (K + 3) / 4.
 * @param weights  [4 V], written
 * @param gains    [G, 3], written
 * @retval SUPINE_ERROR_UNSUPPORTED  a vector field, or more than SUPINE_GL_MODES modes */
SUPINE_API supine_status supine_gl_weights(const supine_basis *basis, const supine_pose *pose,
                                           float *weights, float *gains);

/** The normals' modes of vertices begin <= i < end for supine.glsl, three to a word, in
 * SUPINE_WORDS W = (Q + 2) / 3 attributes uvec3.
 * @param words  [end - begin, W, 3], written, for glVertexAttribIPointer; 24 bytes of 6 modes
 * @retval SUPINE_ERROR_UNSUPPORTED  the basis has no normals, or was opened without_normals */
SUPINE_API supine_status supine_gl_pack_normals(const supine_basis *basis, size_t begin, size_t end,
                                                uint32_t *words);

/** The uniform supine_normal_weights of supine.glsl.
 * @param uniforms  [G, W, 3], written, for glUniform3fv(location, G W, uniforms)
 * @retval SUPINE_ERROR_UNSUPPORTED  as supine_gl_pack_normals */
SUPINE_API supine_status supine_gl_normal_weights(const supine_basis *basis,
                                                  const supine_pose *pose, float *uniforms);

#ifdef __cplusplus
}
#endif
#endif
