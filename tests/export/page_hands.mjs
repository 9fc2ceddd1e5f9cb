// SPDX-License-Identifier: GPL-3.0-or-later
// Test the page with pointer, touch and keyboard: every key and button works, numbers can be typed, probes (marked
// points with their displacement) show what the library computes, the arrow of gravity is visible from all sides, a
// breath has the right duration, and a lost WebGL context is restored with camera, posture and probes.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { checkLoss, close, evaluateFor, openLungs, orderOf, picture, press, settled } from './browser.mjs';
import { basis, html } from './lungs.mjs';
import { folder, inOrder, supine } from './support.mjs';

const PROBE_MM = 0.06; // tolerance of displacements at marked points: the page shows one decimal
const state = (page, name) => page.evaluate((key) => window.supine.state[key], name);

/** Check that keys have their documented effect, and that a second press or the opposite key undoes
 * it. */
async function checkKeys(page) {
  await page.locator('#picture').focus();
  const press = async (...keys) => {
    for (const key of keys) await page.keyboard.press(key);
    await settled(page);
  };
  for (const [key, name] of [
    ['g', 'ghost'],
    ['w', 'wires'],
    ['b', 'beside'],
    ['s', 'room'],
  ]) {
    await press(key);
    assert.equal(await state(page, name), true, key);
    await press(key);
    assert.equal(await state(page, name), false, key);
  }
  for (const kind of ['difference', 'expansion', 'plain', 'displacement']) {
    await press('c');
    assert.equal(await state(page, 'kind'), kind);
  }
  for (const [key, posture] of [
    ['1', 'supine'],
    ['2', 'prone'],
    ['3', 'left'],
    ['4', 'right'],
    ['5', 'upright'],
    ['6', 'supine+15'],
  ]) {
    await press(key);
    assert.equal(await page.locator('#posture-name').inputValue(), posture);
  }
  await press('n');
  assert.match(await page.locator('#pinned').textContent(), /supine, head 15 degrees down/);
  await press('1', 'n');
  const camera = await state(page, 'camera');
  await press('ArrowLeft', 'ArrowUp', '+', 'Shift+ArrowRight');
  const turned = await state(page, 'camera');
  assert.ok(
    turned.azimuth < camera.azimuth &&
      turned.elevation < camera.elevation &&
      turned.zoom > camera.zoom &&
      turned.pan[0] !== camera.pan[0],
  );
  await press('0');
  assert.deepEqual(await state(page, 'camera'), camera);
  await press(' ');
  assert.equal(await state(page, 'playing'), true);
  await press(' ');
  assert.equal(await state(page, 'playing'), false);
}

/** Check the buttons of views, the double click, full screen, and saving the picture. */
async function checkButtons(page) {
  for (const [letter, azimuth, elevation] of [
    ['A', 0, 0],
    ['P', Math.PI, 0],
    ['L', -Math.PI / 2, 0],
    ['R', Math.PI / 2, 0],
    ['H', 0, Math.PI / 2],
    ['F', 0, -Math.PI / 2],
  ]) {
    await page.locator('#views button').filter({ hasText: letter }).click();
    const { azimuth: a, elevation: e } = await state(page, 'camera');
    assert.deepEqual([a, e], [azimuth, elevation], letter);
  }
  await page.locator('#views button').filter({ hasText: 'A' }).click();
  await settled(page);
  const box = await page.locator('#picture').boundingBox();
  await page.mouse.dblclick(box.x + box.width * 0.36, box.y + box.height * 0.5);
  await page.waitForFunction(() => window.supine.state.camera.pivot !== null);
  await settled(page);
  const off = await page.evaluate(() => {
    // distance of the pivot from the centre of the picture, mm
    const { toEye: m } = window.supine.panes()[0];
    const { pivot } = window.supine.state.camera;
    return [0, 1].map((i) => m[i] * pivot[0] + m[4 + i] * pivot[1] + m[8 + i] * pivot[2] + m[12 + i]);
  });
  assert.ok(Math.hypot(...off) < 1e-3, `the pivot is ${off} mm off`);
  assert.equal((await state(page, 'probes')).length, 0, 'a double click leaves a probe');
  await page.locator('#reset').click();
  const [download] = await Promise.all([page.waitForEvent('download'), page.locator('#save').click()]);
  const png = readFileSync(await download.path());
  assert.deepEqual([...png.subarray(0, 4)], [0x89, 0x50, 0x4e, 0x47]);
  assert.match(download.suggestedFilename(), /\.png$/);
  await page.locator('#full').click();
  await page.waitForFunction(() => document.fullscreenElement !== null);
  await page.locator('#full').click();
  await page.waitForFunction(() => document.fullscreenElement === null);
}

/** Check that typed numbers are taken, and that wrong ones are told beside their field, with what is right; the field
 * then shows the number of the picture. */
async function checkTyped(page) {
  const type = async (id, text) => {
    await page.locator(id).fill(text);
    await page.keyboard.press('Enter');
    await settled(page);
  };
  await type('#depth-number', '123');
  assert.equal(await state(page, 'depth'), 123);
  await type('#tilt-number', '-20');
  assert.equal(await page.locator('#posture-name').inputValue(), 'supine-20');
  await type('#tilt-number', '0');
  await type('#rate-number', '15');
  assert.equal(await state(page, 'rate'), 15);
  const { depthMax, tidalMin, tidalMax } = await page.evaluate(() => window.supine.state);
  const limits = (...ends) => ends.map((x) => String(Number(x.toFixed(1)))).join(' to ');
  for (const [id, text, wants, shown] of [
    ['#tilt-number', '400', '\u221290 to 90', '0'],
    ['#depth-number', '9000', limits(0, depthMax), '123'],
    ['#tidal-number', '1', limits(tidalMin, tidalMax), '500'],
    ['#rate-number', '', '4 to 40', '15'],
    ['#range-begin', '1e9', /a number below \d+/, null],
    ['#range-end', '-1', /a number above 0/, null],
  ]) {
    const before = await page.locator(id).inputValue();
    await type(id, text);
    const told = await page.locator(`${id}-trouble`).textContent();
    const named = await page.locator(id).getAttribute('aria-label');
    assert.ok(told.startsWith(`${named} ${text && `\u201c${text}\u201d `}is not taken: give `), told);
    assert.ok(typeof wants === 'string' ? told.includes(` give ${wants}. `) : wants.test(told), told);
    assert.equal(await page.locator(id).inputValue(), shown ?? before);
    assert.ok(told.endsWith(` Taken instead: ${shown ?? before}.`), told);
    assert.equal(await page.locator(id).getAttribute('aria-invalid'), 'true');
    await type(id, shown ?? before);
    assert.ok(await page.locator(`${id}-trouble`).isHidden(), `${id} stays wrong`);
  }
  await page.locator('#range-auto').click();
  await type('#tidal-number', '');
  await page.locator('#tidal-number').blur();
  await page.locator('#depth').fill('500');
  await settled(page);
  assert.equal(await page.locator('#tidal-number').inputValue(), '500');
  await type('#range-begin', '5');
  await type('#range-end', '25');
  assert.deepEqual(
    await page.evaluate(() => [window.supine.state.range.begin, window.supine.state.range.end]),
    [5, 25],
  );
  assert.deepEqual(
    await page.evaluate(() => [...document.querySelectorAll('#ticks span')].map((tick) => tick.textContent)),
    ['5', '10', '15', '20', '25'],
  );
  await page.locator('#range-auto').click();
  await page.evaluate(() => document.activeElement.blur());
}

/** Check the displacements of marked points and the distances between them against the library. */
async function checkProbes(page) {
  await press(page, '2');
  await settled(page);
  const box = await page.locator('#picture').boundingBox();
  for (const [i, [x, y]] of [
    [0.38, 0.5],
    [0.62, 0.55],
  ].entries()) {
    await page.mouse.click(box.x + box.width * x, box.y + box.height * y);
    await page.waitForFunction((n) => window.supine.state.probes.length > n, i);
  }
  await page.mouse.move(5, 5);
  await settled(page);
  const [probes, lines, between, names] = await page.evaluate(() => {
    const { state: s, basis: b } = window.supine;
    return [
      s.probes,
      [...document.querySelectorAll('#probes li span')].map((e) => e.textContent),
      document.getElementById('probes-text').textContent,
      s.probes.map((v) => b.lungNames[b.lungBegin.findLastIndex((begin) => v >= begin)]),
    ];
  });
  const depth = await state(page, 'depth');
  const [now, rest] = await evaluateFor(page, basis, [
    [[0, -1, 0], depth],
    [[0, 1, 0], 0],
  ]);
  const at = ({ xyz }, v) => Array.from(xyz.slice(3 * v, 3 * v + 3));
  const apart = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));
  probes.forEach((v, i) => {
    const [, number, lung, mm] = /^(\d)  (left lung|right lung)  ([\d.]+) mm/.exec(lines[i]);
    assert.equal(Number(number), i + 1);
    assert.equal(lung, names[i]);
    assert.ok(
      Math.abs(Number(mm) - apart(at(now, v), at(rest, v))) < PROBE_MM,
      `${lines[i]}, not ${apart(at(now, v), at(rest, v))}`,
    );
  });
  const [, distance, before] = /1 to 2: ([\d.]+) mm; supine at rest ([\d.]+) mm/.exec(between);
  assert.ok(Math.abs(Number(distance) - apart(at(now, probes[0]), at(now, probes[1]))) < PROBE_MM);
  assert.ok(Math.abs(Number(before) - apart(at(rest, probes[0]), at(rest, probes[1]))) < PROBE_MM);
}

/** Check that after the loss of the WebGL context the picture is the same in every pixel, with
 * marked points, a turned camera and a reference posture. */
async function checkLossOfState(page) {
  await press(page, '3');
  await page.evaluate(() => {
    document.getElementById('pin').click();
    document.getElementById('beside').click();
  });
  await page.keyboard.press('ArrowLeft');
  await press(page, '2');
  const facts = () =>
    page.evaluate(() => [
      window.supine.state.camera,
      window.supine.state.probes,
      window.supine.state.pinnedQ,
      window.supine.state.q,
      document.getElementById('probes').textContent,
    ]);
  await picture(page); // until the turn has ended
  const told = await facts();
  await checkLoss(page);
  assert.deepEqual(await facts(), told);
  await page.locator('#beside').uncheck();
  await page.locator('#probes-clear').click();
}

/** Check that the program reads a direction as the page writes it. */
async function checkNotation(page) {
  const order = await orderOf(page, basis);
  for (const gravity of [
    [0.6, 0, -0.8],
    [0, 0.9659258, 0.258819],
    [0, -0.9396926, 0.3420201],
    [0, 0, -1],
  ]) {
    const text = await page.evaluate((g) => window.supine.postureText(g), gravity);
    const moved = join(folder, 'moved.obj');
    supine('deform', basis, '--posture', text, '--volume', 'rest+200', '-o', moved);
    const said = [...readFileSync(moved, 'utf8').matchAll(/^v (\S+) (\S+) (\S+)/gm)].flatMap(([, ...v]) =>
      v.map(Number),
    );
    const found = await page.evaluate((g) => Array.from(window.supine.positions(g, 200)), gravity);
    const worst = inOrder(Float64Array.from(said), order).reduce(
      (most, x, i) => Math.max(most, Math.abs(x - found[i])),
      0,
    );
    // If the direction of gravity changes by a degree, lungs move by more
    assert.ok(worst < 0.05, `${text}: ${worst} mm`);
  }
}

/** Check touch: dragging with one finger rotates and marks no point of the picture; two fingers zoom and pan. */
async function checkTouch() {
  const { page, complaints } = await openLungs(html, {
    viewport: { width: 390, height: 844 },
    hasTouch: true,
    isMobile: true,
  });
  const cdp = await page.context().newCDPSession(page);
  const box = await page.locator('#picture').boundingBox();
  const middle = [box.x + box.width / 2, box.y + box.height / 2];
  const touch = (type, points) =>
    cdp.send('Input.dispatchTouchEvent', { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
  const before = await state(page, 'camera');
  await touch('touchStart', [middle]);
  for (let i = 1; i <= 5; ++i) await touch('touchMove', [[middle[0] + 16 * i, middle[1]]]);
  await touch('touchEnd', []);
  await settled(page);
  const dragged = await state(page, 'camera');
  assert.ok(dragged.azimuth > before.azimuth + 0.3, 'a drag does not rotate the camera');
  assert.equal((await state(page, 'probes')).length, 0, 'a drag keeps a probe');
  const two = (gap, shift) => [
    [middle[0] - gap + shift, middle[1]],
    [middle[0] + gap + shift, middle[1]],
  ];
  await touch('touchStart', two(30, 0));
  for (let i = 1; i <= 5; ++i) await touch('touchMove', two(30 + 8 * i, 4 * i));
  await touch('touchEnd', []);
  await settled(page);
  const pinched = await state(page, 'camera');
  assert.ok(pinched.zoom > 1.5 * dragged.zoom && pinched.pan[0] > dragged.pan[0], JSON.stringify(pinched));
  assert.equal(pinched.azimuth, dragged.azimuth);
  /* Dragging the silhouette with one finger turns the patient. */
  const ball = await page.locator('#patient').boundingBox();
  const gravity = await page.evaluate(() => window.supine.state.gravity);
  await touch('touchStart', [[ball.x + 20, ball.y + 20]]);
  for (let i = 1; i <= 4; ++i) await touch('touchMove', [[ball.x + 20 + 6 * i, ball.y + 20]]);
  await touch('touchEnd', []);
  const after = await page.evaluate(() => window.supine.state.gravity);
  assert.ok(Math.hypot(...after.map((x, i) => x - gravity[i])) > 0.1, 'the silhouette does not turn the patient');
  assert.deepEqual(complaints, []);
  await close(page);
}

/** Check that an animated change of posture ends in the right posture, and that slow frames do not slow the breath: it
 * advances by the time between frames. */
async function checkMotion() {
  const { page, complaints } = await openLungs(html, {
    viewport: { width: 840, height: 630 },
    reducedMotion: 'no-preference',
  });
  const frames = await page.evaluate(
    () =>
      new Promise((done) => {
        const { state: s, picture: p } = window.supine;
        const deform = p.deform.bind(p);
        const seen = [];
        p.deform = (name, moment) => {
          if (name === 'now') seen.push(moment.gravity);
          deform(name, moment);
        };
        document.querySelector('[data-posture=prone]').click();
        const wait = () =>
          s.turning
            ? requestAnimationFrame(wait)
            : requestAnimationFrame(() => requestAnimationFrame(() => done(seen)));
        requestAnimationFrame(wait);
      }),
  );
  assert.ok(frames.length >= 1);
  assert.ok(
    Math.hypot(frames.at(-1)[0], frames.at(-1)[1] + 1, frames.at(-1)[2]) < 1e-9,
    `the turn ends at ${frames.at(-1)}`,
  );
  const [told, clock, phases] = await page.evaluate(
    () =>
      new Promise((done) => {
        const { state: s } = window.supine;
        const advance = s.advance.bind(s);
        let [sum, begin, first, count] = [0, NaN, NaN, 0];
        s.advance = (seconds) => {
          sum += seconds;
          return advance(seconds);
        };
        document.getElementById('play').click();
        const next = (now) => {
          // called after the page's callback for the same frame, with the same time
          if (count === 2) [begin, sum, first] = [now, 0, s.phase];
          if (++count === 8) {
            done([sum, (now - begin) / 1000, [first, s.phase, s.rate]]);
            return;
          }
          const until = performance.now() + 150; // makes frames take 150 ms
          while (performance.now() < until);
          requestAnimationFrame(next);
        };
        requestAnimationFrame(next);
      }),
  );
  assert.ok(clock > 0.7 && Math.abs(told - clock) < 1e-6, `${told} s of ${clock}`);
  const went = (phases[1] - phases[0] + 1) % 1;
  assert.ok(Math.abs(went - (((clock * phases[2]) / 60) % 1)) < 1e-6, `the breath advanced by ${went}`);
  assert.deepEqual(complaints, []);
  await close(page);
}

/** Check for each quantity that the value at the pointer is within the range of values around
 * it. */
async function checkKinds(page) {
  await press(page, '1');
  await press(page, 'n');
  await press(page, '2');
  await press(page, 'a');
  await settled(page);
  const [now, pinned, rest, corners] = await page.evaluate(() => {
    const { state: s, positions, basis: b } = window.supine;
    return [positions(s.gravity, s.depth), positions([0, 1, 0], s.depth), positions([0, 1, 0], 0), b.corners].map(
      (list) => Array.from(list),
    );
  });
  const point = (list, v) => list.slice(3 * v, 3 * v + 3);
  const apart = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));
  const area = (list, t) => {
    const [a, b, c] = [0, 1, 2].map((i) => point(list, corners[t + i]));
    const [u, v] = [b.map((x, i) => x - a[i]), c.map((x, i) => x - a[i])];
    return Math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]);
  };
  const vertices = (place, far) =>
    Array.from({ length: now.length / 3 }, (_, v) => v).filter((v) => apart(point(now, v), place) < far);
  const kinds = {
    displacement: (place) => vertices(place, 24).map((v) => apart(point(now, v), point(rest, v))),
    difference: (place) => vertices(place, 24).map((v) => apart(point(now, v), point(pinned, v))),
    expansion: (place) =>
      Array.from({ length: corners.length / 3 }, (_, i) => 3 * i)
        .filter((t) => apart(point(now, corners[t]), place) < 30)
        .map((t) => 100 * (area(now, t) / area(rest, t) - 1)),
  };
  const box = await page.locator('#picture').boundingBox();
  for (const [kind, around] of Object.entries(kinds)) {
    await page.locator(`[name=kind][value=${kind}]`).check();
    for (const [x, y] of [
      [0.4, 0.5],
      [0.6, 0.52],
    ]) {
      await page.mouse.move(box.x + box.width * x, box.y + box.height * y);
      await settled(page);
      await page.waitForFunction(() => !window.supine.picture.picking);
      await settled(page);
      const text = (await page.locator('#pointed').textContent()).replace('\u2212', '-');
      const [, value, ends, l, p, h] =
        /^(-?[\d.]+) (?:mm|%)(?:left|right) lung {3}(([LR] \d+) {2}([PA] \d+) {2}([HF] \d+)) mm$/.exec(text);
      assert.ok(ends);
      const place = [l, p, h].map((part) => ('LPH'.includes(part[0]) ? 1 : -1) * Number(part.slice(2)));
      const values = around(place);
      assert.ok(values.length >= 3, `nothing is near ${place}`);
      const [low, high] = [Math.min(...values), Math.max(...values)];
      assert.ok(
        Number(value) >= low - 0.2 && Number(value) <= high + 0.2,
        `${kind} at ${place}: ${value}, not within ${low} and ${high}`,
      );
    }
  }
  await page.locator('[name=kind][value=displacement]').check();
  await page.mouse.move(5, 5);
}

/** Check that text over the lungs has a background of its own with enough contrast. */
async function checkLegible(page) {
  for (const theme of ['light', 'dark']) {
    await page.evaluate((name) => {
      if (document.documentElement.dataset.theme !== name) document.getElementById('theme').click();
    }, theme);
    await settled(page);
    const worst = await page.evaluate(() => {
      const channels = (text) => (/[\d.]+/.test(text) ? text.match(/[\d.]+/g).map(Number) : [0, 0, 0, 0]);
      const luminance = ([r, g, b]) => {
        const [x, y, z] = [r, g, b].map((c) =>
          c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4,
        );
        return 0.2126 * x + 0.7152 * y + 0.0722 * z;
      };
      const texts = [...document.getElementById('stage').querySelectorAll('*')].filter(
        (e) => [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim()) && e.checkVisibility(),
      );
      return texts.map((element) => {
        let ground = element;
        while (ground && !((channels(getComputedStyle(ground).backgroundColor)[3] ?? 1) > 0.5))
          ground = ground.parentElement;
        if (!ground) return [element.id || element.className, 0];
        const [r, g, b, alpha = 1] = channels(getComputedStyle(ground).backgroundColor);
        const ink = luminance(channels(getComputedStyle(element).color));
        const ratios = [0, 255].map((behind) => {
          // contrast of the text if black or white lungs are behind its background
          const paper = luminance([r, g, b].map((c) => alpha * c + (1 - alpha) * behind));
          return (Math.max(ink, paper) + 0.05) / (Math.min(ink, paper) + 0.05);
        });
        return [element.id || element.className || element.tagName, Math.min(...ratios)];
      });
    });
    assert.ok(worst.length >= 6);
    assert.deepEqual(
      worst.filter(([, ratio]) => ratio < 4.5),
      [],
      theme,
    );
  }
  await page.evaluate(() => {
    if (document.documentElement.dataset.theme !== 'light') document.getElementById('theme').click();
  });
}

/** Check that the disclaimer is shown, that details are folded, and that reduced motion turns off
 * the animation. */
async function checkWords(page) {
  assert.match(await page.locator('#title').textContent(), /not for diagnosis/);
  const behind = await page.evaluate(() =>
    [...document.querySelectorAll('dl#facts dd')].map((e) => [e.textContent, e.closest('details').open]),
  );
  assert.ok(behind.some(([text]) => /modes of band/.test(text)) && behind.every(([, open]) => !open));
  const { page: still } = await openLungs(html, { viewport: { width: 840, height: 630 } });
  await still.locator('[data-posture=prone]').click();
  assert.equal(
    await still.evaluate(() => window.supine.state.turning),
    null,
    'it is animated in spite of reduced motion',
  );
  await close(still);
}

const { page, complaints } = await openLungs(html, { viewport: { width: 840, height: 630 } });
for (const check of [
  checkKeys,
  checkButtons,
  checkTyped,
  checkProbes,
  checkLossOfState,
  checkNotation,
  checkWords,
  checkKinds,
  checkLegible,
]) {
  await check(page);
  console.log(check.name);
}
assert.deepEqual(
  complaints.filter((text) => !text.includes('CONTEXT_LOST')),
  [],
);
await close(page);
await checkTouch();
await checkMotion();
