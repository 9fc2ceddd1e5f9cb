// SPDX-License-Identifier: GPL-3.0-or-later
// `compare`, `deform` and the page state the same displacements of a nodule and of the surface, measured from supine
// at rest or from the state of --from. The sentences of the page are true in any direction of gravity.
import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { close, evaluateFor, openLungs, settled } from './browser.mjs';
import { basis } from './lungs.mjs';
import { folder, randomDirections, supine } from './support.mjs';

const AGREE_MM = 0.051; // tolerance: the page rounds to one decimal, the program to three
const [points, inside, html, moved, vtp] = [
  'nodule.csv',
  'nodule.safetensors',
  'numbers.html',
  'nodules.csv',
  'surface.vtp',
].map((name) => join(folder, name));
writeFileSync(points, 'name,x,y,z\nnodule,-80,-120,-90\n');
supine('embed', basis, points, '-o', inside);

/** Run `compare` and `deform` for a posture at the volume at rest. Return the displacement of the structure "nodule" by
 * each command, the mean and largest displacement of the surface by `compare`, and the largest by `deform`. */
function told(posture, from) {
  const pair = JSON.parse(supine('compare', inside, '--postures', `supine,${posture}`, '--json')).targets.find(
    ({ name }) => name === 'nodule',
  );
  const report = JSON.parse(
    supine('compare', basis, '--postures', posture, '--json', '--from', from).replace(/^[^{]*/, ''),
  );
  supine('deform', inside, '--posture', posture, '--volume', 'rest', '--from', from, '-o', moved);
  const [columns, row] = readFileSync(moved, 'utf8')
    .trim()
    .split('\n')
    .slice(-2)
    .map((line) => line.split(','));
  const largest = /largest displacement ([\d.]+) mm from (.*?),/.exec(
    supine('deform', basis, '--posture', posture, '--volume', 'rest', '--from', from, '-o', vtp),
  );
  const column = (name) => Number(row[columns.indexOf(name)]);
  return {
    pair: pair.mm,
    nodule: column('moved_mm'),
    move: ['dx', 'dy', 'dz'].map(column),
    sigma: column('moved_error_mm'),
    mean: report.postures[0].displacement_mm.mean,
    max: report.postures[0].displacement_mm.max,
    largest: Number(largest[1]),
    name: largest[2],
    reported: report.displacement_from,
    held: report.postures[0].volume_ml,
    error: report.postures[0].moved_error_mm,
  };
}

/** Return the numbers and texts of the page for a posture at the volume at rest. */
async function shown(page, posture) {
  await page.evaluate((text) => {
    location.hash = `posture=${text}&depth=0`;
  }, posture);
  await page.waitForFunction((text) => document.getElementById('posture-name').value === text, posture);
  await settled(page);
  return page.evaluate(() => ({
    finding: document.getElementById('finding').textContent,
    surface: document.getElementById('surface-text').textContent,
    target: [...document.querySelectorAll('#inside-rows td')].map((cell) => cell.textContent),
    held: window.supine.state.moment.held,
    lungs: window.supine.basis.lungNames,
  }));
}

const near = (a, b, what) => assert.ok(Math.abs(a - b) <= AGREE_MM, `${what}: ${a} and ${b} mm`);

for (const [from, name] of [
  ['supine:rest', 'supine at rest'],
  ['scan', 'the scan'],
  ['right:rest+200', 'right side at rest + 200 mL'],
]) {
  supine('export', basis, '--inside', inside, '-o', html, ...(from === 'supine:rest' ? [] : ['--from', from]));
  const { page, complaints } = await openLungs(html, {}, '#show=contours');
  for (const posture of ['prone', 'left']) {
    const [program, seen] = [told(posture, from), await shown(page, posture)];
    assert.equal(program.name, name);
    assert.equal(program.reported, name);
    const [, mean, largest, error] =
      /^([\d.]+) mm on average from .*, 95 % within [\d.]+, at most ([\d.]+); expected error ([\d.]+) mm\.$/
        .exec(seen.surface)
        .map(Number);
    assert.ok(seen.surface.includes(` from ${name}, `) && seen.finding.includes(` from ${name}`), seen.finding);
    const [distance, words, sigma] = seen.target;
    near(
      Number(distance.split(' ')[0]),
      program.nodule,
      `${posture} from ${name}: displacement of the nodule, page and deform`,
    );
    near(
      Number(sigma.split(' ')[0]),
      program.sigma,
      `${posture} from ${name}: expected error of the nodule, page and deform`,
    );
    if (program.nodule > program.sigma) {
      const ways = { left: [0, 1], right: [0, -1], back: [1, 1], front: [1, -1], head: [2, 1], feet: [2, -1] };
      const parts = [...words.matchAll(/(\d+) to the (\w+)/g)].map(([, mm, way]) => [Number(mm), way]);
      for (const [mm, way] of parts)
        assert.ok(Math.abs(mm - ways[way][1] * program.move[ways[way][0]]) <= 0.51, `${words}: ${program.move}`);
      assert.ok(
        seen.finding.includes(
          parts
            .slice(0, 2)
            .map(([mm, way]) => `${mm} to the ${way}`)
            .join(', '),
        ),
        seen.finding,
      );
    } else
      assert.ok(
        seen.finding.includes(
          `nodule moves ${distance} from ${name}, within its error of ${parseFloat(sigma).toFixed(1)}: ` +
            'no change that the model can tell',
        ),
        seen.finding,
      );
    if (from === 'supine:rest')
      near(program.pair, program.nodule, `${posture}: displacement of the nodule, compare and deform`);
    near(mean, program.mean, `${posture} from ${name}: mean displacement, page and compare`);
    near(largest, program.max, `${posture} from ${name}: largest displacement, page and compare`);
    near(program.largest, program.max, `${posture} from ${name}: largest displacement, deform and compare`);
    near(error, program.error, `${posture} from ${name}: expected error of the surface, page and compare`);
    seen.lungs.forEach((lung, i) =>
      assert.ok(
        Math.abs(seen.held[i] - program.held[lung.replace(' lung', '')].value) < 0.01,
        `${lung}: ${seen.held[i]}`,
      ),
    );
    if (posture === 'left') assert.match(seen.finding, /^Lying on the left side, nodule/);
  }
  assert.deepEqual(complaints, []);
  await close(page);
}

/* Volumes and displacements of the page equal those computed from positions by the library, in any direction. */
supine('export', basis, '-o', html);
const { page, complaints } = await openLungs(html);
const directions = [[0, -1, 0], [1, 0, 0], [-1, 0, 0], [0, 0, -1], [0, 0, 1], ...randomDirections(20, 41)].map((g) =>
  g.map((x) => Number(x.toFixed(2))),
);
const places = (await evaluateFor(page, basis, [[[0, 1, 0], 0], ...directions.map((g) => [g, 0])])).map(
  ({ xyz }) => xyz,
);
const { lungBegin, corners, lungs } = await page.evaluate(() => {
  const { basis: b } = window.supine;
  return { lungBegin: b.lungBegin, corners: Array.from(b.corners), lungs: b.lungNames };
});
/** Return the volume enclosed by a lung's triangles, mL. */
const enclosed = (xyz, lung) => {
  let sum = 0;
  for (let t = 0; t < corners.length; t += 3) {
    if (corners[t] < lungBegin[lung] || corners[t] >= lungBegin[lung + 1]) continue;
    const [a, b, c] = [0, 1, 2].map((i) => Array.from(xyz.slice(3 * corners[t + i], 3 * corners[t + i] + 3)));
    sum += a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
  }
  return sum / 6000;
};
for (const [i, g] of directions.entries()) {
  const { held, largest } = await page.evaluate((gravity) => {
    const { state, postureFrom, basis: b, movedBetween } = window.supine;
    const { q } = postureFrom(gravity.join(':'));
    state.depth = 0;
    state.settle(q, 0, 0);
    state.compute();
    return { held: state.moment.held, largest: movedBetween(b, state.moment, state.from).largest };
  }, g);
  lungs.forEach((lung, j) =>
    assert.ok(
      Math.abs(held[j] - enclosed(places[i + 1], j)) < 0.5,
      `${lung}: ${held[j]} mL, the surface holds ${enclosed(places[i + 1], j)}`,
    ),
  );
  const far = Math.max(
    ...Array.from({ length: places[0].length / 3 }, (_, v) =>
      Math.hypot(...[0, 1, 2].map((k) => places[i + 1][3 * v + k] - places[0][3 * v + k])),
    ),
  );
  assert.ok(Math.abs(largest - far) < 0.1, `${largest}; the largest is ${far} mm`);
}
assert.deepEqual(complaints, []);
await close(page);
