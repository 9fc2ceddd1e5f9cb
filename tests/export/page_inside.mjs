// SPDX-License-Identifier: GPL-3.0-or-later
// Test how the page shows targets, the structures inside the lungs: they have the positions of `supine deform`, the
// sentence is about the chosen one, a table usable by keyboard lists all, and they can be hidden. The lens is right
// during breaths. Pictures are kept in the folder tests/page_inside of the build folder.
import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import {
  assertAccessible,
  assertPicture,
  assertUncut,
  checkLoss,
  close,
  openLungs,
  picture,
  press,
  settled,
} from './browser.mjs';
import { basis, mesh } from './lungs.mjs';
import { folder, largestDistance, pictureFolder, supine } from './support.mjs';

const TOLERANCE_MM = 0.02; // the page stores 16-bit numbers
const PRINTED_MM = 0.001; // tolerance: numbers in text files have three decimals
const WRITTEN_MM = 0.071; // tolerance: displacements in the table have one decimal, and the page stores 16-bit numbers
const NAMES = ['nodule <b>&amp;</data>', 'carina', 'upper lobe', 'lower lobe'];
// Lungs without colours, whose bar would cover a structure
const HASH = '#posture=supine&depth=500&show=contours&room=0';
const PARTS = [...NAMES, 'tumour', 'metastasis'];
const files = Object.fromEntries(
  ['tumour.obj', 'metastasis.obj', 'points.csv', 'inside.safetensors', 'inside.html', 'many.html', 'moved.csv'].map(
    (name) => [name, join(folder, name)],
  ),
);

/* Embed four named points, a soft octahedron and a rigid one. */
const at = [
  [-80, -120, -90],
  [60, -150, -110],
  [70, -160, -60],
  [-70, -90, -150],
];
writeFileSync(files['points.csv'], `name,x,y,z\n${at.map((p, i) => `${NAMES[i]},${p.join(',')}\n`).join('')}`);
const corners = [
  [1, 0, 0],
  [-1, 0, 0],
  [0, 1, 0],
  [0, -1, 0],
  [0, 0, 1],
  [0, 0, -1],
].map((c) => c.map((x, i) => 14 * x + [80, -110, -130][i]));
const faces = [
  [1, 3, 5],
  [3, 2, 5],
  [2, 4, 5],
  [4, 1, 5],
  [3, 1, 6],
  [2, 3, 6],
  [4, 2, 6],
  [1, 4, 6],
];
writeFileSync(
  files['tumour.obj'],
  `${corners.map((c) => `v ${c.join(' ')}\n`).join('')}${faces.map((f) => `f ${f.join(' ')}\n`).join('')}`,
);
const stretched = (c) => c.map((x, i) => (x - [80, -110, -130][i]) * (1 + i / 2) + [-80, -110, -120][i]);
writeFileSync(
  files['metastasis.obj'],
  [...corners.map((c) => `v ${stretched(c).join(' ')}\n`), ...faces.map((f) => `f ${f.join(' ')}\n`)].join(''),
);
supine(
  'embed',
  basis,
  files['points.csv'],
  files['tumour.obj'],
  files['metastasis.obj'],
  '--rigid',
  'metastasis',
  '-o',
  files['inside.safetensors'],
);
supine('export', basis, '--inside', files['inside.safetensors'], '-o', files['inside.html']);

/** Return the positions that `supine deform` computes, as {name: [positions]}. */
function deformed(posture, volume) {
  supine(
    'deform',
    files['inside.safetensors'],
    '--posture',
    posture,
    '--volume',
    volume,
    '--vertices',
    '-o',
    files['moved.csv'],
  );
  const places = {};
  for (const line of readFileSync(files['moved.csv'], 'utf8')
    .trim()
    .split('\n')
    .filter((row) => !row.startsWith('#'))
    .slice(1)) {
    const [name, , ...place] = line.split(',');
    (places[name.replace(/^"(.*)"$/, '$1')] ??= []).push(place.slice(0, 3).map(Number));
  }
  return places;
}

/** Compare the page's positions with those of `supine deform`, in several postures and volumes. */
async function checkPositions(page) {
  let worst = 0;
  for (const [posture, gravity, volume] of [
    ['supine', [0, 1, 0], 0],
    ['prone', [0, -1, 0], 320],
    ['left', [1, 0, 0], 700],
    ['0.6:0:-0.8', [0.6, 0, -0.8], 150],
  ]) {
    const truth = deformed(posture, `rest+${volume}`);
    const found = await page.evaluate(
      ([g, mL]) => {
        const {
          basis: { inside },
          insidePositions,
        } = window.supine;
        const xyz = insidePositions(g, mL);
        return inside.names.map((name, part) => [
          name,
          inside.members[part].map((v) => Array.from(xyz.slice(3 * v, 3 * v + 3))),
        ]);
      },
      [gravity, volume],
    );
    assert.deepEqual(found.map(([name]) => name).sort(), Object.keys(truth).sort());
    for (const [name, places] of found) {
      assert.equal(places.length, /tumour|metastasis/.test(name) ? 6 : 1);
      worst = Math.max(worst, largestDistance(places.flat(), truth[name].flat()));
    }
  }
  console.log(`inside: within ${worst.toFixed(4)} mm of supine deform`);
  assert.ok(worst < TOLERANCE_MM + PRINTED_MM, `${worst} mm off`);
}

const distance = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));
const mean = (values) => values.reduce((sum, x) => sum + x, 0) / values.length;

/** Check that the table and the sentence have the displacement of each target's centre, from both references. */
async function checkTable(page) {
  await press(page, '2');
  await page.locator('#depth').fill('500');
  const now = deformed('prone', 'rest+500');
  for (const [from, state] of [
    ['the scan', ['supine', 'full']],
    ['supine at rest', ['supine', 'rest']],
  ]) {
    const rest = deformed(...state);
    await page.locator(`#since label`).filter({ hasText: from }).locator('input').check();
    await settled(page);
    const rows = await page.evaluate(() =>
      [...document.querySelectorAll('#inside-rows tr')].map((row) => [...row.cells].map((cell) => cell.textContent)),
    );
    assert.deepEqual(rows.map(([name]) => name).sort(), PARTS.sort());
    for (const [name, mm, words, error] of rows) {
      const [to, was] = [now, rest].map((places) => [0, 1, 2].map((i) => mean(places[name].map((p) => p[i]))));
      const far = distance(to, was);
      assert.ok(far > 0.5 && Math.abs(far - parseFloat(mm)) < WRITTEN_MM, `${name}: ${mm}, not ${far}`);
      assert.equal(
        words === `within its error of ${parseFloat(error).toFixed(1)}`,
        far <= parseFloat(error),
        `${name}: ${words} ${error}`,
      );
    }
    const told = await page.evaluate(() => {
      const { sentenceOf, movedBetween, basis: b, state } = window.supine;
      const moved = movedBetween(b, state.moment, state.from);
      return moved.targets.map((target) => [
        target.mm > target.error,
        sentenceOf(b, moved, target, state.gravity, '').told !== '',
      ]);
    });
    // Nothing is emphasised below its expected error
    for (const [above, emphasised] of told) assert.equal(emphasised, above);
    const large = await page.evaluate(() =>
      window.supine.basis.inside.anatomy.map((part) => window.supine.basis.inside.names[part]),
    );
    const [name, mm] = rows
      .filter(([who]) => !large.includes(who))
      // The target that is told of first
      .sort((a, b) => parseFloat(b[1]) / parseFloat(b[3]) - parseFloat(a[1]) / parseFloat(a[3]))[0];
    const finding = await page.locator('#finding').textContent();
    assert.ok(
      finding.includes(name) &&
        finding.includes(mm) &&
        finding.includes(`from ${from}`) &&
        finding.startsWith('Prone, 500 mL above rest, '),
      finding,
    );
  }
  return deformed('supine', 'rest');
}

/** Return where on the screen the centre of an embedded structure (point or mesh) is. */
const onPage = (page, name) =>
  page.evaluate((wanted) => {
    const {
      basis: { inside },
      insidePositions,
      state,
      panes,
    } = window.supine;
    const xyz = insidePositions(state.gravity, state.depth);
    const members = inside.members[inside.names.indexOf(wanted)];
    const place = [0, 1, 2].map((i) => members.reduce((sum, v) => sum + xyz[3 * v + i] / members.length, 0));
    const pane = panes()[0];
    const m = pane.toEye;
    const eye = [0, 1, 2].map((i) => m[i] * place[0] + m[4 + i] * place[1] + m[8 + i] * place[2] + m[12 + i]);
    const ndc = [0, 1].map((i) => (pane.projection[5 * i] * eye[i]) / -eye[2]);
    const stage = document.getElementById('picture').getBoundingClientRect();
    return [stage.x + ((ndc[0] + 1) / 2) * stage.width, stage.y + ((1 - ndc[1]) / 2) * stage.height];
  }, name);

async function pointed(page, [x, y]) {
  await page.mouse.move(x, y);
  await settled(page);
  await page.waitForFunction(() => !window.supine.picture.picking);
  await settled(page);
  return page
    .locator('#pointed')
    .isVisible()
    .then((shown) => (shown ? page.locator('#pointed').textContent() : ''));
}

/** Check that the name and displacement of the structure at the pointer are shown through transparent lungs, but not
 * through opaque lungs or if structures are hidden. */
async function checkPointer(page, rest) {
  const depth = await page.evaluate(() => window.supine.state.depth);
  const now = deformed('prone', `rest+${depth}`);
  for (const name of PARTS) {
    const text = await pointed(page, await onPage(page, name));
    assert.ok(text.startsWith(name), `at ${name}: ${text}`);
    const said = Number(/moved ([\d.]+) mm/.exec(text.slice(name.length))[1]);
    const moves = now[name].map((p, i) => distance(p, rest[name][i]));
    assert.ok(said > Math.min(...moves) - 0.02 && said < Math.max(...moves) + 0.02, `${name}: ${said}, not ${moves}`);
  }
  const place = await onPage(page, 'tumour');
  for (const lung of [0, 1]) await page.locator(`[name=lung-${lung}][value="1"]`).check();
  assert.match(await pointed(page, place), /lung/);
  for (const lung of [0, 1]) await page.locator(`[name=lung-${lung}][value="0.35"]`).check();
  await page.locator('#inside').uncheck();
  assert.match(await pointed(page, place), /lung/);
  await page.locator('#inside').check();
}

/** Check that keyboard and pointer choose a target, which the sentence, the card and the outlines then show, and that a
 * link restores the choice and the reference. */
async function checkControls(page) {
  await page.mouse.move(5, 5);
  const before = await picture(page);
  await page.locator('#inside').uncheck();
  await assertPicture(page, before, 'hiding content does not change the picture', false);
  await page.locator('#inside').check();
  await assertPicture(page, before, 'the picture differs after content was hidden and shown');
  await page.locator('#since input').last().focus();
  await page.keyboard.press('Tab'); // to the list, which scrolls
  for (const name of PARTS) {
    await page.keyboard.press('Tab');
    await page.keyboard.press('Enter');
    await settled(page);
    const chosen = await page.evaluate(() => window.supine.basis.inside.names[window.supine.state.chosen]);
    assert.ok(PARTS.includes(chosen), name);
    assert.equal(
      await page.evaluate(() => document.querySelector('#inside-rows [aria-pressed=true]').textContent),
      chosen,
    );
    assert.ok((await page.locator('#finding').textContent()).includes(chosen));
    assert.equal(await page.locator('#outlines-title').textContent(), `Outlines through ${chosen}`);
  }
  await page.mouse.click(...(await onPage(page, 'carina')));
  await page.waitForFunction(() => window.supine.basis.inside.names[window.supine.state.chosen] === 'carina');
  assert.equal(await page.evaluate(() => window.supine.state.probes.length), 0);
  // The link is written later
  await page.waitForFunction(() => location.hash.includes(`target=${window.supine.state.chosen}`));
  const { page: again } = await openLungs(
    files['inside.html'],
    {},
    await page.evaluate(() => `${location.hash.replace(/since=\d/, '')}&since=1&inside=0`),
  );
  assert.deepEqual(
    await again.evaluate(() => [
      window.supine.basis.inside.names[window.supine.state.chosen],
      window.supine.state.from.name,
      document.getElementById('inside').checked,
    ]),
    ['carina', 'the scan', false],
  );
  await close(again);
}

async function checkSizes() {
  const pictures = pictureFolder('page_inside');
  for (const [width, height, colorScheme] of [
    [1400, 900, 'light'],
    [900, 600, 'dark'],
    [844, 390, 'light'],
    [390, 844, 'dark'],
  ]) {
    const touch = Math.min(width, height) < 400;
    const { page, complaints } = await openLungs(
      files['inside.html'],
      { viewport: { width, height }, colorScheme, ...(touch && { hasTouch: true }) },
      '#posture=left&target=4',
    );
    await assertUncut(page, '#panel button, #panel input, #inside-table td', `${width} x ${height}`);
    if (touch) {
      await page.locator('#picture').evaluate((canvas) => canvas.scrollIntoView({ block: 'center' }));
      await page.touchscreen.tap(...(await onPage(page, 'carina')));
      await page.waitForFunction(() => window.supine.basis.inside.names[window.supine.state.chosen] === 'carina');
    }
    await page.locator('#targets').scrollIntoViewIfNeeded();
    await settled(page);
    writeFileSync(join(pictures, `${width}x${height}-${colorScheme}.png`), await page.screenshot());
    if (width === 1400 || touch) {
      // check accessibility at three sizes; these have the light and the dark theme
      await assertAccessible(page, `${width} x ${height}`);
    }
    assert.deepEqual(complaints, []);
    await close(page);
  }
}

/** Check that many names can be searched, and that a list of more than 200 is cut with a note. */
async function checkMany() {
  const count = 230;
  const row = (_, i) => `node ${i},${60 + (i % 10)},${-150 + (i % 7)},${-110 + (i % 13)}\n`;
  writeFileSync(files['points.csv'], `name,x,y,z\n${Array.from({ length: count }, row).join('')}`);
  supine('embed', basis, files['points.csv'], '-o', files['inside.safetensors']);
  supine('export', basis, '--inside', files['inside.safetensors'], '-o', files['many.html']);
  const { page, complaints } = await openLungs(files['many.html'], { viewport: { width: 500, height: 320 } }, HASH);
  const rows = () =>
    page.evaluate(() => [...document.querySelectorAll('#inside-rows button')].map((e) => e.textContent));
  assert.equal((await rows()).length, 200);
  assert.equal(await page.locator('#inside-count').textContent(), `listed: 200 of ${count}`);
  await page.locator('#inside-find').fill('NODE 22');
  assert.deepEqual(await rows(), ['node 22', ...Array.from({ length: 10 }, (_, i) => `node ${220 + i}`)]);
  await page.waitForFunction(() =>
    [...document.querySelectorAll('#inside-rows td:nth-child(4)')].every((cell) =>
      /^\d+\.\d mm$/.test(cell.textContent),
    ),
  );
  await page.locator('#inside-rows button').last().click();
  assert.deepEqual(await page.evaluate(() => window.supine.basis.inside.names[window.supine.state.chosen]), 'node 229');
  assert.deepEqual(complaints, []);
  await close(page);
}

/** Return the displacement of a structure, and the expected errors of its position on another day and in the session of
 * the scan, mm, that `supine deform` states at a volume above rest. */
function statedFor(name, depth) {
  const state = ['--from', 'supine:rest', '--posture', 'supine', '--volume', `rest+${depth}`];
  supine('deform', files['inside.safetensors'], ...state, '-o', files['moved.csv']);
  const lines = readFileSync(files['moved.csv'], 'utf8')
    .split('\n')
    .filter((line) => !line.startsWith('#'))
    .map((line) => line.replaceAll('"', '').split(','));
  const row = lines.find(([first]) => first === name);
  const columns = ['moved_mm', 'another_day_error_mm', 'expected_error_mm'];
  return columns.map((column) => Number(row[lines[0].indexOf(column)]));
}

/** Check that the row of a target states the error of its place on another day that `supine deform` states and,
 * with one switch or by the link, that in the same session; and that the scan's own state is of the same session. */
async function checkDays(page) {
  const shown = () =>
    page.evaluate(() => {
      const row = document.querySelector('#inside-rows .chosen');
      const checked = document.querySelector('[name=day]:checked');
      return [row.cells[0].textContent, row.cells[4].textContent, checked.labels[0].textContent];
    });
  const follow = async (link) => {
    await page.evaluate((text) => {
      location.hash = text;
    }, link);
    await settled(page);
    await settled(page);
  };
  await follow('posture=supine&depth=430&target=4&show=contours');
  const [name] = await shown();
  const [, another, same] = statedFor(name, 430);
  assert.ok(another > same + 0.5, `${another} and ${same}`);
  const states = async (error, day) => {
    const [, words, chosen] = await shown();
    const [, mm, named] = /^within ([\d.]+)\u00a0mm, (.*)$/.exec(words);
    assert.ok(Math.abs(mm - error) < WRITTEN_MM, `${words}, not ${error}`);
    assert.deepEqual([named, chosen], [day, day]);
  };
  await states(another, 'another day');
  await page.locator('[name=day][value=session]').check();
  await settled(page);
  await states(same, 'same session');
  await follow('posture=supine&depth=430&target=4&show=contours&day=session');
  await states(same, 'same session');
  await follow('posture=supine&depth=430&target=4&show=contours');
  await states(another, 'another day');
  const [scan, part, scanned] = ['scan.safetensors', 'part.safetensors', 'scan.html'].map((file) => join(folder, file));
  supine('precompute', mesh, '--scanned', 'supine:rest', '--band', '3', '--held-out', '10', '-o', scan);
  supine('embed', scan, files['points.csv'], '-o', part);
  supine('export', scan, '--inside', part, '-o', scanned);
  for (const [posture, words] of [
    ['supine', /^within 0\.0\u00a0mm, same session$/],
    ['prone', /, another day$/],
  ]) {
    const { page: own } = await openLungs(scanned, {}, `#posture=${posture}`);
    assert.match(await own.locator('#inside-rows td:nth-child(5)').first().textContent(), words);
    await close(own);
  }
}

/** Check that, in the middle of a breath and after a jump, the lens has the displacement and the expected error that
 * `supine deform` states for the volume that is drawn. The texts of the picture are recorded as they are drawn. */
async function checkLens() {
  const { page: breathing, complaints: told } = await openLungs(
    files['inside.html'],
    { viewport: { width: 1400, height: 900 } },
    '#posture=supine&depth=0&tidal=500&show=contours&room=0',
  );
  await breathing.evaluate(() => {
    window.drawn = [];
    const fillText = CanvasRenderingContext2D.prototype.fillText;
    CanvasRenderingContext2D.prototype.fillText = function record(words, ...rest) {
      if (this.canvas.id === 'notes') window.drawn.push(words);
      return fillText.call(this, words, ...rest);
    };
  });
  /** Return the texts of the first frame that has a lens, and the volume above rest that it shows. */
  const frame = (act) =>
    breathing.evaluate(
      (text) =>
        new Promise((done) => {
          new Function(text)();
          const look = () => {
            const at = window.drawn.findLastIndex((words) => /^ring: /.test(words));
            if (at >= 0 && window.supine.state.depth > 100)
              done({ words: window.drawn.slice(0, at + 1), depth: window.supine.state.depth });
            else {
              window.drawn = [];
              requestAnimationFrame(look);
            }
          };
          window.drawn = [];
          requestAnimationFrame(look);
        }),
      act,
    );
  const acts = {
    'in mid-breath': 'window.supine.state.phase = 0.2; window.supine.state.playing = true; window.supine.touch();',
    'after a jump': 'Object.assign(window.supine.state, { playing: false, depth: 430 }); window.supine.touch();',
  };
  for (const [when, act] of Object.entries(acts)) {
    const { words, depth } = await frame(act);
    const name = await breathing.evaluate(() => window.supine.basis.inside.names[window.supine.state.chosen]);
    const [mm, error] = statedFor(name, depth);
    const [ring, length] = [words.at(-1), words.findLast((text) => /^[\d.]+ mm$/.test(text))].map((text) =>
      Number(/([\d.]+) mm/.exec(text)[1]),
    );
    console.log(
      `lens ${when}, rest + ${depth.toFixed(0)} mL: ${length} mm with an error of ${ring} mm; ` +
        `supine deform: ${mm}, ${error} mm`,
    );
    assert.ok(Math.abs(length - mm) < WRITTEN_MM, `${when}: ${length} mm, not ${mm}`);
    assert.ok(
      Math.abs(ring - error) < (error < 3 ? 0.05 : 0.5) + 0.02,
      `${when}: an error of ${ring} mm, not ${error}`,
    );
  }
  assert.deepEqual(told, []);
  await close(breathing);
}

const { page, complaints } = await openLungs(files['inside.html'], { viewport: { width: 840, height: 630 } }, HASH);
await checkPositions(page);
await checkPointer(page, await checkTable(page));
await checkControls(page);
await checkDays(page);
assert.deepEqual(complaints, []);
await page.mouse.move(5, 5);
await checkLoss(page);
await close(page);
await checkLens();
await checkSizes();
await checkMany();
