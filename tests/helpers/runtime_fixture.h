/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Synthetic basis files: bipyramids with random displacements, evaluated in double precision. */
#ifndef SUPINE_TEST_RUNTIME_FIXTURE_H
#define SUPINE_TEST_RUNTIME_FIXTURE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

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
  double *mode;        /* [modes, (band + 1)^2] harmonic coefficients of the weight of each mode */
  unsigned char *lung; /* [vertices] index of the lung */
  double *linear, *quadratic, *cubic;
  /* [9] harmonic coefficients, mL, of the volume at rest as a function of gravity; may be NULL */
  const double *resting;
  bool fields;     /* whether the metadata says that another simulator computed the displacements */
  size_t normals;  /* number of modes from which normals are computed, set by fixture_add_normals */
  int16_t *normal; /* [vertices, 3, normals] coefficients of vertex normals, as integers */
  int8_t *normal_byte;   /* `normal` as supine_basis_info.normals, or NULL */
  double *normal_weight; /* [lungs, normals, terms] coefficients of the weight of each normal mode:
                            a quadratic polynomial in the weights of the displacement modes */
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

/* Create two closed lungs that shrink towards their apex, by a factor that depends on gravity. */
fixture *fixture_create_shrinking(size_t vertices, size_t modes, uint64_t seed);

/* Compute the coefficients from which the library computes the volumes of lungs. */
void fixture_add_forms(fixture *f);

/* Add `modes` modes of vertex normals, with random vectors. */
void fixture_add_normals(fixture *f, size_t modes, uint64_t seed);

/* Round the vectors of the normals so that the file stores them in bytes. */
void fixture_round_normals(fixture *f);

/* Write the basis file, and assert that this succeeds. */
void fixture_write(const fixture *f, const char *path);

/* Return the content of the basis file (malloc), and set `size` to its size in bytes. */
unsigned char *fixture_bytes(const fixture *f, size_t *size);

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
