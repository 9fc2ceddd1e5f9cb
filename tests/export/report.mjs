// SPDX-License-Identifier: GPL-3.0-or-later
// Test the printed report: on A4 and Letter every heading and number is inside the sheet, pages are numbered, the
// provenance is complete, and the orientation letters L, R, H and F in pictures are at the correct ends of the lungs.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { close, open } from './browser.mjs';
import { basis } from './lungs.mjs';
import { folder, oklab, skip, supine } from './support.mjs';

try {
  execFileSync('pdftotext', ['-v'], { stdio: 'ignore' });
} catch {
  skip('pdftotext is not installed');
}
const postures = ['supine', 'prone', 'left', 'right', 'upright', 'supine+15', '0.6:0:-0.8', 'inverted', 'prone-20'];
const html = join(folder, 'report.html');
const [points, inside] = ['points.csv', 'inside.safetensors'].map((name) => join(folder, name));
writeFileSync(points, 'name,x,y,z\nnodule,-80,-120,-90\nmark,70,-150,-60\n');
supine('embed', basis, points, '-o', inside);
supine(
  'compare',
  basis,
  '--inside',
  inside,
  '--postures',
  postures.join(','),
  '--volume',
  'rest+120',
  '--breath',
  '350mL',
  '-o',
  html,
);

const { page, complaints } = await open(html);
const cells = await page.evaluate(() =>
  [...document.querySelectorAll('table')].map((table) => ({
    headings: [...table.querySelectorAll('th')].map((cell) => cell.textContent.trim()).filter(Boolean),
    cells: [...table.querySelectorAll('td')].map((cell) => cell.textContent.trim()).filter(Boolean),
  })),
);
assert.equal(cells.length, 5); // of three times three postures, of volumes, and the provenance
const cards = await page.evaluate(() =>
  [...document.querySelectorAll('section')].map((section) => ({
    heading: section.querySelector('h2').textContent,
    first: section.innerText
      .split('\n')
      .map((line) => line.trim())
      .filter(Boolean)[1]
      .split(/\s+/)[0],
  })),
);
assert.deepEqual(cards.map(({ heading }) => heading).slice(0, 3), [
  'Changes from supine at rest',
  'Where each target was and is',
  'Lungs',
]);
/* Pictures and rows of tables are not split between sheets. */
await page.emulateMedia({ media: 'print' });
const parted = await page.evaluate(
  () =>
    [...document.querySelectorAll('tr, figure, .scale, .whole')].filter(
      (e) => getComputedStyle(e).breakInside !== 'avoid',
    ).length,
);
assert.equal(parted, 0);
await page.emulateMedia({ media: null });

const json = JSON.parse(
  supine(
    'compare',
    basis,
    '--inside',
    inside,
    '--postures',
    postures.join(','),
    '--volume',
    'rest+120',
    '--json',
  ).replace(/^[^{]*/, ''),
);
assert.equal(json.displacement_from, 'supine at rest');

/* The table of postures has volumes, their changes from supine at rest in %, and displacements. */
const supineRest = JSON.parse(supine('compare', basis, '--postures', 'supine', '--json').replace(/^[^{]*/, ''))
  .postures[0].volume_ml;
const summary = await page.evaluate(() =>
  [...document.querySelectorAll('table.postures tbody tr')].map((row) =>
    [...row.cells].map((cell) =>
      [...cell.childNodes]
        .filter(({ nodeName }) => !['SMALL', 'SUP'].includes(nodeName))
        .map((node) => node.textContent)
        .join(''),
    ),
  ),
);
assert.deepEqual(
  summary.map(([name]) => name),
  postures.map((name) => ({ left: 'left side', right: 'right side' })[name] ?? name),
);
/** Return the share by which the first third of ten slabs expands. */
function expansionOfThird(slabs) {
  const parts = [1, 1, 1, 1 / 3];
  const sum = (key) => parts.reduce((total, part, k) => total + part * slabs[k][key], 0);
  return sum('gain_ml') / sum('volume_ml');
}
json.postures.forEach(({ volume_ml: ml, displacement_mm: mm, moved_error_mm: error, slabs }, i) => {
  ['left', 'right'].forEach((lung, j) => {
    assert.ok(Math.abs(Number(summary[i][1 + j]) - ml[lung].value) <= 0.5, `${summary[i]}`);
    assert.ok(
      Math.abs(Number(summary[i][3 + j]) - (100 * ml[lung].value) / supineRest[lung].value + 100) <= 0.51,
      `${summary[i]}`,
    );
  });
  [mm.mean, mm.max, error].forEach((x, k) =>
    assert.ok(Math.abs(Number(summary[i][5 + k]) - x) <= 0.051, `${summary[i]}`),
  );
  if (postures[i] === 'supine') {
    const ratio = expansionOfThird(slabs.toReversed()) / expansionOfThird(slabs);
    assert.ok(Math.abs(ratio - Number(summary[i][10])) < 0.06, `${summary[i]}`); // the breath of the report is smaller
  }
});
/* Published values are footnotes of the values beside which they stand. */
const notes = await page.evaluate(() => ({
  marks: [...document.querySelectorAll('table.postures tbody tr')].map((row) =>
    [...row.querySelectorAll('sup')].map((sup) => sup.textContent).join(''),
  ),
  texts: [...document.querySelectorAll('.footnote')].map((note) => note.textContent),
}));
assert.deepEqual(notes.marks, ['b', '', 'aa', '', '', '', '', '', '']);
assert.match(notes.texts[0], /^a Published on the left side.*Little 2021/);
assert.match(notes.texts[1], /^b Published supine: 1\.75.*Sa 2010/);
const findings = await page.evaluate(() => [...document.querySelectorAll('.finding')].map((e) => e.textContent));
assert.equal(findings.length, json.postures.length); // a headline for each posture
assert.match(findings[2], /^With gravity|^Lying on the left side, (nodule|mark) moves [\d.]+ mm/);
/* The matrix has the numbers of --json: a row for each target, and a column for each posture but the reference. */
const matrix = await page.evaluate(() =>
  [...document.querySelectorAll('table.matrix')].map((table) => ({
    heads: [...table.tHead.rows[0].cells].slice(1).map((cell) => cell.textContent),
    rows: [...table.tBodies[0].rows].map((row) => ({
      name: row.cells[0].textContent,
      cells: [...row.cells].slice(1).map((cell) => [cell.firstChild.textContent.trim(), cell.lastChild.textContent]),
    })),
  })),
);
const moved = json.postures; // at rest + 120 mL, supine has moved too
assert.deepEqual(
  matrix.flatMap(({ heads }) => heads),
  summary.map(([name]) => name),
);
assert.ok(matrix.every(({ heads }) => heads.length <= 4));
moved.forEach(({ targets }, i) => {
  for (const { name, mm, moved_error_mm: error } of targets) {
    const [size, words] = matrix[Math.floor(i / 3)].rows.find((row) => row.name === name).cells[i % 3];
    const [, said, within] = /^([\d.]+) \u00b1 ([\d.]+)$/.exec(size).map(Number);
    assert.ok(Math.abs(said - mm) <= 0.051 && Math.abs(within - error) <= 0.051, `${name}: ${size}`);
    assert.equal(words === `within its error of ${error.toFixed(1)}`, mm <= error, `${name}: ${words}`);
  }
});
/* Three planes show where each target was, and for each posture a dot where it is, in a ring of the expected error of
 * its displacement. All have one scale, and no dot hides another. */
const traced = await page.evaluate(() =>
  [...document.querySelectorAll('.thirds figure')].map((figure) => ({
    scale: figure.querySelector('svg').getScreenCTM().a,
    rings: [...figure.querySelectorAll('.ring')].map((ring) => Number(ring.getAttribute('r'))),
    radii: [...figure.querySelectorAll('circle:not(.was, .ring)')].map((dot) => Number(dot.getAttribute('r'))),
    title: figure.querySelector('figcaption').textContent,
    dots: figure.querySelectorAll('circle:not(.was, .ring)').length,
    was: ['cx', 'cy'].map((at) => Number(figure.querySelector('.was').getAttribute(at))),
    at: Object.fromEntries(
      [...figure.querySelectorAll('circle:not(.was, .ring)')].map((dot) => [
        dot.textContent,
        ['cx', 'cy'].map((at) => Number(dot.getAttribute(at))),
      ]),
    ),
  })),
);
assert.deepEqual(
  traced.map(({ title }) => title.split(',')[0]),
  ['axial', 'coronal', 'sagittal', 'axial', 'coronal', 'sagittal'],
);
for (const { title, scale, radii } of traced) {
  assert.ok(Math.abs(scale / traced[0].scale - 1) < 0.01, `${title}: ${scale}, not ${traced[0].scale} pixels per mm`);
  assert.ok(radii.every((r, i) => i === 0 || r < radii[i - 1]), `${title}: ${radii}`);
}
/* Lines of two postures differ in their dashes, or in lightness: colours alone tell nothing. */
const lines = await page.evaluate(() =>
  [...document.querySelectorAll('.thirds figure')[0].querySelectorAll('path[stroke-dasharray]')].map((line) => ({
    dash: line.getAttribute('stroke-dasharray'),
    colour: line.getAttribute('stroke'),
  })),
);
const lightness = ({ colour }) => oklab(Buffer.from(colour.slice(1), 'hex'))[0];
assert.equal(lines.length, postures.length);
lines.forEach((a, i) =>
  lines.slice(i + 1).forEach((b) =>
    assert.ok(a.dash !== b.dash || Math.abs(lightness(a) - lightness(b)) > 0.05, JSON.stringify([a, b])),
  ),
);
const PLANES = { axial: (x) => [x[0], x[1]], coronal: (x) => [x[0], -x[2]], sagittal: (x) => [x[1], -x[2]] };
['nodule', 'mark'].forEach((name, k) =>
  moved.forEach(({ targets }, i) => {
    const { move, moved_error_mm: error } = targets.find((target) => target.name === name);
    for (const { title, was, at, dots, rings } of traced.slice(3 * k, 3 * k + 3)) {
      assert.equal(dots, postures.length);
      assert.ok(Math.abs(rings[i] - error) <= 0.051, `${name}, ${title}: ring of ${rings[i]}, not ${error} mm`);
      const seen = at[summary[i][0]].map((x, axis) => x - was[axis]);
      PLANES[title.split(',')[0]](move).forEach((x, axis) =>
        assert.ok(Math.abs(x - seen[axis]) < 0.11, `${name}, ${title}: ${seen}, not ${x}`),
      );
    }
  }),
);
for (const format of ['A4', 'Letter']) {
  const pdf = join(folder, `${format}.pdf`);
  await page.pdf({ path: pdf, format, preferCSSPageSize: false, printBackground: true });
  const text = execFileSync('pdftotext', ['-layout', pdf, '-'], { encoding: 'utf8' });
  const packed = text.replace(/\s+/g, '');
  for (const table of cells) {
    for (const words of [...table.headings, ...table.cells]) {
      for (const word of words.split(/\s+/))
        assert.ok(
          packed.includes(word.slice(0, 24).replace(/\s/g, '')),
          `${format}: '${word}' of '${words}' is missing`,
        );
    }
    const last = table.cells.at(-1);
    assert.ok(packed.includes(last.replace(/\s+/g, '').slice(-8)), `${format}: the last number, ${last}, is missing`);
  }
  const boxes = execFileSync('pdftotext', ['-bbox', pdf, '-'], { encoding: 'utf8' });
  const sheets = boxes.split('<page ').slice(1);
  sheets.forEach((sheet, i) => {
    const [, width, height] = /width="([\d.]+)" height="([\d.]+)"/.exec(sheet).map(Number);
    for (const [, x, y, right, bottom, word] of sheet.matchAll(
      /<word xMin="([-\d.]+)" yMin="([-\d.]+)" xMax="([-\d.]+)" yMax="([-\d.]+)">([^<]*)/g,
    )) {
      assert.ok(
        x >= 20 && right <= width - 20 && y >= 15 && bottom <= height - 10,
        `${format}, sheet ${i + 1}: '${word}' is cut: ${[x, y, right, bottom]} of ${width} x ${height}`,
      );
    }
  });
  assert.ok(text.includes(`page ${sheets.length} of ${sheets.length}`));
  for (const word of [
    'compressionerror,RMS,%',
    'basismadeby',
    'comparelungs.safetensors',
    'notfordiagnosis',
    'lawofdisplacementdeep',
    'stateinthescansupineatfullinflation',
    'checksumxxh64:',
  ])
    assert.ok(packed.includes(word), `no ${word}`);
  const bySheet = text.split('\f').map((sheet) => sheet.replace(/\s+/g, ''));
  for (const { heading, first } of cards) {
    // each heading is on one sheet with the beginning of its section
    assert.ok(
      bySheet.some((sheet) => {
        const at = sheet.indexOf(heading.replace(/\s+/g, ''));
        return at >= 0 && sheet.indexOf(first, at + heading.replace(/\s+/g, '').length) >= 0;
      }),
      `${format}: '${heading}' is parted from '${first}'`,
    );
  }
  assert.match(text, /\d{4}-\d\d-\d\d/);
  // Of nine postures and two targets; four postures take four
  assert.ok(sheets.length <= 6, `${format}: ${sheets.length} sheets`);
}

/* Without targets there are outlines in four slices, whose areas differ from that of the reference by the stated
 * percentages. */
supine(
  'compare',
  basis,
  '--postures',
  postures.join(','),
  '--volume',
  'rest+120',
  '--breath',
  '350mL',
  '-o',
  join(folder, 'plain.html'),
);
const { page: plain } = await open(join(folder, 'plain.html'));
const outlines = await plain.evaluate(() =>
  [...document.querySelectorAll('.pairs figure')].map((figure) => ({
    title: figure.querySelector('figcaption').textContent,
    paths: [...figure.querySelectorAll('path')].map((path) => [
      path.querySelector('title')?.textContent ?? path.getAttribute('class'),
      path.getAttribute('d'),
    ]),
  })),
);
assert.equal(outlines.length, 4);
for (const { title, paths } of outlines) {
  const area = Object.fromEntries(
    paths.map(([name, d]) => {
      const rings = d.split('M').map((ring) => ring.split('L').map((point) => point.split(' ').map(Number)));
      const lines = rings.flatMap((ring) => ring.slice(1).map((end, i) => [...ring[i], ...end]));
      return [name, Math.abs(lines.reduce((sum, [x, y, u, v]) => sum + (x * v - u * y) / 2, 0))];
    }),
  );
  assert.ok(area.before > 1000, title);
  for (const posture of ['prone', 'left side', 'inverted']) {
    const [, percent] = new RegExp(`${posture} ([-+]\\d+)\\s%`).exec(title);
    assert.ok(Math.abs(100 * (area[posture] / area.before - 1) - percent) < 1, `${title}: ${JSON.stringify(area)}`);
  }
}
await close(plain);

/* Each picture has four orientation letters. The picture and its arrow of gravity are rotated to the posture. */
const shots = await page.evaluate(() =>
  Object.fromEntries(
    [...document.querySelectorAll('.shot')].map((shot) => [
      shot.querySelector('img').alt,
      {
        ends: Object.fromEntries([...shot.querySelectorAll('.end')].map((end) => [end.classList[1], end.textContent])),
        gravity: shot.querySelector('.gravity').innerHTML,
        turn: (parseFloat(shot.style.getPropertyValue('--turn')) + 360) % 360,
      },
    ]),
  ),
);
assert.equal(Object.keys(shots).length, postures.length);
for (const [alt, { ends, gravity }] of Object.entries(shots)) {
  assert.deepEqual(ends, { right: 'L', left: 'R', top: 'H', bottom: 'F' }, alt);
  assert.ok(/<g|<circle/.test(gravity), alt);
}
const along = (name) => Number(/rotate\(([-\d.]+)\)/.exec(shots[`${name}, from the front`].gravity)?.[1]);
// Angles of gravity in pictures from the front before they are rotated, clockwise, where 0 points to the right.
assert.equal(Math.abs(along('left side')), 0); // to the patient's left, which the picture shows on the right
assert.equal(Math.abs(along('right side')), 180);
assert.equal(along('upright'), 90);
assert.deepEqual(
  ['left side', 'right side'].map((name) => shots[`${name}, from the front`].turn),
  [90, 270],
); // degrees by which a picture is rotated, so that gravity points down
assert.deepEqual(complaints, []);
assert.ok(!readFileSync(html, 'utf8').includes('0.000 %'));
