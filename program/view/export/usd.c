/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Write an OpenUSD text file. Each lung is a mesh with blend shapes, the morph targets of a .glb
 * file; time samples of their weights show breaths while the patient turns. */
#include <stdio.h>
#include <string.h>

#include "base/arena.h"
#include "base/ascii.h"
#include "base/number.h"
#include "base/output.h"
#include "program/options/facts.h"
#include "program/view/export/export.h"
#include "program/view/export/moments.h"

enum { DEFAULT_VERTICES = 5000, NAME_SIZE = 48 };
static const double degrees = 180.0 / 3.14159265358979323846;

/* Arrays of a lung's mesh: positions and normals, and what a blend shape adds to them at weight
 * 1. */
typedef enum usd_kind { USD_POINTS, USD_NORMALS, USD_OFFSETS, USD_NORMAL_OFFSETS } usd_kind;

typedef struct usd {
  FILE *file;
  const supine_basis_info *info;
  export_targets targets;
  export_order order;
  float *normals; /* [N, 3] of the base meshes */
  float *added;   /* [targets.count, N, 3] change of the normals by each target at weight 1 */
  char name[SUPINE_LUNGS_MAX][NAME_SIZE]; /* identifier of each lung */
} usd;

/* Make an identifier of a lung's name: letters, digits and _ of ASCII, and the number of the lung,
 * so that no two lungs share one. */
static void make_name(usd *u, size_t lung) {
  char *to = u->name[lung];
  size_t at = (size_t)snprintf(to, NAME_SIZE, "Lung_%zu_", lung);
  for (const char *c = u->info->lung_names[lung]; *c != '\0' && at < NAME_SIZE - 1; ++c) {
    to[at++] = '_';
    if (supine_ascii_is_letter(*c) || supine_ascii_is_digit(*c)) {
      to[at - 1] = *c;
    }
  }
}

/* Print a text between quotes, with escapes. */
static void put_text(const usd *u, const char *before, const char *text) {
  (void)fprintf(u->file, "%s\"", before);
  for (const char *c = text; *c != '\0'; ++c) {
    if (*c == '"' || *c == '\\') {
      (void)fputc('\\', u->file);
    }
    (void)fputc((unsigned char)*c < ' ' ? ' ' : *c, u->file);
  }
  (void)fputs("\"\n", u->file);
}

static void find_vector(const usd *u, size_t lung, usd_kind kind, size_t target, size_t vertex,
                        double v[3]) {
  const float *normal = u->normals + 3 * vertex;
  if (kind == USD_POINTS) {
    supine_export_targets_base(&u->targets, lung, vertex, v);
    return;
  }
  if (kind == USD_OFFSETS) {
    supine_export_targets_field(&u->targets, vertex, target, v);
    for (size_t k = 0; k < 3; ++k) {
      v[k] *= u->targets.lung[lung].unit[target];
    }
    return;
  }
  if (kind == USD_NORMAL_OFFSETS) {
    normal = u->added + 3 * (target * u->info->vertex_count + vertex);
  }
  for (size_t k = 0; k < 3; ++k) {
    v[k] = (double)normal[k];
  }
}

static void put_vectors(const usd *u, const char *before, size_t lung, usd_kind kind,
                        size_t target) {
  const size_t *begin = u->order.lung_begin + lung;
  (void)fprintf(u->file, "%s = [", before);
  for (size_t i = begin[0]; i < begin[1]; ++i) {
    double v[3];
    find_vector(u, lung, kind, target, u->order.vertex[i], v);
    (void)supine_print(u->file, "%s(%.4f,%.4f,%.4f)", i == begin[0] ? "" : ",", v[0], v[1], v[2]);
  }
  (void)fputs("]", u->file);
}

static void put_triangles(const usd *u, size_t lung) {
  const size_t *begin = u->order.corner_begin + lung;
  (void)fputs("\n        int[] faceVertexCounts = [", u->file);
  for (size_t i = begin[0]; i < begin[1]; i += 3) {
    (void)fputs(i == begin[0] ? "3" : ",3", u->file);
  }
  (void)fputs("]\n        int[] faceVertexIndices = [", u->file);
  for (size_t i = begin[0]; i < begin[1]; ++i) {
    (void)fprintf(u->file, "%s%zu", i == begin[0] ? "" : ",",
                  u->order.corners[i] - u->order.lung_begin[lung]);
  }
  (void)fputs("]\n", u->file);
}

/* Print the names of the blend shapes of a lung, each between `before` and `after`, joined by
 * ",". */
static void put_shapes(const usd *u, size_t lung, const char *before, const char *after) {
  for (size_t j = 0; j < u->targets.count; ++j) {
    (void)fprintf(u->file, "%s%s%s_%zu%s", j == 0 ? "" : ",", before, u->name[lung], j, after);
  }
}

static void put_lung(const usd *u, size_t lung) {
  (void)fprintf(u->file,
                "\n    def Mesh \"%s\" (\n"
                "        prepend apiSchemas = [\"SkelBindingAPI\"]\n",
                u->name[lung]);
  put_text(u, "        customData = {\n            string name = ", u->info->lung_names[lung]);
  (void)fputs("        }\n    )\n    {\n        uniform token subdivisionScheme = \"none\"\n"
              "        uniform bool doubleSided = 1\n"
              "        color3f[] primvars:displayColor = [(0.66, 0.32, 0.29)]\n"
              "        rel skel:skeleton = </Patient/Skeleton>\n",
              u->file);
  put_vectors(u, "        point3f[] points", lung, USD_POINTS, 0);
  put_vectors(u, "\n        normal3f[] normals", lung, USD_NORMALS, 0);
  (void)fputs(" (\n            interpolation = \"vertex\"\n        )", u->file);
  put_triangles(u, lung);
  (void)fputs("        uniform token[] skel:blendShapes = [", u->file);
  put_shapes(u, lung, "\"", "\"");
  char path[2 * NAME_SIZE];
  (void)snprintf(path, sizeof path, "</Patient/%s/", u->name[lung]);
  (void)fputs("]\n        rel skel:blendShapeTargets = [", u->file);
  put_shapes(u, lung, path, ">");
  (void)fputs("]\n", u->file);
  for (size_t j = 0; j < u->targets.count; ++j) {
    (void)fprintf(u->file, "\n        def BlendShape \"%s_%zu\"\n        {\n", u->name[lung], j);
    put_vectors(u, "            uniform vector3f[] offsets", lung, USD_OFFSETS, j);
    put_vectors(u, "\n            uniform vector3f[] normalOffsets", lung, USD_NORMAL_OFFSETS, j);
    (void)fputs("\n        }\n", u->file);
  }
  (void)fputs("    }\n", u->file);
}

/* Print the weights of all blend shapes at each frame of a full turn. */
static void put_animation(const usd *u) {
  (void)fputs("\n    def SkelAnimation \"Breath\"\n    {\n        uniform token[] blendShapes = [",
              u->file);
  for (size_t lung = 0; lung < u->info->lung_count; ++lung) {
    (void)fputs(lung == 0 ? "" : ",", u->file);
    put_shapes(u, lung, "\"", "\"");
  }
  (void)fputs("]\n        float[] blendShapeWeights.timeSamples = {\n", u->file);
  for (int frame = 0; frame <= EXPORT_RATE * EXPORT_SECONDS * EXPORT_POSTURES; ++frame) {
    const double seconds = (double)frame / EXPORT_RATE;
    const char *before = "";
    (void)fprintf(u->file, "            %d: [", frame);
    for (size_t lung = 0; lung < u->info->lung_count; ++lung) {
      double weights[EXPORT_TARGETS_MAX];
      supine_export_moment(&u->targets, supine_export_roll(seconds), seconds, lung, weights);
      for (size_t j = 0; j < u->targets.count; ++j) {
        (void)supine_print(u->file, "%s%.6f", before, weights[j]);
        before = ",";
      }
    }
    (void)fputs("],\n", u->file);
  }
  (void)fputs("        }\n    }\n", u->file);
}

/* Print what holds for the whole file, and the patient, who turns about the long axis and lies down
 * on the back at first: points are LPS, mm, from the middle of the lungs. */
static void put_head(const usd *u) {
  char caveats[SUPINE_CAVEATS_SIZE];
  const double *middle = u->targets.middle;
  (void)supine_basis_caveats(u->targets.basis, caveats, sizeof caveats);
  (void)fprintf(u->file,
                "#usda 1.0\n(\n    defaultPrim = \"Patient\"\n    metersPerUnit = 0.001\n"
                "    upAxis = \"Y\"\n    startTimeCode = 0\n    endTimeCode = %d\n"
                "    timeCodesPerSecond = %d\n",
                EXPORT_RATE * EXPORT_SECONDS * EXPORT_POSTURES, EXPORT_RATE);
  put_text(u, "    customLayerData = {\n        string assumed = ", caveats);
  (void)supine_print(
      u->file,
      "        string axes = \"points are in the patient's axes, LPS, mm, from middle\"\n"
      "        double3 middle = (%.4f, %.4f, %.4f)\n    }\n)\n\n",
      middle[0], middle[1], middle[2]);
  (void)fputs("def SkelRoot \"Patient\" (\n    prepend apiSchemas = [\"SkelBindingAPI\"]\n)\n{\n"
              "    rel skel:animationSource = </Patient/Breath>\n"
              "    float xformOp:rotateX:axes = -90\n    float xformOp:rotateX:lie = -90\n"
              "    float xformOp:rotateY:roll.timeSamples = {\n",
              u->file);
  for (int frame = 0; frame <= EXPORT_RATE * EXPORT_SECONDS * EXPORT_POSTURES; ++frame) {
    (void)supine_print(u->file, "        %d: %.4f,\n", frame,
                       degrees * supine_export_roll((double)frame / EXPORT_RATE));
  }
  (void)fputs(
      "    }\n    uniform token[] xformOpOrder = [\"xformOp:rotateX:lie\", "
      "\"xformOp:rotateY:roll\", \"xformOp:rotateX:axes\"]\n"
      "\n    def Skeleton \"Skeleton\"\n    {\n"
      "        uniform token[] joints = [\"root\"]\n"
      "        uniform matrix4d[] bindTransforms = [((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), "
      "(0, 0, 0, 1))]\n"
      "        uniform matrix4d[] restTransforms = [((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), "
      "(0, 0, 0, 1))]\n    }\n",
      u->file);
}

static supine_status prepare(usd *u, size_t simplify, supine_arena *arena, supine_error *error) {
  const size_t n = u->info->vertex_count;
  u->normals = supine_arena_take(arena, n, 3 * sizeof *u->normals);
  u->added = supine_arena_take(arena, n * u->targets.count, 3 * sizeof *u->added);
  SUPINE_TRY(supine_arena_check(arena, error, "%zu vertices", n));
  SUPINE_TRY(supine_export_pack_begin(error));
  SUPINE_TRY(supine_export_order_make(u->info, false, simplify < n ? simplify : 0, arena, &u->order,
                                      error));
  for (size_t lung = 0; lung < u->info->lung_count; ++lung) {
    make_name(u, lung);
  }
  return supine_export_targets_normals(&u->targets, &u->order, true, u->normals, u->added, error);
}

supine_status supine_export_usd_write(const char *path, const supine_basis *basis, double breath,
                                      size_t simplify, export_written *written,
                                      supine_error *error) {
  const size_t vertices = simplify > 0 ? simplify : DEFAULT_VERTICES;
  SUPINE_FREED_BY(supine_output_abandon) supine_output output = {0};
  SUPINE_ARENA arena = {0};
  usd u = {.info = supine_basis_get_info(basis)};
  SUPINE_REFUSE_IF(u.info->triangle_count == 0, error, SUPINE_ERROR_MESH,
                   "the basis has no triangles to draw: precompute it from a surface");
  SUPINE_TRY(supine_export_targets_choose(basis, breath, &u.targets, error));
  SUPINE_TRY(prepare(&u, vertices, &arena, error));
  SUPINE_TRY(supine_output_open(path, &output, error));
  u.file = output.file;
  put_head(&u);
  for (size_t lung = 0; lung < u.info->lung_count; ++lung) {
    put_lung(&u, lung);
  }
  put_animation(&u);
  (void)fputs("}\n", u.file);
  *written = (export_written){.vertices = u.order.vertex_count};
  const long size = ftell(u.file);
  written->bytes = size < 0 ? 0 : (size_t)size;
  SUPINE_TRY(supine_output_commit(&output, error));
  return vertices < u.info->vertex_count
             ? supine_export_order_error(u.info, &u.order, &written->rms, &written->largest, error)
             : SUPINE_OK;
}
