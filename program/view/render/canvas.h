/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Share between the files of this folder: the camera, projected triangles, and their shading. */
#ifndef SUPINE_RENDER_CANVAS_H
#define SUPINE_RENDER_CANVAS_H

#include "base/arena.h"
#include "program/view/render/render.h"

enum { OVERSAMPLE = 2 }; /* each pixel is the mean of OVERSAMPLE x OVERSAMPLE samples */

/* A viewer, who looks at the centre of the reference surface in every state. */
typedef struct camera {
  double axes[3][3]; /* rotation from the body's axes to the viewer's: right, up, to the viewer */
  double centre[3];
  double radius;   /* half the diagonal of the bounding box of the reference surface, mm */
  double away;     /* distance from the viewer to the centre, mm */
  double frame[4]; /* centre of the picture, mm, and scales, half widths and half heights of the
                      picture per mm (supine_render_camera_aim) */
  double size[2];  /* width and height of the picture, pixels or samples */
} camera;

/* A projected vertex. */
typedef struct corner {
  float x, y;      /* position, samples from the left and upper edges of the picture */
  float nearness;  /* 1 / (depth from the viewer), 1/mm; 0 if too near to be drawn */
  float normal[3]; /* unit normal in the viewer's axes: right, up, towards the viewer */
  float eye[3];    /* vector from the vertex to the viewer, mm, in the viewer's axes */
  float value;     /* value that the colour map shows, mm */
  float height;    /* 0 at the lowest point of the lungs along gravity, 1 at the highest */
} corner;

/* Make the camera of a scene, without its frame. */
camera supine_render_camera(const supine_basis_info *info, const supine_scene *scene);
/* Fit the lungs into a picture of width x height pixels or samples: fill `frame` and `size`. */
void supine_render_camera_aim(camera *c, const supine_basis *basis, const supine_scene *scene,
                              double width, double height);
/* Project a position, mm, with a unit normal in the body's axes. `value` and `height` become 0. */
corner supine_render_camera_project(const camera *c, const float xyz[3], const float normal[3]);
/* Return the length in the picture of 1 mm at a projected vertex, pixels or samples. */
float supine_render_camera_scale(const camera *c, const corner *at);

/* What is drawn, which decides its colours. */
typedef enum material {
  MATERIAL_MAP,      /* lungs in the colours of their values, opaque */
  MATERIAL_SHELL,    /* lungs as a translucent shell, lit at the rim */
  MATERIAL_GHOST,    /* a target where it was: white, translucent */
  MATERIAL_TARGET,   /* opaque */
  MATERIAL_SELECTED, /* opaque */
  MATERIAL_ANATOMY,  /* a translucent shell in one of the tints */
  MATERIAL_DOT,      /* a point of anatomy: opaque, in one of the tints */
  MATERIAL_BODY      /* the torso, behind all else */
} material;

/* A point of a surface that covers a sample. */
typedef struct fragment {
  float normal[3]; /* unit normal on the viewer's side, in the viewer's axes */
  float eye[3];    /* unit vector to the viewer */
  float value;     /* as in corner */
  float height;    /* as in corner */
  float contour;   /* share of the sample that contour lines cover, 0 to 1 */
  size_t tint;     /* index of the colour of anatomy */
} fragment;

enum { SHADES = 4096 };

/* Tables of colours, and for those of a map under light. */
typedef struct shades {
  float colours[SHADES + 1][3];       /* colour map, linear RGB, 0 to 1 */
  float encode[SHADES + 1];           /* [i] sRGB of the linear light i / SHADES, 0 to 1 */
  float largest;                      /* value that the last colour shows, mm */
  float target[2][3];                 /* SUPINE_PALETTE_TARGETS, sRGB, 0 to 1 */
  float tint[SUPINE_RENDER_TINTS][3]; /* SUPINE_PALETTE_ANATOMY, sRGB, 0 to 1 */
} shades;

/* The surface of a torso around the lungs. */
typedef struct body {
  size_t vertex_count, triangle_count;
  float *xyz;          /* [vertex_count, 3] mm */
  float *normals;      /* [vertex_count, 3] */
  uint32_t *triangles; /* [triangle_count, 3] */
} body;

/* Make the torso of a patient with these lungs, in memory of `keep`. */
supine_status supine_render_body(const supine_basis_info *info, supine_arena *keep, body *made,
                                 supine_error *error);

void supine_render_shades(const supine_scene *scene, shades *made);
/* Compute the colour of a fragment: premultiplied RGB and coverage, 0 to 1. */
void supine_render_shade(const shades *tables, material what, const fragment *at, float rgba[4]);

#endif
