// SPDX-License-Identifier: GPL-3.0-or-later
// Test what the page with targets says and shows first: the sentence is about the target with the largest displacement
// over its expected error, the reference posture says so, anatomy (a large structure, here a box the size of a lobe) is
// a translucent shell with contours in the slices and without a ball, long names fit, the patient lies on the table,
// and on a phone the picture comes first.
import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { assertAccessible, close, openLungs, press, settled } from './browser.mjs';
import { basis } from './lungs.mjs';
import { folder, pictureFolder, supine } from './support.mjs';

const LONGEST = 28; // characters of a name in the picture
const NAMES = [
  'still',
  'Right lower lobe superior segment part-solid nodule of the screening CT of March, named in full ' +
    'by someone who wanted to be understood ok',
  'ورم في الفص السفلي الأيمن',
  'Tumor im rechten Unterlappenü',
  'mover',
];
const AT = [
  [60, -150, -40],
  [-80, -130, -110],
  [-70, -90, -150],
  [70, -120, -120],
  [-80, -150, -150],
];
assert.ok(NAMES[1].length >= 134 && NAMES[3].length === 29);
const [points, lobe, inside, html] = ['first.csv', 'lobe.obj', 'first.safetensors', 'first.html'].map((name) =>
  join(folder, name),
);
writeFileSync(points, `name,x,y,z\n${NAMES.map((name, i) => `"${name}",${AT[i]}\n`).join('')}`);
const corners = Array.from({ length: 8 }, (_, i) => [
  70 + (i & 1 ? 45 : -45),
  -120 + (i & 2 ? 45 : -45),
  -100 + (i & 4 ? 50 : -50),
]);
const faces = [
  [1, 3, 2],
  [2, 3, 4],
  [5, 6, 7],
  [6, 8, 7],
  [1, 2, 5],
  [2, 6, 5],
  [3, 7, 4],
  [4, 7, 8],
  [1, 5, 3],
  [3, 5, 7],
  [2, 4, 6],
  [4, 8, 6],
];
writeFileSync(
  lobe,
  `${corners.map((c) => `v ${c.join(' ')}\n`).join('')}${faces.map((f) => `f ${f.join(' ')}\n`).join('')}`,
);
supine('embed', basis, points, lobe, '-o', inside);
supine('export', basis, '--inside', inside, '-o', html);

/** Record the texts of the picture, and the colours of the lines of the outlines. */
const record = () => {
  window.drawn = [];
  window.lines = new Set();
  const { fillText, stroke } = CanvasRenderingContext2D.prototype;
  CanvasRenderingContext2D.prototype.fillText = function words(text, ...rest) {
    if (this.canvas.id === 'notes') window.drawn.push(text);
    return fillText.call(this, text, ...rest);
  };
  CanvasRenderingContext2D.prototype.stroke = function line(...rest) {
    if (this.canvas.closest('#outlines')) window.lines.add(this.strokeStyle);
    return stroke.apply(this, rest);
  };
};
/** Do `act`, and return the texts and colours that are drawn after it, and the sentence. */
async function after(page, act) {
  await page.evaluate(() => {
    window.drawn = [];
    window.lines.clear();
  });
  await act();
  await settled(page);
  await page.evaluate(() => window.supine.touch());
  await settled(page);
  return page.evaluate(() => ({
    drawn: window.drawn,
    lines: [...window.lines],
    finding: document.getElementById('finding').textContent,
  }));
}

const { page, complaints } = await openLungs(html, { viewport: { width: 1440, height: 900 }, init: record }, '');
const rows = () =>
  page.evaluate(() =>
    [...document.querySelectorAll('#inside-rows tr')].map((row) => [...row.cells].map((cell) => cell.textContent)),
  );
const ratio = ([, mm, , error]) => parseFloat(mm) / parseFloat(error);

/* The sentence is about the target with the largest displacement over its error in the posture, until one is chosen. */
for (const [key, posture] of [
  ['3', 'Lying on the left side'],
  ['2', 'Prone'],
  ['4', 'Lying on the right side'],
]) {
  const { finding } = await after(page, () => press(page, key));
  const targets = (await rows()).filter(([name]) => name !== 'lobe');
  const best = targets.reduce((most, row) => (ratio(row) > ratio(most) ? row : most));
  assert.ok(finding.startsWith(`${posture}, ${best[0]} moves ${best[1]}`), `${finding}, not ${best}`);
  assert.notEqual(best[0], 'still');
}
assert.ok(!(await page.evaluate(() => window.supine.state.picked)));

/* In the reference posture, each label says so. */
const { drawn: supineDrawn } = await after(page, () => press(page, '1'));
assert.equal(supineDrawn.filter((text) => text === 'the reference').length % (NAMES.length + 1), 0);
assert.ok(
  supineDrawn.includes('the reference') && !supineDrawn.some((text) => /within|no change/.test(text)),
  `${supineDrawn}`,
);

/* A change within the error is stated with both numbers. */
await press(page, '3');
await page.locator('#inside-rows button').first().click();
const still = await after(page, async () => {});
const [, mm, words, error] = (await rows())[0];
assert.ok(parseFloat(mm) <= parseFloat(error), `${mm} ${error}`);
assert.equal(words, `within its error of ${parseFloat(error).toFixed(1)}`);
assert.ok(still.finding.includes(`still moves ${mm} from supine at rest, ${words}`), still.finding);

/* Names are cut in the picture, at a character, and nowhere else. */
const graphemes = (text) => [...new Intl.Segmenter().segment(text)].length;
for (const name of NAMES) {
  const shown = still.drawn.find(
    (text) => text === name || (text.endsWith('\u2026') && name.startsWith(text.slice(0, -1))),
  );
  assert.ok(shown && graphemes(shown) <= LONGEST, `${name}: ${still.drawn}`);
}

/* Anatomy: the list has its colour, slices its contour, the picture no ball or lens; a target inside is found. */
const large = await page.evaluate(() => {
  const {
    basis: { inside: i },
    state,
  } = window.supine;
  state.slices = null;
  return {
    names: i.anatomy.map((part) => i.names[part]),
    shells: i.shells,
    targetCorners: i.targetCorners,
    own: [...document.querySelectorAll('#inside-rows button')].map((button) => button.style.getPropertyValue('--own')),
  };
});
assert.deepEqual(large.names, ['lobe']);
assert.deepEqual([large.shells.length, large.shells[0].count, large.targetCorners], [1, 36, 0]);
assert.deepEqual(large.own.map(Boolean), [...NAMES.map(() => false), true]);
const shell = await after(page, () => page.locator('#inside-rows button').last().click());
const chosen = await page.evaluate(() =>
  getComputedStyle(document.documentElement).getPropertyValue('--change').trim(),
);
assert.ok(shell.lines.includes(chosen) && !shell.lines.includes(large.own.at(-1)), `${shell.lines}`);
assert.ok(!shell.drawn.some((text) => text.startsWith('ring: ')), `${shell.drawn}`);
assert.match(shell.finding, /^Lying on the left side, lobe moves/);
const place = await page.evaluate(() => {
  const {
    basis: { inside: i },
    insidePositions,
    state,
    panes,
  } = window.supine;
  const vertex = i.members[i.names.indexOf('Tumor im rechten Unterlappenü')][0];
  const at = insidePositions(state.gravity, state.depth).slice(3 * vertex, 3 * vertex + 3);
  const [{ toEye: m, projection }] = panes();
  const eye = [0, 1, 2].map((k) => m[k] * at[0] + m[4 + k] * at[1] + m[8 + k] * at[2] + m[12 + k]);
  const stage = document.getElementById('picture').getBoundingClientRect();
  return [0, 1].map(
    (k) =>
      (k ? stage.y : stage.x) +
      ((1 + ((k ? -1 : 1) * (projection[5 * k] * eye[k])) / -eye[2]) / 2) * (k ? stage.height : stage.width),
  );
});
await page.mouse.move(...place);
await page.waitForFunction(() => document.getElementById('pointed').textContent.startsWith('Tumor im rechten'));

/* The patient's body touches the table and does not enter it. */
for (const gravity of [
  [0, 1, 0],
  [0, -1, 0],
  [1, 0, 0],
  [-1, 0, 0],
  [0.6, 0.8, 0],
  [0.7, 0.1, -0.7],
]) {
  const [deepest, table] = await page.evaluate((g) => {
    const { state, postureFrom, touch, basis: b, armsOf, downOf, panes, torsoRings } = window.supine;
    state.settle(postureFrom(g.join(':')).q, 0, 0);
    touch();
    return new Promise((done) => {
      requestAnimationFrame(() =>
        requestAnimationFrame(() => {
          const down = downOf(g);
          const { centre, half } = b.torso;
          const body = [
            ...torsoRings(b.torso).map(([, x, y]) => Math.hypot(x * half[0] * down[0], y * half[1] * down[1])),
            ...armsOf(b.torso, down)
              .flat()
              .map(([x, y, , r]) => x * down[0] + y * down[1] + r),
          ];
          const [{ tableToEye: t, toEye: m }] = panes();
          const middle = [0, 1, 2].map(
            (k) => m[k] * centre[0] + m[4 + k] * centre[1] + m[8 + k] * centre[2] + m[12 + k],
          );
          const thick = Math.hypot(...t.slice(8, 11));
          done([
            Math.max(...body),
            [0, 1, 2].reduce((sum, k) => sum + ((t[12 + k] - middle[k]) * t[8 + k]) / thick, 0) - thick,
          ]);
        }),
      );
    });
  }, gravity);
  assert.ok(
    Math.abs(deepest - table) < 0.1,
    `gravity ${gravity}: the body reaches ${deepest} mm down, the table is at ${table}`,
  );
}
await assertAccessible(page, 'anatomy is chosen');
assert.deepEqual(complaints, []);
await page.close();

/* On a phone the picture comes first, then the sentence; the headings of a long list stay. */
const pictures = pictureFolder('page_first');
for (const [width, height, colorScheme, chosen] of [
  [1440, 900, 'light', '1'],
  [1440, 900, 'dark', '0'],
  [1024, 768, 'light', '5'],
  [1024, 768, 'dark', ''],
  [390, 844, 'light', ''],
  [390, 844, 'dark', '5'],
]) {
  const { page: sized, complaints: said } = await openLungs(
    html,
    { viewport: { width, height }, colorScheme },
    `#posture=left${chosen && `&target=${chosen}`}`,
  );
  const top = (id) =>
    sized
      .locator(id)
      .first()
      .boundingBox()
      .then((box) => box.y);
  const wide = (cell) => sized.locator(cell).first().boundingBox().then((box) => box.width);
  const least = width < 800 ? 0.3 : 0.2; // share of a row that is a name's; directions have more on a wide page
  assert.ok((await wide('#inside-rows th')) > least * (await wide('#inside-rows tr')), `${width}: names have no room`);
  if (width < 800)
    assert.ok(
      (await top('#stage')) < (await top('#finding')) &&
        (await top('#finding')) < (await top('#targets')) &&
        (await top('#finding')) < 0.7 * height,
    );
  else {
    await sized.locator('#inside-scroll').evaluate((list) => {
      list.scrollTop = 90;
    });
    const [list, head] = [await top('#inside-scroll'), await top('#inside-table thead th')];
    assert.ok(Math.abs(list - head) < 2, `the headings are at ${head}, the list begins at ${list}`);
  }
  assert.ok(
    await sized.evaluate(() => document.documentElement.scrollWidth <= innerWidth),
    `${width} x ${height}: something is cut`,
  );
  await assertAccessible(sized, `${width} x ${height}, ${colorScheme}, target ${chosen}`);
  writeFileSync(join(pictures, `${width}x${height}-${colorScheme}.png`), await sized.screenshot());
  assert.deepEqual(said, []);
  await close(sized);
}

/* A model that was fitted to the patient is named on the first screen. */
const fitted = join(folder, 'fitted.html');
writeFileSync(
  fitted,
  readFileSync(html, 'utf8').replace(
    '&quot;metadata&quot;:{',
    '&quot;metadata&quot;:{&quot;patient&quot;:&quot;two states and 300 landmarks&quot;,',
  ),
);
const { page: own } = await openLungs(fitted, { viewport: { width: 390, height: 844 } }, '');
assert.equal(await own.locator('#patient-fit').textContent(), 'fitted to this patient: two states and 300 landmarks');
assert.ok((await own.locator('#patient-fit').boundingBox()).y < 100);
await close(own);
