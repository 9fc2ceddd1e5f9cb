// SPDX-License-Identifier: GPL-3.0-or-later
// A headless Chromium that draws in software, and pages opened in it from disk.
import { pathToFileURL } from 'node:url';
import { evaluate, inOrder, load, matchPoints, skip } from './support.mjs';

const { chromium } = await load('playwright-core/index.mjs');
if (!process.env.CHROMIUM || process.env.CHROMIUM.includes('NOTFOUND')) skip('no Chromium is installed');

export const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM,
  args: ['--headless', '--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader',
    '--enable-unsafe-swiftshader', '--disable-background-networking', '--disable-component-update',
    '--disable-sync', '--no-first-run'],
});

/** Open a page and collect its errors and requests. */
export async function open(path, options = {}, hash = '') {
  const page = await browser.newPage({ viewport: { width: 900, height: 640 }, reducedMotion: 'reduce', ...options });
  page.setDefaultTimeout(60000);
  if (options.init) await page.addInitScript(options.init);
  const complaints = [];
  page.on('console', (message) => { if (['error', 'warning'].includes(message.type())) complaints.push(message.text()); });
  page.on('pageerror', (error) => complaints.push(error.stack));
  const own = pathToFileURL(path).href;
  page.on('request', (request) => { if (request.url() !== own && !/^(data|blob):/.test(request.url())) complaints.push(`asked for ${request.url()}`); });
  await page.goto(own + hash);
  return { page, complaints };
}

/** Open the page of a basis, wait for the first drawing and show all controls. By default the patient is
 * supine and still, as the positions in the picture used by tests require. */
export async function openLungs(path, options, hash = '#posture=supine&depth=500&show=contours&room=0') {
  const opened = await open(path, options, hash);
  await opened.page.waitForFunction(() => window.supine?.panes().length > 0);
  await opened.page.evaluate(() => { document.getElementById('more').open = true; });
  return opened;
}

/** Evaluate [gravity, mL] pairs in C, as evaluate() of support.mjs, in the page's order of vertices. */
export async function evaluateFor(page, basis, pairs) {
  const order = await orderOf(page, basis);
  return evaluate(basis, pairs).map(({ scale, xyz }) => ({ scale, xyz: inOrder(xyz, order) }));
}

/** Return the index in the basis of each vertex of the page, which orders vertices for compression. */
export async function orderOf(page, basis) {
  const rest = await page.evaluate(() => Array.from(window.supine.positions([0, 1, 0], 0)));
  return matchPoints(rest, evaluate(basis, [[[0, 1, 0], 0]])[0].xyz, 0.1);
}

/** Press a key on the picture, the only element that handles letters and digits. */
export async function press(page, key) {
  await page.locator('#picture').focus();
  await page.keyboard.press(key);
}

/** Return the picture after it has been drawn. */
export async function picture(page) {
  await settled(page);
  return page.locator('#picture').screenshot();
}

/** Wait until a change is drawn. */
export const settled = (page) => page.evaluate(() => new Promise((done) => { requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done))); }));
