// SPDX-License-Identifier: GPL-3.0-or-later
// Helpers for tests of exported files. The environment variables SUPINE and POSITIONS name the programs `supine` and
// export_positions, MODULES the folder of node_modules. A test that cannot run exits with 77, which CTest reports as
// skipped.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { dirname, join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';

export function skip(reason) {
  console.log(`skipped: ${reason}`);
  process.exit(77);
}

/** Import a file of an npm package, or skip the test. */
export async function load(path) {
  const file = join(process.env.MODULES, 'node_modules', path);
  if (!existsSync(file)) skip(`${path} is not installed: npm install in tests/export`);
  return import(pathToFileURL(file));
}

/** Import a CommonJS package, or skip the test. */
export function loadCommon(name) {
  const require = createRequire(pathToFileURL(join(process.env.MODULES, 'package.json')));
  try {
    return require(name);
  } catch {
    return skip(`${name} is not installed: npm install in tests/export`);
  }
}

export function supine(...words) {
  return execFileSync(process.env.SUPINE, words, { encoding: 'utf8' });
}

/** Make a folder for pictures that are kept: tests/NAME in the folder of the program, which is the build folder. */
export function pictureFolder(name) {
  const made = join(dirname(resolve(process.env.SUPINE)), 'tests', name);
  mkdirSync(made, { recursive: true });
  return made;
}

/** Temporary folder, removed when the test ends. */
export const folder = mkdtempSync(join(tmpdir(), 'supine-export-'));
process.on('exit', () => rmSync(folder, { recursive: true, force: true }));

/** Write a safetensors file of float64 tensors, {name: [shape, numbers]}. */
function writeTensors(path, tensors) {
  let at = 0;
  const header = JSON.stringify(
    Object.fromEntries(
      Object.entries(tensors).map(([name, [shape, numbers]]) => [
        name,
        { dtype: 'F64', shape, data_offsets: [at, (at += 8 * numbers.length)] },
      ]),
    ),
  );
  const size = Buffer.alloc(8);
  size.writeBigUInt64LE(BigInt(header.length));
  writeFileSync(
    path,
    Buffer.concat([
      size,
      Buffer.from(header),
      ...Object.values(tensors).map(([, numbers]) => Buffer.from(Float64Array.from(numbers).buffer)),
    ]),
  );
}

/** Return the numbers of a tensor of 32-bit floats of a safetensors file. */
export function floatsOf(path, name) {
  const bytes = readFileSync(path);
  const start = 8 + Number(bytes.readBigUInt64LE(0));
  const [begin, end] = JSON.parse(bytes.subarray(8, start).toString())[name].data_offsets;
  return new Float32Array(Uint8Array.from(bytes.subarray(start + begin, start + end)).buffer);
}

/** Write a phantom with about `vertices` vertices to `path`. Return its points, and for each of them whether it
 * belongs to the left lung. */
function phantomPoints(path, vertices) {
  supine('phantom', '--vertices', String(vertices), '-o', path);
  const lines = readFileSync(path, 'utf8')
    .split('\n')
    .map((line) => line.split(' '));
  const points = lines.filter(([kind]) => kind === 'v').map((words) => words.slice(1, 4).map(Number));
  // A vertex of the same lung; the last in the chain is the same for all vertices of a lung
  const of = points.map((_, i) => i);
  const last = (v) => {
    while (of[v] !== v) v = of[v] = of[of[v]];
    return v;
  };
  for (const [kind, ...corners] of lines)
    if (kind === 'f')
      for (const corner of corners) of[last(parseInt(corner, 10) - 1)] = last(parseInt(corners[0], 10) - 1);
  const leftmost = points.reduce((most, p, i) => (p[0] > points[most][0] ? i : most), 0);
  return { points, left: points.map((_, i) => last(i) === last(leftmost)) };
}

/** Write a basis of fields over gravity and volume of a phantom with about `vertices` vertices. The right lung opens
 * later than the left lung. `storage` is modes or clusters; `options` are further ones of precompute. */
export function breathingFieldsBasis(path, vertices, storage, ...options) {
  const [mesh, fields] = ['breathing.obj', 'breathing-fields.safetensors'].map((name) => join(folder, name));
  const { points, left } = phantomPoints(mesh, vertices);
  const centres = [false, true].map((side) =>
    [0, 1, 2].map((axis) => {
      const own = points.filter((_, i) => left[i] === side);
      return own.reduce((sum, p) => sum + p[axis], 0) / own.length;
    }),
  );
  const move = (g, s) =>
    points.map((p, i) => {
      const q = p.map((x, axis) => (x - centres[Number(left[i])][axis]) / 100);
      const along = q[0] * g[0] + q[1] * g[1] + q[2] * g[2];
      const open = left[i] ? s : s * (0.4 + 0.6 * s);
      return q.map(
        (x, axis) =>
          16 * (open - 0.2) * x +
          (1 - 0.6 * s) * ((7 - 3 * (q[0] ** 2 + q[1] ** 2 + q[2] ** 2)) * g[axis] + 3 * Math.tanh(along) * x) -
          (axis === 2 ? 4 * open * open * x * x : 0),
      );
    });
  const directions = supine('precompute', '--directions', '20')
    .trim()
    .split('\n')
    .slice(1)
    .map((line) => line.split(',').map(Number));
  const runs = [0, 1 / 3, 2 / 3, 1].flatMap((s) => directions.map((g) => [g, s]));
  writeTensors(fields, {
    points: [[points.length, 3], points.flat()],
    gravity: [[runs.length, 3], runs.flatMap(([g]) => g)],
    displacement: [[runs.length, points.length, 3], runs.flatMap(([g, s]) => move(g, s).flat())],
  });
  supine('precompute', mesh, '--fields', fields, '--modes', '16', '--storage', storage, ...options, '-o', path);
}

/** Write a basis of smooth fields, as another simulator may compute them, of a phantom with about `vertices` vertices.
 * It has more than 20 vector modes. */
export function fieldsBasis(path, vertices) {
  const [mesh, fields] = ['fields.obj', 'fields.safetensors'].map((name) => join(folder, name));
  const { points } = phantomPoints(mesh, vertices);
  const gravity = supine('precompute', '--directions', '100')
    .trim()
    .split('\n')
    .slice(1)
    .map((line) => line.split(',').map(Number));
  const wave = ([gx, gy, gz], [x, y, z]) => [
    6 * Math.sin(gx * (2 + x / 60)),
    8 * gy + 3 * Math.cos(2 * gz + (gx * y) / 40),
    5 * gz + 4 * Math.sin(gx + (gy * z) / 50),
  ];
  writeTensors(fields, {
    points: [[points.length, 3], points.flat()],
    gravity: [[gravity.length, 3], gravity.flat()],
    displacement: [[gravity.length, points.length, 3], gravity.flatMap((g) => points.flatMap((p) => wave(g, p)))],
  });
  supine('precompute', mesh, '--fields', fields, '--modes', '30', '--scanned', 'supine', '-o', path);
}

/** Return the positions, mm, of the surface that 'supine deform' writes for a state. */
export function deformed(basis, ...state) {
  const path = join(folder, 'deformed.obj');
  supine('deform', basis, ...state, '-o', path);
  return Float64Array.from(
    readFileSync(path, 'utf8')
      .split('\n')
      .filter((line) => line.startsWith('v '))
      .flatMap((line) => line.split(' ').slice(1, 4).map(Number)),
  );
}

/** Return a generator of uniform random numbers in [0, 1) (mulberry32). */
export function randomSource(seed) {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let t = Math.imul(state ^ (state >>> 15), state | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

/** Return random unit vectors, uniform on the sphere. */
export function randomDirections(count, seed) {
  const random = randomSource(seed);
  return Array.from({ length: count }, () => {
    const z = 2 * random() - 1;
    const turn = 2 * Math.PI * random();
    const r = Math.sqrt(1 - z * z);
    return [r * Math.cos(turn), r * Math.sin(turn), z];
  });
}

/** Evaluate [gravity, mL] pairs in C. Return {scale, xyz} for each: the factor of the first lung's displacement, and
 * the positions, mm. */
export function evaluate(basis, pairs) {
  const bytes = execFileSync(process.env.POSITIONS, [basis, ...pairs.map(([g, volume]) => [...g, volume].join(','))], {
    maxBuffer: 1 << 30,
  });
  const size = bytes.length / pairs.length;
  return pairs.map((_, i) => {
    const part = Uint8Array.prototype.slice.call(bytes, i * size, (i + 1) * size).buffer;
    return { scale: new Float64Array(part, 0, 1)[0], xyz: new Float32Array(part, 8) };
  });
}

/** Return, for each point of `points` [N, 3], the index of the point of `others` within `tolerance` mm; assert that the
 * indices are a permutation. Points are sorted into cells of 1 mm; a search visits a cell and its 26 neighbours. */
export function matchPoints(points, others, tolerance) {
  const cells = new Map();
  const cellOf = (xyz, i, shift = [0, 0, 0]) => shift.map((s, k) => Math.floor(xyz[3 * i + k]) + s).join();
  const shifts = [-1, 0, 1].flatMap((x) => [-1, 0, 1].flatMap((y) => [-1, 0, 1].map((z) => [x, y, z])));
  const apart = (i, j) => Math.hypot(...[0, 1, 2].map((k) => points[3 * i + k] - others[3 * j + k]));
  assert.equal(points.length, others.length);
  for (let j = 0; j < others.length / 3; ++j)
    cells.set(cellOf(others, j), [...(cells.get(cellOf(others, j)) ?? []), j]);
  const found = Array.from({ length: points.length / 3 }, (_, i) =>
    shifts.flatMap((shift) => cells.get(cellOf(points, i, shift)) ?? []).find((j) => apart(i, j) < tolerance),
  );
  assert.equal(new Set(found).size, found.length);
  assert.ok(!found.includes(undefined));
  return found;
}

/** Return the points [N, 3] permuted by `order`. */
export const inOrder = (points, order) =>
  Float64Array.from(order.flatMap((i) => [...points.subarray(3 * i, 3 * i + 3)]));

/** Return the largest distance between points of equal index. */
export function largestDistance(a, b) {
  assert.equal(a.length, b.length);
  let largest = 0;
  for (let i = 0; i < a.length; i += 3) {
    const d = Math.hypot(a[i] - b[i], a[i + 1] - b[i + 1], a[i + 2] - b[i + 2]);
    assert.ok(Number.isFinite(d));
    if (d > largest) largest = d;
  }
  return largest;
}

/** Return the OKLab colour of sRGB bytes. */
export function oklab(bytes) {
  const [r, g, b] = Array.from(bytes, (x) =>
    x / 255 <= 0.04045 ? x / 255 / 12.92 : ((x / 255 + 0.055) / 1.055) ** 2.4,
  );
  const l = Math.cbrt(0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b);
  const m = Math.cbrt(0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b);
  const s = Math.cbrt(0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b);
  return [
    0.2104542553 * l + 0.793617785 * m - 0.0040720468 * s,
    1.9779984951 * l - 2.428592205 * m + 0.4505937099 * s,
    0.0259040371 * l + 0.7827717662 * m - 0.808675766 * s,
  ];
}
