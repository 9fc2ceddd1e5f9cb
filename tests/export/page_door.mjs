// SPDX-License-Identifier: GPL-3.0-or-later
// Type each of the given texts as the posture of a page, and print the verdicts as JSON: page_door.mjs PAGE TEXT...
import { browser, close, openLungs } from './browser.mjs';

const { page } = await openLungs(process.argv[2]);
const verdicts = [];
for (const text of process.argv.slice(3)) {
  await page.locator('#posture-name').fill(text);
  await page.locator('#posture-name').press('Enter');
  const trouble = page.locator('#posture-trouble');
  verdicts.push(await trouble.isVisible() ? ['refused', await trouble.textContent()] : ['taken', '']);
}
console.log(JSON.stringify(verdicts));
await close(page);
await browser.close();
