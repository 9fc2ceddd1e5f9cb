// SPDX-License-Identifier: GPL-3.0-or-later
// The live page with two viewers in headless Chromium: both show the posture of the tracker's last pose, then that
// of the tilt sensor of one viewer. stream_page.mjs PAGE PORT
import assert from 'node:assert/strict';
import { createConnection } from 'node:net';
import { skip } from '../export/support.mjs';

const [site, port] = process.argv.slice(2);
if (!site) skip('no page is served: the program was built without libwebsockets');
const { browser, listen } = await import('../export/browser.mjs');

/** Return the CRC-64 of ECMA-182, computed bit by bit. */
function crc64(bytes) {
  let crc = 0n;
  for (const byte of bytes) {
    crc ^= BigInt(byte) << 56n;
    for (let i = 0; i < 8; ++i) crc = ((crc << 1n) ^ (crc >> 63n ? 0x42f0e1eba9ea3693n : 0n)) & 0xffffffffffffffffn;
  }
  return crc;
}

/** Return a TRANSFORM message from the directions of left, back and head in a room whose z is
 * up. */
function transform(left, back, head) {
  const body = Buffer.alloc(48);
  [...left, ...back, ...head].forEach((x, i) => body.writeFloatBE(x, 4 * i));
  const header = Buffer.alloc(58);
  header.writeUInt16BE(1, 0);
  header.write('TRANSFORM', 2);
  header.write('Patient', 14);
  header.writeBigUInt64BE(48n, 42);
  header.writeBigUInt64BE(crc64(body), 50);
  return Buffer.concat([header, body]);
}

const tracker = createConnection(Number(port), '127.0.0.1');
tracker.on('data', () => {});
const complaints = [];
const context = await browser.newContext({ viewport: { width: 900, height: 640 }, reducedMotion: 'reduce' });
context.setDefaultTimeout(120000); // ms, long enough on a busy machine

async function view() {
  const page = await context.newPage();
  listen(page, complaints);
  await page.goto(site);
  await page.waitForFunction(() => window.supine?.state.moment && window.supineLive?.moments() > 0, null);
  return page;
}

const viewers = [await view(), await view()];
const ages = () => Promise.all(viewers.map((page) => page.evaluate(() => window.supineLive.age())));
assert.deepEqual(await ages(), ['no tracker yet', 'no tracker yet']);
assert.ok(
  await viewers[0].evaluate(() => document.body.classList.contains('waiting')),
  'not grey before the first pose',
);
await viewers[0].evaluate(() => {
  // count the announcements of a screen reader
  window.announced = 0;
  new MutationObserver(() => {
    window.announced += 1;
  }).observe(document.getElementById('finding'), { childList: true, subtree: true, characterData: true });
});

/** Wait until every viewer shows this direction of gravity and the server's volume. */
async function expectGravity(wanted, what) {
  for (const page of viewers) {
    await page
      .waitForFunction((g) => {
        const { state, gravityOf } = window.supine;
        return Math.hypot(...gravityOf(state.q).map((x, i) => x - g[i])) < 1e-5 && Math.abs(state.depth - 300) < 1e-3;
      }, wanted)
      .catch(async () => {
        const shown = () => [window.supine.gravityOf(window.supine.state.q), window.supine.state.depth];
        assert.fail(`${what}: ${await page.evaluate(shown)}`);
      });
    await page.waitForFunction(
      (g) => Math.hypot(...window.supine.state.moment.gravity.map((x, i) => x - g[i])) < 1e-5,
      wanted,
    );
  }
}

const lies = [
  ['prone', [-1, 0, 0], [0, 0, 1], [0, 1, 0], [0, -1, 0]],
  ['left', [0, 0, -1], [-1, 0, 0], [0, 1, 0], [1, 0, 0]],
  ['right', [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0]],
  ['upright', [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1]],
  ['supine', [1, 0, 0], [0, 0, -1], [0, 1, 0], [0, 1, 0]],
];
for (const [name, left, back, head, gravity] of lies) {
  tracker.write(transform(left, back, head));
  await expectGravity(gravity, name);
  for (const page of viewers) {
    await page.waitForFunction((wanted) => document.getElementById('posture-name').value === wanted, name);
  }
}
for (const text of await ages()) assert.match(text, /^pose \d+\.\d s old$/);
// The age grows
await viewers[1].waitForFunction(() => Number(/^pose ([\d.]+) s old$/.exec(window.supineLive.age())[1]) >= 1.5);
viewers.push(await view()); // a later viewer gets the age of the pose, too
assert.match(await viewers[2].evaluate(() => window.supineLive.age()), /^pose (1\.[5-9]|[2-9]\.\d|\d\d+) s old$/);
await viewers.pop().close();
// After many poses in a short time, the last is shown.
for (let i = 0; i <= 400; ++i) {
  const a = (i / 400) * 2.1;
  tracker.write(transform([Math.cos(a), 0, Math.sin(a)], [Math.sin(a), 0, -Math.cos(a)], [0, 1, 0]));
}
await expectGravity([-Math.sin(2.1), Math.cos(2.1), 0], 'the last of many');

await viewers[0].waitForFunction(() =>
  /^Prone, rolled 60 degrees to the right \(/.test(document.getElementById('finding').textContent),
);
// The sentence changed only after each posture had settled, and says nothing of the breath.
const [announced, sentence, cards] = await viewers[0].evaluate(() => [
  window.announced,
  document.getElementById('finding').textContent,
  [...document.querySelectorAll('#postures small')].map((e) => e.textContent),
]);
assert.ok(announced >= 1 && announced <= lies.length + 2, `${announced} announcements`);
assert.ok(!/above/.test(sentence) && cards.every((text) => text !== ''), `${sentence} ${cards}`);
assert.ok(await viewers[0].evaluate(() => !document.body.classList.contains('waiting')));

// The tilt sensor of a phone on the breastbone gives the posture.
const phone = await context.newCDPSession(viewers[0]);
assert.ok(await viewers[0].getByRole('button', { name: /tilt/ }).isVisible());
await viewers[0].getByRole('button', { name: /tilt/ }).click();
for (const [name, beta, gamma, gravity] of [
  ['lying on the back', 0, 0, [0, 1, 0]],
  ['sitting up', 90, 0, [0, 0, -1]],
  ['half on the side', 0, 60, [Math.sin(Math.PI / 3), 0.5, 0]],
]) {
  await phone.send('DeviceOrientation.setDeviceOrientationOverride', { alpha: 30, beta, gamma });
  await expectGravity(gravity, name);
}
// A pose that is refused is told on the page, until one is taken.
const status = (wanted) =>
  viewers[0].waitForFunction((text) => new RegExp(text).test(document.querySelector('#live p').textContent), wanted);
await viewers[0].evaluate(() => {
  const other = new WebSocket(`ws://${location.host}/`, 'supine');
  other.addEventListener('open', () => other.send('{"gravity":[0,0,0]}'));
});
await status('^a pose is refused: ');
await phone.send('DeviceOrientation.setDeviceOrientationOverride', { alpha: 30, beta: 45, gamma: 0 });
await status('^live$');
// The page is served on 127.0.0.1 only: a connection to another address of this machine is refused.
const elsewhere = await new Promise((done) => {
  const socket = createConnection(Number(new URL(site).port), '127.0.0.2');
  socket.on('connect', () => done('let in')).on('error', (error) => done(error.code));
});
assert.equal(elsewhere, 'ECONNREFUSED');
// A page from another origin may not open the socket.
const stranger = await context.newPage();
await stranger.goto('data:text/html,<title>elsewhere</title>');
const opened = await stranger.evaluate(
  (place) =>
    new Promise((done) => {
      const socket = new WebSocket(place, 'supine');
      socket.onopen = () => done(true);
      socket.onerror = () => done(false);
    }),
  site.replace('http', 'ws'),
);
assert.equal(opened, false, 'a page from another origin opened the socket');
assert.deepEqual(complaints, []);
tracker.destroy();
await browser.close();
