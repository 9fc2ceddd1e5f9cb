// SPDX-License-Identifier: MIT
// Compute a vertex of a deformed lung and its normal in a vertex shader, in GLSL ES 3.00 or GLSL 3.30 core.
// Put this text after the #version line (and, for ES, after "precision highp float;").
//
//     x = reference + gain (w . c) direction    w, c: weight of each of K modes, and its coefficient at the vertex
//     x = reference + gain (w . cx, w . cy, w . cz)  if a mode has a coefficient for each axis
//     x = b + A reference + a_0 Q_0 + a_1 Q_1   b, A, Q_0, Q_1: frame of a cluster of vertices; a: scalars of the vertex
//     normal = sum over j of v_j m_j            v_j, m_j: weight of each of Q vectors, and the vector at the vertex
//
// `direction` is the vector along which the vertex moves. `gain` multiplies the displacement of a lung along x, y and z.
// Attributes (reference, direction, c, m) come from supine_gl_pack and supine_gl_pack_normals, the uniforms from
// supine_gl_weights and supine_gl_normal_weights (supine/runtime.h). reference.w is the index of the lung and selects
// its gains, so that one draw call draws all lungs. A vertex costs K + 6 multiplications and K + 2 additions, or 3 K + 3
// and 3 K; its normal costs 3 Q multiplications and 3 Q additions.
//
// In a basis of clusters (supine_basis_info.cluster_count), a vertex costs 15 multiplications and 15 additions and has 20
// bytes, however many modes there are. Its attributes (reference, scalars, cluster, lung) come from
// supine_gl_pack_clusters, and the texture supine_frames from supine_gl_frames.

#ifndef SUPINE_LUNGS
#define SUPINE_LUNGS 2
#endif
#ifndef SUPINE_VECTORS
#define SUPINE_VECTORS 4 // vec4s that hold the coefficients of K modes: (K + 3) / 4
#endif
#ifndef SUPINE_WORDS
#define SUPINE_WORDS 2 // uvec3s that hold the Q vectors of a vertex whose weighted sum is its normal: (Q + 2) / 3
#endif

#ifndef SUPINE_BY_LUNG
#define SUPINE_BY_LUNG 0 // 1 if each lung has weights of its own: supine_basis_info.order is above 0
#endif

#if SUPINE_BY_LUNG
uniform vec4 supine_weights[SUPINE_LUNGS * SUPINE_VECTORS];
#else
uniform vec4 supine_weights[SUPINE_VECTORS];
#endif
uniform vec3 supine_gains[SUPINE_LUNGS];
uniform vec3 supine_normal_weights[SUPINE_LUNGS * SUPINE_WORDS];

// Return the index in supine_weights of the first weights of a vertex's lung.
int supine_first(vec4 reference) {
  return SUPINE_BY_LUNG * SUPINE_VECTORS * int(reference.w);
}

vec3 supine_place(vec4 reference, vec3 direction, float amount) {
  return reference.xyz + supine_gains[int(reference.w)] * amount * direction;
}

// Sum weight times coefficient over the modes, from supine_weights[first] on (supine_first), or from the first on; and
// displace a vertex by the sum along `direction`.
float supine_amount(int first, vec4 c0) {
  return dot(supine_weights[first], c0);
}

float supine_amount(vec4 c0) {
  return supine_amount(0, c0);
}

vec3 supine_displace(vec4 reference, vec3 direction, vec4 c0) {
  return supine_place(reference, direction, supine_amount(supine_first(reference), c0));
}

#if SUPINE_VECTORS > 1
float supine_amount(int first, vec4 c0, vec4 c1) {
  return dot(supine_weights[first], c0) + dot(supine_weights[first + 1], c1);
}

float supine_amount(vec4 c0, vec4 c1) {
  return supine_amount(0, c0, c1);
}

vec3 supine_displace(vec4 reference, vec3 direction, vec4 c0, vec4 c1) {
  return supine_place(reference, direction, supine_amount(supine_first(reference), c0, c1));
}
#endif

#if SUPINE_VECTORS > 2
float supine_amount(int first, vec4 c0, vec4 c1, vec4 c2) {
  return supine_amount(first, c0, c1) + dot(supine_weights[first + 2], c2);
}

float supine_amount(vec4 c0, vec4 c1, vec4 c2) {
  return supine_amount(0, c0, c1, c2);
}

vec3 supine_displace(vec4 reference, vec3 direction, vec4 c0, vec4 c1, vec4 c2) {
  return supine_place(reference, direction, supine_amount(supine_first(reference), c0, c1, c2));
}
#endif

#if SUPINE_VECTORS > 3
float supine_amount(int first, vec4 c0, vec4 c1, vec4 c2, vec4 c3) {
  return supine_amount(first, c0, c1) +
         (dot(supine_weights[first + 2], c2) + dot(supine_weights[first + 3], c3));
}

float supine_amount(vec4 c0, vec4 c1, vec4 c2, vec4 c3) {
  return supine_amount(0, c0, c1, c2, c3);
}

vec3 supine_displace(vec4 reference, vec3 direction, vec4 c0, vec4 c1, vec4 c2, vec4 c3) {
  return supine_place(reference, direction, supine_amount(supine_first(reference), c0, c1, c2, c3));
}
#endif

// Displace a vertex of a basis with coefficients along x, y and z (supine_basis_info.vector). `amounts` has the sum of
// each axis, such as vec3(supine_amount(x0, x1), supine_amount(y0, y1), supine_amount(z0, z1)) with 5 to 8 modes; if each
// lung has weights of its own, supine_amount(supine_first(reference), x0, x1) and so on.
vec3 supine_displace(vec4 reference, vec3 amounts) {
  return supine_place(reference, amounts, 1.0);
}

uniform highp sampler2D supine_frames; // a row for each cluster: b, the columns of A, Q_0 and Q_1

// Displace a vertex of a basis of clusters.
vec3 supine_displace(vec3 reference, vec2 scalars, uint cluster) {
  int row = int(cluster);
  vec3 b = texelFetch(supine_frames, ivec2(0, row), 0).xyz;
  vec3 ax = texelFetch(supine_frames, ivec2(1, row), 0).xyz;
  vec3 ay = texelFetch(supine_frames, ivec2(2, row), 0).xyz;
  vec3 az = texelFetch(supine_frames, ivec2(3, row), 0).xyz;
  vec3 q0 = texelFetch(supine_frames, ivec2(4, row), 0).xyz;
  vec3 q1 = texelFetch(supine_frames, ivec2(5, row), 0).xyz;
  return b + reference.x * ax + reference.y * ay + reference.z * az + scalars.x * q0 + scalars.y * q1;
}

// Compute the part of a vertex normal that one vertex attribute holds; the normal is the sum over all `part`s, before
// normalisation. `words` is the attribute packed by supine_gl_pack_normals: each word has one coordinate of three
// vectors, in 13, 10 and 9 bits. reference.w is the index of the lung, which has its own weights of the vectors.
vec3 supine_normal(vec4 reference, int part, uvec3 words) {
  vec3 v = supine_normal_weights[int(reference.w) * SUPINE_WORDS + part];
  return v.x * vec3(ivec3(words)) + v.y * vec3(ivec3(words << 13)) + v.z * vec3(ivec3(words << 23));
}

#ifdef SUPINE_FRAGMENT // define it if this text is put before a fragment shader
// Compute the unit normal of the triangle, for a basis without stored normals. `place` is the position that the vertex
// shader computed, interpolated over the triangle. The normal points to where the corners run counter-clockwise.
vec3 supine_triangle_normal(vec3 place) {
  return normalize(cross(dFdx(place), dFdy(place)));
}
#endif
