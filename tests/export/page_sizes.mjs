// SPDX-License-Identifier: GPL-3.0-or-later
// Test the page at five sizes in two themes: nothing is cut off, cards do not move when another posture
// is chosen, and a tap marks a point. Pictures are kept in the folder
// tests/page_sizes of the build folder.
import assert from 'node:assert/strict';
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { assertUncut, close, openLungs, press, settled } from './browser.mjs';
import { html } from './lungs.mjs';
import { pictureFolder } from './support.mjs';

const pictures = pictureFolder('page_sizes');

for (const [width, height] of [
  [1400, 900],
  [900, 600],
  [2560, 1440],
  [844, 390],
  [390, 844],
]) {
  const touch = Math.min(width, height) < 400;
  const { page, complaints } = await openLungs(
    html,
    { viewport: { width, height }, ...(touch && { hasTouch: true }) },
    '#posture=left',
  );
  await assertUncut(page, '#panel button, #panel input', `${width} x ${height}`);
  if (touch) {
    // a tap marks a point of the picture, and does not turn the camera
    const box = await page.locator('#picture').boundingBox();
    const azimuth = await page.evaluate(() => window.supine.state.camera.azimuth);
    await page.touchscreen.tap(box.x + box.width * 0.48, box.y + box.height * 0.36);
    await page.waitForFunction(() => window.supine.state.probes.length === 1);
    assert.equal(await page.evaluate(() => window.supine.state.camera.azimuth), azimuth);
  }
  let cards = null; // top and height of the cards, px
  for (const key of ['1', '4', '5', '3']) {
    await press(page, key);
    await settled(page);
    const { y, height: tall } = await page.locator('#cards').boundingBox();
    assert.ok(
      !cards || (Math.abs(y - cards.y) < 60 && tall === cards.tall),
      `${width} x ${height}, posture ${key}: the cards move`,
    );
    cards = { y, tall };
  }
  for (const theme of ['light', 'dark']) {
    writeFileSync(join(pictures, `${width}x${height}-${theme}.png`), await page.screenshot());
    await page.evaluate(() => document.getElementById('theme').click());
    await settled(page);
  }
  assert.deepEqual(complaints, []);
  await close(page);
}
