// SPDX-License-Identifier: GPL-3.0-or-later
// OpenUSD files: tinyusdz reads them in Chromium without an error. The blend shapes, weights and angles that it has
// read give the positions of the C evaluator.
import assert from 'node:assert/strict';
import { existsSync, readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { join } from 'node:path';
import { browser } from './browser.mjs';
import { basis } from './lungs.mjs';
import { evaluate, folder, largestDistance, skip, supine } from './support.mjs';

const ROUNDED_MM = 0.002; // the base and each of the targets are rounded to 0.0001 mm
const [RATE, BREATH_SECONDS, BREATH] = [6, 3, 500];
const tinyusdz = join(process.env.MODULES, 'node_modules/tinyusdz');
if (!existsSync(tinyusdz)) skip('tinyusdz is not installed: npm install in tests/export');

/** Let tinyusdz read files in one page: return its error, its meshes, and the layer as it prints it again. */
async function read(paths) {
  const types = { js: 'text/javascript', wasm: 'application/wasm', usda: 'text/plain' };
  const server = createServer(({ url }, answer) => {
    const name = url.slice(1);
    answer.setHeader('content-type', types[name.split('.').pop()] ?? 'text/html');
    const path = join(name.endsWith('.usda') ? folder : tinyusdz, name);
    answer.end(name === '' || !existsSync(path) ? '' : readFileSync(path));
  });
  await new Promise((ready) => server.listen(0, '127.0.0.1', ready));
  const page = await browser.newPage();
  await page.goto(`http://127.0.0.1:${server.address().port}/`);
  const found = await page.evaluate(async (names) => {
    const native = await (await import('/tinyusdz.js')).default();
    return Promise.all(
      names.map(async (name) => {
        const bytes = new Uint8Array(await (await fetch(name)).arrayBuffer());
        const [scene, layer] = [new native.TinyUSDZLoaderNative(), new native.TinyUSDZLoaderNative()];
        const ok = scene.loadFromBinary(bytes, name) && layer.loadAsLayerFromBinary(bytes, name);
        const meshes = Array.from({ length: ok ? scene.numMeshes() : 0 }, (_, i) => scene.getMesh(i));
        return {
          error: ok ? '' : scene.error() || layer.error(),
          meshes: meshes.map((mesh) => ({ name: mesh.primName, corners: mesh.faceVertexIndices.length })),
          layer: ok ? layer.layerToString() : '',
        };
      }),
    );
  }, paths);
  await page.close();
  server.close();
  return found;
}

const numbers = (text) => text.match(/-?\d[\d.]*(e-?\d+)?/g).map(Number);

/** Return the numbers of each array of a name, in the order of the file. */
const arrays = (text, name) =>
  [...text.matchAll(new RegExp(`${name} = \\[(.*?)\\]\\n`, 'g'))].map(([, list]) => numbers(list));

/** Return {time: numbers} of an attribute's time samples. */
function samples(text, name) {
  const [, block] = text.match(new RegExp(`${name.replace(/[.]/g, '\\.')}\\.timeSamples = \\{([^}]*)\\}`));
  return Object.fromEntries(
    block
      .trim()
      .split('\n')
      .map((line) => [Number(line.split(':')[0]), numbers(line.slice(line.indexOf(':') + 1))]),
  );
}

supine('export', basis, '-o', join(folder, 'whole.usda'), '--simplify', '100000');
const said = supine('export', basis, '-o', join(folder, 'small.usda'), '--simplify', '300');
assert.match(said, /small.usda: 2 lungs with blend shapes and an animation, [\d.]+ [kM]B\nsimplified from \d+ to \d+/);
const [whole, small] = await read(['whole.usda', 'small.usda']);
assert.deepEqual([whole.error, small.error], ['', '']);
assert.deepEqual(
  whole.meshes.map((mesh) => mesh.name),
  ['Lung_0_left', 'Lung_1_right'],
);
assert.ok(small.meshes[0].corners < whole.meshes[0].corners / 2);
const text = whole.layer;
for (const words of ['metersPerUnit = 0.001', 'upAxis = "Y"', 'string name = "left"', 'law of displacement'])
  assert.ok(text.includes(words), words);
const [points, offsets] = [arrays(text, 'points'), arrays(text, ' offsets')];
const weights = samples(text, 'blendShapeWeights');
const roll = samples(text, 'xformOp:rotateY:roll');
const [middle] = [numbers(text.match(/middle = \((.*)\)/)[1])];
const targets = offsets.length / 2;
const frames = [0, 9, 27, 61, 100, 144];
const states = frames.map((frame) => {
  const [at] = roll[frame].map((degrees) => (degrees * Math.PI) / 180);
  const fraction = 0.5 - 0.5 * Math.cos((2 * Math.PI * frame) / RATE / BREATH_SECONDS);
  return [[Math.sin(at), Math.cos(at), 0], BREATH * fraction];
});
const expected = evaluate(basis, states);
frames.forEach((frame, k) => {
  assert.equal(weights[frame].length, 2 * targets);
  const moved = points.flatMap((base, lung) => {
    const own = offsets.slice(lung * targets, (lung + 1) * targets);
    const weight = weights[frame].slice(lung * targets);
    return base.map((x, i) => own.reduce((sum, offset, j) => sum + weight[j] * offset[i], x + middle[i % 3]));
  });
  const distance = largestDistance(moved, expected[k].xyz);
  assert.ok(distance < ROUNDED_MM, `frame ${frame}: ${distance} mm`);
});
assert.equal(roll[36][0], 90); // after 6 s, on the left side
