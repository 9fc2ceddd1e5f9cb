// SPDX-License-Identifier: GPL-3.0-or-later
// Test the page as it opens, with the patient on the left side at rest: cards and bars show the numbers of
// `supine compare`, outlines enclose the lungs' volumes, and colours of the surface match the colour bar. The page also
// works in a small window, with forced colours and without WebGL.
import assert from 'node:assert/strict';
import { close, openLungs, press, settled } from './browser.mjs';
import { basis, html } from './lungs.mjs';
import { supine } from './support.mjs';

const { page, complaints } = await openLungs(html, { viewport: { width: 1400, height: 900 } }, '');
assert.deepEqual(
  await page.evaluate(() => {
    const { state: s } = window.supine;
    return [document.getElementById('posture-name').value, s.depth, s.room, s.ghost];
  }),
  ['left', 0, true, true],
);
await settled(page);
assert.match(
  await page.locator('#finding').textContent(),
  new RegExp(
    '^Lying on the left side, the surface moves [\\d.]+ mm on average from supine at rest, [\\d.]+ mm at most, ' +
      'at the \\w+ of the (left|right) lung; expected error [\\d.]+ mm\\.$',
  ),
);

/* Cards, volumes and the text on the surface have the numbers of `supine compare`. */
const json = JSON.parse(
  supine('compare', basis, '--postures', 'supine,prone,left,right,upright,supine+15', '--json').replace(/^[^{]*/, ''),
);
const [rest] = json.postures;
const cards = await page.evaluate(() => [...document.querySelectorAll('#postures small')].map((e) => e.textContent));
json.postures.forEach(({ name, displacement_mm: mm, moved_error_mm: error }, i) => {
  if (i === 0) return assert.equal(cards[0], 'reference');
  const [, mean, words] = /^([\d.]+) mm(, error [\d.]+| on average)$/.exec(cards[i]);
  assert.equal(words, mm.mean > error ? ' on average' : `, error ${error.toFixed(1)}`, name);
  return assert.ok(Math.abs(Number(mean) - mm.mean) <= 0.051, `${name}: ${cards[i]}, not ${mm.mean}`);
});
const surface = (await page.locator('#surface-text').textContent()).match(/[\d.]+\d/g).map(Number);
const { mean, p95, max } = json.postures[2].displacement_mm;
[mean, 95, p95, max, json.postures[2].moved_error_mm].forEach((x, i) =>
  assert.ok(Math.abs(surface[i] - x) < 0.06, `${surface}`),
);
const bars = await page.evaluate(() =>
  [...document.querySelectorAll('.hold')].map((e) => [
    e.querySelector('.who').textContent,
    e.querySelector('.ml').textContent,
    e.querySelector('.band').hidden,
  ]),
);
for (const [who, text, hidden] of bars) {
  const lung = who.split(' ')[0];
  assert.equal(who, `${lung} lung (${lung === 'left' ? 'down' : 'up'})`);
  const [, ...ml] = /^(\d+) \u2192 (\d+) mL, range (\d+) to (\d+)$/.exec(text).map(Number);
  ['low', 'high'].forEach((end, i) =>
    assert.ok(Math.abs(ml[2 + i] - json.postures[2].volume_ml[lung][end]) <= 0.51, `${who}: ${text}`),
  );
  ml.slice(0, 2).forEach((x, i) =>
    assert.ok(Math.abs(x - [rest, json.postures[2]][i].volume_ml[lung].value) <= 0.51, `${who}: ${text}`),
  );
  assert.equal(hidden, false);
}
assert.equal(await page.locator('#holds-source').textContent(), 'assumed from healthy people');
assert.match(await page.locator('#caveats').textContent(), /assumed: .*volume at rest, supine \d+ mL \(\d+ to \d+\)/);
await press(page, '3');
await settled(page);

/* The areas of all axial outlines times their distance sum to the volume of the lungs. So do those of coronal
 * outlines. */
const [summed, held] = await page.evaluate(() => {
  const { basis: b, state, linesAcross, placesOf } = window.supine;
  const places = placesOf(b, state.moment);
  const area = (line) =>
    line.reduce(
      (sum, [x, y], i) => sum + (x * line[(i + 1) % line.length][1] - line[(i + 1) % line.length][0] * y) / 2,
      0,
    );
  const within = (line, [x, y]) =>
    line.filter(([u, v], i) => {
      const [s, t] = line[(i + 1) % line.length];
      return v > y !== t > y && x < u + ((y - v) * (s - u)) / (t - v);
    }).length %
      2 ===
    1;
  return [
    [2, 1].map((axis) => {
      let ml = 0;
      for (let at = state.body.low[axis] + 0.5; at < state.body.high[axis]; at += 2) {
        const lines = linesAcross(b, places, axis, at);
        for (const line of lines)
          ml +=
            ((lines.filter((other) => other !== line && within(other, line[0])).length % 2 ? -2 : 2) *
              Math.abs(area(line))) /
            1000;
      }
      return ml;
    }),
    state.moment.held.reduce((sum, x) => sum + x),
  ];
});
for (const ml of summed) assert.ok(Math.abs(ml - held) < 0.001 * held, `outlines enclose ${summed} mL, lungs ${held}`);

/* Dragging the line in one of the two pictures of slices, or pressing arrow keys, moves the slice of the other. */
const slices = () => page.evaluate(() => window.supine.state.slices);
const before = await slices();
const box = await page.locator('#outlines canvas').nth(1).boundingBox();
await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
await page.mouse.down();
// Towards the head, which is on the left as in the picture of the lungs
await page.mouse.move(box.x + box.width / 2 - 15, box.y + box.height / 2, { steps: 3 });
await page.mouse.up();
const after = await slices();
assert.ok(before === null && after.length === 3, `${before} to ${after}`);
await page.locator('#outlines canvas').nth(1).press('ArrowLeft');
assert.ok(Math.abs((await slices())[2] - after[2]) > 1);
await page.locator('#outlines canvas').first().press('ArrowUp');
assert.ok(Math.abs((await slices())[1] - after[1]) > 1);
/* The drawings look the same way as the picture: in each posture, the directions that point right and up in the second
 * drawing are those of the picture, and gravity points down in both. */
for (const key of ['1', '2', '3', '4', '5', '6']) {
  await press(page, key);
  await settled(page);
  const off = await page.evaluate(() => {
    const { toEye: m } = window.supine.panes()[0];
    const [axial, along] = window.supine.planesFor(window.supine.state.gravity);
    const eye = (v) => [0, 1].map((i) => m[i] * v[0] + m[4 + i] * v[1] + m[8 + i] * v[2]);
    return [
      eye(along.right)[0],
      eye(along.up)[1],
      ...[axial, along].map(({ up }) => -up.reduce((sum, x, i) => sum + x * window.supine.state.gravity[i], 0)),
    ];
  });
  assert.ok(off[0] > 0.9 && off[1] > 0.9 && off[3] > 0.9 && (off[2] > 0.9 || key === '5'), `posture ${key}: ${off}`);
}
await press(page, '3');

/* Look up the colour of random pixels on the colour bar. The values found differ from the data by at most 3 % of the
 * range at the median, and 8 % at the 90th percentile. The range of `expansion` is symmetric about 0. */
for (const kind of ['displacement', 'expansion']) {
  await page.locator(`[name=kind][value=${kind}]`).check();
  await settled(page);
  const errors = await page.evaluate(async () => {
    const { picture: p, panes, basis: b } = window.supine;
    const [pane] = panes();
    const [width, height] = pane.box.slice(2);
    const pixels = new Uint8Array(4 * width * height);
    p.draw(panes());
    p.gl.readPixels(0, 0, width, height, p.gl.RGBA, p.gl.UNSIGNED_BYTE, pixels);
    const answer = p.picked.bind(p);
    p.picked = () => undefined; // keeps the page from reading the picked value before this test does
    const bar = b.colours[pane.map];
    const found = [];
    for (let i = 0; found.length < 250 && i < 20000; ++i) {
      const [x, y] = [(i * 0.754877666) % 1, (i * 0.569840291) % 1].map((part, k) =>
        Math.floor(part * [width, height][k]),
      );
      const at = 4 * (y * width + x);
      if (pixels[at + 3] < 255) continue;
      p.pick(pane, (2 * x + 1) / width - 1, (2 * y + 1) / height - 1);
      let picked;
      while ((picked = answer()) === undefined)
        await new Promise((done) => {
          setTimeout(done, 0);
        });
      if (!picked) continue;
      const far = (colour) => [0, 1, 2].reduce((sum, k) => sum + (bar[4 * colour + k] - pixels[at + k]) ** 2, 0);
      let best = 0;
      for (let colour = 1; colour < 256; ++colour) if (far(colour) < far(best)) best = colour;
      const { begin, end } = pane.range;
      found.push(Math.abs(best / 255 - Math.max(0, Math.min(1, (picked.value - begin) / (end - begin)))));
    }
    delete p.picked;
    return found.sort((a, c) => a - c);
  });
  assert.ok(errors.length === 250, `${errors.length} places`);
  const [median, most] = [0.5, 0.9].map((part) => errors[Math.floor(part * errors.length)]);
  console.log(
    `${kind}: on the bar within ${(100 * median).toFixed(1)} % of the range at the median, ` +
      `${(100 * most).toFixed(1)} % at the 90th percentile`,
  );
  assert.ok(median < 0.03 && most < 0.08);
}
assert.equal(await page.evaluate(() => window.supine.state.range.begin + window.supine.state.range.end), 0);
/* The bar of displacements ends above the largest displacement in any posture that has a card. */
assert.ok(
  (await page.evaluate(() => window.supine.state.ranges.displacement.end)) >
    Math.max(...json.postures.map(({ displacement_mm: mm }) => mm.max)) - 0.5,
);

/* Letter and digit keys act only while the picture has the focus. */
await page.locator('#theme').focus();
for (const key of ['2', 'g', 'c']) await page.keyboard.press(key);
assert.deepEqual(
  await page.evaluate(() => {
    const { state: s } = window.supine;
    return [document.getElementById('posture-name').value, s.ghost, s.kind];
  }),
  ['left', true, 'expansion'],
);
await press(page, '2');
await settled(page);
assert.equal(await page.locator('#posture-name').inputValue(), 'prone');
assert.deepEqual(complaints, []);
await close(page);

/* In a window of 320 x 256 (1280 x 1024 at a zoom of 400 %) nothing is cut off, and the picture is at least 240 px
 * wide. */
const { page: small } = await openLungs(html, { viewport: { width: 320, height: 256 } }, '#posture=left&depth=900');
// Colours are for the volume that depth= in the link gives, 900 mL above rest
assert.equal(await small.evaluate(() => window.supine.state.measured), 900);
const { width, height, wide } = await small.evaluate(() => ({
  ...document.getElementById('picture').getBoundingClientRect().toJSON(),
  wide: document.documentElement.scrollWidth,
}));
assert.ok(width >= 240 && height >= 120 && wide <= 320, `${width} x ${height} in ${wide}`);
const targets = await small.evaluate(() =>
  [...document.querySelectorAll('button, select, summary, input')]
    .filter((e) => e.checkVisibility())
    .map((e) => {
      const target = (e.type === 'checkbox' && e.labels.length ? e.labels[0] : e).getBoundingClientRect();
      return [e.id || e.textContent, target.width, target.height];
    })
    .filter(([, w, h]) => w < 24 || h < 24),
);
assert.deepEqual(targets, []);
await close(small);

/* With forced colours the bar keeps its gradient, and a pressed button has an outline. */
const { page: forced } = await openLungs(html, { forcedColors: 'active' }, '');
const [bar, pressed, other] = await forced.evaluate(() => [
  getComputedStyle(document.getElementById('colours')).backgroundImage,
  ...['true', 'false'].map(
    (x) => getComputedStyle(document.querySelector(`[data-posture][aria-pressed=${x}]`)).outlineStyle,
  ),
]);
assert.match(bar, /gradient/);
assert.ok(pressed === 'solid' && other === 'none');
await close(forced);

/* Without WebGL the numbers are the same, and the lungs are drawn on a 2-D canvas. */
const { page: flat, complaints: said } = await openLungs(
  html,
  {
    init: () => {
      const { getContext } = HTMLCanvasElement.prototype;
      HTMLCanvasElement.prototype.getContext = function context(kind, ...rest) {
        return kind === 'webgl2' ? null : getContext.call(this, kind, ...rest);
      };
    },
  },
  '',
);
await settled(flat);
const painted = await flat.evaluate(() => {
  const canvas = document.getElementById('picture');
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  let [count, colours] = [0, new Set()];
  for (let i = 0; i < data.length; i += 4)
    if (data[i + 3] > 20) {
      ++count;
      colours.add(data[i + 3] >> 4);
    }
  return [count / (canvas.width * canvas.height), colours.size, document.getElementById('message').textContent];
});
assert.ok(painted[0] > 0.04 && painted[1] > 4, `${painted}`);
assert.deepEqual(
  await flat.evaluate(() => [...document.querySelectorAll('#postures small')].map((e) => e.textContent)),
  cards,
);
assert.deepEqual(said, []);
await close(flat);
