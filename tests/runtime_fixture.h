/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Synthetic bases: bipyramids with random displacements, evaluated in double precision. */
#ifndef SUPINE_TEST_RUNTIME_FIXTURE_H
#define SUPINE_TEST_RUNTIME_FIXTURE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct fixture {
  size_t vertices, triangles, modes, band, lungs; /* N, M, K, L, G below */
  bool vector, volume;
  size_t lung_begin[17];
  float *vertex;       /* [N, 3], mm */
  uint32_t *triangle;  /* [M, 3] */
  float *direction;    /* [N, 3] */
  float *coefficient;  /* [N, K] or [N, 3, K] */
  double *mode;        /* [K, (L + 1)^2] spherical-harmonic coefficients of the modes' weights */
  unsigned char *lung; /* [N] */
  double *linear, *quadratic, *cubic;
  /* [9] harmonic coefficients of the volume at rest; NULL if it is unknown */
  const double *resting;
  bool fields;     /* whether the metadata says that another simulator computed the displacements */
  size_t normals;  /* number Q of modes of normals, set by fixture_add_normals */
  int16_t *normal; /* [N, 3, Q] */
  double *normal_weight; /* [G, Q, (K + 1)(K + 2) / 2] */
} fixture;

/* Return zeroed memory. Abort if the allocation fails. */
__attribute__((returns_nonnull)) void *fixture_allocate(size_t count, size_t size);

/* Return a pseudo-random number in [-1, 1), and advance the caller's `state`. */
double fixture_random(uint64_t *state);

/* Create `lungs` lungs of about 10 cm radius, each with an equal share of the `vertices`. A lung of
 * at least 5 vertices is closed. Its displacements are random, of about `amplitude` mm. If
 * `volume`, call fixture_add_forms. */
fixture *fixture_create(size_t vertices, size_t modes, size_t band, size_t lungs, bool vector,
                        bool volume, double amplitude, uint64_t seed);
void fixture_destroy(fixture *f);

/* Create two closed lungs that shrink towards their apex, by a factor that depends on gravity. */
fixture *fixture_create_shrinking(size_t vertices, size_t modes, uint64_t seed);

/* Add the coefficients from which volumes are computed. */
void fixture_add_forms(fixture *f);

/* Add modes of random normals, which are not normal to the surface. */
void fixture_add_normals(fixture *f, size_t modes, uint64_t seed);

/* Write the basis file, and assert that this succeeds. */
void fixture_write(const fixture *f, const char *path);

/* Return the content of the basis file (malloc), and set `size` to its size in bytes. */
unsigned char *fixture_bytes(const fixture *f, size_t *size);

/* Compute positions xyz [N, 3], mm, in double precision. `scales` has a gain for each lung. */
void fixture_deform(const fixture *f, const double *weights, const double *scales, double *xyz);

/* Return the volume of a lung, mL, whose vertices have the positions xyz [N, 3]. */
double fixture_volume(const fixture *f, size_t lung, const double *xyz);

/* Make a temporary folder and return its path (malloc). fixture_folder_remove deletes the folder
 * with its files, and frees the path. */
char *fixture_folder(void);
void fixture_folder_remove(char *folder);

#endif
