// SPDX-License-Identifier: GPL-3.0-or-later
// axe-core finds no violation in the page and the report, in both themes. Every control of the page has a name,
// and its border has a contrast of at least 3 to 1.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { assertAccessible, close, open, openLungs } from './browser.mjs';
import { basis, html } from './lungs.mjs';
import { folder, supine } from './support.mjs';

const report = join(folder, 'report.html');
supine('compare', basis, '--postures', 'supine,prone,left,supine+15', '-o', report);

/** Return the contrast of two CSS colours as defined by WCAG. */
function contrast(a, b) {
  const luminance = (hex) => {
    const [r, g, bl] = [1, 3, 5]
      .map((i) => parseInt(hex.slice(i, i + 2), 16) / 255)
      .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * bl;
  };
  const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
  return (high + 0.05) / (low + 0.05);
}

/* Before the first picture, without WebAssembly, without WebGL, and after a link with wrong values, on a phone and on a
 * wall; nothing is wider than the window, and the console is empty. */
for (const [what, width, init, hash] of [
  ['before the first picture', 320, () => { WebAssembly.compile = () => new Promise(() => {}); }, ''],
  ['without WebAssembly', 390, () => { delete window.WebAssembly; }, ''],
  [
    'without WebGL',
    2560,
    () => {
      const { getContext } = HTMLCanvasElement.prototype;
      HTMLCanvasElement.prototype.getContext = function context(kind, ...rest) {
        return kind === 'webgl2' ? null : getContext.call(this, kind, ...rest);
      };
    },
    '#show=doubt',
  ],
  ['after a wrong link', 320, () => {}, '#posture=pron&depth=9000&prone&show=doubt&colour=displacement'],
]) {
  const { page, complaints } = await open(html, { viewport: { width, height: 700 }, init }, hash);
  const isRead = !what.startsWith('before') && !what.endsWith('WebAssembly');
  if (isRead) await page.waitForFunction(() => document.getElementById('finding').textContent);
  await assertAccessible(page, what);
  const [said, wide] = await page.evaluate(() => [
    document.body.innerText,
    document.documentElement.scrollWidth - window.innerWidth,
  ]);
  const [word] = what.split(' ');
  const words = { before: /Reading the lungs/, without: /moves|WebAssembly/, after: /Link: posture .* instead: left/ };
  assert.match(said, words[word], what);
  assert.ok(wide <= 0, `${what}: ${wide} px too wide`);
  assert.deepEqual(complaints, [], what);
  await close(page);
}

for (const colorScheme of ['light', 'dark']) {
  const { page, complaints } = await openLungs(
    html,
    { colorScheme },
    '#probes=3.250&colour=difference&show=beside.ghost.doubt',
  );
  await page.evaluate(() => {
    for (const details of document.querySelectorAll('details')) details.open = true;
  });
  await assertAccessible(page, `the page, ${colorScheme}`);
  const nameless = await page.evaluate(() =>
    [...document.querySelectorAll('button, input, select, canvas[tabindex]')]
      .filter((e) => {
        const label =
          e.getAttribute('aria-label') ??
          (e.labels?.length ? [...e.labels].map((l) => l.textContent).join() : e.textContent);
        return !label?.trim();
      })
      .map((e) => e.outerHTML),
  );
  assert.deepEqual(nameless, []);
  const colours = await page.evaluate(() => {
    const style = getComputedStyle(document.documentElement);
    return Object.fromEntries(
      ['edge', 'accent', 'accent-ink', 'paper-solid', 'field', 'change', 'ink', 'back'].map((name) => [
        name,
        style.getPropertyValue(`--${name}`).trim(),
      ]),
    );
  });
  const long = (hex) => (hex.length === 4 ? `#${[...hex.slice(1)].map((c) => c + c).join('')}` : hex);
  for (const [a, b] of [
    ['edge', 'paper-solid'],
    ['accent', 'paper-solid'],
    ['accent', 'field'],
    ['accent', 'accent-ink'],
    ['change', 'paper-solid'],
    ['ink', 'back'],
  ]) {
    const ratio = contrast(long(colours[a]), long(colours[b]));
    assert.ok(ratio >= 3, `${colorScheme}: ${a} on ${b} is ${ratio.toFixed(2)}`);
  }
  /* Printed, the picture is large, and controls are left out. */
  await page.emulateMedia({ media: 'print' });
  const printed = await page.evaluate(() => {
    window.dispatchEvent(new Event('beforeprint'));
    const stage = document.getElementById('stage');
    const shown = [...document.querySelectorAll('input, select, #play, #more')].filter((e) => e.checkVisibility());
    return [stage.clientHeight, stage.style.backgroundImage.slice(0, 14), shown.map((e) => e.id || e.name)];
  });
  assert.ok(printed[0] > 400, `a picture of ${printed[0]} px`);
  assert.deepEqual(printed.slice(1), ['url("data:imag', []]);
  await page.evaluate(() => window.dispatchEvent(new Event('afterprint')));
  await page.emulateMedia({ media: null });
  assert.deepEqual(complaints, []);
  await close(page);

  const second = await open(report, { colorScheme });
  await assertAccessible(second.page, `the report, ${colorScheme}`);
  assert.deepEqual(second.complaints, []);
  await close(second.page);
}
