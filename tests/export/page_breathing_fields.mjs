// SPDX-License-Identifier: GPL-3.0-or-later
// A page of another simulator's fields over gravity and volume, stored as modes and as clusters: positions, on the
// graphics card and in the script, and volumes are those of the library; clusters stay clusters, so that the page is
// smaller; the two lungs open differently, the volume and the breath have their sliders, and a volume that was not
// simulated is replaced by the nearest.
import assert from 'node:assert/strict';
import { readFileSync, statSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { close, evaluateFor, openLungs, settled } from './browser.mjs';
import { breathingFieldsBasis, deformed, floatsOf, folder, largestDistance, supine } from './support.mjs';

const TOLERANCE_MM = 0.02;
const [html, simplified, points, inside, rows, deformedSurface] = [
  'breathing.html',
  'breathing-simplified.html',
  'breathing.csv',
  'breathing-inside.safetensors',
  'breathing-moved.csv',
  'breathing-moved.ply',
].map((name) => join(folder, name));
const states = [
  [[0, 1, 0], 300],
  [[0, -1, 0], 1200],
  [[1, 0, 0], 700],
  [[0, 0, -1], 1700],
  [[0.48, -0.6, 0.64], 950],
  [[-0.8, 0.36, 0.48], 150],
  [[-0.6, -0.64, -0.48], 1450],
  [[0, 1, 0], 0],
  [[1, 0, 0], 0],
];
const sizes = {};

/** Return the expected errors that `supine deform` writes of a surface: the last of eight properties of a vertex. */
function errorsOf(basis, ...state) {
  supine('deform', basis, ...state, '-o', deformedSurface);
  const file = readFileSync(deformedSurface);
  const begin = file.indexOf('end_header\n') + 11;
  const count = Number(/element vertex (\d+)/.exec(file.toString('latin1', 0, begin))[1]);
  return Array.from({ length: count }, (_, v) => file.readFloatLE(begin + 32 * v + 28));
}

for (const storage of ['modes', 'clusters']) {
  const basis = join(folder, `breathing-${storage}.safetensors`);
  breathingFieldsBasis(basis, 1200, storage, '--scanned', storage === 'modes' ? 'none' : 'supine');
  assert.equal(JSON.parse(supine('info', basis, '--json')).multiplications === 15, storage === 'clusters');
  const surface = floatsOf(basis, 'vertices');
  const chosen = [100, 300, 600, 900].map((v) => [v, ...surface.subarray(3 * v, 3 * v + 3)]);
  writeFileSync(points, `name,x,y,z\n${chosen.map((row) => row.join()).join('\n')}\n`);
  supine('embed', basis, points, '-o', inside);
  supine('export', basis, '--inside', inside, '-o', html);
  const { page, complaints } = await openLungs(html);
  const truth = await evaluateFor(page, basis, states);
  const moments = await page.evaluate(
    (all) => all.map(([g, ml]) => ({ ...window.supine.moment(g, ml), at: Array.from(window.supine.positions(g, ml)) })),
    states,
  );
  let worst = 0;
  moments.forEach(({ at }, i) => {
    worst = Math.max(worst, largestDistance(at, truth[i].xyz));
  });
  console.log(`${storage}: ${worst.toExponential(2)} mm off in ${states.length} states`);
  assert.ok(worst < TOLERANCE_MM, `${worst} mm`);
  const scripted = await page.evaluate(
    (all) => all.map(([g, ml]) => Array.from(window.supine.placesOf(window.supine.basis, window.supine.moment(g, ml)))),
    states,
  );
  scripted.forEach((at, i) =>
    assert.ok(largestDistance(at, truth[i].xyz) < TOLERANCE_MM, `${states[i]}: the script errs`),
  );

  // The error of the fit at each vertex is that of the library in the last state, in steps of 0.002 mm times its growth
  // with the direction of gravity. Vertices have another order.
  const sorted = (errors) => Array.from(errors).toSorted((a, b) => a - b);
  const stored = errorsOf(basis, '--gravity', states.at(-1)[0].join());
  const shown = sorted(await page.evaluate(() => Array.from(window.supine.basis.library.expectedError())));
  assert.ok(stored.at(-1) > 0.002 && largestDistance(shown, sorted(stored)) < 0.004, `${stored.at(-1)} mm`);

  // A page of clusters has no coefficients of vertices. The vertices that have arrows move like the others.
  assert.equal(await page.evaluate(() => window.supine.basis.counts === undefined), storage === 'clusters');
  sizes[storage] = statSync(html).size;
  const few = await page.evaluate(([g, ml]) => {
    const { picture, moment } = window.supine;
    const target = picture.buffer(16 * picture.fewCount, picture.gl.DYNAMIC_READ);
    picture.capture(moment(g, ml), picture.fewInputs, target);
    return {
      every: Math.floor(picture.basis.vertices / picture.fewCount),
      at: Array.from(picture.take(target, picture.fewCount)),
    };
  }, states[4]);
  assert.ok(few.every > 1 && few.at.length / 3 > 400);
  assert.ok(
    largestDistance(
      few.at,
      moments[4].at.filter((_, i) => Math.floor(i / 3) % few.every === 0),
    ) < 1e-4,
  );

  // A vertex that a simplified page keeps stays where it was.
  supine('export', basis, '--simplify', '700', '-o', simplified);
  const part = await openLungs(simplified);
  assert.ok(await part.page.evaluate(() => window.supine.basis.vertices < 800));
  const [moved700] = await part.page.evaluate(
    (all) => all.map(([g, ml]) => Array.from(window.supine.positions(g, ml))),
    [states[4]],
  );
  for (let i = 0; i < moved700.length; i += 3) {
    let nearest = Infinity; // a vertex that is kept stays where it was
    for (let j = 0; j < moments[4].at.length; j += 3)
      nearest = Math.min(nearest, Math.hypot(...[0, 1, 2].map((axis) => moved700[i + axis] - moments[4].at[j + axis])));
    assert.ok(nearest < 1e-3, `vertex ${i / 3} of the simplified page is ${nearest} mm off`);
  }
  assert.deepEqual(part.complaints, []);
  await close(part.page);
  assert.ok(
    states.every((_, i) => i === 0 || largestDistance(truth[i].xyz, truth[0].xyz) > 2),
    'the states are alike',
  );

  // Where a volume begins to differ from that of the scan, the lungs do not jump.
  const jump = await page.evaluate(
    (postures) => postures.map((g) => [0, 0.01].map((ml) => Array.from(window.supine.positions(g, ml)))),
    [
      [0, 1, 0],
      [1, 0, 0],
    ],
  );
  for (const [at, near] of jump) assert.ok(largestDistance(at, near) < 0.005, 'a jump');

  // The lungs hold the volume that is asked, and share it as 'deform' does: the right lung lags behind.
  const { references } = await page.evaluate(() => window.supine.basis);
  const sum = (values) => values.reduce((total, x) => total + x, 0);
  for (const [i, [, ml]] of states.entries()) assert.ok(Math.abs(sum(moments[i].held) - sum(references) - ml) < 1e-3);
  const shares = moments[0].held.map((ml, lung) => (ml - references[lung]) / references[lung]);
  assert.ok(shares[0] > 1.3 * shares[1], `${shares}`);

  // The weights of each lung also move structures inside it. Points that were given on the surface stay on it.
  supine('deform', inside, '--gravity', states[4][0].join(), '--volume', `scan+${states[4][1]}`, '-o', rows);
  const [columns, ...parts] = readFileSync(rows, 'utf8')
    .trim()
    .split('\n')
    .filter((line) => !line.startsWith('#'))
    .map((line) => line.split(','));
  const moved = deformed(basis, '--gravity', states[4][0].join(), '--volume', `scan+${states[4][1]}`);
  parts.forEach((row, i) =>
    assert.ok(
      largestDistance(
        moved.subarray(3 * chosen[i][0], 3 * chosen[i][0] + 3),
        ['x', 'y', 'z'].map((axis) => Number(row[columns.indexOf(axis)])),
      ) < TOLERANCE_MM,
      `${row}`,
    ),
  );
  const within = await page.evaluate(([g, ml]) => Array.from(window.supine.insidePositions(g, ml)), states[4]);
  parts.forEach((row, i) =>
    assert.ok(
      largestDistance(
        within.slice(3 * i, 3 * i + 3),
        ['x', 'y', 'z'].map((axis) => Number(row[columns.indexOf(axis)])),
      ) < TOLERANCE_MM,
      `${row}`,
    ),
  );

  // The slider has the range that was simulated, and a breath stays within what all postures can hold.
  assert.ok(await page.locator('#depth').isVisible());
  const sliders = await page.evaluate(() => {
    const { depthMin, depthMax, shared, tidal, expired } = window.supine.state;
    return { depthMin, depthMax, shared, tidal, expired };
  });
  assert.ok(sliders.depthMin < 0 && sliders.depthMax > 1700 && sliders.tidal === 500, JSON.stringify(sliders));
  assert.ok(
    sliders.expired >= sliders.shared[0] && sliders.expired + sliders.tidal <= sliders.shared[1],
    JSON.stringify(sliders),
  );
  const limited = await page.evaluate(() => window.supine.moment([0, -1, 0], 9000));
  assert.equal(limited.above, limited.limited[1]);
  await page.evaluate(() => {
    location.hash = 'posture=prone&depth=900&room=0';
  });
  await page.waitForFunction(() => document.getElementById('posture-name').value === 'prone');
  await settled(page);
  assert.match(await page.locator('#finding').textContent(), /^Prone, 900 mL above the scan, /);
  const words = await page.locator('#surface-text').textContent();
  assert.match(words, /; error of the fit to the simulator (below )?[\d.]+ mm\.$/);
  const before = await page.evaluate(() =>
    Array.from(window.supine.state.moment.frames ?? window.supine.state.moment.weights),
  );
  await page.locator('#play').click();
  await page.waitForFunction(
    (weights) =>
      weights.some(
        (w, i) => Math.abs(w - (window.supine.state.moment.frames ?? window.supine.state.moment.weights)[i]) > 1e-4,
      ),
    before,
  );
  assert.ok(await page.evaluate(() => window.supine.state.playing && window.supine.state.moment.limited === null));
  await page.locator('#play').click();
  assert.deepEqual(complaints, []);
  await page.screenshot({ path: process.env.SCREENSHOT ?? join(folder, 'breathing.png') });
  await close(page);
}
assert.ok(sizes.clusters < sizes.modes - 20000, JSON.stringify(sizes));
