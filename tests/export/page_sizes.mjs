// SPDX-License-Identifier: GPL-3.0-or-later
// Test the page at four sizes in two themes: nothing is cut off, orientation letters (L, R, ...) do not overlap, and a tap
// marks a point. Pictures are kept in the folder page_sizes of the working folder.
import assert from 'node:assert/strict';
import { mkdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { close, openLungs, press, settled } from './browser.mjs';
import { html } from './lungs.mjs';

mkdirSync('page_sizes', { recursive: true });

/** Check that orientation letters (L, R, ...) do not overlap panels, the arrow of gravity or each other. */
async function checkLetters(page, what) {
  const { letters, plates, arrow } = await page.evaluate(() => {
    const middle = (box) => [box.x + box.width / 2, box.y + box.height / 2];
    const stage = document.getElementById('picture').getBoundingClientRect();
    const pane = window.supine.panes()[0];
    const onScreen = ([x, y, z]) => {
      const m = pane.toEye;
      const eye = [0, 1, 2].map((i) => m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i]);
      const ndc = [0, 1].map((i) => (pane.projection[5 * i] * eye[i]) / -eye[2]);
      return [stage.x + ((ndc[0] + 1) / 2) * stage.width, stage.y + ((1 - ndc[1]) / 2) * stage.height];
    };
    return {
      letters: [...document.querySelectorAll('.letter:not([hidden])')].map((e) => ({ letter: e.textContent, at: middle(e.getBoundingClientRect()) })),
      plates: ['legend', 'ball'].map((id) => { const { left, right, top, bottom } = document.getElementById(id).getBoundingClientRect(); return { id, left, right, top, bottom }; }),
      arrow: pane.arrowEnds.map(onScreen),
    };
  });
  const apart = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
  const fromArrow = (at) => Math.min(...Array.from({ length: 41 }, (_, i) => apart(at, arrow[0].map((x, k) => x + (i / 40) * (arrow[1][k] - x)))));
  assert.ok(letters.length >= 4, `${what}: ${letters.length} letters`);
  letters.forEach(({ letter, at }, i) => {
    for (const { id, left, right, top, bottom } of plates) {
      assert.ok(at[0] < left - 11 || at[0] > right + 11 || at[1] < top - 11 || at[1] > bottom + 11, `${what}: ${letter} is on the ${id}`);
    }
    assert.ok(fromArrow(at) > 20, `${what}: ${letter} is on the arrow`);
    for (const other of letters.slice(i + 1)) assert.ok(apart(at, other.at) > 20, `${what}: ${letter} is on ${other.letter}`);
  });
}

for (const [width, height] of [[1400, 900], [900, 600], [844, 390], [390, 844]]) {
  const touch = Math.min(width, height) < 400;
  const { page, complaints } = await openLungs(html, { viewport: { width, height }, ...(touch && { hasTouch: true }) }, '#posture=left');
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth && [...document.querySelectorAll('#panel button, #panel input')].every((e) => { const b = e.getBoundingClientRect(); return b.width === 0 || (b.left >= 0 && b.right <= innerWidth + 0.5); })), `${width} x ${height}: something is cut`);
  if (touch) { // a tap marks a point of the picture, and does not turn the camera
    const box = await page.locator('#picture').boundingBox();
    const azimuth = await page.evaluate(() => window.supine.state.camera.azimuth);
    await page.touchscreen.tap(box.x + box.width * 0.48, box.y + box.height * 0.36);
    await page.waitForFunction(() => window.supine.state.probes.length === 1);
    assert.equal(await page.evaluate(() => window.supine.state.camera.azimuth), azimuth);
  }
  for (const key of ['1', '4', '5', '3']) {
    await press(page, key);
    await settled(page);
    await checkLetters(page, `${width} x ${height}, posture ${key}`);
  }
  for (const theme of ['light', 'dark']) {
    writeFileSync(join('page_sizes', `${width}x${height}-${theme}.png`), await page.screenshot());
    await page.evaluate(() => document.getElementById('theme').click());
    await settled(page);
  }
  assert.deepEqual(complaints, []);
  await close(page);
}
