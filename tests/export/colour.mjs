// SPDX-License-Identifier: GPL-3.0-or-later
// The page's colours: equal steps of perception, lightness always rising, nothing cut off.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';

const code = readFileSync(new URL('../../runtime/export/page/colour.js', import.meta.url), 'utf8');
const { colourMap, roundRange } = new Function(`${code}
  return { colourMap, roundRange };`)();

/** OKLab of sRGB bytes. */
function oklab(bytes) {
  const [r, g, b] = Array.from(bytes, (x) => (x / 255 <= 0.04045 ? x / 255 / 12.92 : ((x / 255 + 0.055) / 1.055) ** 2.4));
  const l = Math.cbrt(0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b);
  const m = Math.cbrt(0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b);
  const s = Math.cbrt(0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b);
  return [
    0.2104542553 * l + 0.793617785 * m - 0.0040720468 * s,
    1.9779984951 * l - 2.428592205 * m + 0.4505937099 * s,
    0.0259040371 * l + 0.7827717662 * m - 0.808675766 * s,
  ];
}

for (const name of ['displacement', 'difference']) {
  const bytes = colourMap(name);
  const colours = Array.from({ length: 256 }, (_, i) => oklab(bytes.slice(4 * i, 4 * i + 3)));
  const steps = []; // over 15 colours, so that rounding to bytes matters little
  for (let i = 0; i + 15 < 256; i += 15) {
    steps.push(Math.hypot(...colours[i].map((x, j) => x - colours[i + 15][j])));
    assert.ok(colours[i + 15][0] > colours[i][0] + 0.01, `${name}: lightness does not rise at ${i}`);
  }
  const ratio = Math.max(...steps) / Math.min(...steps);
  console.log(`${name}: steps within a factor of ${ratio.toFixed(3)}`);
  assert.ok(ratio < 1.1, `${name}: steps differ by a factor of ${ratio}`);
}

for (const x of [0.013, 0.99, 1, 1.01, 7.3, 9.7, 10, 34, 512]) {
  const { end, step } = roundRange(x);
  assert.ok(end >= 0.999 * x && end < 1.7 * x, `a range of ${end} for ${x}`);
  assert.ok(Math.abs(end / step - Math.round(end / step)) < 1e-9 && end / step >= 4 && end / step <= 6.01);
}
