// SPDX-License-Identifier: GPL-3.0-or-later
// Start a headless Chromium that draws in software, and open pages from disk in it.
import { pathToFileURL } from 'node:url';
import { evaluate, inOrder, load, matchPoints, skip } from './support.mjs';

const { chromium } = await load('playwright-core/index.mjs');
if (!process.env.CHROMIUM || process.env.CHROMIUM.includes('NOTFOUND')) skip('no Chromium is installed');

export const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM,
  args: ['--headless', '--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader',
    '--enable-unsafe-swiftshader', '--disable-gpu-compositing', '--disable-background-networking', '--disable-component-update',
    '--disable-sync', '--no-first-run'],
});

/** Open a page, and collect its errors and its requests for other files. */
export async function open(path, options = {}, hash = '') {
  const page = await browser.newPage({ viewport: { width: 900, height: 640 }, reducedMotion: 'reduce', ...options });
  page.setDefaultTimeout(60000);
  if (options.init) await page.addInitScript(options.init);
  const complaints = [];
  page.on('console', (message) => {
    const text = message.text(); // the compositor, which has no GPU here, reads the picture back
    if (['error', 'warning'].includes(message.type()) && !text.includes('GPU stall due to ReadPixels')) complaints.push(text);
  });
  page.on('pageerror', (error) => complaints.push(error.stack));
  const own = pathToFileURL(path).href;
  page.on('request', (request) => { if (request.url() !== own && !/^(data|blob):/.test(request.url())) complaints.push(`asked for ${request.url()}`); });
  await page.goto(own + hash);
  return { page, complaints };
}

/** Open the page of a basis, wait until it is drawn, and show all controls. By default the patient is supine and
 * does not breathe, as tests point at fixed places in the picture. */
export async function openLungs(path, options, hash = '#posture=supine&depth=500&show=contours&room=0') {
  const opened = await open(path, options, hash);
  await opened.page.waitForFunction(() => window.supine?.panes().length > 0);
  await opened.page.evaluate(() => { document.getElementById('more').open = true; });
  return opened;
}

/** Evaluate [gravity, mL] pairs in C as evaluate() of support.mjs does, but with vertices in the
 * page's order. */
export async function evaluateFor(page, basis, pairs) {
  const order = await orderOf(page, basis);
  return evaluate(basis, pairs).map(({ scale, xyz }) => ({ scale, xyz: inOrder(xyz, order) }));
}

/** Return, for each vertex of the page, its index in the basis: the page reorders vertices for
 * compression. */
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
