/* SPDX-License-Identifier: GPL-3.0-or-later */
/** @file
 * Draw pictures of deformed lungs. Functions that compose pictures or write PNG use cairo, and
 * return SUPINE_ERROR_UNSUPPORTED if cairo is not installed. */
#ifndef SUPINE_RENDER_H
#define SUPINE_RENDER_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <supine/runtime.h>
#include <supine/status.h>

/** Where the viewer stands. */
typedef enum supine_view {
  SUPINE_VIEW_ANTERIOR = 0, /**< in front; the patient's left is on the right of the picture */
  SUPINE_VIEW_POSTERIOR,
  SUPINE_VIEW_LEFT,
  SUPINE_VIEW_RIGHT,
  SUPINE_VIEW_HEAD,
  SUPINE_VIEW_FEET,
  SUPINE_VIEW_LYING, /**< gravity points down, and the head is on the left; a patient who stands is
                        seen from the front */
  SUPINE_VIEW_COUNT
} supine_view;

/** Largest component of gravity along the body, head or feet, at which a patient lies. */
#define SUPINE_VIEW_LYING_TILT 0.8

/** Return the name of a view; NULL if `view` is SUPINE_VIEW_COUNT or above. */
const char *supine_render_view_name(supine_view view);

/** Compute the rotation from the body's axes (LPS) to the viewer's axes: right, up, towards the
 * viewer.
 * @param gravity  unit vector, which only SUPINE_VIEW_LYING needs; otherwise it may be NULL */
void supine_render_view_axes(supine_view view, const double gravity[3], double axes[3][3]);

/** Colour maps: for the displacement in one state, and for the difference between two states. */
typedef enum supine_colours {
  SUPINE_COLOURS_DISPLACEMENT = 0, /**< from violet through teal to yellow */
  SUPINE_COLOURS_DIFFERENCE,       /**< from blue through red to cream */
  SUPINE_COLOURS_COUNT
} supine_colours;

/** Compute the colour of a map at t, 0 to 1, as sRGB, 0 to 1. Equal steps of t are equal distances
 * in OKLab [Ottosson2020], and lightness rises with t, so that grey copies keep the order.
 * Pictures, the report and the page use the same maps. */
void supine_render_colour(supine_colours map, double t, double rgb[3]);

/** Write the colour of a map at t as the six hexadecimal digits of HTML. */
void supine_render_hex(supine_colours map, double t, char text[7]);

/** Colours that tell one thing from another of its kind. */
typedef enum supine_palette {
  SUPINE_PALETTE_TARGETS = 0, /**< teal; orange for the selected target */
  SUPINE_PALETTE_ANATOMY,     /**< of large structures, such as airways and lobes */
  SUPINE_PALETTE_POSTURES,    /**< of the outlines and lines of a report */
  SUPINE_PALETTE_COUNT
} supine_palette;

/** Return colour `i` of a palette, sRGB, 0xRRGGBB; its colours repeat. Pictures, the report and the
 * page take theirs from here. What a colour tells is told by a name or a shape, too. */
uint32_t supine_render_palette(supine_palette palette, size_t i);

/** How the lungs are drawn. */
typedef enum supine_look {
  SUPINE_LOOK_MAP = 0, /**< opaque, in the colours of a value; what is inside is drawn over them */
  SUPINE_LOOK_SHELL    /**< a translucent shell, bright where it turns away from the viewer and
                          darker towards gravity; what is inside is seen through it, with a white
                          ghost of each target where it was */
} supine_look;

/** What a structure inside the lungs is, which decides its colour. */
typedef enum supine_mark_kind {
  SUPINE_MARK_TARGET = 0, /**< teal */
  SUPINE_MARK_SELECTED,   /**< the target that the captions are about: orange, with a ghost where it
                             was, an arrow, and a ring of its expected error */
  SUPINE_MARK_ANATOMY     /**< part of a large structure, such as airways or a lobe: a translucent
                             shell with a colour of SUPINE_PALETTE_ANATOMY, without ghost and arrow */
} supine_mark_kind;

enum { SUPINE_RENDER_TINTS = 6 }; /**< number of colours of anatomy */

/** A point, or a vertex of a mesh, inside the lungs. */
typedef struct supine_mark {
  float xyz[3];          /**< position, mm */
  float from[3];         /**< position from which displacements are measured, mm */
  float radius;          /**< radius of the ball that shows it, mm; 0 for no ball */
  supine_mark_kind kind; /**< what its structure is */
  size_t tint;           /**< index of the colour of anatomy */
  bool moved;            /**< whether its structure is elsewhere than it was */
  const char *label;     /**< text written beside the mark, or NULL */
  float reach;           /**< of a mark with a label, radius of its structure, mm */
  float expected;        /**< of a mark with a label, expected error of its displacement, mm;
                            0: no ring is drawn */
} supine_mark;

typedef struct supine_marks {
  size_t count;
  const supine_mark *mark;
  size_t triangle_count;
  const uint32_t *triangles; /**< [triangle_count, 3] indices of marks: meshes */
} supine_marks;

/** One drawing: the lungs in one state from one side. */
typedef struct supine_scene {
  const supine_pose *pose;
  supine_look look;
  const float *value; /**< [N] value that the colour of each vertex shows, mm; a shell needs none */
  double largest;     /**< value that the last colour shows, mm; above 0. Contour lines are at the
                           ticks of its colour bar (supine_render_bar_step) */
  supine_colours colours;
  supine_view view;
  const double *gravity;       /**< [3] unit vector; needed if `view` is SUPINE_VIEW_LYING */
  const supine_marks *content; /**< structures inside the lungs, or NULL */
  size_t width, height;        /**< size of the drawing, pixels */
  const double *extent; /**< [4] smallest and largest x, then y, mm; NULL: those of this scene */
} supine_scene;

enum { SUPINE_RENDER_SECTIONS = 15 }; /**< number of sections of the torso's outline */

/** Return a section of the outline of the torso that is drawn around lungs, in halves of the lungs'
 * extent along each axis: height of its centre above that of the lungs, and its half widths to the
 * sides and to front and back. NULL if `i` is SUPINE_RENDER_SECTIONS or above. */
const double *supine_render_torso(size_t i);

/** Enlarge a box, with the corners `low` and `high`, to contain the vertices `xyz` [count, 3]. */
void supine_render_box(const float *xyz, size_t count, double low[3], double high[3]);

/** Empty extent, to be enlarged by supine_render_extent. */
#define SUPINE_EXTENT_NONE                                                                         \
  { INFINITY, -INFINITY, INFINITY, -INFINITY }

/** Enlarge an extent to contain a scene, so that several states can be drawn at one scale. An
 * extent is the smallest x, the largest x, the smallest y and the largest y, mm, on the plane
 * through the lungs' centre that the viewer faces. All scenes must have the same view. */
void supine_render_extent(const supine_basis *basis, const supine_scene *scene, double extent[4]);

/** Draw a scene on a transparent background, using all cores.
 * @param pixels  [height, width] premultiplied ARGB as in cairo, top row first; output */
supine_status supine_render_draw(const supine_basis *basis, const supine_scene *scene,
                                 uint32_t *pixels, supine_error *error);

/** Draw a scene and write it as PNG. */
supine_status supine_render_png(const supine_basis *basis, const supine_scene *scene, FILE *file,
                                supine_error *error);

/** Compute the positions of marks in the drawing of a scene, or those of supine_mark.from.
 * @param pixel  [count, 3] pixels from the left and upper edges, and pixels per mm there; output */
void supine_render_project(const supine_basis *basis, const supine_scene *scene,
                           const supine_marks *marks, bool from, double (*pixel)[3]);

/** Load the library that shapes Arabic, Hebrew and other scripts. Return false if it is not
 * installed: pictures then have unshaped text. */
bool supine_render_shapes_text(void);

/** A column of a picture: the lungs in one posture. */
typedef struct supine_panel {
  const char *title;
  const char *figure;   /**< number at the beginning of the second line, in the colour of the
                           selected target; NULL for none */
  const char *subtitle; /**< rest of the second line */
  const char *note;     /**< third line, in place of the name of the view SUPINE_VIEW_LYING */
  double gravity[3];
  const supine_pose *pose;
  const float *value;
  const supine_marks *marks; /**< structures inside the lungs, or NULL */
} supine_panel;

enum { SUPINE_PANELS_MAX = 8, SUPINE_VIEWS_MAX = 8 };

/** A picture: a column for each posture, a row for each view, and a colour bar below them. */
typedef struct supine_picture {
  const supine_panel *panel;
  size_t panel_count; /**< 1 to SUPINE_PANELS_MAX */
  const supine_view *view;
  size_t view_count; /**< 1 to SUPINE_VIEWS_MAX */
  const char *bar_label;
  const char *legend;        /**< below a shell, on the left: what its signs mean; NULL for none */
  const char *remark;        /**< below a shell, on the right; NULL for none */
  const char *caption;       /**< small text below all, broken into lines; or NULL */
  supine_look look;          /**< a shell has a dark background, and no colour bar */
  double largest;            /**< value that the last colour shows, mm */
  const double (*extent)[4]; /**< [view_count] smallest and largest x, then y, of each view, mm;
                                NULL: those of this picture */
  supine_colours colours;
  bool beyond; /**< whether values exceed `largest`, so that the colour bar has a pointed end */
  size_t width, height; /**< size of the picture, pixels */
} supine_picture;

/** Return the interval between ticks of a colour bar that shows 0 to `value`: a round number, 1/10
 * to 1/4 of `value`. */
double supine_render_bar_step(double value);
/** Return the end of a colour bar: `value` rounded up to a tick. */
double supine_render_bar_end(double value);

/** Enlarge the extents of all views (see supine_render_extent) so that they contain a picture.
 * Several pictures can then be drawn at one scale. With SUPINE_VIEW_LYING, y counts from the table
 * on which the patient lies.
 * @param extent  [view_count, 4] smallest and largest x, then y, of each view, mm */
void supine_render_picture_extent(const supine_basis *basis, const supine_picture *picture,
                                  double (*extent)[4]);

/** Compose a picture.
 * @param pixels  [height, width] RGB, 0x00RRGGBB or 0xFFRRGGBB, top row first; output */
supine_status supine_render_picture_draw(const supine_basis *basis, const supine_picture *picture,
                                         uint32_t *pixels, supine_error *error);

/** Compose a picture and write it to a file: PDF if its name ends in .pdf, SVG if in .svg, else
 * PNG. A unit of PDF and SVG, 1/72 inch, is a pixel of the picture; the lungs have three times as
 * many pixels. */
supine_status supine_render_picture_save(const supine_basis *basis, const supine_picture *picture,
                                         const char *path, supine_error *error);

/** A WebP animation that repeats forever. */
typedef struct supine_animation supine_animation;

/** Create an animation; supine_render_animation_close frees it. */
supine_status supine_render_animation_open(size_t width, size_t height,
                                           supine_animation **animation, supine_error *error);
/** Append a picture of the animation's size, to be shown for `milliseconds`. */
supine_status supine_render_animation_add(supine_animation *animation, const supine_basis *basis,
                                          const supine_picture *picture, int milliseconds,
                                          supine_error *error);
/** Write the animation to a file. */
supine_status supine_render_animation_write(supine_animation *animation, FILE *file,
                                            supine_error *error);
/** Free *animation, which may be NULL; for SUPINE_FREED_BY. */
void supine_render_animation_close(supine_animation **animation);

#endif
