// SPDX-License-Identifier: GPL-3.0-or-later
// The lungs that the tests of pages share: a phantom, its basis with default options, and its page, made once.
import { join } from 'node:path';
import { folder, supine } from './support.mjs';

export const [mesh, basis, html] = ['lungs.ply', 'lungs.safetensors', 'lungs.html'].map((name) => join(folder, name));
supine('phantom', '-o', mesh, '--vertices', '1500');
supine('precompute', mesh, '-o', basis);
supine('export', basis, '-o', html);
