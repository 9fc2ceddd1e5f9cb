// SPDX-License-Identifier: GPL-3.0-or-later
// Give each text to an input of a page, and print the verdicts as JSON: page_door.mjs PAGE '[["posture", TEXT], ...]'.
// The inputs are the name of the posture, the number beside the volume, and the posture and the volume of a link.
import assert from 'node:assert/strict';
import { browser, close, openLungs } from './browser.mjs';

const { page } = await openLungs(process.argv[2]);

/** Return the verdict of the page: refused if it says what is wrong. */
async function said(note, isOther) {
  const trouble = page.locator(note);
  if (await trouble.isVisible()) return ['refused', await trouble.textContent()];
  return isOther ? ['told', ''] : ['taken', ''];
}

async function enterPosture(text) {
  await page.locator('#posture-name').fill(text);
  await page.locator('#posture-name').press('Enter');
  return said('#posture-name-trouble');
}

/** Type a number; a wrong one is told beside the field, which then shows the number of the picture. */
async function enterVolume(text) {
  const field = page.locator('#depth-number');
  try {
    await field.fill(text);
  } catch (error) {
    return ['refused', error.message.split('\n')[0]];
  }
  await field.press('Enter');
  await field.blur();
  await page.evaluate(() => new Promise((shown) => requestAnimationFrame(() => requestAnimationFrame(shown))));
  const [shown, depth] = [Number(await field.inputValue()), await page.evaluate(() => window.supine.state.depth)];
  assert.equal(shown, Math.round(depth));
  return said('#depth-number-trouble', shown !== Number(text));
}

/** Follow a link; what it gives must be shown, or a message. */
async function follow(text) {
  await page.evaluate((link) => {
    const followed = new Promise((done) => {
      addEventListener('hashchange', done, { once: true });
    });
    location.hash = `${link}&colour=${location.hash.includes('colour=plain') ? 'displacement' : 'plain'}`; // changes it
    return followed;
  }, text);
  return said('#link-trouble');
}

const enter = {
  posture: enterPosture,
  above: enterVolume,
  link: (text) => follow(`posture=${encodeURIComponent(text)}`),
  linked: (text) => follow(`depth=${encodeURIComponent(text)}`),
};
const verdicts = [];
for (const [input, text] of JSON.parse(process.argv[3])) verdicts.push(await enter[input](text));
console.log(JSON.stringify(verdicts));
await close(page);
await browser.close();
