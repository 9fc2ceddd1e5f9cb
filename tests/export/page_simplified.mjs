// SPDX-License-Identifier: GPL-3.0-or-later
// Test that the whole surface stays as near to the surface of a simplified page as `export` states: in the scan, and
// where gravity and breathing have moved both.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { close, openLungs } from './browser.mjs';
import { basis, html } from './lungs.mjs';
import { folder, supine } from './support.mjs';

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const clamp = (x) => Math.max(0, Math.min(1, x));

/** Return the square of the distance of a point from a segment from the origin to `along`. */
function fromSegment(point, along) {
  const t = clamp(dot(point, along) / dot(along, along));
  const off = point.map((x, i) => x - t * along[i]);
  return dot(off, off);
}

/** Return the square of the distance of a point from the triangle [a, b, c]. */
function fromTriangle(point, [a, b, c]) {
  const [u, v, p] = [minus(b, a), minus(c, a), minus(point, a)];
  const [uu, uv, vv, pu, pv] = [dot(u, u), dot(u, v), dot(v, v), dot(p, u), dot(p, v)];
  const area = uu * vv - uv * uv;
  const [s, t] = [(vv * pu - uv * pv) / area, (uu * pv - uv * pu) / area];
  if (s >= 0 && t >= 0 && s + t <= 1) {
    const off = p.map((x, i) => x - s * u[i] - t * v[i]);
    return dot(off, off);
  }
  return Math.min(fromSegment(p, u), fromSegment(p, v), fromSegment(minus(point, b), minus(c, b)));
}

/** Return the RMS and the largest distance of points from a surface. */
function distancesFrom(points, { places, corners }) {
  const at = (list, i) => [list[3 * i], list[3 * i + 1], list[3 * i + 2]];
  const triangles = Array.from({ length: corners.length / 3 }, (_, t) =>
    [0, 1, 2].map((i) => at(places, corners[3 * t + i])),
  );
  const squares = Array.from({ length: points.length / 3 }, (_, i) =>
    triangles.reduce((least, triangle) => Math.min(least, fromTriangle(at(points, i), triangle)), Infinity),
  );
  return [Math.sqrt(squares.reduce((sum, x) => sum + x, 0) / squares.length), Math.sqrt(Math.max(...squares))];
}

/** Return the places of a page's vertices in some states, and the corners of its triangles. */
async function readPage(path, states) {
  const { page, complaints } = await openLungs(path);
  const read = await page.evaluate(
    (all) => ({
      moved: all.map(([g, ml]) => Array.from(window.supine.positions(g, ml))),
      corners: Array.from(window.supine.basis.corners),
      reference: Array.from(window.supine.basis.surface),
    }),
    states,
  );
  assert.deepEqual(complaints, []);
  await close(page);
  return read;
}

const states = [
  [[0, -1, 0], 0],
  [[1, 0, 0], 0],
  [[0, 1, 0], 1500],
];
const small = join(folder, 'simplified.html');
const [, ...stated] = /: ([\d.]+) mm RMS and ([\d.]+) mm at most/
  .exec(supine('export', basis, '--simplify', '500', '-o', small))
  .map(Number);
const [whole, part] = [await readPage(html, states), await readPage(small, states)];
const found = distancesFrom(whole.reference, { places: part.reference, corners: part.corners });
found.forEach((mm, i) => assert.ok(Math.abs(mm - stated[i]) < 0.01 * stated[i] + 0.01, `${mm} mm, not ${stated[i]}`));
states.forEach((state, s) => {
  const moved = distancesFrom(whole.moved[s], { places: part.moved[s], corners: part.corners });
  moved.forEach((mm, i) => assert.ok(mm <= stated[i], `state ${state}: ${mm} mm, and ${stated[i]} is stated`));
});
