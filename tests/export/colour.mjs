// SPDX-License-Identifier: GPL-3.0-or-later
// Test the colour maps of pages, pictures and reports: perceptual steps are even, lightness increases, and ranges end
// at round numbers.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { folder, oklab, supine } from './support.mjs';

supine('phantom', '-o', join(folder, 'lungs.ply'), '--vertices', '200');
supine('precompute', join(folder, 'lungs.ply'), '-o', join(folder, 'lungs.safetensors'));
supine('export', join(folder, 'lungs.safetensors'), '-o', join(folder, 'lungs.html'));
const page = readFileSync(join(folder, 'lungs.html'), 'utf8');
const data = page.match(/<data id="basis" hidden>(.*?)<\/data>/)[1].replaceAll('&quot;', '"');
const { anatomyColours, colours } = JSON.parse(data);

const code = readFileSync(new URL('../../program/view/page/colour.js', import.meta.url), 'utf8');
const { tickStep, rangeEnd } = new Function(`${code}
  return { tickStep, rangeEnd };`)();

/* Lobes that touch differ in lightness: the left two, and the right three, in the order of their names. */
const lightness = anatomyColours.map((colour) => oklab(Buffer.from(colour.slice(1), 'hex'))[0]);
for (const [a, b] of [
  [0, 1],
  [2, 3],
  [3, 4],
  [2, 4],
])
  assert.ok(Math.abs(lightness[a] - lightness[b]) > 0.05, `${anatomyColours[a]}, ${anatomyColours[b]}`);

for (const name of ['displacement', 'difference']) {
  const bytes = Buffer.from(colours[name], 'hex');
  const lab = Array.from({ length: 256 }, (_, i) => oklab(bytes.subarray(3 * i, 3 * i + 3)));
  const steps = []; // OKLab distances of the colours i and i + 15: far apart, so that rounding to bytes matters little
  for (let i = 0; i + 15 < 256; i += 15) {
    steps.push(Math.hypot(...lab[i].map((x, j) => x - lab[i + 15][j])));
    assert.ok(lab[i + 15][0] > lab[i][0] + 0.01, `${name}: lightness does not rise at ${i}`);
  }
  const ratio = Math.max(...steps) / Math.min(...steps);
  console.log(`${name}: steps within a factor of ${ratio.toFixed(3)}`);
  assert.ok(ratio < 1.1, `${name}: steps differ by a factor of ${ratio}`);
}

// The colour bar of the report shows the colour map of displacements.
supine('compare', join(folder, 'lungs.safetensors'), '--postures', 'supine,prone', '-o', join(folder, 'report.html'));
const report = readFileSync(join(folder, 'report.html'), 'utf8');
const bytesOf = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
const apart = (hex, name, i) =>
  Math.max(...bytesOf(hex).map((x, k) => Math.abs(x - Buffer.from(colours[name], 'hex')[3 * i + k])));
const bars = [...report.matchAll(/linear-gradient\(90deg,(#[^)]*)\)/g)].map((found) => found[1].split(','));
assert.equal(bars.length, 1);
for (const stops of bars) {
  assert.equal(stops.length, 17);
  const off = Object.keys(colours).map((name) =>
    Math.max(...stops.map((hex, i) => apart(hex, name, Math.round((255 * i) / 16)))),
  );
  assert.ok(Math.min(...off) <= 3, `colours of a bar differ by ${off}: ${stops}`);
}

// Ranges end at the same round numbers as those of pictures and reports: the cases are from
// tests/program/test_render.c.
for (const [value, step, end] of [
  [31.6, 5, 35],
  [18.7, 2, 20],
  [20, 5, 20],
  [0.043, 0.01, 0.05],
  [7.99, 1, 8],
  [8, 2, 8],
  [0, 0.2, 1],
]) {
  assert.ok(
    Math.abs(tickStep(value) - step) < 1e-12 && Math.abs(rangeEnd(value) - end) < 1e-12,
    `${value}: ${tickStep(value)}, ${rangeEnd(value)}`,
  );
}
