// SPDX-License-Identifier: GPL-3.0-or-later
// Give each text to an input of a page, and print the verdicts as JSON: page_door.mjs PAGE '[["posture", TEXT], ...]'.
// The inputs are the name of the posture, the number beside the volume, and the posture and the volume of a link.
import { browser, close, openLungs } from './browser.mjs';

const { page } = await openLungs(process.argv[2]);

async function enterPosture(text) {
  await page.locator('#posture-name').fill(text);
  await page.locator('#posture-name').press('Enter');
  const trouble = page.locator('#posture-trouble');
  return (await trouble.isVisible()) ? ['refused', await trouble.textContent()] : ['taken', ''];
}

/** Type a number; the field shows another if it is out of range. */
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
  const shown = await field.inputValue();
  return Number(shown) === Number(text) ? ['taken', ''] : ['told', `the field shows ${shown}`];
}

/** Follow a link; what it gives must be shown, or a message. */
async function follow(text) {
  await enterPosture('supine'); // takes an older message away
  await page.evaluate((link) => {
    location.hash = link;
  }, text);
  const trouble = page.locator('#posture-trouble');
  return (await trouble.isVisible()) ? ['refused', await trouble.textContent()] : ['taken', ''];
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
