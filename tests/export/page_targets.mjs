// SPDX-License-Identifier: GPL-3.0-or-later
// Thirty targets at random places have the same displacement and expected error in `deform`, in the table of `compare`,
// in the report, on the page, also of a simplified surface, and in pictures. The printed report of thirty targets, with
// long names and other scripts, has every number on the paper, in letters of a legible size. The page's switch "doubt"
// shows the lungs of `deform --samples`, and leaves the numbers as they are.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { close, open, openLungs, settled } from './browser.mjs';
import { basis } from './lungs.mjs';
import { floatsOf, folder, randomSource, supine } from './support.mjs';

const COUNT = 30;
const ROUNDED_MM = 0.051; // tolerance: numbers have one decimal
const WRITTEN_MM = 0.071; // of the page, which also stores 16-bit numbers
const SMALLEST_PT = 7; // height of printed letters, with the space above and below
const POSTURES = ['prone', 'right', '0.48:-0.60:0.64'];
const [points, inside, html, small, report, table, moved, pdf] = [
  'thirty.csv',
  'thirty.safetensors',
  'thirty.html',
  'small.html',
  'thirty-report.html',
  'thirty-table.csv',
  'thirty-moved.csv',
  'thirty.pdf',
].map((name) => join(folder, name));

const random = randomSource(1907);
const long = [
  'Right lower lobe superior segment part-solid nodule of the screening CT of March, named in full ' +
    'by someone who wanted to be understood ok',
  'ورم في الفص السفلي الأيمن',
  'Tumor im rechten Unterlappenü',
];
const names = Array.from({ length: COUNT }, (_, i) => long[i] ?? `nodule ${i + 1}`);
const places = names.map((_, i) =>
  [(i % 2 ? 70 : -80) + 40 * (random() - 0.5), -120 + 80 * (random() - 0.5), -110 + 120 * (random() - 0.5)].map((x) =>
    x.toFixed(1),
  ),
);
writeFileSync(points, `name,x,y,z\n${names.map((name, i) => `"${name}",${places[i]}\n`).join('')}`);
supine('embed', basis, points, '-o', inside);

const split = (line) =>
  [...line.matchAll(/(?:^|,)(?:"((?:[^"]|"")*)"|([^,]*))/g)].map(
    ([, quoted, bare]) => quoted?.replaceAll('""', '"') ?? bare,
  );
/** Read a CSV file with a header as a list of objects. */
function readTable(path) {
  const [header, ...rows] = readFileSync(path, 'utf8')
    .trim()
    .split('\n')
    .filter((line) => !line.startsWith('#'))
    .map(split);
  return rows.map((row) => Object.fromEntries(header.map((name, i) => [name, row[i]])));
}
const near = (a, b, tolerance, what) => assert.ok(Math.abs(a - b) <= tolerance, `${what}: ${a} and ${b}`);

/* The numbers of `deform`. */
const truth = Object.fromEntries(
  POSTURES.map((posture) => {
    supine('deform', inside, '--posture', posture, '--volume', 'rest', '--from', 'supine:rest', '-o', moved);
    return [posture, readTable(moved)];
  }),
);

/* The table and the JSON of `compare`. */
supine('compare', basis, '--inside', inside, '--postures', POSTURES.join(','), '-o', table);
const rows = readTable(table);
assert.ok(rows.every(({ schema, from }) => schema === '1' && from === 'supine at rest'));
const json = JSON.parse(
  supine('compare', basis, '--inside', inside, '--postures', POSTURES.join(','), '--json').replace(/^[^{]*/, ''),
);
assert.equal(json.schema, 1);
POSTURES.forEach((posture, p) => {
  const own = rows.filter((row) => row.posture === posture);
  const targets = own.filter(({ kind }) => kind === 'target');
  assert.deepEqual(
    targets.map(({ name }) => name),
    names,
  );
  truth[posture].forEach((row, i) => {
    for (const [column, other] of [
      ['mm', 'moved_mm'],
      ['dx', 'dx'],
      ['dy', 'dy'],
      ['dz', 'dz'],
      ['moved_error_mm', 'moved_error_mm'],
      ['expected_error_mm', 'expected_error_mm'],
      ['another_day_error_mm', 'another_day_error_mm'],
    ])
      near(targets[i][column], row[other], 0.0011, `${posture}, ${row.name}, ${column}: table and deform`);
  });
  const { displacement_mm: mm, volume_ml: ml, moved_error_mm: error, gravity } = json.postures[p];
  const [surface] = own.filter(({ kind }) => kind === 'surface');
  near(surface.mm, mm.mean, 0.0006, `${posture}: mean of the surface`);
  near(surface.max_mm, mm.max, 0.0006, `${posture}: largest of the surface`);
  near(surface.moved_error_mm, error, 0.0006, `${posture}: error of the surface`);
  ['gx', 'gy', 'gz'].forEach((column, axis) => near(surface[column], gravity[axis], 1e-6, column));
  for (const { name, volume_ml: held } of own.filter(({ kind }) => kind === 'lung'))
    near(held, ml[name].value, 0.0006, `${posture}: ${name} lung`);
});

/* The report, and its print. */
supine('compare', basis, '--inside', inside, '--postures', POSTURES.join(','), '-o', report);
const { page, complaints } = await open(report);
const matrix = await page.evaluate(() =>
  [...document.querySelectorAll('table.matrix tbody tr')].map((row) =>
    [...row.cells].map((cell) => cell.firstChild.textContent.trim()),
  ),
);
assert.deepEqual(
  matrix.map(([name]) => name),
  names,
);
matrix.forEach(([name, ...cells], i) =>
  cells.forEach((cell, p) => {
    const [mm, error] = cell.split(' \u00b1 ').map(Number);
    near(mm, truth[POSTURES[p]][i].moved_mm, ROUNDED_MM, `${name}, ${POSTURES[p]}: report and deform`);
    near(
      error,
      truth[POSTURES[p]][i].moved_error_mm,
      ROUNDED_MM,
      `${name}, ${POSTURES[p]}: error of report and deform`,
    );
  }),
);
await page.pdf({ path: pdf, format: 'A4', printBackground: true });
const sheets = execFileSync('pdftotext', ['-bbox', pdf, '-'], { encoding: 'utf8' }).split('<page ').slice(1);
const printed = [];
sheets.forEach((sheet, s) => {
  const [, width, height] = /width="([\d.]+)" height="([\d.]+)"/.exec(sheet).map(Number);
  for (const [, ...found] of sheet.matchAll(
    /<word xMin="([-\d.]+)" yMin="([-\d.]+)" xMax="([-\d.]+)" yMax="([-\d.]+)">([^<]*)/g,
  )) {
    const [x, y, right, bottom] = found.slice(0, 4).map(Number);
    assert.ok(
      x >= 20 && right <= width - 20 && y >= 15 && bottom <= height - 10,
      `sheet ${s + 1}: '${found[4]}' is cut: ${[x, y, right, bottom]} of ${width} x ${height}`,
    );
    const letter = found[4].length === 1 ? Math.max(bottom - y, right - x) : bottom - y; // a letter may be turned
    if (!/^[LRAPHF]$/.test(found[4]))
      assert.ok(letter >= SMALLEST_PT, `sheet ${s + 1}: '${found[4]}' is ${letter} pt high`);
    printed.push(found[4]);
  }
});
for (const [, ...cells] of matrix)
  for (const number of cells.flatMap((cell) => cell.split(' \u00b1 ')))
    assert.ok(printed.includes(number), `${number} is not printed`);
for (const word of long.flatMap((name) => name.split(' ')).filter((name) => /^[\w,-]{2,}$/.test(name)))
  assert.ok(printed.join('').includes(word), `'${word}' is not printed`);
assert.deepEqual(complaints, []);
await close(page);

/** Check that the switch, pressed by the keyboard, shows the samples of `deform` in the last of POSTURES, all targets
 * and the surface together, and that the numbers stay. */
async function checkDoubt(page) {
  const drawn = join(folder, 'thirty-drawn.safetensors');
  supine('deform', inside, '--posture', POSTURES.at(-1), '--volume', 'rest', '--samples', '20', '-o', drawn);
  const samples = floatsOf(drawn, 'positions');
  const words = () =>
    page.evaluate(() =>
      ['finding', 'meaning', 'inside-rows', 'holds'].map((id) => document.getElementById(id).textContent),
    );
  await page.locator('[name=day][value=session]').check({ force: true });
  await settled(page);
  const before = await words();
  await page.locator('#doubt').focus();
  await page.keyboard.press('Space');
  const shows = (number) =>
    page.waitForFunction((n) => {
      const { shift, kept } = window.supine.doubt;
      return shift && shift === kept[n - 1];
    }, number);
  await shows(1);
  await page.locator('#sample').focus();
  await page.keyboard.press('End');
  await shows(20);
  await settled(page);
  assert.deepEqual(await words(), before);
  assert.match(await page.locator('#sampled').textContent(), /^20 plausible lungs, seed 0: number 20$/);
  const [places, far] = await page.evaluate(() => {
    const { basis: b, doubt, insidePositions, state } = window.supine;
    const at = insidePositions(state.gravity, state.depth, doubt.shift);
    const square = doubt.shift.surface.reduce((sum, x) => sum + x * x, 0) / b.vertices;
    const own = b.inside.members.map(([vertex]) => Array.from(at.slice(3 * vertex, 3 * vertex + 3)));
    return [own, Math.sqrt(square)];
  });
  const away = places.map((at, i) => Math.hypot(...at.map((x, k) => x - samples[3 * (19 * COUNT + i) + k])));
  assert.ok(Math.max(...away) < WRITTEN_MM, `targets are up to ${Math.max(...away)} mm from those of deform`);
  assert.ok(far > 1, `the surface differs by ${far} mm`);
  await page.locator('#doubt').press('Space');
  await page.locator('#sampled').waitFor({ state: 'hidden' });
}

/* The page, of the whole surface and of a simplified one. */
supine('export', basis, '--inside', inside, '-o', html);
supine('export', basis, '--inside', inside, '-o', small, '--simplify', '500');
for (const path of [html, small]) {
  const { page: lungs, complaints: said } = await openLungs(path, {}, '');
  for (const posture of POSTURES) {
    await lungs.evaluate((text) => {
      location.hash = `posture=${text}&depth=0`;
    }, posture);
    await lungs.waitForFunction((text) => document.getElementById('posture-name').value === text, posture);
    await settled(lungs);
    const shown = await lungs.evaluate(() =>
      [...document.querySelectorAll('#inside-rows tr')].map((row) => [...row.cells].map((cell) => cell.textContent)),
    );
    assert.deepEqual(
      shown.map(([name]) => name),
      names,
    );
    shown.forEach(([name, mm, , error, place], i) => {
      const [, another, day] = /^within ([\d.]+)\u00a0mm, (.*)$/.exec(place);
      assert.equal(day, 'another day');
      near(
        another,
        truth[posture][i].another_day_error_mm,
        WRITTEN_MM,
        `${name}, ${posture}: error on another day of page and deform`,
      );
      near(parseFloat(mm), truth[posture][i].moved_mm, WRITTEN_MM, `${name}, ${posture}: page and deform`);
      near(
        parseFloat(error),
        truth[posture][i].moved_error_mm,
        WRITTEN_MM,
        `${name}, ${posture}: error of page and deform`,
      );
    });
  }
  if (path === html) await checkDoubt(lungs);
  assert.deepEqual(said, []);
  await close(lungs);
}

/* Pictures: the caption tells of the target that moves farthest in multiples of its error. */
supine('render', basis, '--inside', inside, '--posture', 'prone:rest', '--from', 'supine:rest', '-o', pdf);
const first = truth.prone.reduce((most, row) =>
  row.moved_mm / row.moved_error_mm > most.moved_mm / most.moved_error_mm ? row : most,
);
const [, length, error, way] = /([\d.]+) mm \u00b1 ([\d.]+) expected\n(\d+ to the .*)/.exec(
  execFileSync('pdftotext', [pdf, '-'], { encoding: 'utf8' }),
);
near(length, first.moved_mm, ROUNDED_MM, `${first.name}: displacement of picture and deform`);
near(error, first.moved_error_mm, ROUNDED_MM, `${first.name}: error of picture and deform`);
const AXES = {
  left: ['dx', 1],
  right: ['dx', -1],
  back: ['dy', 1],
  front: ['dy', -1],
  head: ['dz', 1],
  feet: ['dz', -1],
};
for (const [, mm, to] of way.matchAll(/(\d+) to the (\w+)/g))
  near(mm, AXES[to][1] * first[AXES[to][0]], 0.51, `${first.name}: ${way}`);
console.log(`targets: ${COUNT} in ${POSTURES.length} postures; the picture tells of ${first.name}`);
