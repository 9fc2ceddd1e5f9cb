/* SPDX-License-Identifier: MIT */
/* Join vertices at the same position, in linear time, by a hash of the position's bits. */
#include <string.h>

#include "mesh/io/read.h"
#include "mesh/repair.h"

static const uint32_t free_slot = UINT32_MAX;

static uint64_t hash_position(const double position[3]) {
  uint64_t bits[3];
  memcpy(bits, position, sizeof bits);
  uint64_t hash = 0;
  for (int k = 0; k < 3; ++k) {
    hash = (hash ^ bits[k]) * UINT64_C(0x9E3779B97F4A7C15);
    hash ^= hash >> 32;
  }
  return hash;
}

static bool same_position(const double a[3], const double b[3]) {
  return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* Remove all vertices but the first at each position, and return the number kept. Write the new
 * index of each old vertex to `remap`. `slots` is a hash table, initially all free_slot. */
static size_t join(supine_mesh *mesh, uint32_t *remap, uint32_t *slots, size_t slot_count) {
  const size_t mask = slot_count - 1;
  double *vertices = mesh->vertices;
  size_t kept = 0;
  for (size_t i = 0; i < mesh->vertex_count; ++i) {
    const double *position = vertices + 3 * i;
    size_t slot = hash_position(position) & mask;
    while (slots[slot] != free_slot &&
           !same_position(vertices + 3 * (size_t)slots[slot], position)) {
      slot = (slot + 1) & mask;
    }
    if (slots[slot] == free_slot) {
      slots[slot] = (uint32_t)kept;
      memmove(vertices + 3 * kept, position, 3 * sizeof *vertices);
      ++kept;
    }
    remap[i] = slots[slot];
  }
  return kept;
}

supine_status supine_io_weld(supine_mesh *mesh, supine_mesh_report *report) {
  size_t slot_count = 16;
  while (slot_count < 2 * mesh->vertex_count) {
    slot_count *= 2;
  }
  SUPINE_ARENA arena = {0};
  uint32_t *remap = supine_arena_take(&arena, mesh->vertex_count, sizeof *remap);
  uint32_t *slots = supine_arena_take(&arena, slot_count, sizeof *slots);
  SUPINE_TRY(supine_arena_status(&arena));
  memset(slots, 0xFF, slot_count * sizeof *slots);

  mesh->vertex_count = join(mesh, remap, slots, slot_count);
  report->degenerate_faces += supine_mesh_remap(mesh, remap);
  report->unreferenced_vertices += supine_mesh_drop_unreferenced(mesh, remap);
  return SUPINE_OK;
}
