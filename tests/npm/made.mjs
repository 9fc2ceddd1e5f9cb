// SPDX-License-Identifier: GPL-3.0-or-later
// Make what tests of the JavaScript package need: a folder with the package in node_modules, bases, and the results of
// plain C for these bases. The environment variables NATIVE (program npm_native), TARBALL (the package), GOLDEN (a
// basis file without volumes at rest) and LUNGS (folder examples/lungs) are paths.
import { execFileSync } from 'node:child_process';
import { copyFileSync, existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { breathingFieldsBasis, folder, skip, supine } from '../export/support.mjs';

if (!existsSync(process.env.TARBALL)) skip('no package: build the target npm');
export const packed = join(folder, 'node_modules/supine');
mkdirSync(packed, { recursive: true });
execFileSync('tar', ['xzf', process.env.TARBALL, '-C', packed, '--strip-components=1']);

export const [mesh, demo, content, inside, unrested] = [
  'lungs.ply',
  'lungs.safetensors',
  'content.csv',
  'inside.safetensors',
  'unrested.safetensors',
].map((name) => join(folder, name));
copyFileSync(process.env.GOLDEN, unrested);
supine('phantom', '-o', mesh);
supine('precompute', mesh, '-o', demo);
writeFileSync(content, 'name,x,y,z\nnodule,-80,-120,-90\nother,70,-150,-120\n');
supine('embed', demo, content, mesh, '-o', inside);
const states = [
  'supine',
  'prone:rest+500',
  'left:full-1500',
  'supine+35:rest+120',
  '0.6:0.2:-0.7:2600mL',
  'upright:full',
];
const ofScan = ['supine:scan+200', 'prone:scan+500', '0.6:0.2:-0.7:scan-100']; // for a basis without volumes at rest
/** Paths of bases, each with the states to test. */
export const bases = [
  [demo, states],
  [inside, states],
  [unrested, ofScan],
];
const real = ['left', 'right'].map((side) => join(process.env.LUNGS, `${side}.obj`));
bases.push([join(folder, 'real.safetensors'), states]);
supine('precompute', ...real, '-o', bases.at(-1)[0]);

/** Bases of fields over gravity and volume, stored as modes and as clusters. */
export const breathing = ['modes', 'clusters'].map((storage) => join(folder, `breathing-${storage}.safetensors`));
breathing.forEach((path, i) => breathingFieldsBasis(path, 1000, ['modes', 'clusters'][i]));
bases.push(...breathing.map((path) => [path, ['supine', 'prone:scan+900', 'left:left=3000mL,right=3900mL']]));

/** Run npm_native, the program in plain C, for one state. In its results, `expected` [N] are expected errors, mm. */
export function native(basis, state, lungs) {
  const out = join(folder, 'native');
  execFileSync(process.env.NATIVE, [basis, state, out], { stdio: 'pipe' });
  const { buffer, byteOffset } = Buffer.concat([readFileSync(out)]);
  const bytes = buffer.slice(byteOffset);
  const n = (bytes.byteLength - 8 * lungs) / 28;
  const floats = (at, count) => new Float32Array(bytes, 8 * lungs + 4 * at, count);
  return {
    volumes: Array.from(new Float64Array(bytes, 0, lungs)),
    positions: floats(0, 3 * n),
    normals: floats(3 * n, 3 * n),
    expected: floats(6 * n, n),
  };
}
