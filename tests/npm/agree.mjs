// SPDX-License-Identifier: GPL-3.0-or-later
// Compare the results of the JavaScript package, in node or in a browser, with those of plain C: each basis in several
// states.
import assert from 'node:assert/strict';
import { bases, native } from './made.mjs';
import { largestDistance } from '../export/support.mjs';

async function check(basis, states, ask) {
  const said = await ask(basis, states);
  for (const [i, state] of states.entries()) {
    const [js, c] = [said[i], native(basis, state, said[i].volumes.length)];
    const apart = largestDistance(js.positions, c.positions);
    assert.ok(
      js.error < 0.01 && apart <= 2 * js.error,
      `${basis} ${state}: ${apart} mm apart, where ${js.error} mm are allowed`,
    );
    assert.ok(largestDistance(js.normals, c.normals) < 1e-3, `${basis} ${state}: normals`);
    js.volumes.forEach((volume, lung) =>
      assert.ok(Math.abs(volume - c.volumes[lung]) <= 1e-9 * c.volumes[lung], `${basis} ${state}: ${volume} mL`),
    );
    assert.equal(js.expected.length, c.expected.length);
    js.expected.forEach((sigma, v) =>
      assert.ok(Math.abs(sigma - c.expected[v]) < 1e-3, `${basis} ${state}: expected error ${sigma} mm of vertex ${v}`),
    );
  }
}

/** Return positions, normals, volumes and errors of an open basis in each state. It runs in node or in a browser. */
export function pose(lungs, states) {
  return states.map((state) => {
    lungs.pose(state).deformLit();
    const unknown = lungs.metadata.route === 'fields' && lungs.tensor('error_vertices') === undefined;
    return {
      positions: lungs.positions.slice(),
      normals: lungs.normals.slice(),
      volumes: Object.values(lungs.volumes),
      expected: unknown ? new Float32Array(lungs.vertexCount) : lungs.expectedError().slice(),
      error: lungs.error,
    };
  });
}

/** Compare the results for each basis in the last `most` of its states. `ask(basis, states)` must open the basis and
 * return what `pose` returns. */
export async function checkAll(ask, most = Infinity) {
  for (const [basis, states] of bases) await check(basis, states.slice(-most), ask);
  console.log(`${bases.length} bases give the same results as in C`);
}
