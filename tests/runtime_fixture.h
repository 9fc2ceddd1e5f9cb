/* SPDX-License-Identifier: GPL-3.0-or-later */
/* A made basis of any size: closed bipyramids with random fields, and what a double-precision
 * evaluation of it gives. */
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
  const double *resting; /* [9], the caller's; NULL: nothing is known of rest */
  bool fields;           /* says that its numbers are another simulator's fields */
  size_t normals;        /* Q; 0 but for fixture_add_normals */
  int16_t *normal;       /* [N, 3, Q] */
  double *normal_weight; /* [G, Q, (K + 1)(K + 2) / 2] */
} fixture;

/* Zeroed memory, never NULL: ends the program where there is none. */
__attribute__((returns_nonnull)) void *fixture_allocate(size_t count, size_t size);

/* Random number in [-1, 1) of a generator whose state the caller keeps. */
double fixture_random(uint64_t *state);

/* Lungs of about 10 cm radius, of `vertices` / `lungs` vertices each (closed where at least 5),
 * fields of about `amplitude` mm; volume forms where `volume`. */
fixture *fixture_create(size_t vertices, size_t modes, size_t band, size_t lungs, bool vector,
                        bool volume, double amplitude, uint64_t seed);
void fixture_destroy(fixture *f);

/* Two closed lungs that shrink towards their apex and, by up to a third, where gravity points. */
fixture *fixture_create_shrinking(size_t vertices, size_t modes, uint64_t seed);

/* Gives it the volume forms of its field, where it was made without. */
void fixture_add_forms(fixture *f);

/* Gives it normals of random modes: no surface's, but numbers to compare with. */
void fixture_add_normals(fixture *f, size_t modes, uint64_t seed);

/* Writes the basis file; asserts that it was. */
void fixture_write(const fixture *f, const char *path);

/* The same as bytes (malloc). */
unsigned char *fixture_bytes(const fixture *f, size_t *size);

/* Whole file (malloc). */
unsigned char *fixture_read(const char *path, size_t *size);

/* Deformed positions [N, 3] in double precision. */
void fixture_deform(const fixture *f, const double *weights, const double *scales, double *xyz);

/* Volume of lung `lung` at these positions, mL. */
double fixture_volume(const fixture *f, size_t lung, const double *xyz);

/* A new temporary folder, and its removal with every file in it. */
char *fixture_folder(void);
void fixture_folder_remove(char *folder);

#endif
