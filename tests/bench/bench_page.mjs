// SPDX-License-Identifier: GPL-3.0-or-later
// Measure the time in which the exported page draws a frame, and the time of each pass of a frame. Each time is the
// shortest of several alternating runs.
//
//     node tests/bench/bench_page.mjs PAGE.html [CHROMIUM [FLAG...]]
//
// Needs playwright-core (npm install in tests/export, or in the folder of the environment variable MODULES). Chromium
// draws in software unless FLAGs choose a graphics card: --enable-gpu and --use-angle=gl or --use-angle=vulkan.
// "still" is a frame that draws the surface without deforming it. "turning" is a frame while the patient turns:
// weights, positions, normals and drawing. "script" is the time of the CPU in such a frame. The ratio of turning to
// still is the cost of deforming and drawing relative to drawing alone. "doubting" is a turning frame of plausible
// lungs, and "sample" the time in which the CPU draws one of them, every 0.4 s at most.
import { createRequire } from 'node:module';
import { resolve } from 'node:path';
import { fileURLToPath, pathToFileURL } from 'node:url';

const [file, executablePath = '/usr/bin/chromium', ...flags] = process.argv.slice(2);
if (!file) {
  console.error('usage: node bench_page.mjs PAGE.html [CHROMIUM [FLAG...]]');
  process.exit(2);
}
const modules = process.env.MODULES ?? fileURLToPath(new URL('../export', import.meta.url));
const require = createRequire(resolve(modules, 'package.json'));
const { chromium } = require('playwright-core');
const software = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];
const browser = await chromium.launch({
  executablePath,
  args: [
    '--headless',
    '--no-sandbox',
    '--no-first-run',
    '--disable-background-networking',
    ...(flags.length ? flags : software),
  ],
});
const page = await browser.newPage({ viewport: { width: 1280, height: 800 }, reducedMotion: 'reduce' });
page.setDefaultTimeout(300000);
await page.goto(pathToFileURL(resolve(file)).href, { timeout: 300000 });
await page.waitForFunction(() => window.supine?.panes().length > 0, null, { timeout: 300000 });

const found = await page.evaluate(() => {
  const { picture, panes, state, frameScript } = window.supine;
  const { gl, basis } = picture;
  const pixel = new Uint8Array(4);
  const done = () => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel); // waits for the GPU
  let tilt = 0;
  const weights = () => {
    tilt += 1;
    state.settle(state.standing.q, tilt % 60, 0);
    state.compute();
  };
  const shift = { surface: new Float32Array(3 * basis.vertices).fill(1) };
  let sampled = 0;
  const passes = {
    weights,
    deform: () => picture.deform('now', state.moment),
    still: () => picture.draw(panes()),
    turning: () => {
      weights();
      picture.deform('now', state.moment);
      picture.draw(panes());
    },
    doubting: () => {
      weights();
      picture.deform('now', state.moment, shift);
      picture.draw(panes());
    },
    sample: () => basis.library.sample(++sampled % 20, { anotherDay: true }),
  };
  const times = Object.fromEntries(['script', ...Object.keys(passes)].map((name) => [name, Infinity]));
  const some = 20; // frames per measurement, because the clock of a browser has steps of 0.1 ms
  for (let i = 0; i < 60; ++i) {
    // 60 x 20 frames, so that the script is compiled and optimised
    const begin = performance.now();
    for (let j = 0; j < some; ++j) {
      tilt += 1;
      state.settle(state.standing.q, tilt % 60, 0);
      frameScript();
    }
    times.script = Math.min(times.script, (performance.now() - begin) / some);
  }
  const end = performance.now() + 30000;
  for (let round = 0; round < 5 || (round < 30 && performance.now() < end); ++round) {
    for (const [name, run] of Object.entries(passes)) {
      done();
      const begin = performance.now();
      run();
      done();
      times[name] = Math.min(times[name], performance.now() - begin);
    }
  }
  const names = gl.getExtension('WEBGL_debug_renderer_info');
  return {
    renderer: gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER),
    vertices: basis.vertices,
    triangles: basis.corners.length / 3,
    modes: basis.modes,
    times,
  };
});
await browser.close();

console.log(found.renderer);
console.log(`${found.vertices} vertices, ${found.triangles} triangles, ${found.modes} modes; ms:`);
for (const [name, time] of Object.entries(found.times)) console.log(`  ${name.padEnd(10)} ${time.toFixed(2)}`);
console.log(`turning / still: ${(found.times.turning / found.times.still).toFixed(2)}`);
console.log(`doubting / turning: ${(found.times.doubting / found.times.turning).toFixed(2)}`);
