// SPDX-License-Identifier: GPL-3.0-or-later
// Fuzz the numbers of basis files in JavaScript: node numbers.mjs SUPINE_JS. Each case changes one tensor or one
// metadata string of a sound file, and then corrects the checksum. The JavaScript package, which the page uses too,
// must refuse the file or give finite results. A worker runs the cases, so that one that does not end is found. The
// environment variable SUPINE is the path of the program.
import assert from 'node:assert/strict';
import { existsSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { isMainThread, parentPort, Worker, workerData } from 'node:worker_threads';

const NUMBERS = {
  F32: Float32Array,
  F64: Float64Array,
  U32: Uint32Array,
  U8: Uint8Array,
  I8: Int8Array,
  I16: Int16Array,
  U16: Uint16Array,
};
const VALUES = [NaN, Infinity, -Infinity, 0, -1, 1, 5e-324, 1e-300, -1e-300, 1e-30, 1e-9, 1000, 1e9, 1e30, 1e300];
const WAYS = {
  set: (numbers, value) => numbers.fill(value),
  multiply: (numbers, value) => numbers.map((x) => x * value),
  first: (numbers, value) => numbers.map((x, i) => (i === 0 ? value : x)),
};

/** Hash bytes by XXH64. */
function hash(bytes, seed) {
  const [p1, p2, p3, p4, p5] = [
    0x9e3779b185ebca87n,
    0xc2b2ae3d27d4eb4fn,
    0x165667b19e3779f9n,
    0x85ebca77c2b2ae63n,
    0x27d4eb2f165667c5n,
  ];
  const wrap = (x) => BigInt.asUintN(64, x);
  const turn = (x, bits) => wrap((x << bits) | (x >> (64n - bits)));
  const round = (sum, word) => wrap(turn(wrap(sum + word * p2), 31n) * p1);
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  let at = 0;
  let h = wrap(seed + p5);
  if (bytes.length >= 32) {
    const v = [seed + p1 + p2, seed + p2, seed, seed - p1].map(wrap);
    for (; at + 32 <= bytes.length; at += 32)
      for (let i = 0; i < 4; ++i) v[i] = round(v[i], view.getBigUint64(at + 8 * i, true));
    h = wrap(turn(v[0], 1n) + turn(v[1], 7n) + turn(v[2], 12n) + turn(v[3], 18n));
    for (const x of v) h = wrap((h ^ round(0n, x)) * p1 + p4);
  }
  h = wrap(h + BigInt(bytes.length));
  for (; at + 8 <= bytes.length; at += 8) h = wrap(turn(h ^ round(0n, view.getBigUint64(at, true)), 27n) * p1 + p4);
  for (; at + 4 <= bytes.length; at += 4)
    h = wrap(turn(h ^ wrap(BigInt(view.getUint32(at, true)) * p1), 23n) * p2 + p3);
  for (; at < bytes.length; ++at) h = wrap(turn(h ^ wrap(BigInt(bytes[at]) * p5), 11n) * p1);
  h = wrap((h ^ (h >> 33n)) * p2);
  h = wrap((h ^ (h >> 29n)) * p3);
  return h ^ (h >> 32n);
}

const utf8 = (text) => new TextEncoder().encode(text);

/** Parse a safetensors file: {metadata, tensors: {name: {dtype, shape, numbers}}}. */
function parse(bytes) {
  const length = Number(bytes.readBigUInt64LE(0));
  const { __metadata__: metadata, ...entries } = JSON.parse(bytes.subarray(8, 8 + length).toString());
  const tensors = {};
  for (const [
    name,
    {
      dtype,
      shape,
      data_offsets: [begin, end],
    },
  ] of Object.entries(entries)) {
    const data = Uint8Array.from(bytes.subarray(8 + length + begin, 8 + length + end));
    tensors[name] = { dtype, shape, numbers: new NUMBERS[dtype](data.buffer) };
  }
  return { metadata, tensors };
}

const hashes = new WeakMap(); // those of the numbers of tensors that did not change
function hashTensor(name, { dtype, shape, numbers }) {
  if (!hashes.has(numbers)) {
    const bytes = new Uint8Array(numbers.buffer, numbers.byteOffset, numbers.byteLength);
    hashes.set(numbers, hash(bytes, hash(utf8(`${dtype} [${shape.join(',')}]`), hash(utf8(name), 0n))));
  }
  return hashes.get(numbers);
}

/** Return the bytes of a safetensors file with its checksum. */
function format({ metadata, tensors }) {
  let total = 0n;
  let at = 0;
  const entries = {};
  for (const [name, tensor] of Object.entries(tensors)) {
    total += hashTensor(name, tensor);
    entries[name] = { dtype: tensor.dtype, shape: tensor.shape, data_offsets: [at, (at += tensor.numbers.byteLength)] };
  }
  for (const [key, value] of Object.entries(metadata))
    if (key !== 'checksum') total += hash(utf8(value), hash(utf8(key), 1n));
  const checksum = `xxh64:${BigInt.asUintN(64, total).toString(16).padStart(16, '0')}`;
  const header = Buffer.from(JSON.stringify({ __metadata__: { ...metadata, checksum }, ...entries }));
  const size = Buffer.alloc(8);
  size.writeBigUInt64LE(BigInt(header.length));
  return Buffer.concat([
    size,
    header,
    ...Object.values(tensors).map(({ numbers }) => Buffer.from(numbers.buffer, numbers.byteOffset, numbers.byteLength)),
  ]);
}

/** Return the file after a change: {tensor, way, value} or {key, value}. */
function change({ metadata, tensors }, { tensor, way, key, value }) {
  if (key !== undefined) return { metadata: { ...metadata, [key]: value }, tensors };
  if (tensor === undefined) return { metadata, tensors };
  const { dtype, shape, numbers } = tensors[tensor];
  return { metadata, tensors: { ...tensors, [tensor]: { dtype, shape, numbers: WAYS[way](numbers.slice(), value) } } };
}

/** Return all changes of a file to try, and first none. */
function casesOf({ metadata, tensors }) {
  const cases = [{}];
  for (const [tensor, { dtype }] of Object.entries(tensors)) {
    const values = { F32: VALUES, F64: VALUES, U32: [0, 1000, 4294967295] }[dtype] ?? [];
    for (const way of dtype === 'U32' ? ['set', 'first'] : Object.keys(WAYS))
      for (const value of values) cases.push({ tensor, way, value });
  }
  for (const [key, text] of Object.entries(metadata)) {
    const parts = text.split(',');
    if (key === 'version' || !parts.every((part) => part !== '' && Number.isFinite(Number(part)))) continue;
    for (const value of VALUES)
      cases.push({ key, value: parts.map((part, i) => (i === 0 ? String(value) : part)).join(',') });
  }
  return cases;
}

const finite = (numbers) => Array.from(numbers).flat().every(Number.isFinite);
const GRAVITIES = [
  [0, 1, 0],
  [0, -1, 0],
  [0.6, 0.2, -0.7],
];

/** Return a function that tries a file with the package. */
async function tryPackage(path) {
  const { open, SupineError } = await import(pathToFileURL(path));
  const refused = (act, status) => {
    try {
      act();
    } catch (error) {
      assert.ok(error instanceof SupineError, error.stack);
      if (status) assert.equal(error.status, status);
      return true;
    }
    return false;
  };
  return async (file) => {
    let lungs;
    try {
      lungs = await open(format(file));
    } catch (error) {
      assert.ok(error instanceof SupineError && error.status === 'format', error.stack);
      return 'refused';
    }
    for (const [name, { dtype, numbers }] of Object.entries(file.tensors)) {
      assert.ok(lungs.tensor(name).data instanceof NUMBERS[dtype], `tensor ${name}`);
      assert.equal(lungs.tensor(name).data.length, numbers.length);
    }
    for (const [i, gravity] of GRAVITIES.entries()) {
      for (const value of [NaN, Infinity]) {
        assert.ok(
          refused(() => lungs.pose({ gravity, gain: value }), 'argument'),
          'a gain that is not finite',
        );
        assert.ok(
          refused(() => lungs.pose({ gravity: gravity.with(i, value) }), 'argument'),
          'gravity that is not finite',
        );
      }
      for (const volume of ['', 'rest+300', 'full', 'scan-500', '3000mL']) {
        if (refused(() => lungs.pose({ gravity, volume }))) continue;
        lungs.deformLit();
        assert.ok(finite(lungs.positions) && finite(lungs.normals), 'finite positions and normals');
        assert.ok(finite(Object.values(lungs.volumes)) && Number.isFinite(lungs.error), 'finite volumes and error');
        refused(() => assert.ok(finite(lungs.expectedError()), 'finite expected errors'));
        if (lungs.tensor('names'))
          refused(() => assert.ok(finite(lungs.targets().map(({ mm }) => mm)), 'finite targets'));
      }
    }
    return 'opened';
  };
}

async function work() {
  const { path, files } = workerData;
  const attempt = await tryPackage(path);
  const sound = files.map((file) => parse(readFileSync(file)));
  parentPort.on('message', async ({ file, one }) => {
    try {
      parentPort.postMessage({ verdict: await attempt(change(sound[file], one)) });
    } catch (error) {
      parentPort.postMessage({ fault: error.stack });
    }
  });
}

/** Return the verdict of the worker on a case; throw if it finds a fault or does not end within a minute. */
function ask(worker, file, one) {
  return new Promise((resolve, reject) => {
    const words = JSON.stringify({ file, ...one, value: String(one.value) });
    const timer = setTimeout(() => reject(new Error(`does not end: ${words}`)), 60000);
    worker.once('message', ({ verdict, fault }) => {
      clearTimeout(timer);
      if (fault) reject(new Error(`${words}: ${fault}`));
      else resolve(verdict);
    });
    worker.postMessage({ file, one });
  });
}

async function main() {
  const { folder, skip, supine } = await import('../export/support.mjs');
  const [path] = process.argv.slice(2);
  if (!existsSync(path)) skip(`no ${path}`);
  const [mesh, lungs, points, inside] = ['lungs.ply', 'lungs.safetensors', 'points.csv', 'inside.safetensors'].map(
    (name) => join(folder, name),
  );
  supine('phantom', '--vertices', '100', '-o', mesh);
  supine('precompute', mesh, '--band', '3', '-o', lungs);
  writeFileSync(points, 'name,x,y,z\nnodule,-80,-120,-90\nother,70,-150,-120\n');
  supine('embed', lungs, points, '-o', inside);
  const files = [lungs, inside];
  const worker = new Worker(new URL(import.meta.url), { workerData: { path, files } });
  const verdicts = { opened: 0, refused: 0 };
  try {
    for (const [i, file] of files.entries()) {
      for (const [j, one] of casesOf(parse(readFileSync(file))).entries()) {
        const verdict = await ask(worker, i, one);
        assert.ok(j > 0 || verdict === 'opened', 'the file without a change opens');
        ++verdicts[verdict];
      }
    }
  } finally {
    await worker.terminate();
  }
  console.log(`${verdicts.opened} files opened, ${verdicts.refused} refused`);
}

if (isMainThread) await main();
else await work();
