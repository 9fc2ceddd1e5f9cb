/* SPDX-License-Identifier: MIT */
/** @file
 * Load, measure and save triangle surfaces of lungs, and find their topology.
 *
 * Inside the program a mesh is in millimetres and in the DICOM patient axes, LPS: +x left, +y
 * posterior, +z head. */
#ifndef SUPINE_MESH_H
#define SUPINE_MESH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <supine/status.h>

/** Axes of a file's coordinates, one of 48. Three letters, as in Slicer and nibabel, name the
 * direction in which each coordinate grows (Left, Right, Posterior, Anterior, Superior, Inferior).
 * supine_mesh_axes_parse also returns values that have no name here. */
typedef enum supine_axes {
  SUPINE_AXES_AUTO = 0, /**< the axes given by the file's SPACE tag; LPS if there is no tag */
  SUPINE_AXES_LPS = 1,
  SUPINE_AXES_RAS = 4,
  SUPINE_AXES_COUNT = 49
} supine_axes;

/** Parse three letters, such as "RAI"; return false for anything else. */
bool supine_mesh_axes_parse(const char *letters, supine_axes *axes);
/** Write the three letters of axes and a NUL; AUTO counts as LPS. */
void supine_mesh_axes_letters(supine_axes axes, char letters[4]);
/** Find the signed permutation matrix that converts coordinates to LPS; AUTO counts as LPS. */
void supine_mesh_axes_matrix(supine_axes axes, double matrix[3][3]);
/** Convert a point or vector to LPS in place, and multiply it by `scale`. */
void supine_mesh_axes_apply(supine_axes axes, double scale, double point[3]);
/** Combine two conversions: find the axes whose matrix is that of `then` times that of `first`. */
supine_axes supine_mesh_axes_after(supine_axes first, supine_axes then);
/** Return whether axes are left-handed, so that conversion to LPS reverses the triangles. */
bool supine_mesh_axes_mirrored(supine_axes axes);

/** A triangle surface. Zero-initialise; release with supine_mesh_free. */
typedef struct supine_mesh {
  size_t vertex_count;
  double *vertices; /**< [vertex_count, 3] mm, LPS */
  size_t triangle_count;
  uint32_t *triangles; /**< [triangle_count, 3] counter-clockwise seen from outside */
} supine_mesh;

/** How to read a file. If all fields are 0, axes and unit are taken from it. */
typedef struct supine_mesh_load_options {
  supine_axes axes;
  double millimetres_per_unit; /**< length of the unit of coordinates, mm; 0 means the unit that the
                                  file states (AMF, COLLADA), else 1 */
  const supine_mesh *arrays;   /**< surface to copy instead of reading the file; NULL: none */
} supine_mesh_load_options;

typedef struct supine_mesh_report {
  size_t degenerate_faces; /**< number of dropped faces with fewer than three different corners */
  size_t unreferenced_vertices; /**< number of dropped vertices that no triangle uses */
  supine_axes axes;             /**< axes assumed for the file */
  bool axes_from_tag; /**< whether the axes come from a SPACE tag, as 3D Slicer writes it */
} supine_mesh_report;

/** Read one surface: PLY and VTP by readers of this folder, OBJ, STL and other formats by the
 * library assimp. Polygons are cut into triangles, all nodes of a scene are joined, and vertices at
 * the same position are welded, in the order of their first appearance.
 *
 * Counts are checked against the file's size, so truncated or corrupt files are refused. assimp
 * runs in its own process, so files on which an importer crashes or exceeds its limits are refused
 * too. Positions are rounded to float32.
 *
 * @param options  NULL for the defaults
 * @param mesh     zero-initialised; written only on success
 * @param report   optional
 * Thread-safe. */
supine_status supine_mesh_load(const char *path, const supine_mesh_load_options *options,
                               supine_mesh *mesh, supine_mesh_report *report, supine_error *error);

/** Length of the smallest lungs of which a scan is likely, mm; a mouse's are some 15 mm long. */
enum { SUPINE_MESH_ANIMAL_LEAST = 5 };

/** Return whether `side`, mm, is a possible longest side of the bounding box of lungs.
 * @param other  output, a string literal: the unit other than mm in which a length of `side` is
 *             most likely; NULL if it is impossible in every other unit */
bool supine_mesh_unit_is_likely(double side, const char **other);
/** Name a unit of length: "mm", "cm", "m", "um", "in" or, for others, a text such as "2.5 mm".
 * @param text  [24] output */
void supine_mesh_unit_name(double millimetres, char *text);

/** Allocate the arrays of a mesh. */
supine_status supine_mesh_allocate(size_t vertices, size_t triangles, supine_mesh *mesh);

/** Free the arrays and zero the struct, which may be zero already. */
void supine_mesh_free(supine_mesh *mesh);

/** The edges and connected components of a mesh. */
typedef struct supine_topology {
  size_t edge_count;
  uint32_t *edges;           /**< [edge_count, 2] vertex pairs, first < second, sorted */
  size_t boundary_edges;     /**< edges that belong to one triangle */
  size_t non_manifold_edges; /**< edges shared by three or more triangles */
  size_t inconsistent_edges; /**< edges that two triangles run through in the same direction */
  size_t component_count;    /**< sets of vertices connected by edges */
  uint32_t *component;       /**< [vertex_count] index of the component of each vertex */
  long euler_characteristic; /**< vertices - edges + triangles */
  long genus;  /**< (2 component_count - euler_characteristic) / 2 if the surface is closed and this
                  is a whole number >= 0; otherwise -1 */
  bool closed; /**< whether every edge joins exactly two triangles of the same orientation */
} supine_topology;

/** Number the sets of vertices that faces connect, and return how many there are.
 * @param corners    vertices of a face: 3 for triangles, 2 for edges
 * @param faces      [count, corners] indices of vertices
 * @param component  [vertex_count] written: index of the component of each vertex */
size_t supine_mesh_components(size_t vertex_count, size_t corners, size_t count,
                              const uint32_t *faces, uint32_t *component);

/** Find edges and components in linear time, except for sorting the edges of each vertex.
 * @param topology  zero-initialised; written only on success */
supine_status supine_mesh_topology_create(const supine_mesh *mesh, supine_topology *topology);
void supine_mesh_topology_free(supine_topology *topology);

/** Compute the volume that a closed surface encloses, mm^3, as the sum of p0 . (p1 x p2) / 6 over
 * all triangles, with corners p0, p1 and p2 relative to the centre of the bounding box. The volume
 * is negative if the triangles face inwards, and 0 without triangles. */
double supine_mesh_volume(const supine_mesh *mesh);

/** Measure what a part of a closed surface encloses: how widely it spreads along each axis. This
 * hardly depends on single vertices, unlike the bounding box.
 * @param begin   triangles with first corner begin <= i < end are the part
 * @param spread  written: standard deviation of x, y and z over the enclosed volume, mm; 0 if the
 *                volume is not above 0
 * @return enclosed volume, mm^3 */
double supine_mesh_spread(const supine_mesh *mesh, size_t begin, size_t end, double spread[3]);

/** Find the axis-aligned bounding box, mm, and return its longest side, mm. All are 0 without
 * vertices. */
double supine_mesh_box(const supine_mesh *mesh, double minimum[3], double maximum[3]);

typedef struct supine_mesh_anatomy {
  supine_axes axes; /**< axes that fit the shape best if clearly better than LPS, otherwise LPS */
  bool certain;     /**< whether `axes` fit the shape clearly better than all other axes */
  int side;         /**< +1 left, -1 right; 0 if unknown, for two lungs, or if `axes` are not LPS */
  bool joined;      /**< whether a single surface seems to hold both lungs */
} supine_mesh_anatomy;

/** Find the axes from third moments of the volume. A lung is narrow at the head, reaches lowest at
 * the back, and is hollow towards the heart. The right lung is larger than the left lung, which
 * leaves room for the heart.
 * @param lungs  [count] one or two surfaces, each a lung */
supine_mesh_anatomy supine_mesh_anatomy_find(const supine_mesh *lungs, size_t count);

/** Reverse the order of the corners of each triangle, so that it faces the other way. */
void supine_mesh_reverse(const supine_mesh *mesh);

/** Compute the area of each vertex [vertex_count], mm^2: one third of the area of its triangles. */
void supine_mesh_vertex_area(const supine_mesh *mesh, double *area);

/** Divide each vector [count, 3] by its length, unless that is 0. */
void supine_mesh_normalise(size_t count, double *vectors);

/** Compute the unit normal of each vertex [vertex_count, 3]: the normalised mean of the normals of
 * its triangles, weighted by area. It is 0 where the mean is 0. */
void supine_mesh_vertex_normals(const supine_mesh *mesh, double *normals);

/** Compute the unit normal of each vertex as supine_mesh_vertex_normals, then replace each normal
 * ten times by the normalised mean of its own and its neighbours'. A surface that moves along
 * smoothed normals does not fold at its edges.
 * @param normals  [vertex_count, 3] output
 * @param space    [vertex_count, 3] work space */
void supine_mesh_smooth_normals(const supine_mesh *mesh, const supine_topology *topology,
                                double *normals, double *space);

/** Compute the volume, mm^3, that a surface gains if all vertices move by h times `direction`, as
 * change[0] h + change[1] h^2 + change[2] h^3.
 * @param direction  [vertex_count, 3] */
void supine_mesh_volume_along(const supine_mesh *mesh, const double *direction, double change[3]);

/** Find the distance h at which the polynomial of supine_mesh_volume_along is `volume`, mm^3, by
 * Newton's method from h = 0. Return false if it does not converge. */
bool supine_mesh_offset_to(const double change[3], double volume, double *distance);

/** Return the fraction of triangles, 0 to 1, whose normal turns by more than a right angle when the
 * vertices move to `vertices`. Above a few in a thousand the folds are visible. */
double supine_mesh_turned_over(const supine_mesh *mesh, const double *vertices);

/** Numbers that describe a whole surface, for the field data of VTP. */
typedef struct supine_mesh_field {
  const char *name; /**< name with a unit, such as "volume_mL" */
  size_t count;
  const double *
      values; /**< [frames, count] values; only supine_mesh_save_frames takes more than one frame */
} supine_mesh_field;

/** A number at each vertex: point data of VTP and PLY files. */
typedef struct supine_mesh_scalar {
  const char *name;
  const float *values; /**< [vertex_count]; NULL if there is no number */
} supine_mesh_scalar;

enum { SUPINE_MESH_SCALARS = 3 };

/** How to write a file, and its optional contents. */
typedef struct supine_mesh_save_options {
  supine_axes axes;    /**< axes of the file and of its SPACE tag; AUTO means LPS */
  const double *from;  /**< optional [vertex_count, 3] starting points of displacements, mm: VTP and
                          PLY files then hold displacements and their magnitudes */
  const char *comment; /**< optional note of one line */
  double millimetres_per_unit; /**< unit of positions and displacements; 0 means 1 */
  supine_mesh_scalar scalars[SUPINE_MESH_SCALARS]; /**< optional */
  /** @{ For VTP only, all optional. */
  const float *normals;            /**< [vertex_count, 3] written as point data "Normals" */
  const unsigned char *lung;       /**< [vertex_count] index of the lung, as point data "lung" */
  const supine_mesh_field *fields; /**< [field_count] written as field data */
  size_t field_count;
  /** @} */
} supine_mesh_save_options;

/** Write the surface in the format of the name's ending: .ply (binary), .obj, .stl (binary), .vtp.
 * The file appears completely or not at all.
 * @param options  NULL for LPS without displacements and comment */
supine_status supine_mesh_save(const char *path, const supine_mesh *mesh,
                               const supine_mesh_save_options *options, supine_error *error);

/** The frames of a surface that moves over time. */
typedef struct supine_mesh_frames {
  size_t count;
  const double *times; /**< [count] in s; NULL for a surface without a time */
  /** Update the mesh's vertices and the options' normals to a frame. A failure ends the writing. */
  supine_status (*next)(void *context, size_t frame, supine_error *error);
  void *context;
} supine_mesh_frames;

/** Write a surface that moves over time, in the form of VTP that VTK and ParaView read. The
 * triangles are stored once. The field data hold the times, "time_s", and options->fields, with one
 * tuple for each frame. The file appears completely or not at all. */
supine_status supine_mesh_save_frames(const char *path, const supine_mesh *mesh,
                                      const supine_mesh_save_options *options,
                                      const supine_mesh_frames *frames, supine_error *error);

/** The formats of supine_mesh_save, by ending; each has a function supine_io_save_NAME in
 * mesh/io. This is the only list of formats. */
#define SUPINE_MESH_FORMATS(FIRST, NEXT) FIRST(ply) NEXT(obj) NEXT(stl) NEXT(vtp)

/** The endings as text: ".ply, .obj, .stl, .vtp". */
#define SUPINE_MESH_ENDINGS SUPINE_MESH_FORMATS(SUPINE_MESH_ENDING, SUPINE_MESH_NEXT_ENDING)
#define SUPINE_MESH_ENDING(name) "." #name
#define SUPINE_MESH_NEXT_ENDING(name) ", ." #name

/** Return whether `path` ends in one of SUPINE_MESH_ENDINGS. */
bool supine_mesh_save_supports(const char *path);

#endif
