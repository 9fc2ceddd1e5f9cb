// SPDX-License-Identifier: GPL-3.0-or-later
// Start a headless Chromium that draws in software, and open pages from disk in it.
import assert from 'node:assert/strict';
import { pathToFileURL } from 'node:url';
import { evaluate, inOrder, load, loadCommon, matchPoints, skip } from './support.mjs';

const { chromium } = await load('playwright-core/index.mjs');
if (!process.env.CHROMIUM || process.env.CHROMIUM.includes('NOTFOUND')) skip('no Chromium is installed');

export const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM,
  args: [
    '--headless',
    '--no-sandbox',
    '--use-gl=angle',
    '--use-angle=swiftshader',
    '--enable-unsafe-swiftshader',
    '--disable-gpu-compositing',
    '--disable-background-networking',
    '--disable-component-update',
    '--disable-sync',
    '--no-first-run',
  ],
});

/** Add the page's errors and warnings to `complaints`. */
export function listen(page, complaints) {
  page.on('console', (message) => {
    const text = message.text();
    // Without a GPU, Chromium itself reads pixels back, and warns of it
    const ofCompositor = text.includes('GPU stall due to ReadPixels');
    if (['error', 'warning'].includes(message.type()) && !ofCompositor) complaints.push(text);
  });
  page.on('pageerror', (error) => complaints.push(error.stack));
}

// Closed pages to use again, by device properties: a new page takes a second of processor time
const unused = new Map();

/** Open a file, and collect its errors and its requests for other files. */
export async function open(
  path,
  {
    viewport = { width: 900, height: 640 },
    colorScheme = 'light',
    forcedColors = 'none',
    reducedMotion = 'reduce',
    init,
    ...device
  } = {},
  hash = '',
) {
  const kind = JSON.stringify(device);
  const page = (!init && unused.get(kind)?.pop()) || (await browser.newPage(device));
  page.setDefaultTimeout(120000); // ms, long enough on a busy machine
  await page.setViewportSize(viewport);
  await page.emulateMedia({ colorScheme, forcedColors, reducedMotion });
  if (init) await page.addInitScript(init);
  else page.kind = kind;
  const complaints = [];
  listen(page, complaints);
  const own = pathToFileURL(path).href;
  page.on('request', (request) => {
    if (request.url() !== own && !/^(data|blob):/.test(request.url())) complaints.push(`asked for ${request.url()}`);
  });
  await page.goto(own + hash);
  return { page, complaints };
}

/** Close a page that open() returned, or keep it to be used again. */
export async function close(page) {
  if (page.kind === undefined) {
    await page.close();
    return;
  }
  for (const event of ['console', 'pageerror', 'request']) page.removeAllListeners(event);
  await page.mouse.move(0, 0);
  await page.goto('about:blank');
  unused.set(page.kind, [...(unused.get(page.kind) ?? []), page]);
}

/** Open the page of a basis, wait until it is drawn and its texts, which move the picture, are written, and show all
 * controls. By default the patient is supine and
 * does not breathe, as tests point at fixed places in the picture. */
export async function openLungs(
  path,
  options,
  hash = '#posture=supine&depth=500&show=contours&room=0&colour=displacement',
) {
  const opened = await open(path, options, hash);
  await opened.page.waitForFunction(
    () => window.supine?.panes().length > 0 && document.getElementById('finding').textContent,
  );
  await opened.page.evaluate(() => {
    document.getElementById('more').open = true;
  });
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

/** Press a key on the picture, the only element that handles letter and digit keys. */
export async function press(page, key) {
  await page.locator('#picture').focus();
  await page.keyboard.press(key);
}

/** Return the picture without the texts and, on a small screen, the cards over it. */
const screenshot = (page) =>
  page
    .locator('#picture')
    .screenshot({ style: '#cards, #stage > :not(#picture):not(#notes) { visibility: hidden !important }' });

/** Return the picture after it has been drawn and no longer changes. */
export async function picture(page) {
  await settled(page);
  for (let before = null; ;) {
    const now = await screenshot(page);
    if (before?.equals(now)) return now;
    before = now;
  }
}

/** Assert that the picture becomes equal to an earlier one, or different if `equal` is false. */
export async function assertPicture(page, before, message, equal = true) {
  const end = Date.now() + 120000; // ends a test that hangs
  let found = false;
  do {
    await settled(page);
    found = (await screenshot(page)).equals(before) === equal;
  } while (!found && Date.now() < end);
  assert.ok(found, message);
}

/** Check that the picture is the same after the loss of the WebGL context. */
export async function checkLoss(page) {
  const before = await picture(page);
  await page.evaluate(() => {
    window.lose = window.supine.picture.gl.getExtension('WEBGL_lose_context');
    window.lose.loseContext();
  });
  await page.waitForFunction(() => window.supine.picture === null);
  await page.evaluate(() => window.lose.restoreContext());
  await page.waitForFunction(() => window.supine.picture !== null && document.getElementById('message').hidden);
  await assertPicture(page, before, 'the picture differs after the loss of the context');
}

const RULES = ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice'];

/** Assert that axe-core finds no violation in a page. */
export async function assertAccessible(page, what) {
  await page.evaluate(loadCommon('axe-core').source);
  const { violations } = await page.evaluate((runOnly) => window.axe.run(document, { runOnly }), RULES);
  assert.deepEqual(
    violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html.slice(0, 120)).join(' | ')}`),
    [],
    what,
  );
}

/** Assert that the window shows all of some elements, and is as wide as the page. */
export async function assertUncut(page, selector, what) {
  const fits = await page.evaluate((wanted) => {
    const all = [...document.querySelectorAll(wanted)].map((element) => element.getBoundingClientRect());
    return (
      document.documentElement.scrollWidth <= innerWidth &&
      all.every((b) => b.width === 0 || (b.left >= 0 && b.right <= innerWidth + 0.5))
    );
  }, selector);
  assert.ok(fits, `${what}: something is cut`);
}

/** Wait until a change is drawn. */
export const settled = (page) =>
  page.evaluate(
    () =>
      new Promise((done) => {
        requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done)));
      }),
  );
