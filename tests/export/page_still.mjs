// SPDX-License-Identifier: GPL-3.0-or-later
// Test that a page whose scripts may not run, by the browser's setting or by a policy, shows a picture and the numbers
// of `compare`, and that a page whose script runs does not.
import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { browser, close, openLungs } from './browser.mjs';
import { basis } from './lungs.mjs';
import { folder, loadCommon, supine } from './support.mjs';

const PICTURE_MAX = 60_000; // letters of base64
const WRITTEN_MM = 0.051;
const NAMES = ['a & <b>tumour</b>', 'nodule'];
const axe = loadCommon('axe-core').source;
const [points, inside, html] = ['still.csv', 'still.safetensors', 'still.html'].map((name) => join(folder, name));
writeFileSync(points, `name,x,y,z\n${NAMES[0]},-80,-120,-90\n${NAMES[1]},70,-150,-120\n`);
supine('embed', basis, points, '-o', inside);
supine('export', basis, '--inside', inside, '-o', html);
const truth = JSON.parse(supine('compare', inside, '--postures', 'supine,prone,left,right', '--json')).targets;

/** Check what a page shows without its script. */
async function checkStill(page) {
  const shown = await page.evaluate(() => ({
    visible: [...document.querySelectorAll('h1, body > :not(#title)')]
      .filter((e) => e.checkVisibility())
      .map((e) => e.id || e.tagName),
    picture: document.querySelector('#still img').getAttribute('src').length,
    drawn: document.querySelector('#still img').naturalWidth,
    rows: [...document.querySelectorAll('#still tbody tr')].map((row) => [...row.cells].map((c) => c.innerText)),
    wide: document.documentElement.scrollWidth - window.innerWidth,
    text: document.getElementById('caveats').innerText,
  }));
  assert.deepEqual(shown.visible, ['H1', 'still']);
  assert.ok(shown.drawn === 600 && shown.picture <= PICTURE_MAX, `a picture of ${shown.picture} letters`);
  assert.ok(shown.wide <= 0, `${shown.wide} px too wide`);
  assert.match(shown.text, /assumed: .*volume at rest/);
  assert.deepEqual(
    shown.rows.map(([name]) => name),
    NAMES,
  );
  for (const [name, ...cells] of shown.rows)
    ['prone', 'left', 'right'].forEach((posture, i) => {
      const row = truth.find((t) => t.name === name && t.from === 'supine' && t.to === posture);
      const [, mm, error] = /^([\d.]+) \u00b1 ([\d.]+)/.exec(cells[i]).map(Number);
      assert.ok(Math.abs(mm - row.mm) < WRITTEN_MM, `${name}, ${posture}: ${mm}, not ${row.mm} mm`);
      assert.ok(Math.abs(error - row.moved_error_mm) < WRITTEN_MM, `${name}, ${posture}: error ${error}`);
    });
}

for (const width of [320, 1280]) {
  const context = await browser.newContext({ javaScriptEnabled: false, viewport: { width, height: 800 } });
  const page = await context.newPage();
  await page.goto(`file://${encodeURI(html)}`);
  await checkStill(page);
  await context.close();
}

const context = await browser.newContext();
const page = await context.newPage();
const headers = { 'content-type': 'text/html', 'content-security-policy': "script-src 'none'" };
await page.route('**/*', (route) => route.fulfill({ body: readFileSync(html), headers }));
await page.goto('http://portal.invalid/lungs.html');
await checkStill(page);
await page.evaluate(axe);
const { violations } = await page.evaluate(() => window.axe.run(document));
assert.deepEqual(
  violations.map(({ id, nodes }) => `${id}: ${nodes[0].html.slice(0, 120)}`),
  [],
);
await context.close();

const { page: run, complaints } = await openLungs(html);
assert.equal(await run.evaluate(() => document.getElementById('still').checkVisibility()), false);
assert.deepEqual(complaints, []);
await close(run);
