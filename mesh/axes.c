/* SPDX-License-Identifier: MIT */
/* Convert between the 48 ways to assign a file's coordinates to the patient's axes. */
#include <math.h>
#include <string.h>

#include "base/vec3.h"

#include "mesh/mesh.h"

enum { CODES = 48, SIGNS = 8 };

/* The six orders of the axes (0 left-right, 1 front-back, 2 feet-head) in a file's coordinates. */
static const unsigned char orders[CODES / SIGNS][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2},
                                                       {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};

void supine_mesh_axes_matrix(supine_axes axes, double matrix[3][3]) {
  const unsigned code = axes == SUPINE_AXES_AUTO ? 0 : (unsigned)axes - 1;
  memset(matrix, 0, 9 * sizeof(double));
  for (int k = 0; k < 3; ++k) {
    matrix[orders[code / SIGNS][k]][k] = (code % SIGNS) >> k & 1 ? -1.0 : 1.0;
  }
}

void supine_mesh_axes_apply(supine_axes axes, double scale, double point[3]) {
  double matrix[3][3];
  const double from[3] = {point[0], point[1], point[2]};
  supine_mesh_axes_matrix(axes, matrix);
  for (int k = 0; k < 3; ++k) {
    /* Adding 0.0 turns -0.0 into 0.0. */
    point[k] =
        scale * (matrix[k][0] * from[0] + matrix[k][1] * from[1] + matrix[k][2] * from[2]) + 0.0;
  }
}

void supine_mesh_axes_letters(supine_axes axes, char letters[4]) {
  double matrix[3][3];
  supine_mesh_axes_matrix(axes, matrix);
  for (int k = 0; k < 3; ++k) {
    for (int a = 0; a < 3; ++a) {
      if (matrix[a][k] != 0.0) {
        letters[k] = (matrix[a][k] > 0.0 ? "LPS" : "RAI")[a];
      }
    }
  }
  letters[3] = '\0';
}

bool supine_mesh_axes_parse(const char *letters, supine_axes *axes) {
  for (unsigned code = 1; code <= CODES; ++code) {
    char of_code[4];
    supine_mesh_axes_letters((supine_axes)code, of_code);
    if (strcmp(letters, of_code) == 0) {
      *axes = (supine_axes)code;
      return true;
    }
  }
  return false;
}

supine_axes supine_mesh_axes_after(supine_axes first, supine_axes then) {
  static const char all[] = "LPSRAI"; /* three directions, then their opposites */
  char from[4];
  char to[4];
  char letters[4] = "";
  supine_axes found = SUPINE_AXES_AUTO;
  supine_mesh_axes_letters(first, from);
  supine_mesh_axes_letters(then, to);
  for (int k = 0; k < 3; ++k) {
    const long at = strchr(all, from[k]) - all;
    letters[k] = all[(strchr(all, to[at % 3]) - all + at / 3 * 3) % 6];
  }
  (void)supine_mesh_axes_parse(letters, &found);
  return found;
}

bool supine_mesh_axes_mirrored(supine_axes axes) {
  double m[3][3];
  supine_mesh_axes_matrix(axes, m);
  return supine_triple(m[0], m[1], m[2]) < 0.0;
}
