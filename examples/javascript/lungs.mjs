// SPDX-License-Identifier: MIT
// Deform lungs to one state, and print the first vertex and the volumes:
//
//     node lungs.mjs lungs.safetensors prone:rest+500
import { readFile } from 'node:fs/promises';
import { open } from 'supine';

const [path, state] = process.argv.slice(2);
const lungs = await open(await readFile(path)); // in a browser: await (await fetch(url)).arrayBuffer()
lungs.pose(state).deformLit(); // once per frame; positions and normals stay the same arrays
const [x, y, z] = lungs.positions;
console.log(`${lungs.vertexCount} vertices; the first is at ${x} ${y} ${z} mm`);
for (const [name, volume] of Object.entries(lungs.volumes)) console.log(`${name} lung: ${Math.round(volume)} mL`);
