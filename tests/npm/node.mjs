// SPDX-License-Identifier: GPL-3.0-or-later
// Test the JavaScript package in node: its results equal those of plain C, its size is within limits, wrong
// input is refused, and its examples and types are correct.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync, renameSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { brotliCompressSync } from 'node:zlib';
import { checkAll, pose } from './agree.mjs';
import { breathing, content, demo, inside, native, packed } from './made.mjs';
import { folder, largestDistance, loadCommon, supine } from '../export/support.mjs';

const { open, SupineError } = await import(join(packed, 'supine.js'));
const bytes = readFileSync(demo);

await checkAll(async (basis, states) => pose(await open(readFileSync(basis)), states));

/* supine.wasm has at most 179 kB, and at most 74 kB if compressed: 51 before it held what the page needs (files made in
 * memory, weights for GLSL, the range of simulated volumes) and the facts about a basis, 56 before the random field of
 * the expected error (covariances, registrations, samples), 66 before kriging with a fit's landmarks, and 73 before the
 * errors of fields between directions. */
const wasm = readFileSync(join(packed, 'supine.wasm'));
const small = brotliCompressSync(wasm).length;
console.log(`supine.wasm: ${wasm.length} bytes, ${small} with brotli`);
assert.ok(wasm.length <= 179000 && small <= 74000);

/* A basis is opened from a path, an address, a Blob, a Response, or a promise. Other values are refused with what it
 * takes; a file that cannot be read is named. */
for (const source of [
  demo,
  pathToFileURL(demo),
  new Blob([bytes]),
  new Response(bytes),
  Promise.resolve(bytes),
  Promise.resolve(demo),
]) {
  assert.equal((await open(source)).vertexCount, (await open(bytes)).vertexCount);
}
for (const source of [undefined, null, 5, {}, [1, 2]])
  await assert.rejects(open(source), {
    status: 'argument',
    message: /a path, the bytes of a basis file, a Blob, a Response/,
  });
await assert.rejects(open(join(folder, 'none.safetensors')), { status: 'read', message: /none\.safetensors/ });
await assert.rejects(open(new Response('', { status: 404 })), { status: 'read', message: /404/ });

/* After a first failure to load supine.wasm, a further call tries again. */
const [moved, away] = [join(packed, 'supine.wasm'), join(folder, 'supine.wasm')];
const { open: openAgain } = await import(`${join(packed, 'supine.js')}?again`);
renameSync(moved, away);
await assert.rejects(openAgain(bytes), { status: 'read' });
renameSync(away, moved);
assert.ok((await openAgain(bytes)).vertexCount > 0);

/* One vertex moves like all of them, and the sums of supine.glsl give its position. */
const single = (await open(bytes, { exact: true })).pose('prone:rest+500');
const [{ weights, gains }, modes] = [single.uniforms, single.tensor('coefficients')];
const [direction, all] = [single.tensor('direction').data, single.deform()];
for (const v of [0, 17, single.vertexCount - 1]) {
  const amount = modes.data
    .subarray(v * modes.shape[1], (v + 1) * modes.shape[1])
    .reduce((sum, c, k) => sum + c * weights[k], 0);
  const lung = Object.values(single.lungs).findIndex(([, end]) => v < end);
  const sum = [0, 1, 2].map(
    (axis) => single.vertices[3 * v + axis] + gains[3 * lung + axis] * amount * direction[3 * v + axis],
  );
  assert.ok(
    largestDistance(single.at(v), all.subarray(3 * v, 3 * v + 3)) < 1e-4 && largestDistance(sum, single.at(v)) < 1e-3,
    `vertex ${v}`,
  );
}
assert.throws(() => single.at(single.vertexCount), { status: 'argument' });
assert.equal(single.simulatedRange([0, 1, 0], 'rest'), undefined);

/* Two open bases do not affect each other, and their arrays stay valid. A state can be given as text, or as gravity
 * with a volume or a gain (factor of the displacements). A refused state changes nothing. */
const [lungs, other] = [
  await open(bytes),
  await open(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), { wasm }),
];
const { positions, normals } = lungs;
assert.ok(
  largestDistance(positions, lungs.vertices) < 0.002,
  'positions before the first pose differ from those in the file',
);
lungs.pose('prone:rest+500').deformLit();
const prone = positions.slice();
other.pose({ gravity: new Float32Array([0, -2, 0]), volume: 'rest+500' }).deform();
assert.deepEqual(other.positions, prone);
other.pose('left').deform();
assert.notDeepEqual(other.positions, prone);
assert.equal(lungs.deform(), positions);
assert.deepEqual(positions, prone);
for (let i = 0; i < 2000; ++i) lungs.pose(`left:rest+${i}`).expectedError('prone');
assert.ok(lungs.positions === positions && lungs.normals === normals && positions.length === 3 * lungs.vertexCount);
lungs.pose({ gravity: [0, -1, 0], gain: 0 }).deform();
assert.ok(largestDistance(positions, lungs.vertices) < 0.002);
lungs.pose('prone:rest+500');
for (const [state, status, words] of [
  ['pron', 'argument', /did you mean 'prone'/],
  ['prone:500', 'argument', /500/],
  ['prone:full-30000', 'numerical', /folds/],
  [{ gravity: [0, 0, 0] }, 'argument', /gravity/],
  [{ gravity: [0, NaN, 0], gain: 1 }, 'argument', /gravity/],
  [`prone:${'0'.repeat(600)}mL`, 'argument', /at most 511/],
  [{ posture: 'prone:rest', volume: 'full' }, 'argument', /no member 'posture'/],
  [[0, -1, 0], 'argument', /text/],
  [5, 'argument', /text/],
  [null, 'argument', /text/],
  [{ volume: 'prone:rest' }, 'argument', /volume/],
  [{ gain: 1, volume: 'full' }, 'argument', /one of them/],
  ['supine:90L', 'numerical', /folds/],
]) {
  assert.throws(
    () => lungs.pose(state),
    (error) => error instanceof SupineError && error.status === status && words.test(error.message),
    `${JSON.stringify(state)}`,
  );
}
assert.deepEqual(lungs.deform(), prone);
try {
  native(demo, 'pron', 2);
  assert.fail('C accepts the posture pron');
} catch (error) {
  assert.throws(() => lungs.pose('pron'), { message: error.stderr.toString().trim() });
}
for (const cut of [0, 7, 1000, bytes.length - 1]) {
  await assert.rejects(
    open(bytes.subarray(0, cut)),
    (error) => error instanceof SupineError && error.status === 'format',
    `${cut} bytes`,
  );
}

/* The lungs of a simulator do not jump where a volume begins to differ from that of the scan. */
for (const path of breathing) {
  const moving = await open(readFileSync(path));
  for (const posture of ['supine', 'prone', 'left']) {
    const [at, near] = [`${posture}:scan`, `${posture}:scan+0.01`].map((state) => moving.pose(state).deform().slice());
    assert.ok(largestDistance(at, near) < 0.005, posture);
  }
}

/* Lungs, triangles, metadata and tensors of the file can be read. */
assert.deepEqual(Object.keys(lungs.lungs), ['left', 'right']);
assert.deepEqual(Object.values(lungs.lungs).flat(), [0, lungs.lungs.right[0], lungs.lungs.right[0], lungs.vertexCount]);
assert.equal(lungs.metadata.format, 'supine-basis');
assert.equal(Math.max(...lungs.triangles), lungs.vertexCount - 1);
assert.deepEqual(lungs.tensor('coefficients').shape[0], lungs.vertexCount);
assert.equal(lungs.tensor('none'), undefined);
assert.ok(lungs.tensor('normals').data instanceof Int8Array); // numbers.mjs reads every tensor of a file
const numberWanted = (what) => ({ status: 'argument', message: what });
for (const nothing of [null, '', [], '1', true]) {
  const [part, gain] = [{ gravity: [0, nothing, 1] }, { gravity: [0, 1, 0], gain: nothing }];
  assert.throws(() => lungs.pose(part), numberWanted(/gravity has .*: give a number/));
  assert.throws(() => lungs.pose(gain), numberWanted(/gain has .*: give a number/));
  assert.throws(() => lungs.pose({ gravity: nothing }), numberWanted(/gravity must be three numbers/));
}
assert.throws(() => lungs.pose({ gravity: [0, 1, 0], gain: 9.81 }), { status: 'numerical', message: /allowFolds/ });

/* A pose that lungs cannot hold is refused or, if that is allowed, told. */
assert.throws(() => lungs.pose('supine:full+2L'), { status: 'numerical', message: /allowFolds: true/ });
assert.deepEqual(lungs.pose('prone').findings, []);
const allowed = await open(bytes, { allowFolds: true });
assert.deepEqual(allowed.findings, []);
assert.match(allowed.pose('supine:full+2L').findings[0].text, /of full inflation .*, outside the 10 to 120 %/);
assert.equal(allowed.findings[0].warning, true);
assert.equal(allowed.findings.length, 1);
assert.deepEqual(allowed.pose('prone').findings, []);
const strict = (await open(readFileSync(inside), { doubt: true })).pose('prone');
const folding = await open(readFileSync(inside), { allowFolds: true, doubt: true });
for (const ask of [
  (basis, since) => basis.targets(since),
  (basis, since) => basis.expectedError(since),
  (basis, since) => basis.covariance([0], { since }),
  (basis, since) => basis.registration([0, 100, 200], { since }),
]) {
  ask(folding.pose('prone'), 'supine:full+2L');
  assert.equal(folding.findings.length, 1, ask);
  assert.match(folding.findings[0].text, /^supine at full inflation \+ 2000 mL: .* of full inflation/);
  assert.deepEqual(folding.pose('prone').findings, []);
  assert.throws(() => ask(strict, 'supine:full+2L'), { status: 'numerical', message: /allowFolds: true/ });
  assert.throws(() => ask(strict, { gain: 1 }), { status: 'argument', message: /give a volume/ });
  assert.throws(() => ask(strict, null), { status: 'argument', message: /a state must be/ });
}
for (const gain of [NaN, Infinity])
  assert.throws(() => lungs.pose({ gravity: [0, 1, 0], gain }), { status: 'argument' });
assert.equal(strict.tensor('names').data.length > 0, true);

/* A pose that no state describes has no expected error. */
for (const pose of [() => strict.poseScan(), () => strict.pose({ gain: 1 })]) {
  pose();
  for (const ask of [() => strict.expectedError(), () => strict.covariance([0]), () => strict.sample(0)])
    assert.throws(ask, { status: 'unsupported', message: /pose a state/ });
  assert.ok(strict.targets().every(({ expectedError, movedError }) => Number.isNaN(expectedError + movedError)));
}

/* Gravity from a rotation: of three.js's objects, which face +z, and cameras, which face -z. */
const { Matrix3, Object3D, PerspectiveCamera } = loadCommon('three');
const aimed = (object, top, target) => {
  object.up.set(...top);
  object.lookAt(...target);
  object.updateMatrixWorld();
  const { w, x, y, z } = object.quaternion;
  return [[w, x, y, z], new Matrix3().setFromMatrix4(object.matrixWorld).transpose().elements];
};
for (const [axes, top, target, gravity] of [
  ['three', [0, 1, 0], [3, 0, 4], [0, 0, -1]], // upright, turned about the vertical
  ['three', [0, 0, -1], [0, 1, 0], [0, 1, 0]], // faces up: on the back
  ['three', [0, 0, 1], [0, -1, 0], [0, -1, 0]],
  ['three', [1, 0, 0], [0, 0, 1], [1, 0, 0]], // the head points to +x; left = head x front = x x z = -y is below
  ['headset', [0, 1, 0], [0, 0, -1], [0, 0, -1]],
  ['headset', [0, 0, 1], [0, 1, 0], [0, 1, 0]],
  ['headset', [1, 0, 0], [0, 0, -1], [-1, 0, 0]], // left = x x (-z) = y is above
]) {
  const object = axes === 'three' ? new Object3D() : new PerspectiveCamera();
  for (const rotation of aimed(object, top, target)) {
    const found = lungs.gravityOfRotation(rotation, [0, 1, 0], axes);
    assert.ok(largestDistance(found, gravity) < 1e-6, `${axes} ${top} ${target}: ${found}`);
  }
}
assert.deepEqual(lungs.gravityOfRotation([1, 0, 0, 0], [0, 0, 1]), [0, 0, -1]);
for (const [rotation, up, axes, words] of [
  [[1, 1, 0, 0], [0, 1, 0], 'unity', /scale 2 instead of 1.*Normalise/],
  [[-1, 0, 0, 0, 1, 0, 0, 0, 1], [0, 1, 0], 'unity', /mirrored/],
  [[NaN, 0, 0, 0], [0, 1, 0], 'unity', /rotation is NaN/],
  [new Float32Array(16), [0, 1, 0], 'unity', /16 numbers: give a quaternion of 4 or a matrix of 9/],
  [[1, 0, 0, 0], [0, 1], 'unity', /up must be three numbers/],
  [[1, 0, 0, 0], [0, 1, 0], 'godot', /give one of lps unity unreal three headset/],
]) {
  assert.throws(() => lungs.gravityOfRotation(rotation, up, axes), { status: 'argument', message: words });
}

/* The targets are the rows of 'supine deform': a row for each name, also of a mesh. */
const [parts, table] = [await open(readFileSync(inside)), join(folder, 'targets.csv')];
for (const [since, from] of [
  ['supine:rest', ['--from', 'supine:rest']],
  [undefined, []],
]) {
  supine('deform', inside, '--posture', 'left', ...from, '-o', table);
  const rows = readFileSync(table, 'utf8')
    .trim()
    .split('\n')
    .slice(2)
    .map((line) => line.split(','));
  const targets = parts.pose('left').targets(since);
  assert.deepEqual(
    targets.map(({ name, lung }) => [name, lung]),
    rows.map((row) => row.slice(0, 2)),
  );
  assert.deepEqual(
    targets.filter(({ anatomy }) => anatomy).map(({ name }) => name),
    ['lungs'],
  ); // a mesh as large as the lungs
  targets.forEach(({ at, move, mm, movedError, expectedError, anotherDayError }, i) =>
    [...at, ...move, mm, movedError, expectedError, anotherDayError].forEach((x, k) =>
      assert.ok(Math.abs(x - rows[i][2 + k]) < 5e-3, `${rows[i]}: ${x}`),
    ),
  );
}

/* Fields over gravity and volume have no gain. Targets inside them move by the weights of their lung, from the scan. */
const [breaths, breathed] = [await open(readFileSync(breathing[1])), join(folder, 'breathed.safetensors')];
assert.throws(() => breaths.pose({ gravity: [0, 1, 0], gain: 1 }), {
  status: 'unsupported',
  message: /give a volume instead of a gain/,
});
supine('embed', breathing[1], content, '-o', breathed);
supine('deform', breathed, '--posture', 'left', '--volume', 'left=3000mL,right=3900mL', '-o', table);
const rowsOf = readFileSync(table, 'utf8')
  .trim()
  .split('\n')
  .slice(2)
  .map((line) => line.split(','));
const shifted = (await open(readFileSync(breathed))).pose('left:left=3000mL,right=3900mL').targets();
assert.equal(shifted.length, rowsOf.length);
shifted.forEach(({ at, move, mm, expectedError }, i) => {
  [...at, ...move, mm].forEach((x, k) => assert.ok(Math.abs(x - rowsOf[i][2 + k]) < 5e-3, `${rowsOf[i]}: ${x}`));
  assert.ok(Number.isNaN(expectedError));
});

/* A basis of an open surface has no volumes. A pose needs a gain, the displacement factor. */
const openSurface = join(dirname(process.env.GOLDEN), 'open_surface.safetensors');
const opened = await open(readFileSync(openSurface));
assert.throws(() => opened.volumes, { status: 'open surface' });
assert.throws(() => opened.pose('prone:rest+500'), SupineError);
opened.pose({ gravity: [0, -1, 0], gain: 3 }).deformLit();
assert.notDeepEqual(opened.positions, opened.vertices);
assert.ok(Math.abs(Math.hypot(...opened.normals.slice(0, 3)) - 1) < 1e-6);
const gained = { gravity: [0, -1, 0], gain: 9.81 };
assert.throws(() => opened.pose(gained), { status: 'numerical', message: /the gain 9.81 .* outside -5 to 5/ });
const taken = await open(readFileSync(openSurface), { allowFolds: true });
assert.match(taken.pose(gained).findings[0].text, /the gain 9.81 .* outside -5 to 5/);

/* The JavaScript examples in the README.md of the package and in that of the project run without errors. */
for (const readme of [join(packed, 'README.md'), process.env.README]) {
  const [, code] = /```js\n([\s\S]*?)```/.exec(readFileSync(readme, 'utf8'));
  writeFileSync(join(folder, 'readme.mjs'), code);
  assert.match(execFileSync(process.execPath, ['readme.mjs'], { cwd: folder, encoding: 'utf8' }), /Float32Array/);
}

/* The example runs, and prints the volumes of both lungs. */
writeFileSync(join(folder, 'lungs.mjs'), readFileSync(join(folder, 'node_modules/supine/examples/lungs.mjs')));
assert.match(
  execFileSync(process.execPath, ['lungs.mjs', demo, 'prone:rest+500'], { cwd: folder, encoding: 'utf8' }),
  /vertices; the first is at .*\nleft lung: \d+ mL\nright lung: \d+ mL\n$/,
);

/* The field of the expected error: the covariance of points, what a registration leaves, and samples, which are those
 * of the command. They need memory that is reserved as the basis is opened. */
assert.throws(() => lungs.sample(0), { status: 'argument', message: /doubt: true/ });
const doubted = await open(bytes, { doubt: true });
doubted.pose('prone:rest');
const stated = doubted.expectedError().slice();
const last = doubted.vertexCount - 1;
const { mean, covariance } = doubted.covariance([0, last]);
doubted.deform();
assert.ok(Math.abs(mean[3] - doubted.positions[3 * last]) < 1e-3);
const trace = covariance[0] + covariance[7] + covariance[14];
assert.ok(trace > 0.999 * stated[0] ** 2 && trace < 1.34 * stated[0] ** 2);
assert.equal(covariance[3], covariance[18]);
const anotherDay = doubted.covariance([0], { anotherDay: true }).covariance;
assert.ok(Math.abs(anotherDay[0] - covariance[0] - (4 / 9) * 6.2 ** 2) < 1e-9);
const fiducials = [0, 1, 2, 3, 4, 5].map((i) => Math.floor((i * last) / 5));
const { rotation, translation, error: left } = doubted.registration(fiducials);
const apart = (moved) => fiducials.reduce((sum, f) => {
  const x = Array.from(doubted.positions.subarray(3 * f, 3 * f + 3));
  const [r, t] = moved ? [rotation, translation] : [[1, 0, 0, 0, 1, 0, 0, 0, 1], [0, 0, 0]];
  const y = [0, 1, 2].map((k) => r[3 * k] * x[0] + r[3 * k + 1] * x[1] + r[3 * k + 2] * x[2] + t[k]);
  return sum + Math.hypot(...y.map((value, k) => value - doubted.vertices[3 * f + k])) ** 2;
}, 0);
assert.ok(apart(true) < 0.9 * apart(false) && left[0] > 0 && left[0] < 1.16 * stated[0]);
assert.throws(() => doubted.registration([0, 1]), { status: 'argument', message: /3 to 300/ });
const drawn = join(folder, 'drawn.safetensors');
supine('deform', demo, '--posture', 'prone:rest', '--samples', '2', '--seed', '3', '-o', drawn);
const file = readFileSync(drawn);
const start = 8 + file.readUInt32LE(0);
const at = start + JSON.parse(file.subarray(8, start)).positions.data_offsets[0] + 12 * doubted.vertexCount;
const second = new Float32Array(Uint8Array.from(file.subarray(at, at + 12 * doubted.vertexCount)).buffer);
doubted.registration(fiducials); // in the memory of the samples' field
assert.ok(largestDistance(doubted.sample(1, { seed: 3 }), second) < 0.05);
const { left: volume } = doubted.volumes;
assert.ok(largestDistance(doubted.sample(0, { seed: 3 }), second) > 5 && volume > 0);

/* In TypeScript, correct use of the package compiles, and each line of wrong use gives one error. */
const typescript = loadCommon('typescript');
const use = `import { open, SupineError, type State } from 'supine';
const lungs = await open(new ArrayBuffer(8), { wasm: new Uint8Array(8) });
const state: State = { gravity: [0, 1, 0], volume: 'rest+500' };
const numbers: Float32Array = lungs.pose(state).deformLit();
const [begin, end]: [number, number] = lungs.lungs.left;
try { lungs.pose('pron'); } catch (error) {
  if (error instanceof SupineError && error.status === 'argument') throw error;
}
`;
const wrong = ['lungs.pose(5);', 'lungs.positions = numbers;', 'await open(5);', 'lungs.volumes.left = "much";'];
const compile = (text) => {
  const file = join(folder, 'use.ts');
  writeFileSync(file, text);
  const program = typescript.createProgram([file], {
    strict: true,
    noEmit: true,
    target: typescript.ScriptTarget.ES2022,
    module: typescript.ModuleKind.NodeNext,
    moduleResolution: typescript.ModuleResolutionKind.NodeNext,
    types: [],
  });
  return typescript
    .getPreEmitDiagnostics(program)
    .map(({ messageText }) => typescript.flattenDiagnosticMessageText(messageText, '\n'));
};
writeFileSync(join(folder, 'package.json'), '{ "type": "module" }');
assert.deepEqual(compile(use), []);
for (const line of wrong) assert.equal(compile(use + line).length, 1, line);
