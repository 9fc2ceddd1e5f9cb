// SPDX-License-Identifier: GPL-3.0-or-later
// Make a phantom, its basis with default options, and its page, once for all tests of pages.
import { join } from 'node:path';
import { folder, supine } from './support.mjs';

export const [mesh, basis, html] = ['lungs.ply', 'lungs.safetensors', 'lungs.html'].map((name) => join(folder, name));
supine('phantom', '-o', mesh, '--vertices', '2000');
supine('precompute', mesh, '-o', basis);
supine('export', basis, '-o', html);
