// SPDX-License-Identifier: GPL-3.0-or-later
// Measure the time per vertex of the JavaScript package in node, and that of plain C, in the fastest of several
// alternating runs. With the package built (target npm) and B=build/release:
//
//   SUPINE=$B/supine NATIVE=$B/tests/npm_native TARBALL=$(ls $PWD/$B/runtime/js/supine-*.tgz) LUNGS=. \
//     GOLDEN=tests/golden/basis_lungs.safetensors node tests/bench/bench_npm.mjs
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { demo, packed } from '../npm/made.mjs';

const { open } = await import(join(packed, 'supine.js'));
const lungs = await open(readFileSync(demo));
lungs.pose('prone');
const fastest = [
  [Infinity, Infinity],
  [Infinity, Infinity],
];
const calls = Math.ceil(1000000 / lungs.vertexCount);
for (let round = 0; round < 5; ++round) {
  const c = execFileSync(process.env.NATIVE, [demo, 'prone'], { encoding: 'utf8' }).split(' ').map(Number);
  for (const [i, call] of ['deform', 'deformLit'].entries()) {
    for (let again = 0; again < 9; ++again) {
      const begin = performance.now();
      for (let j = 0; j < calls; ++j) lungs[call]();
      fastest[0][i] = Math.min(fastest[0][i], (1e6 * (performance.now() - begin)) / calls / lungs.vertexCount);
    }
    fastest[1][i] = Math.min(fastest[1][i], c[i]);
  }
}
const ratios = fastest[0].map((taken, i) => taken / fastest[1][i]);
console.log(
  `ns per vertex of deform and deformLit: ${fastest[0].map((x) => x.toFixed(2))}; in plain C ${fastest[1]}; ` +
    `ratios ${ratios.map((x) => x.toFixed(2))}`,
);
