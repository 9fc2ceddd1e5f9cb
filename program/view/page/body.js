// SPDX-License-Identifier: MIT
// Shape of the patient's body, which is only drawn: a torso around the lungs, and arms that lie on the table. If the
// patient lies on a side, the lower arm is raised, and the upper one lies along the body.

/** Points of the left arm from the shoulder to the fingers, in the units of the torso's outline, beside the body and
 * raised beside the head, and the arm's radius there, in half widths of the lungs. */
const ARM = {
  beside: [
    [1.2, 0, 0.72],
    [1.42, 0, 0.5],
    [1.52, 1, -0.3],
    [1.54, 1, -1.1],
    [1.52, 1, -1.9],
    [1.5, 1, -2.7],
    [1.48, 1, -3.3],
  ],
  raised: [
    [1.2, 0, 0.72],
    [1.1, -0.2, 1],
    [1.06, -0.4, 1.5],
    [1.08, -0.5, 2],
    [1.12, -0.55, 2.5],
    [1.16, -0.55, 2.9],
    [1.2, -0.55, 3.2],
  ],
  radius: [0.02, 0.4, 0.36, 0.31, 0.29, 0.22, 0.02],
};

/** Return rows of numbers with `count` - 1 rows between each two, on a Catmull-Rom spline. */
const smooth = (rows, count) =>
  Array.from({ length: (rows.length - 1) * count + 1 }, (_, i) => {
    const [at, t] = [
      Math.min(Math.floor(i / count), rows.length - 2),
      i / count - Math.min(Math.floor(i / count), rows.length - 2),
    ];
    const [a, b, c, d] = [at - 1, at, at + 1, at + 2].map((j) => rows[Math.max(0, Math.min(rows.length - 1, j))]);
    return b.map(
      (x, k) =>
        x + 0.5 * t * (c[k] - a[k] + t * (2 * a[k] - 5 * x + 4 * c[k] - d[k] + t * (3 * (x - c[k]) + d[k] - a[k]))),
    );
  });

/** Return the way down across the body, a unit vector [x, y, 0] in the patient's axes; null if the patient stands. */
function downOf(gravity) {
  const flat = Math.hypot(gravity[0], gravity[1]);
  return flat > 0.4 ? [gravity[0] / flat, gravity[1] / flat, 0] : null;
}

/** Return the points of both arms, from shoulder to fingers, relative to the centre of the torso, and their radii:
 * rows of x, y, z, radius, mm. An arm beside the body lies on the table. */
function armsOf({ half, outline }, down) {
  const deepest = Math.max(...outline.map(([, , y]) => y)) * half[1];
  // 0: beside the body, 1: raised
  const raised = (side) => (down ? Math.min(1, Math.max(0, (side * down[0] - 0.4) / 0.5)) : 0);
  return [1, -1].map((side) =>
    smooth(
      ARM.beside.map((beside, i) => {
        const radius = ARM.radius[i] * half[0];
        const lying = [beside[0] * half[0], beside[1] * (down ? down[1] * (deepest - radius) : 0), beside[2] * half[2]];
        const [x, y, z] = lying.map((from, axis) => from + raised(side) * (ARM.raised[i][axis] * half[axis] - from));
        return [side * x, y, z, radius];
      }),
      4,
    ).map(([x, y, z, radius]) => [x, y, z, Math.max(radius, 0.01)]),
  );
}

/** Return the sections of the torso: rows of its outline, and others between them. */
const torsoRings = ({ outline }) => smooth(outline, 6);

/** Return how far the body reaches down from the centre of the torso, mm. */
function reachDown(torso, arms, down) {
  const { half } = torso;
  const rings = torsoRings(torso).map(([, x, y]) => Math.hypot(x * half[0] * down[0], y * half[1] * down[1]));
  return Math.max(...rings, ...arms.flat().map(([x, y, , radius]) => x * down[0] + y * down[1] + radius));
}

/** Return a tube around a line of points [x, y, z, radius] as positions, unit normals and triangles of a mesh. */
function tubeOf(line, sides) {
  const [places, normals, corners] = [[], [], []];
  line.forEach(([x, y, z, radius], i) => {
    const [below, above] = [line[Math.max(0, i - 1)], line[Math.min(line.length - 1, i + 1)]];
    const along = unit([0, 1, 2].map((k) => above[k] - below[k]));
    const across = unit(cross(along, Math.abs(along[1]) < 0.8 ? [0, 1, 0] : [1, 0, 0]));
    const other = cross(along, across);
    for (let j = 0; j < sides; ++j) {
      const [cos, sin] = [Math.cos((2 * Math.PI * j) / sides), Math.sin((2 * Math.PI * j) / sides)];
      const out = across.map((a, k) => cos * a + sin * other[k]);
      places.push(x + radius * out[0], y + radius * out[1], z + radius * out[2]);
      normals.push(...out);
      const [a, b] = [i * sides + j, i * sides + ((j + 1) % sides)];
      if (i + 1 < line.length) corners.push(a, b, b + sides, a, b + sides, a + sides);
    }
  });
  return { places, normals, corners };
}
