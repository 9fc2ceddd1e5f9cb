// SPDX-License-Identifier: GPL-3.0-or-later
// Test views, pan, zoom, postures, display options, probes (marked points), links and a lost WebGL context on the page.
import assert from 'node:assert/strict';
import { assertPicture, checkLoss, close, openLungs, picture, press, settled } from './browser.mjs';
import { basis, html } from './lungs.mjs';

/** Check that each view shows the side of the body that it names, with the patient's axes in the right directions. */
async function checkViews(page) {
  // Where the patient's left is in the picture: x right, y up
  const left = { a: [1, 0], p: [-1, 0], h: [1, 0], f: [1, 0] };
  for (const [key, words] of Object.entries({ a: 'front', p: 'back', l: 'left', r: 'right', f: 'feet', h: 'head' })) {
    await press(page, key);
    await settled(page);
    assert.equal(await page.locator('#seen').textContent(), `seen from the ${words}`);
    const m = await page.evaluate(() => Array.from(window.supine.panes()[0].toEye));
    if (left[key])
      assert.ok(Math.abs(m[0] - left[key][0]) < 1e-6 && Math.abs(m[1] - left[key][1]) < 1e-6, `seen from ${key}: ${m}`);
    else assert.ok(Math.abs(m[2] - (key === 'l' ? 1 : -1)) < 1e-6, `seen from ${key}: ${m}`);
  }
  await press(page, 'a');
  await settled(page);
  const [leftLung, middle] = await page.evaluate(() =>
    ['left lung', 'right lung'].map(
      (name) => window.supine.basis.lungBoxes[window.supine.basis.lungNames.indexOf(name)].centre[0],
    ),
  );
  assert.ok(leftLung > middle);
}

/** Check that panning follows the pointer and that zooming is centred at it. */
async function checkCamera(page) {
  const box = await page.locator('#picture').boundingBox();
  const [x, y] = [box.x + box.width * 0.6, box.y + box.height * 0.4];
  const under = () =>
    page.evaluate(() => {
      const pane = window.supine.panes()[0];
      return [pane.toEye[12], pane.toEye[13]];
    });
  const before = await under();
  await page.mouse.move(x, y);
  await page.mouse.down({ button: 'right' });
  await page.mouse.move(x + 60, y + 30, { steps: 3 });
  await page.mouse.up({ button: 'right' });
  await settled(page);
  const after = await under();
  assert.ok(after[0] > before[0] + 5 && after[1] < before[1] - 2, 'the right button does not pan');
  await press(page, '0');
  await page.mouse.move(x, y);
  await page.mouse.wheel(0, -400);
  await settled(page);
  const pan = await page.evaluate(() => window.supine.state.camera.pan);
  assert.ok(
    pan[0] < -1 && pan[1] < -1,
    `zooming in at the upper right does not move the lungs to the lower left: ${pan}`,
  );
  await press(page, '0');
}

/** Check that the page writes postures as the command line accepts them, and reads them back. */
async function checkPostures(page) {
  const texts = await page.evaluate(() => {
    const { postureText, postureFrom, gravityOf } = window.supine;
    const turned = (text) => {
      const { q, tilt } = postureFrom(text);
      const g = gravityOf(q);
      const [h, c, s] = [Math.hypot(g[0], g[1]), Math.cos((tilt * Math.PI) / 180), Math.sin((tilt * Math.PI) / 180)];
      const u = h > 1e-6 ? [g[0] / h, g[1] / h] : [0, 1];
      return [u[0] * (h * c - g[2] * s), u[1] * (h * c - g[2] * s), h * s + g[2] * c];
    };
    return [
      'supine',
      'prone',
      'left',
      'right',
      'upright',
      'inverted',
      'supine+15',
      'prone-20',
      'left+45',
      'right-30',
      'supine@30',
      '0.60:0.00:-0.80',
      '0:-1:0',
      'HFP',
      'AFDL',
    ].map((text) => [text, postureText(turned(text)), turned(text)]);
  });
  for (const [text, again, gravity] of texts) {
    assert.equal(again, { '0:-1:0': 'prone', HFP: 'prone', AFDL: 'left' }[text] ?? text);
    if (text === 'left+45') assert.ok(Math.abs(gravity[2] - Math.SQRT1_2) < 1e-12, 'left+45 does not lower the head');
    if (text === 'supine+15') assert.ok(Math.abs(gravity[2] - Math.sin(Math.PI / 12)) < 1e-12);
  }
  for (const [text, words] of [
    ['supine', 'supine'],
    ['left', 'left side'],
    ['right-20', 'right side, head 20 degrees up'],
    ['0.81:0.57:0.17', 'supine, rolled 55 degrees to the left, head 10 degrees down'],
    ['-0.86:-0.5:0', 'prone, rolled 60 degrees to the right'],
    ['0:0.34:-0.94', 'upright, leaning 20 degrees back'],
    ['-0.2:-0.2:-0.96', 'upright, leaning 16 degrees forward and to the right'],
    ['0.34:0:0.94', 'inverted, leaning 20 degrees to the left'],
  ])
    assert.equal(
      await page.evaluate((name) => {
        const { postureWords, postureFrom, gravityOf, state } = window.supine;
        const { q, tilt } = postureFrom(name);
        state.settle(q, tilt, 0);
        return postureWords(gravityOf(state.goal));
      }, text),
      words,
    );
  await page.locator('#posture-name').fill('0.6:0:-0.8');
  await page.keyboard.press('Enter');
  await page.waitForFunction(() => Math.abs(window.supine.state.gravity[0] - 0.6) < 1e-9);
  await page.locator('#posture-name').fill('prune');
  await page.keyboard.press('Enter');
  assert.match(await page.locator('#posture-name-trouble').textContent(), /prune/);
  await page.locator('#posture-name').fill('supine');
  await page.keyboard.press('Enter');
  await page.locator('#posture-name').blur();
}

/** Check that each wrong value of the link is told, with the value that is taken instead, and that no other key
 * suffers. */
async function checkWrongLinks(page) {
  const follow = (link) =>
    page.evaluate(
      (text) =>
        new Promise((done) => {
          addEventListener('hashchange', () => {
            const note = document.getElementById('link-trouble');
            done(note.hidden ? '' : note.textContent);
          }, { once: true });
          location.hash = text;
        }),
      link,
    );
  const right = 'posture=prone&depth=200&tidal=500&colour=displacement';
  assert.equal(await follow(right), '');
  for (const [key, text, taken] of [
    ['posture', 'left%2b100', 'prone'],
    ['depth', '9000', '200'],
    ['tidal', '', '500'],
    ['colour', 'red', 'displacement'],
    ['reference', 'pron', 'supine'],
    ['room', 'no', '1'],
    ['show', 'ghost.goats', 'contours.ghost'],
    ['lungs', '2:1', '1:1'],
    ['cut', 'z:1.5', 'none'],
    ['range', '5:nan', 'automatic'],
    ['camera', '0:9:1:0:0', '0:0.05:1:0:0'],
    ['probes', '3.1e9', 'none'],
    ['target', '0', 'first'],
    ['since', '2', '0'],
    ['slices', '1:2', 'middle'],
    ['inside', '1', '0'],
    ['inside', '0&inside=0', '0'],
    ['prone', '', 'nothing'],
  ]) {
    const told = await follow(`${right.replace(new RegExp(`${key}=\\w*&?`), '')}&${key}=${text}`);
    const given = decodeURIComponent(text).replace('&inside=', ' ');
    const named = `Link: ${key} ${given && `\u201c${given}\u201d `}`;
    assert.ok(told.startsWith(`${named}is not taken: give `), `${key}: ${told}`);
    assert.ok(told.endsWith(` Taken instead: ${taken}.`), told);
    assert.equal(told.split('Link: ').length, 2, told);
  }
  assert.equal(await follow('posture=supine&depth=500&show=contours&room=0&colour=displacement'), '');
}

/** Check that each display option changes the picture and can be undone. */
async function checkShown(page) {
  await page.mouse.move(750, 6); // off the lungs, so that no value is shown
  const before = await picture(page);
  for (const [name, act, undo] of [
    [
      'a faded lung',
      () => page.locator('[name=lung-0][value="0.35"]').check(),
      () => page.locator('[name=lung-0][value="1"]').check(),
    ],
    [
      'a hidden lung',
      () => page.locator('[name=lung-1][value="0"]').check(),
      () => page.locator('[name=lung-1][value="1"]').check(),
    ],
    ['a cut', () => page.locator('#cut-axis').selectOption('1'), () => page.locator('#cut-axis').selectOption('-1')],
    ['no contours', () => page.locator('#contours').uncheck(), () => page.locator('#contours').check()],
    ...['ghost', 'arrows', 'wires', 'beside'].map((id) => [
      id,
      () => page.locator(`#${id}`).check(),
      () => page.locator(`#${id}`).uncheck(),
    ]),
    [
      'expansion',
      () => page.locator('[name=kind][value=expansion]').check(),
      () => page.locator('[name=kind][value=displacement]').check(),
    ],
    ['no colours', () => page.locator('#coloured').uncheck(), () => page.locator('#coloured').check()],
    [
      'the scan as reference',
      () => page.locator('[name=since][value="1"]').check(),
      () => page.locator('[name=since][value="0"]').check(),
    ],
    [
      'a typed range',
      async () => {
        await page.locator('#range-end').fill('11');
        await page.locator('#range-end').blur();
      },
      () => page.locator('#range-auto').click(),
    ],
  ]) {
    await act();
    await assertPicture(page, before, `${name} changes nothing`, false);
    await undo();
    await assertPicture(page, before, `${name} is not undone`);
  }
}

/** Return the picture that a user saves, without the page around it. */
async function drawn(page) {
  await settled(page);
  return page.evaluate(async () =>
    Array.from(new Uint8Array(await (await window.supine.picturePng()).arrayBuffer())).join(),
  );
}

/** Check that a lung is seen from every side, also through the table on which the patient lies. */
async function checkSides(page) {
  for (const [posture, views] of [
    ['1', 'ap'],
    ['2', 'ap'],
    ['3', 'lr'],
  ]) {
    for (const view of views) {
      await press(page, posture);
      await press(page, view);
      await page.waitForFunction(() => !window.supine.state.turning);
      const shown = await drawn(page);
      await page.locator('[name=lung-1][value="0"]').check();
      assert.notEqual(await drawn(page), shown, `posture ${posture}, view ${view}: no lung is seen`);
      await page.locator('[name=lung-1][value="1"]').check();
    }
  }
  await press(page, '1');
  await press(page, 'a');
  await page.waitForFunction(() => !window.supine.state.turning);
}

/** Check that marked points move with the tissue and measure distances, and that a link restores them. */
async function checkProbes(page) {
  await page.evaluate(() => window.scrollTo(0, 0));
  const box = await page.locator('#picture').boundingBox();
  for (const [x, y] of [
    [0.41, 0.5],
    [0.59, 0.55],
  ]) {
    const had = await page.evaluate(() => window.supine.state.probes.length);
    await page.mouse.click(box.x + box.width * x, box.y + box.height * y);
    await page.waitForFunction((n) => window.supine.state.probes.length > n, had);
  }
  await page.waitForFunction(() => document.querySelectorAll('#probes li').length === 2);
  const [list, between] = [
    await page.locator('#probes').textContent(),
    await page.locator('#probes-text').textContent(),
  ];
  assert.match(list, /1  (left|right) lung  [\d.]+ mm  [LR] \d+  [PA] \d+  [HF] \d+ mm/);
  assert.match(between, /1 to 2: [\d.]+ mm; supine at rest [\d.]+ mm/);
  await press(page, '2');
  await settled(page);
  await page.waitForFunction(() => location.hash.includes('prone') && location.hash.includes('probes='));
  const hash = await page.evaluate(() => location.hash);
  const { page: again } = await openLungs(html, {}, hash);
  await again.waitForFunction(() => document.querySelectorAll('#probes li').length === 2);
  const facts = (p) =>
    p.evaluate(() => [
      window.supine.state.gravity.map((v) => v.toFixed(6)),
      document.getElementById('probes').textContent,
      document.getElementById('depth-value').textContent,
    ]);
  assert.deepEqual(await facts(again), await facts(page));
  assert.ok(await again.locator('#link-trouble').isHidden());
  await close(again);
  await page.locator('#probes-clear').click();
}

/** Check that an idle page draws nothing, and that a changed page is drawn. */
async function checkFrames(page) {
  const [drawn, touched] = await page.evaluate(async () => {
    const { picture: p, touch } = window.supine;
    let count = 0;
    const draw = p.draw.bind(p);
    p.draw = (panes) => {
      ++count;
      draw(panes);
    };
    const frames = (n) =>
      new Promise((done) => {
        const next = () => (n-- > 0 ? requestAnimationFrame(next) : done());
        next();
      });
    await frames(3);
    count = 0;
    await frames(10);
    const idle = count;
    touch();
    await frames(3);
    delete p.draw;
    return [idle, count];
  });
  assert.equal(drawn, 0, 'drawn while idle');
  assert.ok(touched >= 1);
}

const { page, complaints } = await openLungs(html, { viewport: { width: 760, height: 480 } });
await checkViews(page);
await checkCamera(page);
await checkPostures(page);
await checkShown(page);
await checkWrongLinks(page);
await checkSides(page);
await checkProbes(page);
await checkFrames(page);
await press(page, '3');
await page.mouse.move(5, 5);
await checkLoss(page);
const bytes = await page.evaluate(async () =>
  Array.from(new Uint8Array(await (await window.supine.picturePng()).arrayBuffer()).slice(0, 8)),
);
assert.deepEqual(bytes, [0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]);
/* If the button `pin` is pressed while the patient turns, the posture at the end of the turn becomes the reference. */
const goal = await page.evaluate(() => {
  const { state, postureText, gravityOf, postureFrom } = window.supine;
  state.settle(postureFrom('prone').q, 0, 0.7);
  state.turning = { from: state.q, to: state.goal, time: 0.3, seconds: 9 };
  document.getElementById('pin').click();
  return postureText(gravityOf(state.pinnedQ));
});
assert.equal(goal, 'prone');
assert.deepEqual(
  complaints.filter((text) => !text.includes('CONTEXT_LOST')),
  [],
);
await close(page);
