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

// Colours of anatomy stay apart with each kind of colour vision. Rows are linear red, green and blue as seen by someone
// without red, green or blue cones (Machado, Oliveira and Fernandes 2009, severity 1).
const VISION = {
  protanopia: [
    [0.152286, 1.052583, -0.204868],
    [0.114503, 0.786281, 0.099216],
    [-0.003882, -0.048116, 1.051998],
  ],
  deuteranopia: [
    [0.367322, 0.860646, -0.227968],
    [0.280085, 0.672501, 0.047413],
    [-0.01182, 0.04294, 0.968881],
  ],
  tritanopia: [
    [1.255528, -0.076749, -0.178779],
    [-0.078411, 0.930809, 0.147602],
    [0.004733, 0.691367, 0.3039],
  ],
};
const APART = 0.045; // OKLab
const linear = (x) => (x / 255 <= 0.04045 ? x / 255 / 12.92 : ((x / 255 + 0.055) / 1.055) ** 2.4);
const coded = (x) => 255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);
/** Return a colour as someone with the cones `rows` sees it, in OKLab. */
function seenAs(rows, hex) {
  const rgb = Array.from(Buffer.from(hex.slice(1), 'hex'), linear);
  const cones = rows.map((row) => row.reduce((sum, part, k) => sum + part * rgb[k], 0));
  return oklab(cones.map((x) => coded(Math.min(1, Math.max(0, x)))));
}
for (const [name, rows] of Object.entries(VISION)) {
  const seen = anatomyColours.map((hex) => seenAs(rows, hex));
  seen.forEach((a, i) =>
    seen.slice(0, i).forEach((b, j) => {
      const far = Math.hypot(...a.map((x, k) => x - b[k]));
      assert.ok(far > APART, `${name}: anatomy ${i} and ${j} are ${far.toFixed(3)} apart`);
    }),
  );
}

// The selected target and the others differ in lightness in the picture of the page, with each kind of colour vision,
// and by a ring in its list, whose colours must have contrast with the paper. Pictures: tests/program/test_render.c.
const [, stage] = page.match(/#stage \{([^}]*)\}/);
const [other, selected] = ['accent', 'change'].map((name) => new RegExp(`--${name}: (#[0-9a-f]{6})`).exec(stage)[1]);
const plain = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
for (const [name, rows] of Object.entries({ plain, ...VISION })) {
  const far = Math.abs(seenAs(rows, other)[0] - seenAs(rows, selected)[0]);
  assert.ok(far > 0.05, `${name}: ${other} and ${selected} differ by ${far.toFixed(3)} in lightness`);
}
assert.match(page, /\.chosen th button::before \{[^}]*box-shadow: 0 0 0 2px/);

// The colour bar of the report shows the colour map of displacements.
const postures = 'supine,prone,left,right,upright,supine+15';
supine('compare', join(folder, 'lungs.safetensors'), '--postures', postures, '-o', join(folder, 'report.html'));
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

// Lines of two postures of the report differ in lightness or in their dashes.
const lines = [...report.matchAll(/class="key".*?stroke="(#[0-9a-f]{6})".*?stroke-dasharray="([^"]*)"/g)];
const keys = new Map(lines.map(([, hex, dash]) => [hex, { light: oklab(bytesOf(hex))[0], dash }]));
assert.equal(keys.size, 6);
for (const [a, { light, dash }] of keys)
  for (const [b, of] of keys)
    assert.ok(a === b || dash !== of.dash || Math.abs(light - of.light) > 0.05, `lines ${a} and ${b}`);

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
