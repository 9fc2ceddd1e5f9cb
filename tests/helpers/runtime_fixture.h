/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Synthetic basis files: bipyramids with random displacements, evaluated in double precision. */
#ifndef SUPINE_TEST_RUNTIME_FIXTURE_H
#define SUPINE_TEST_RUNTIME_FIXTURE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <supine/runtime.h>

typedef struct fixture {
  size_t vertices, triangles, modes, lungs;
  size_t band; /* largest degree of the spherical harmonics */
  bool vector, volume;
  size_t lung_begin[17];
  float *vertex;      /* [vertices, 3] mm */
  uint32_t *triangle; /* [triangles, 3] */
  float *direction; /* [vertices, 3] displacement for a coefficient of 1, mm; unused if `vector` */
  float *coefficient;  /* [vertices, modes] factor of `direction` for each mode. If `vector` is
                          true: [vertices, 3, modes] displacement by each mode, mm */
  size_t orders;       /* polynomials of the volume in each weight: 1, or 0 for 1 */
  double *mode;        /* [modes, (band + 1)^2, orders] coefficients of the weight of each mode */
  unsigned char *lung; /* [vertices] index of the lung */
  /* Volume of each lung, mL, as a polynomial of the weights (supine_volume_contract): [lungs, 3,
     modes], [lungs, 3, modes, modes] and [lungs, modes, modes, modes] */
  double *linear, *quadratic, *cubic;
  /* [lungs, 9] harmonic coefficients, mL, of the volume at rest as a function of gravity, or
   * NULL */
  const double *resting;
  const char *bend;         /* metadata "bend", or NULL */
  const char *scan_gravity; /* metadata "scan_gravity", or NULL */
  bool fields;     /* whether the metadata says that another simulator computed the displacements */
  size_t normals;  /* number of modes from which normals are computed, set by fixture_add_normals */
  int16_t *normal; /* [vertices, 3, normals] coefficients of vertex normals, as integers. They are
                      multiples of 256 but for the first vector, so that bytes can hold them. */
  double *normal_weight; /* [lungs, normals, terms] coefficients of the weight of each normal mode:
                            a quadratic polynomial in the weights of the displacement modes. The
                            file has them for its first axis, and 0 for the others. */
  size_t clusters;       /* number of clusters, set by fixture_add_clusters */
  uint16_t *cluster;     /* [vertices] */
  int16_t *scalar;       /* [vertices, 2] */
  float *cluster_vector; /* [clusters, modes, 18] (supine_basis_info.cluster_vectors) */
  /* Volumes of another simulator, mL above the reference surface, if `orders` is above 1 */
  double range[17][2], limits[17][2][9], shares[17][9][2];
  double total[2];
  const double *full;          /* [lungs, 9] volume at full inflation, or NULL */
  const float *vertex_error;   /* [vertices] mm (tensor 'error_vertices'), or NULL */
  const double *error_gravity; /* [2 band + 4, (band + 2)^2] (tensor 'error_gravity'), or NULL */
  size_t error_volume_count;
  const double *error_volume; /* [error_volume_count] (tensor 'error_volume'), or NULL */
  const float *error_share;   /* [vertices] (tensor 'error_share'), or NULL */
  size_t landmark_count;
  const float *landmarks; /* [landmark_count, 4] (tensor 'landmarks'), or NULL */
  const double *held;     /* [27, lungs, 2] volumes that the lungs can hold, mL, or NULL */
} fixture;

/* Return zeroed memory. Abort if the allocation fails. */
__attribute__((returns_nonnull)) void *fixture_allocate(size_t count, size_t size);

/* Return a pseudo-random number in [-1, 1), and advance the caller's `state`. */
double fixture_random(uint64_t *state);

/* Create `lungs` lungs of about 10 cm radius, each with an equal share of the `vertices`. A lung of
 * at least 5 vertices is closed. Displacements are random, of about `amplitude` mm. If `vector` is
 * true, the direction in which a vertex moves differs between modes. If `volume` is true, add the
 * coefficients of the lungs' volumes. */
fixture *fixture_create(size_t vertices, size_t modes, size_t band, size_t lungs, bool vector,
                        bool volume, double amplitude, uint64_t seed);
void fixture_destroy(fixture *f);

/* Harmonics of the volumes at rest of two lungs, each 850 mL below the reference surface. */
extern const double fixture_resting[18];

/* Create two closed lungs that shrink towards their apex, by a factor that depends on gravity. */
fixture *fixture_create_shrinking(size_t vertices, size_t modes, uint64_t seed);

/* Compute the coefficients from which the library computes the volumes of lungs. */
void fixture_add_forms(fixture *f);

/* Add `modes` modes of vertex normals, with random vectors. */
void fixture_add_normals(fixture *f, size_t modes, uint64_t seed);

/* Replace the coefficients of a fixture of vectors by those of `clusters` clusters, at least one in
 * each lung, with random numbers, of about `amplitude` mm. Compute the coefficients of volumes anew
 * if there are any. */
void fixture_add_clusters(fixture *f, size_t clusters, double amplitude, uint64_t seed);

/* Create two closed lungs of fields over gravity and volume, in `vertices` vertices and 2 modes.
 * Mode 0 multiplies a lung, around its centre, by 1 + w_0, and mode 1 shears it without a change of
 * its volume, so that a lung with the reference volume V holds V (1 + w_0)^3. The weights of mode 0
 * are 0.1 t, and those of mode 1 depend on gravity. In a posture, a lung can hold
 * V (0.8 + 0.02 g_y) to V (1.2 + 0.02 g_y). */
fixture *fixture_create_simulated(size_t vertices, uint64_t seed);

/* Write the basis file, and assert that this succeeds. */
void fixture_write(const fixture *f, const char *path);

/* Return the content of the basis file (malloc), and set `size` to its size in bytes. */
unsigned char *fixture_bytes(const fixture *f, size_t *size);

/* Open a basis in memory. Return NULL if this processor lacks the instruction set. */
supine_basis *fixture_open(const unsigned char *bytes, size_t size, supine_storage storage,
                           supine_simd simd);

/* Compute the positions xyz [N, 3], mm, in double precision. `scales` [lungs] are factors of the
 * displacement. */
void fixture_deform(const fixture *f, const double *weights, const double *scales, double *xyz);

/* Return the volume, mL, of a lung of the fixture whose vertices are at `xyz` [N, 3], mm. */
double fixture_volume(const fixture *f, size_t lung, const double *xyz);

/* Make a temporary folder and return its path (malloc). fixture_folder_remove deletes the folder
 * with its files, and frees the path. */
char *fixture_folder(void);
void fixture_folder_remove(char *folder);

#endif
