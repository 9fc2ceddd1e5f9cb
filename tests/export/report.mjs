// SPDX-License-Identifier: GPL-3.0-or-later
// The report as it prints: on A4 and on Letter every heading and every number is there, inside the
// sheet, with page numbers and provenance; and what its letters say is where the lungs are.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { browser, open } from './browser.mjs';
import { folder, skip, supine } from './support.mjs';

try {
  execFileSync('pdftotext', ['-v'], { stdio: 'ignore' });
} catch {
  skip('pdftotext is not installed');
}
const postures = ['supine', 'prone', 'left', 'right', 'upright', 'supine+15', '0.6:0:-0.8', 'inverted', 'prone-20'];
const mesh = join(folder, 'lungs.ply');
const basis = join(folder, 'lungs.safetensors');
const html = join(folder, 'report.html');
supine('phantom', '-o', mesh, '--vertices', '500');
supine('precompute', mesh, '-o', basis);
supine('compare', basis, '--postures', postures.join(','), '-o', html);

const { page, complaints } = await open(html);
const cells = await page.evaluate(() => [...document.querySelectorAll('table')].map((table) => ({
  headings: [...table.querySelectorAll('th')].map((cell) => cell.textContent.trim()).filter(Boolean),
  cells: [...table.querySelectorAll('td')].map((cell) => cell.textContent.trim()).filter(Boolean),
})));
assert.ok(cells.length >= 6);
for (const format of ['A4', 'Letter']) {
  const pdf = join(folder, `${format}.pdf`);
  await page.pdf({ path: pdf, format, preferCSSPageSize: false, printBackground: true });
  const text = execFileSync('pdftotext', ['-layout', pdf, '-'], { encoding: 'utf8' });
  const packed = text.replace(/\s+/g, '');
  for (const table of cells) {
    for (const words of [...table.headings, ...table.cells]) {
      for (const word of words.split(/\s+/)) assert.ok(packed.includes(word.slice(0, 24).replace(/\s/g, '')), `${format}: '${word}' of '${words}' is missing`);
    }
    const last = table.cells.at(-1);
    assert.ok(packed.includes(last.replace(/\s+/g, '').slice(-8)), `${format}: the last number, ${last}, is missing`);
  }
  const boxes = execFileSync('pdftotext', ['-bbox', pdf, '-'], { encoding: 'utf8' });
  const sheets = boxes.split('<page ').slice(1);
  sheets.forEach((sheet, i) => {
    const [, width, height] = /width="([\d.]+)" height="([\d.]+)"/.exec(sheet).map(Number);
    for (const [, x, y, right, bottom, word] of sheet.matchAll(/<word xMin="([-\d.]+)" yMin="([-\d.]+)" xMax="([-\d.]+)" yMax="([-\d.]+)">([^<]*)/g)) {
      assert.ok(x >= 20 && right <= width - 20 && y >= 15 && bottom <= height - 10, `${format}, sheet ${i + 1}: '${word}' is cut: ${[x, y, right, bottom]} of ${width} x ${height}`);
    }
  });
  assert.ok(text.includes(`page ${sheets.length} of ${sheets.length}`));
  for (const word of ['error_rms_percent', 'made_by', 'supinecompare', 'notfordiagnosis']) assert.ok(packed.includes(word), `no ${word}`);
  assert.match(text, /\d{4}-\d\d-\d\d/);
  console.log(`${format}: ${sheets.length} sheets`);
}

/* Each picture has four letters, and they are where the body's axes put them. */
const shots = await page.evaluate(() => [...document.querySelectorAll('.shot')].map((shot) => ({
  alt: shot.querySelector('img').alt,
  ends: Object.fromEntries([...shot.querySelectorAll('.end')].map((end) => [end.classList[1], end.textContent])),
  gravity: shot.querySelector('.gravity').innerHTML,
})));
if (shots.length > 0) {
  const front = { right: 'L', left: 'R', top: 'H', bottom: 'F' };
  const sides = { front, 'the left': { ...front, right: 'P', left: 'A' }, 'the right': { ...front, right: 'A', left: 'P' } };
  assert.equal(shots.length, 3 * postures.length);
  for (const { alt, ends, gravity } of shots) {
    const side = ['the left', 'the right'].find((words) => alt.endsWith(`from ${words}`)) ?? 'front';
    assert.deepEqual(ends, sides[side], alt);
    assert.ok(/<g|<circle/.test(gravity), alt);
  }
  const along = (alt) => Number(/rotate\(([-\d.]+)\)/.exec(shots.find((shot) => shot.alt === alt).gravity)?.[1]);
  assert.equal(Math.abs(along('left, from the front')), 0);     // lying on the left: to the right of the picture
  assert.equal(Math.abs(along('right, from the front')), 180);
  assert.equal(along('upright, from the front'), 90); // down
  assert.equal(Math.abs(along('supine, left lung from the left')), 0);
}
assert.deepEqual(complaints, []);
assert.ok(!readFileSync(html, 'utf8').includes('0.000 %'));
await browser.close();
