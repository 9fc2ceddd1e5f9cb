// SPDX-License-Identifier: GPL-3.0-or-later
// A page of another simulator's fields, with more coefficients per vertex than vertex attributes hold: positions are
// those of the library, there is no breath, and the error of the basis is stated.
import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { close, evaluateFor, openLungs, press, settled } from './browser.mjs';
import { fieldsBasis, folder, largestDistance, randomDirections, supine } from './support.mjs';

const TOLERANCE_MM = 0.06;
const [basis, html, points, inside, rows] = [
  'basis.safetensors',
  'fields.html',
  'points.csv',
  'inside.safetensors',
  'moved.csv',
].map((name) => join(folder, name));

fieldsBasis(basis, 3000);
writeFileSync(points, 'name,x,y,z\nnodule,-80,-120,-90\n');
supine('embed', basis, points, '-o', inside);
supine('export', basis, '--inside', inside, '-o', html);

const { page, complaints } = await openLungs(html);
const directions = [[0, 1, 0], [0, -1, 0], [0, 0, -1], ...randomDirections(8, 12)];
const truth = await evaluateFor(
  page,
  basis,
  directions.map((g) => [g, 0]),
);
let [worst, moved] = [0, Infinity];
for (const [i, g] of directions.entries()) {
  // The volume has no effect
  const found = await page.evaluate((vector) => Array.from(window.supine.positions(vector, 300)), g);
  worst = Math.max(worst, largestDistance(found, truth[i].xyz));
  if (i > 0) moved = Math.min(moved, largestDistance(found, truth[0].xyz));
}
const modes = await page.evaluate(() => window.supine.basis.modes);
assert.ok(modes > 20, `${modes} modes would fit in vertex attributes`);
console.log(
  `positions of ${modes} vector modes: ${worst.toExponential(2)} mm off; moved by at least ${moved.toFixed(1)} mm`,
);
assert.ok(worst < TOLERANCE_MM && moved > 5, `${worst} mm off, moved ${moved} mm`);
const nodule = await page.evaluate(() => Array.from(window.supine.insidePositions([0, -1, 0], 0).slice(0, 3)));
supine('deform', inside, '--posture', 'prone', '-o', rows);
const [columns, row] = readFileSync(rows, 'utf8')
  .trim()
  .split('\n')
  .slice(-2)
  .map((line) => line.split(','));
assert.ok(
  largestDistance(
    nodule,
    ['x', 'y', 'z'].map((axis) => Number(row[columns.indexOf(axis)])),
  ) < TOLERANCE_MM,
  `${nodule}: ${row}`,
);

assert.ok(await page.locator('#play').isHidden(), 'a breath of fields that have none');
assert.ok(await page.locator('#depth').isHidden());
await press(page, 'Space');
assert.equal(await page.evaluate(() => window.supine.state.playing), false);
const { error_rms_percent: rms, error_max_mm: most } = await page.evaluate(() => window.supine.basis.metadata);
const stated = await page.locator('#state').textContent();
assert.ok(
  stated.includes(
    `${Number(rms).toPrecision(2)} % RMS, ${Number(most).toPrecision(2)} mm at most, each direction from the others`,
  ),
  stated,
);
await page.evaluate(() => {
  location.hash = 'posture=prone';
});
await page.waitForFunction(() => document.getElementById('posture-name').value === 'prone');
await settled(page);
assert.match(await page.locator('#surface-text').textContent(), / mm on average from the scan, /);
assert.deepEqual(complaints, []);
await page.screenshot({ path: process.env.SCREENSHOT ?? join(folder, 'fields.png') });
await close(page);
