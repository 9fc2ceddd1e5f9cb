// SPDX-License-Identifier: GPL-3.0-or-later
// The page of lungs scanned at full inflation: volumes are relative to rest in each posture, normals are perpendicular
// to the surface, a single right lung is named as such, and a headset can be used if there is one.
import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { assertPicture, close, evaluateFor, openLungs, orderOf, picture, press, settled } from './browser.mjs';
import { basis, html } from './lungs.mjs';
import { folder, inOrder, largestDistance, randomDirections, supine } from './support.mjs';

const TOLERANCE_MM = 0.02; // the page stores 16-bit numbers
const PRINTED_MM = 0.001; // tolerance: numbers in text files have three decimals

const both = (page, gravity, depth) =>
  page.evaluate(
    ([g, mL]) => [Array.from(window.supine.positions(g, mL)), Array.from(window.supine.normals(g, mL))],
    [gravity, depth],
  );

/** Check that page, library and program add the volume of the breath to the volume at rest in the same posture. */
async function checkRest(page) {
  for (const gravity of [...randomDirections(4, 31), [1, 0, 0]]) {
    const [found] = await both(page, gravity, 320);
    const [truth] = await evaluateFor(page, basis, [[gravity, 320]]);
    assert.ok(largestDistance(found, truth.xyz) < TOLERANCE_MM);
    const held = await page.evaluate(
      (g) => [320, 0].map((mL) => window.supine.moment(g, mL).held.reduce((sum, x) => sum + x)),
      gravity,
    );
    assert.ok(Math.abs(held[0] - held[1] - 320) < 1e-6, `the lungs hold ${held}`);
  }
  const deformed = join(folder, 'left.obj');
  supine('deform', basis, '--posture', 'left', '--volume', 'rest+320', '-o', deformed);
  const said = Float32Array.from(
    [...readFileSync(deformed, 'utf8').matchAll(/^v (\S+) (\S+) (\S+)/gm)].flatMap(([, ...v]) => v.map(Number)),
  );
  const [found] = await both(page, [1, 0, 0], 320);
  assert.ok(largestDistance(found, inOrder(said, await orderOf(page, basis))) < TOLERANCE_MM + PRINTED_MM);
}

/** Compare the normals on the GPU with area-weighted normals of the triangles. */
async function checkNormals(page) {
  const corners = await page.evaluate(() => Array.from(window.supine.basis.corners));
  const angles = [];
  for (const [i, gravity] of randomDirections(6, 77).entries()) {
    const [xyz, made] = await both(page, gravity, 300 * i);
    const exact = new Float64Array(xyz.length);
    for (let t = 0; t < corners.length; t += 3) {
      const [a, b, c] = [0, 1, 2].map((j) => xyz.slice(3 * corners[t + j], 3 * corners[t + j] + 3));
      const [u, v] = [b.map((x, j) => x - a[j]), c.map((x, j) => x - a[j])];
      const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      for (let j = 0; j < 3; ++j)
        n.forEach((x, k) => {
          exact[3 * corners[t + j] + k] += x;
        });
    }
    for (let v = 0; v < xyz.length; v += 3) {
      const size = Math.hypot(exact[v], exact[v + 1], exact[v + 2]);
      const off = Math.hypot(...[0, 1, 2].map((k) => exact[v + k] / size - made[v + k]));
      angles.push((2 * Math.asin(Math.min(1, off / 2)) * 180) / Math.PI);
    }
  }
  angles.sort((a, b) => a - b);
  const mean = angles.reduce((a, b) => a + b) / angles.length;
  const p999 = angles[Math.floor(0.999 * angles.length)];
  console.log(`normals: mean ${mean.toFixed(3)} degrees, 99.9th percentile ${p999.toFixed(2)}`);
  assert.ok(mean < 0.1 && p999 < 1, `mean ${mean}, 99.9th percentile ${p999}`);
}

/** Check that a single lung right of x = 0 is called "right lung", and that it is seen from the front and
 * the back as it should. */
async function checkRight(page) {
  const { xyz, corners } = await page.evaluate(() => {
    const { basis: b } = window.supine;
    const lung = b.lungNames.indexOf('right lung');
    const [first, last] = [b.lungBegin[lung], b.lungBegin[lung + 1]];
    return {
      xyz: Array.from(b.surface.slice(3 * first, 3 * last)),
      corners: Array.from(b.corners.slice(b.cornerBegin[lung], b.cornerBegin[lung + 1]), (v) => v - first),
    };
  });
  const middle = xyz.reduce((sum, x, i) => sum + (i % 3 === 0 ? x : 0), 0) / (xyz.length / 3);
  assert.ok(middle < -40, `the right lung is at ${middle}`);
  const lines = [];
  for (let i = 0; i < xyz.length; i += 3) lines.push(`v ${xyz[i]} ${xyz[i + 1]} ${xyz[i + 2]}`);
  for (let t = 0; t < corners.length; t += 3)
    lines.push(`f ${corners[t] + 1} ${corners[t + 1] + 1} ${corners[t + 2] + 1}`);
  const [lungMesh, lungBasis, lungHtml] = ['right.obj', 'right.safetensors', 'right.html'].map((name) =>
    join(folder, name),
  );
  writeFileSync(lungMesh, `${lines.join('\n')}\n`);
  supine('precompute', lungMesh, '--units', 'mm', '-o', lungBasis);
  supine('export', lungBasis, '-o', lungHtml);
  const { page: alone, complaints } = await openLungs(lungHtml, { viewport: { width: 760, height: 480 } });
  assert.deepEqual(await alone.evaluate(() => window.supine.basis.lungNames), ['right lung']);
  for (const [key, behind] of [
    ['a', false],
    ['p', true],
  ]) {
    // from the front, then from behind
    await press(alone, key);
    await settled(alone);
    const ends = await alone.evaluate(() => {
      const { surface } = window.supine.basis;
      const m = window.supine.panes()[0].toEye;
      const seen = (v) => m[0] * surface[3 * v] + m[4] * surface[3 * v + 1] + m[8] * surface[3 * v + 2] + m[12];
      let [leftmost, rightmost] = [0, 0]; // vertices at the patient's left and right
      for (let v = 0; v < surface.length / 3; ++v) {
        if (surface[3 * v] > surface[3 * leftmost]) leftmost = v;
        if (surface[3 * v] < surface[3 * rightmost]) rightmost = v;
      }
      return [seen(leftmost), seen(rightmost)];
    });
    assert.equal(ends[0] > ends[1], !behind);
  }
  assert.deepEqual(complaints, []);
  await close(alone);
}

/** Simulate a headset whose two eyes see the halves of the canvas. */
function pretendHeadset() {
  const eye = (shift) => ({
    projectionMatrix: new Float32Array([1.2, 0, 0, 0, 0, 1.2, 0, 0, 0, 0, -1.01, -1, 0, 0, -0.1, 0]),
    transform: { inverse: { matrix: new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, shift, 0, 0, 1]) } },
  });
  const views = [eye(0.03), eye(-0.03)];
  window.eyes = 0;
  window.XRWebGLLayer = class {
    constructor(session, gl) {
      this.gl = gl;
      this.framebuffer = null;
    }

    getViewport(view) {
      window.eyes += 1;
      const half = Math.floor(this.gl.drawingBufferWidth / 2);
      return { x: views.indexOf(view) * half, y: 0, width: half, height: this.gl.drawingBufferHeight };
    }
  };
  WebGL2RenderingContext.prototype.makeXRCompatible = async () => {};
  const xr = {
    isSessionSupported: async (kind) => kind === 'immersive-vr',
    requestSession: async () =>
      Object.assign(new EventTarget(), {
        updateRenderState() {},
        requestReferenceSpace: async () => ({}),
        requestAnimationFrame: (draw) =>
          requestAnimationFrame((time) => draw(time, { getViewerPose: () => ({ views }) })),
        end() {
          this.dispatchEvent(new Event('end'));
        },
      }),
  };
  Object.defineProperty(navigator, 'xr', { value: xr });
}

async function checkHeadset() {
  const { page: plain, complaints } = await openLungs(html, { viewport: { width: 760, height: 480 } });
  await plain.evaluate(
    () =>
      new Promise((done) => {
        setTimeout(done, 0);
      }),
  );
  assert.ok(await plain.locator('#vr').isHidden(), 'a headset is offered where there is none');
  await close(plain);
  const { page, complaints: said } = await openLungs(html, {
    viewport: { width: 760, height: 480 },
    init: pretendHeadset,
  });
  await page.locator('#vr:not([hidden])').waitFor();
  const before = await picture(page);
  await page.locator('#vr').click();
  await page.waitForFunction(() => window.eyes >= 6);
  /* Both eyes see the lungs; the right eye sees them a little further to the left. */
  const seen = await page.evaluate(
    () =>
      new Promise((done) => {
        const { gl, draw } = window.supine.picture;
        window.supine.picture.draw = function drawn(panes, framebuffer) {
          draw.call(this, panes, framebuffer);
          const middles = panes.map(({ box: [x, y, width, height] }) => {
            const pixels = new Uint8Array(4 * width * height);
            gl.readPixels(x, y, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
            let [sum, count] = [0, 0];
            for (let i = 0; i < width * height; ++i)
              if (pixels[4 * i + 3] > 0) [sum, count] = [sum + (i % width), count + 1];
            return { middle: sum / count / width, share: count / (width * height) };
          });
          delete window.supine.picture.draw;
          done(middles);
        };
      }),
  );
  assert.ok(seen.length === 2 && seen.every(({ share }) => share > 0.02 && share < 0.9), JSON.stringify(seen));
  assert.ok(seen[0].middle > seen[1].middle + 0.01, JSON.stringify(seen));
  await page.locator('#vr').click();
  await page.waitForFunction(() => document.getElementById('vr').textContent === 'Enter VR');
  await assertPicture(page, before, 'the picture differs after leaving the headset');
  assert.deepEqual([...complaints, ...said], []);
  await close(page);
}

const { page, complaints } = await openLungs(html, { viewport: { width: 760, height: 480 } });
await checkRest(page);
await checkNormals(page);
await checkRight(page);
assert.deepEqual(complaints, []);
await close(page);
await checkHeadset();
