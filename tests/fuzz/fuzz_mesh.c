/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Fuzz surfaces in the file format FUZZ_ENDING. A mesh that loads must be valid. If a file is
 * refused, the message must name the file. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "mesh/mesh.h"

#include "fuzz.h"

static void expect_whole(const supine_mesh *mesh) {
  supine_topology topology = {0};
  supine_fuzz_expect(mesh->triangle_count > 0 && mesh->vertex_count >= 3,
                     "a mesh of at least one triangle");
  for (size_t i = 0; i < 3 * mesh->vertex_count; ++i) {
    supine_fuzz_expect(isfinite(mesh->vertices[i]), "finite coordinates");
  }
  supine_fuzz_expect(supine_mesh_topology_create(mesh, &topology) == SUPINE_OK,
                     "a loaded mesh whose topology can be computed");
  supine_fuzz_expect(!topology.closed || topology.genus >= -1,
                     "a genus of at least -1 if the surface is closed");
  supine_mesh_topology_free(&topology);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
  const char *path = supine_fuzz_file(bytes, size, FUZZ_ENDING);
  supine_mesh mesh = {0};
  supine_error error = {0};
  const supine_status status = supine_mesh_load(path, NULL, &mesh, NULL, &error);
  if (status == SUPINE_OK) {
    expect_whole(&mesh);
  } else {
    supine_fuzz_expect(
        error.status == status && strstr(error.message, path) != NULL &&
            strchr(error.message, '\n') == NULL && mesh.vertices == NULL,
        "no mesh from a refused file, and a message of one line that names the file");
  }
  supine_mesh_free(&mesh);
  (void)unlink(path);
  return 0;
}

/* Return the file that supine_mesh_save writes for a tetrahedron. */
static uint8_t *saved(size_t *size) {
  double vertices[] = {0, 0, 0, 120, 0, 0, 0, 120, 0, 0, 0, 120};
  uint32_t triangles[] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
  const supine_mesh mesh = {4, vertices, 4, triangles};
  const supine_mesh_save_options options = {.from = vertices};
  const char *path = supine_fuzz_file((const uint8_t *)"", 0, FUZZ_ENDING);
  supine_fuzz_expect(supine_mesh_save(path, &mesh, &options, NULL) == SUPINE_OK,
                     "a seed to be saved");
  return supine_fuzz_take(path, size);
}

uint8_t *supine_fuzz_seed(size_t index, size_t *size) {
  static const struct {
    const char *ending;
    const char *text;
  } texts[] = {
      {".ply", "ply\nformat ascii 1.0\ncomment SPACE=RAS\nelement vertex 4\nproperty float x\n"
               "property double y\nproperty short z\nproperty uchar a\nelement face 2\nproperty "
               "list uchar int vertex_indices\nproperty float w\nend_header\n0 0 0 1\n1 0 0 2\n"
               "0.5 1e1 0 3\n0 0 1 4\n4 0 1 2 3 0.1\n3 0 2 3 -1e-3\n"},
      {".ply", "ply\r\nformat ascii 1.0\r\nelement tristrips 1\r\nproperty list int int "
               "vertex_indices\r\nelement vertex 4\r\nproperty int8 x\r\nproperty uint16 y\r\n"
               "property float64 z\r\nend_header\r\n7 0 1 2 3 -1 0 1\r\n0 0 0\r\n1 0 0\r\n"
               "0 1 0\r\n0 0 1\r\n"},
      {".stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1e2 0 0\n"
               "vertex 0 -.5 0\nendloop\nendfacet\nendsolid a\n"},
      {".vtp",
       "<?xml version=\"1.0\"?><VTKFile type=\"PolyData\" byte_order=\"LittleEndian\">"
       "<PolyData><FieldData><Array type=\"String\" Name=\"SPACE\" format=\"ascii\">82 65 83 "
       "0</Array></FieldData><Piece NumberOfPoints=\"4\" NumberOfPolys=\"2\" "
       "NumberOfStrips=\"1\"><Points><DataArray type=\"Float64\" Name=\"Points\" "
       "NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0 0 1 0 0 0 1e2</DataArray>"
       "</Points><Polys><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0 1 "
       "2 0 1 3 2</DataArray><DataArray type=\"UInt8\" Name=\"offsets\" format=\"ascii\">3 7"
       "</DataArray></Polys><Strips><DataArray type=\"Int32\" Name=\"connectivity\" "
       "format=\"ascii\">0 1 2 3</DataArray><DataArray type=\"Int32\" Name=\"offsets\" "
       "format=\"ascii\">4</DataArray></Strips></Piece></PolyData></VTKFile>"},
      {".vtp", "<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\" header_type=\"UInt32\">"
               "<PolyData><Piece NumberOfPoints=\"3\" NumberOfPolys=\"1\"><Points><DataArray "
               "type=\"Int8\" format=\"binary\">CQAAAAAAAAEAAAABAA==</DataArray></Points><Polys>"
               "<DataArray type=\"Int8\" Name=\"connectivity\" format=\"appended\" offset=\"0\"/>"
               "<DataArray type=\"UInt8\" Name=\"offsets\" format=\"appended\" offset=\"12\"/>"
               "</Polys></Piece></PolyData><AppendedData encoding=\"base64\">_AwAAAAABAg==AQAAAAM="
               "</AppendedData></VTKFile>"},
      {".obj", "# SPACE=LPS\nmtllib a.mtl\no a\nv 0 0 0\nv 1 0 0 1\nv 1 1 0\nv 0 1 0.5\nvt 0 0\n"
               "vn 0 0 1\nusemtl a\ns 1\nf 1//1 2/1/1 3\nf -1 -2 -3 -4\nl 1 2\np 3\n"}};
  size_t seen = 0;
  for (size_t i = 0; i < sizeof texts / sizeof *texts; ++i) {
    if (strcmp(texts[i].ending, FUZZ_ENDING) == 0 && seen++ == index) {
      return supine_fuzz_text(texts[i].text, size);
    }
  }
  return seen == index && supine_mesh_save_supports("a" FUZZ_ENDING) ? saved(size) : NULL;
}
