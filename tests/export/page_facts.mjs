// SPDX-License-Identifier: GPL-3.0-or-later
// Test that the page lists every fact that `info` lists, in the same words, and names those that are assumed, simulated
// or collapsed at its top. The page takes both from the JavaScript package. Other views: tests/scripts/test_views.py.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { close, openLungs } from './browser.mjs';
import { folder, supine } from './support.mjs';

const [mesh, basis, html] = ['lungs.ply', 'facts.safetensors', 'facts.html'].map((name) => join(folder, name));
const kinds = {
  healthy: [],
  collapsed: ['--lung', 'left:0.4'],
  rest: ['--scanned', 'prone:rest'],
  given: ['--scanned', 'full', '--resting', 'supine=2700mL', '--axes', 'LPS'],
};
supine('phantom', '--vertices', '600', '-o', mesh);
for (const [kind, options] of Object.entries(kinds)) {
  supine('precompute', mesh, '--band', '3', '--held-out', '10', ...options, '-o', basis);
  supine('export', basis, '-o', html);
  const { facts } = JSON.parse(supine('info', basis, '--json'));
  const { page, complaints } = await openLungs(html);
  const shown = await page.evaluate(() => ({
    facts: Array.from(document.querySelectorAll('#facts dt'), (term) => [
      term.textContent,
      term.nextElementSibling.textContent,
    ]),
    caveats: document.getElementById('caveats').textContent,
  }));
  for (const { name, line, caveat } of facts) {
    assert.deepEqual(
      shown.facts.find(([term]) => term === name),
      [name, line],
      kind,
    );
    if (caveat) assert.ok(shown.caveats.includes(name), `${kind}: ${name} is not in '${shown.caveats}'`);
  }
  assert.deepEqual(complaints, []);
  await close(page);
}
