// SPDX-License-Identifier: GPL-3.0-or-later
// All browser tests in one process with one Chromium: node pages.mjs [NAME...]
import { browser } from './browser.mjs';

const all = [
  'page',
  'page_answer',
  'page_breathing_fields',
  'page_facts',
  'page_fields',
  'page_hands',
  'page_inside',
  'page_first',
  'page_lungs',
  'page_numbers',
  'page_targets',
  'page_room',
  'page_views',
  'page_simplified',
  'page_usd',
  'page_sizes',
  'page_still',
  'accessibility',
  'report',
];
for (const name of process.argv.length > 2 ? process.argv.slice(2) : all) {
  const begin = performance.now();
  try {
    await import(`./${name}.mjs`);
    console.log(`${name}: passed in ${((performance.now() - begin) / 1000).toFixed(1)} s`);
  } catch (error) {
    console.error(`${name}: failed\n`, error);
    process.exitCode = 1;
  }
}
await browser.close();
