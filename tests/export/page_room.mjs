// SPDX-License-Identifier: GPL-3.0-or-later
// The page in an emulated see-through headset (npm package iwer): a controller on the breastbone turns gravity and the
// lungs and carries them to its place, its trigger calibrates, and a panel has the sentence.
import assert from 'node:assert/strict';
import { existsSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { openLungs } from './browser.mjs';
import { html } from './lungs.mjs';

const emulator = join(process.env.MODULES, 'node_modules/iwer/build/iwer.min.js');
if (existsSync(emulator)) {
  const { page, complaints } = await openLungs(
    html,
    {
      viewport: { width: 760, height: 480 },
      init: {
        content: `${readFileSync(emulator, 'utf8')}
    window.headset = new IWER.XRDevice(IWER.metaQuest3);
    window.headset.installRuntime({ forceInstall: true });`,
      },
    },
    '#posture=supine',
  );
  await page.locator('#ar:not([hidden])').waitFor();
  await page.evaluate(() => {
    const {
      headset,
      supine: { picture },
    } = window;
    headset.position.set(0, 1.5, 0);
    headset.controllers.left.connected = false;
    const draw = picture.draw.bind(picture);
    picture.draw = (panes, framebuffer) => {
      window.drawn = panes;
      draw(panes, framebuffer);
    };
  });
  /** Put the controller on the breastbone; the columns of the rotation are its right, upper and backward directions. */
  const put = (q, place) =>
    page.evaluate(
      ([quaternion, at]) => {
        const { position, quaternion: turn } = window.headset.controllers.right;
        position.set(...at);
        turn.set(...quaternion);
      },
      [q, place],
    );
  const gravity = async (wanted, what) => {
    await page
      .waitForFunction((g) => Math.hypot(...window.supine.state.moment.gravity.map((x, i) => x - g[i])) < 0.02, wanted)
      .catch(async () => assert.fail(`${what}: ${await page.evaluate(() => window.supine.state.moment.gravity)}`));
  };
  const h = Math.SQRT1_2;
  await put([0, 0, 0, 1], [0, 1, -0.8]);
  await page.locator('#ar').click();
  await page.waitForFunction(() => window.drawn?.[0].note);
  await gravity([0, 1, 0], 'level, the head away from the viewer');
  await put([0, 0, 1, 0], [0, 1, -0.8]);
  await gravity([0, -1, 0], 'upside down');
  await put([0, 0, -h, h], [0, 1, -0.8]); // the upper side to the viewer's right
  await gravity([1, 0, 0], 'on the left side');
  await page.waitForFunction(() => /^Lying on the left side/.test(window.drawn[0].note.text));
  if (process.env.ROOM_PNG) await page.screenshot({ path: process.env.ROOM_PNG });
  await put([h, 0, 0, h], [0.2, 1.1, -0.6]); // forward is up
  await gravity([0, 0, -1], 'upright');

  /* The lungs are within 25 cm of the controller, and behind it as seen from the front. */
  const [near, behind] = await page.evaluate(() => {
    const {
      basis: { torso },
    } = window.supine;
    const m = window.drawn[0].toEye;
    const eye = [0, 1, 2].map((i) => m[12 + i] + torso.centre.reduce((sum, x, k) => sum + m[4 * k + i] * x, 0));
    const [x, y, z] = [0.2, 1.1 - 1.5, -0.6]; // the controller, seen from the head
    return [Math.hypot(eye[0] - x, eye[1] - y, eye[2] - z), eye[2] - z];
  });
  assert.ok(near > 0.05 && near < 0.25, `${near} m`);
  assert.ok(behind < -0.03, `${behind} m`); // upright and facing the viewer, who looks along -z

  /* A controller that lies 20 degrees askew is corrected by the trigger: the patient was supine before the session. */
  const a = (20 * Math.PI) / 360;
  await put([Math.sin(a), 0, 0, Math.cos(a)], [0, 1, -0.8]);
  await gravity([0, Math.cos(2 * a), -Math.sin(2 * a)], 'askew');
  await page.evaluate(() => window.headset.controllers.right.updateButtonValue('trigger', 1));
  await gravity([0, 1, 0], 'calibrated');
  await page.evaluate(() => window.headset.controllers.right.updateButtonValue('trigger', 0));
  await page.evaluate(() => document.getElementById('ar').click()); // the emulator's picture covers the button
  await page.waitForFunction(() => document.getElementById('ar').textContent === 'Enter AR');
  assert.deepEqual(complaints, []);
  await page.close();
} else {
  console.log('page_room: skipped: iwer is not installed: npm install in tests/export');
}
