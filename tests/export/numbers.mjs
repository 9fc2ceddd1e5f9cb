// SPDX-License-Identifier: GPL-3.0-or-later
// The numbers of the report and of pictures, for random targets in random postures, equal those of `deform` and of
// `compare`.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { basis } from './lungs.mjs';
import { folder, randomDirections, randomSource, skip, supine } from './support.mjs';

const ROUNDED = 0.051; // mm: the report and pictures have one decimal
const random = randomSource(68);
const files = ['points.csv', 'inside.safetensors', 'report.html', 'moved.csv', 'lungs.pdf'];
const [points, inside, html, moved, pdf] = files.map((name) => join(folder, name));
const names = Array.from({ length: 5 }, (_, i) => `t${i}`);
const places = names.map((_, i) => [
  (i % 2 ? 1 : -1) * (60 + 40 * random()),
  -150 + 60 * random(),
  -140 + 90 * random(),
]);
writeFileSync(points, `name,x,y,z\n${places.map((xyz, i) => `${names[i]},${xyz}\n`).join('')}`);
supine('embed', basis, points, '-o', inside);
const postures = randomDirections(6, 7).map((g) => g.map((x) => x.toFixed(4)).join(':'));
const list = ['--inside', inside, '--postures', postures.join(',')];

/* What `deform` states: for each posture and target, the displacement and its expected error, mm. */
const told = postures.map((posture) => {
  supine('deform', inside, '--posture', posture, '--volume', 'rest', '--from', 'supine:rest', '-o', moved);
  const lines = readFileSync(moved, 'utf8').trim().split('\n');
  const [head, ...rows] = lines.slice(-1 - names.length).map((line) => line.split(','));
  return rows.map((row) => ['moved_mm', 'moved_error_mm'].map((name) => Number(row[head.indexOf(name)])));
});

const { postures: compared } = JSON.parse(supine('compare', basis, ...list, '--json').replace(/^[^{]*/, ''));
supine('compare', basis, ...list, '-o', html);
const report = readFileSync(html, 'utf8');
const cells = names.map((name) =>
  [...report.matchAll(new RegExp(`<th scope="row">${name}</th>(.*?)</tr>`, 'g'))].flatMap(([, row]) =>
    [...row.matchAll(/<td[^>]*>([\d.]+) \u00b1 ([\d.]+) /g)].map((found) => found.slice(1).map(Number)),
  ),
);
let checked = 0;
const close = (a, b, what) => {
  assert.ok(Math.abs(a - b) <= ROUNDED, `${what}: ${a}, not ${b}`);
  ++checked;
};
told.forEach((targets, i) =>
  targets.forEach(([mm, error], k) => {
    const { mm: length, moved_error_mm: stated } = compared[i].targets.find(({ name }) => name === names[k]);
    const what = `${names[k]}, ${postures[i]}`;
    close(length, mm, `compare --json: ${what}`);
    close(stated, error, `compare --json: ${what}`);
    close(cells[k][i][0], mm, `report: ${what}`);
    close(cells[k][i][1], error, `report: ${what}`);
  }),
);
assert.equal(checked, 4 * 30);

/* Captions of pictures are about the target that moves most, in multiples of its error. */
try {
  execFileSync('pdftotext', ['-v'], { stdio: 'ignore' });
} catch {
  skip('pdftotext is not installed');
}
supine('render', basis, '--inside', inside, '--posture', postures.join(','), '-o', pdf);
const text = execFileSync('pdftotext', ['-raw', pdf, '-'], { encoding: 'utf8' }).replace(/[^\S\n]/g, '');
const most = names.map((_, k) => Math.max(...told.map((targets) => targets[k][0] / targets[k][1])));
const chosen = most.indexOf(Math.max(...most));
const sorted = (list) => list.map(Number).sort((a, b) => a - b); // the file may list panels in another order
const same = (found, wanted, what) => {
  assert.equal(found.length, wanted.length, `${what}: ${found}, not ${wanted}`);
  sorted(found).forEach((x, i) => close(x, sorted(wanted)[i], what));
};
const captions = [...text.matchAll(/^([\d.]+)mm\u00b1([\d.]+)expected/gm)];
for (const i of [0, 1])
  same(
    captions.map((found) => found[1 + i]),
    told.map((targets) => targets[chosen][i]),
    ['captions', 'errors of captions'][i],
  );
console.log(`${checked} numbers of random targets and postures agree`);
