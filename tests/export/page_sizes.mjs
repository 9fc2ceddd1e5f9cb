// SPDX-License-Identifier: GPL-3.0-or-later
// The page at four sizes in two themes: nothing is cut, a tap keeps a probe; pictures of each are kept
// in page_sizes/ beside the test.
import assert from 'node:assert/strict';
import { mkdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { browser, openLungs } from './browser.mjs';
import { folder, supine } from './support.mjs';

const mesh = join(folder, 'lungs.ply');
const basis = join(folder, 'lungs.safetensors');
const html = join(folder, 'lungs.html');
supine('phantom', '-o', mesh, '--vertices', '1500');
supine('precompute', mesh, '-o', basis);
supine('export', basis, '-o', html);
mkdirSync('page_sizes', { recursive: true });

const settled = (page) => page.evaluate(() => new Promise((done) => { requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done))); }));

const sizes = [[1400, 900], [900, 600], [844, 390], [390, 844]];
for (const [width, height] of sizes) {
  for (const colorScheme of ['light', 'dark']) {
    const touch = Math.min(width, height) < 400;
    const { page: sized, complaints: said } = await openLungs(html, { viewport: { width, height }, colorScheme, hasTouch: touch }, '#posture=left');
    assert.ok(await sized.evaluate(() => document.documentElement.scrollWidth <= innerWidth && [...document.querySelectorAll('#panel button, #panel input')].every((e) => { const b = e.getBoundingClientRect(); return b.width === 0 || (b.left >= 0 && b.right <= innerWidth + 0.5); })), `${width} x ${height}: something is cut`);
    if (touch) { // a tap keeps a probe and says what is there; dragging turns
      const box = await sized.locator('#picture').boundingBox();
      const azimuth = await sized.evaluate(() => window.supine.state.camera.azimuth);
      await sized.touchscreen.tap(box.x + box.width * 0.38, box.y + box.height * 0.48);
      await sized.waitForFunction(() => window.supine.state.probes.length === 1);
      assert.equal(await sized.evaluate(() => window.supine.state.camera.azimuth), azimuth);
    }
    await settled(sized);
    writeFileSync(join('page_sizes', `${width}x${height}-${colorScheme}.png`), await sized.screenshot());
    assert.deepEqual(said, []);
    await sized.close();
  }
}
await browser.close();
