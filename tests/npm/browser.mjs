// SPDX-License-Identifier: GPL-3.0-or-later
// Test the JavaScript package in Chromium: its results equal those of plain C, and its examples draw moving lungs.
import assert from 'node:assert/strict';
import { copyFileSync, existsSync, readFileSync, symlinkSync, writeFileSync } from 'node:fs';
import { basename, extname, join } from 'node:path';
import { checkAll, pose } from './agree.mjs';
import { browser, settled } from '../export/browser.mjs';
import { folder } from '../export/support.mjs';

const origin = 'http://lungs.test/';
const kinds = { '.html': 'text/html', '.js': 'text/javascript', '.wasm': 'application/wasm' };
/** Open a page of the temporary folder. This process answers the requests of the page, without a network. */
async function visit(path) {
  const page = await browser.newPage({ viewport: { width: 320, height: 240 } });
  page.setDefaultTimeout(120000); // ms, long enough on a busy machine
  const complaints = [];
  page.on('console', (message) => {
    if (message.type() === 'error') complaints.push(message.text());
  });
  page.on('pageerror', (error) => complaints.push(error.stack));
  await page.route('**/*', (route) => {
    const file = join(folder, decodeURI(new URL(route.request().url()).pathname));
    return existsSync(file)
      ? route.fulfill({ contentType: kinds[extname(file)] ?? 'application/octet-stream', body: readFileSync(file) })
      : route.fulfill({ status: 404 });
  });
  await page.goto(origin + path);
  return { page, complaints };
}

for (const example of ['three', 'vtk'])
  copyFileSync(join(folder, `node_modules/supine/examples/${example}.html`), join(folder, `${example}.html`));
writeFileSync(join(folder, 'blank.html'), '<!doctype html>');
const { page } = await visit('blank.html');
await checkAll(
  (basis, states) =>
    page.evaluate(
      async ([file, states, code]) => {
        const { open } = await import('/node_modules/supine/supine.js');
        const lungs = await open(await (await fetch(file)).arrayBuffer());
        const plain = (value) => (ArrayBuffer.isView(value) ? Array.from(value) : value);
        return new Function(`return ${code}`)()(lungs, states).map((one) =>
          Object.fromEntries(Object.entries(one).map(([name, value]) => [name, plain(value)])),
        );
      },
      [`/${basename(basis)}`, states, pose.toString()],
    ),
  2,
);
await page.close();

/** Take a screenshot and return the red values of its pixels. */
async function look(page) {
  await settled(page);
  const shot = (await page.screenshot()).toString('base64');
  if (process.env.PICTURES)
    writeFileSync(join(process.env.PICTURES, `${await page.title()}.png`), Buffer.from(shot, 'base64'));
  return page.evaluate(async (data) => {
    const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${data}`)).blob());
    const canvas = new OffscreenCanvas(image.width, image.height).getContext('2d');
    canvas.drawImage(image, 0, 0);
    return Array.from(canvas.getImageData(0, 0, image.width, image.height).data).filter((_, i) => i % 4 === 0);
  }, shot);
}

/** Take screenshots until `isWanted` is true of one, and return it. */
async function lookUntil(page, isWanted, message) {
  const end = Date.now() + 120000; // ends a test that hangs
  for (;;) {
    const picture = await look(page);
    if (isWanted(picture)) return picture;
    assert.ok(Date.now() < end, message);
  }
}

/** Return the share of the picture that is not background. */
const drawn = (picture) => picture.filter((red) => red > 40).length / picture.length;

/** Check that the example with this name draws lungs, and that the picture changes by itself or after `change`. */
async function check(name, change = () => {}) {
  if (!existsSync(join(process.env.MODULES, 'node_modules', name))) {
    console.log(`${name} is not installed: its example is not tried`);
    return;
  }
  symlinkSync(join(process.env.MODULES, 'node_modules', name), join(folder, 'node_modules', name));
  const { page, complaints } = await visit(`${name.replace('.js', '')}.html`);
  await page.waitForSelector('canvas');
  const before = await lookUntil(page, (picture) => drawn(picture) > 0.1, `${name}: nothing is drawn`);
  await change(page);
  const changed = (picture) => before.filter((red, i) => Math.abs(red - picture[i]) > 20).length / before.length;
  const after = await lookUntil(page, (picture) => changed(picture) > 0.005, `${name}: the picture does not change`);
  for (const picture of [before, after]) {
    assert.ok(drawn(picture) > 0.1 && drawn(picture) < 0.6, `${name}: ${drawn(picture)} of the picture is drawn`);
  }
  assert.deepEqual(complaints, []);
  await page.close();
}
await check('three');
await check('vtk.js', (page) => page.selectOption('select', 'left'));
await browser.close();
