/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A synthetic basis of any size, closed bipyramids with random fields, and its evaluation in double
 * precision. */
#ifndef SUPINE_TEST_RUNTIME_FIXTURE_H
#define SUPINE_TEST_RUNTIME_FIXTURE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct fixture {
  size_t vertices, triangles, modes, band, lungs;
  bool vector, volume;
  size_t lung_begin[17];
  float *vertex;       /* [N, 3] */
  uint32_t *triangle;  /* [M, 3] */
  float *direction;    /* [N, 3] */
  float *coefficient;  /* [N, K] or [N, 3, K] */
  double *mode;        /* [K, (L+1)^2] */
  unsigned char *lung; /* [N] */
  double *linear, *quadratic, *cubic;
  const double *resting; /* [9], owned by the caller; NULL: rest volumes are unknown */
  bool fields;           /* metadata states fields of another simulator */
  size_t normals;        /* Q; 0 unless fixture_add_normals set it */
  int16_t *normal;       /* [N, 3, Q] */
  double *normal_weight; /* [G, Q, (K + 1)(K + 2) / 2] */
} fixture;

/* Return zeroed memory; abort if there is none. */
__attribute__((returns_nonnull)) void *fixture_allocate(size_t count, size_t size);

/* Return a pseudo-random number in [-1, 1); the caller keeps the state. */
double fixture_random(uint64_t *state);

/* Create lungs of about 10 cm radius with `vertices` / `lungs` vertices each (closed if at least
 * 5), random fields of about `amplitude` mm, and volume forms if `volume`. */
fixture *fixture_create(size_t vertices, size_t modes, size_t band, size_t lungs, bool vector,
                        bool volume, double amplitude, uint64_t seed);
void fixture_destroy(fixture *f);

/* Create two closed lungs that shrink towards their apex by up to a third, depending on gravity. */
fixture *fixture_create_shrinking(size_t vertices, size_t modes, uint64_t seed);

/* Add volume forms to a fixture created without them. */
void fixture_add_forms(fixture *f);

/* Add random modes of normals: they match no surface, but their evaluation can be compared. */
void fixture_add_normals(fixture *f, size_t modes, uint64_t seed);

/* Write the basis file; assert success. */
void fixture_write(const fixture *f, const char *path);

/* Return the content of the basis file (malloc). */
unsigned char *fixture_bytes(const fixture *f, size_t *size);

/* Compute deformed positions [N, 3] in double precision. */
void fixture_deform(const fixture *f, const double *weights, const double *scales, double *xyz);

/* Return the volume of a lung at given positions, mL. */
double fixture_volume(const fixture *f, size_t lung, const double *xyz);

/* Make a temporary folder (malloc); remove it with every file in it. */
char *fixture_folder(void);
void fixture_folder_remove(char *folder);

#endif
