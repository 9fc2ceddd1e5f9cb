// SPDX-License-Identifier: GPL-3.0-or-later
// The page in headless Chromium: it loads from disk without requests or errors, computes the positions of
// the C evaluator on the GPU, and its controls work.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { assertPicture, close, evaluateFor, openLungs as open, picture, press, settled } from './browser.mjs';
import { folder, largestDistance, randomDirections, randomSource, supine } from './support.mjs';

const TOLERANCE_MM = 0.02; // the page stores 16-bit numbers

/** Compare positions read back from the GPU with the C evaluator. */
async function checkPositions(page, basis, volume) {
  const random = randomSource(5);
  const pairs = randomDirections(10, 999).map((g) => [g, volume * (0.1 + 0.9 * random())]);
  const [{ xyz: rest }, ...truth] = await evaluateFor(page, basis, [[[0, 1, 0], 0], ...pairs]);
  let worst = 0;
  for (const [i, [g, mL]] of pairs.entries()) {
    const found = await page.evaluate(
      ([gravity, depth]) => Array.from(window.supine.positions(gravity, depth)),
      [g, mL],
    );
    worst = Math.max(worst, largestDistance(found, truth[i].xyz));
    assert.ok(largestDistance(found, rest) > 0.5, 'the lungs did not move, so nothing was tested');
  }
  assert.ok(worst < TOLERANCE_MM, `${worst} mm off`);
  console.log(`positions: ${worst.toExponential(2)} mm`);
}

/** Check that postures, drags, sliders and keys change the picture. */
async function checkControls(page) {
  let before = await picture(page);
  const changes = async (what, act) => {
    await act();
    const after = await picture(page);
    assert.ok(!after.equals(before), `${what} changed nothing`);
    before = after;
  };
  await assertPicture(page, before, 'the picture changes by itself');
  await changes('the posture button', () => page.getByRole('button', { name: 'Prone' }).click());
  await page.waitForFunction(() => document.getElementById('posture-name').value === 'prone');
  const drag = async (selector, dx, dy) => {
    const box = await page.locator(selector).boundingBox();
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + dx, y + dy, { steps: 4 });
    await page.mouse.up();
    await page.mouse.move(5, 5);
  };
  await changes('dragging the picture', () => drag('#picture', 90, 30));
  await changes('dragging the silhouette', () => drag('#patient', 30, 10));
  await changes('the tilt slider', () => page.locator('#tilt').fill('30'));
  await changes('the volume slider', () => page.locator('#depth').fill('900'));
  await changes('a key', () => press(page, '5'));
  await page.waitForFunction(() => document.getElementById('posture-name').value === 'upright');
  await changes('difference', () => page.locator('[name=kind][value=difference]').check({ force: true }));
  await changes('pinning', () => page.getByRole('button', { name: 'Use as the other posture' }).click());
  await changes('another key', () =>
    press(page, '3'),
  ); /* left side, because the room changes nothing in the picture of an upright patient */
  await changes('room', async () => {
    await page.locator('[name=frame][value=room]').check({ force: true });
    await page.waitForFunction(() => window.supine.state.roomBlend > 0.99);
  });
  await changes('the breath', async () => {
    await page.locator('#play').click();
    await page.waitForFunction(() => window.supine.state.depth < 300);
    await page.locator('#play').click();
  });
  await changes('light and dark', async () => {
    await page.locator('[name=kind][value=displacement]').check({ force: true });
    await page.locator('#theme').click();
  });
}

/** Check that the value at the pointer is within the range of displacements on the surface. */
async function checkPointer(page) {
  const box = await page.locator('#picture').boundingBox();
  for (const [x, y] of [
    [0.36, 0.5],
    [0.4, 0.45],
    [0.62, 0.5],
    [0.3, 0.5],
  ]) {
    await page.mouse.move(box.x + box.width * x, box.y + box.height * y);
    await settled(page);
    await page.waitForFunction(() => !window.supine.picture.picking);
    await settled(page);
    if (await page.locator('#pointed').isVisible()) {
      const value = parseFloat(await page.locator('#pointed strong').textContent());
      const [low, high] = await page.evaluate(() => {
        const { gravity, depth } = window.supine.state;
        const [rest, moved] = [window.supine.positions(gravity, 0), window.supine.positions(gravity, depth)];
        const lengths = [];
        for (let i = 0; i < rest.length; i += 3)
          lengths.push(Math.hypot(moved[i] - rest[i], moved[i + 1] - rest[i + 1], moved[i + 2] - rest[i + 2]));
        return [Math.min(...lengths), Math.max(...lengths)];
      });
      assert.ok(value >= low - 0.01 && value <= high + 0.01, `${value} is not within ${low} and ${high}`);
      return;
    }
  }
  assert.fail('no lung was found under the pointer');
}

const mesh = join(folder, 'page.ply');
const bases = ['modes', 'harmonics'].map((name) => join(folder, `${name}.safetensors`));
supine('phantom', '-o', mesh, '--vertices', '2000');
supine('precompute', mesh, '--law', 'paper', '-o', bases[0]);
supine('precompute', mesh, '--law', 'paper', '-o', bases[1], '--band', '3', '--modes', 'harmonics');
const html = join(folder, 'page.html');

supine('export', bases[0], '-o', html, '--title', 'Lungs </title><script>alert("1")</script> & "more"');
const { page, complaints } = await open(html);
assert.equal(await page.title(), 'Lungs </title><script>alert("1")</script> & "more"');
await checkPositions(page, bases[0], 700);
await checkPointer(page);
await checkControls(page);
assert.deepEqual(complaints, []);
await close(page);

supine('export', bases[1], '-o', html);
const dark = await open(html, { colorScheme: 'dark', viewport: { width: 400, height: 780 } });
assert.equal(await dark.page.evaluate(() => document.documentElement.dataset.theme), 'dark');
await checkPositions(dark.page, bases[1], 700);
assert.ok(await dark.page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), 'too wide for a phone');
assert.deepEqual(dark.complaints, []);
await close(dark.page);
