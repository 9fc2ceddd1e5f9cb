// SPDX-License-Identifier: GPL-3.0-or-later
// .glb files: Khronos' validator has nothing to say, and three.js, given weights from Y_lm(g) as
// the file's own extras describe them, makes the positions that the C evaluator makes.
import assert from 'node:assert/strict';
import { readFileSync, statSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import {
  evaluate, folder, largestDistance, load, loadCommon, randomDirections, randomSource, supine,
} from './support.mjs';
import { harmonics } from './harmonics.mjs';

const validator = loadCommon('gltf-validator');
const three = await load('three/build/three.module.js');
const { GLTFLoader } = await load('three/examples/jsm/loaders/GLTFLoader.js');

const FLOAT_MM = 0.001;
const QUANTISED_MM = 0.01;
const BREATH = 1000; // mL

/** Asserts that the validator finds neither error nor warning. */
async function validate(path) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(path)));
  const bad = report.issues.messages.filter((message) => message.severity <= 1);
  assert.deepEqual(bad, [], path);
  assert.equal(report.issues.numErrors + report.issues.numWarnings, 0);
}

async function open(path) {
  const bytes = readFileSync(path);
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
  const gltf = await new GLTFLoader().parseAsync(buffer, '');
  gltf.scene.updateMatrixWorld(true);
  const meshes = []; // one a lung, of the same vertices
  gltf.scene.traverse((object) => { if (object.isMesh) meshes.push(object); });
  return { gltf, meshes, mesh: meshes[0] };
}

/** What all lungs gain at v, f . (x, y, z, yz, xz, xy, xyz) of the gains, from the forms in the extras. */
function volumeForm(volume, v, lungs) {
  const k = v.length;
  const axes = volume.linear.length / k / lungs;
  const form = new Float64Array(7);
  for (let row = 0; row < lungs * axes; ++row) {
    for (let a = 0; a < k; ++a) {
      form[row % axes] += volume.linear[row * k + a] * v[a];
      for (let b = 0; b < k; ++b) form[3 + (row % axes)] += volume.quadratic[(row * k + a) * k + b] * v[a] * v[b];
    }
  }
  volume.cubic.forEach((c, i) => { form[6] += c * v[Math.floor(i / k / k) % k] * v[Math.floor(i / k) % k] * v[i % k]; });
  return form;
}

const formAt = (f, [x, y, z]) => x * f[0] + y * f[1] + z * f[2] + y * z * f[3] + x * z * f[4] + x * y * f[5] + x * y * z * f[6];

/** The root of an ascending or descending function near `from`, by secants. */
function root(f, from) {
  let [a, b] = [0.9 * from, from];
  for (let i = 0; i < 50 && f(b) !== f(a); ++i) [a, b] = [b, b - (f(b) * (b - a)) / (f(b) - f(a))];
  return b;
}

/** Weights for a gravity and mL beyond the vertices as they are, as extras.supine.weights says. */
function weightsFor(extras, gravity, mL) {
  const y = harmonics(extras.band, gravity);
  const v = extras.modes.map((row) => row.reduce((sum, m, i) => sum + m * y[i], 0));
  const form = volumeForm(extras.volume, v, extras.lungBegin.length - 1);
  const even = (volume) => root((s) => formAt(form, [s, s, s]) - volume, volume / (form[0] + form[1] + form[2]));
  let [s, t] = [even(mL), 0];
  if (extras.bend.some((c) => c !== 0)) {
    const y2 = harmonics(2, gravity);
    const rest = extras.restingVolume.harmonics.reduce((sum, h, i) => sum + h * y2[i], 0);
    const r = even(rest);
    const bent = (q) => 2 * r * (q <= 1 ? (q ** 3 - q) / 2 : 1 - 1 / q);
    const q = root((at) => formAt(form, extras.bend.map((c) => r * at + c * bent(at))) - mL, mL / rest);
    [s, t] = [r * q, bent(q)];
  }
  const all = extras.offset.length > v.length ? [...v.map((x) => s * x), ...v.map((x) => t * x)] : v.map((x) => s * x);
  return { s, weights: all.map((x, k) => (x - extras.offset[k]) / extras.unit[k]) };
}

/** Positions as three.js morphs them, in the patient's axes and millimetres. */
function morphed(mesh) {
  const inverse = new three.Matrix4() // metres, y up -> millimetres, LPS
    .set(1000, 0, 0, 0, 0, 0, -1000, 0, 0, 1000, 0, 0, 0, 0, 0, 1);
  const count = mesh.geometry.attributes.position.count;
  const xyz = new Float64Array(3 * count);
  const point = new three.Vector3();
  for (let i = 0; i < count; ++i) {
    mesh.getVertexPosition(i, point).applyMatrix4(mesh.matrixWorld).applyMatrix4(inverse);
    point.toArray(xyz, 3 * i);
  }
  return xyz;
}

/** Unit normals [N] of triangles, by area. */
function exactNormals(xyz, corners) {
  const sums = Array.from({ length: xyz.length / 3 }, () => new three.Vector3());
  const at = (v) => new three.Vector3().fromArray(xyz, 3 * v);
  for (let t = 0; t < corners.length; t += 3) {
    const [a, b, c] = [at(corners[t]), at(corners[t + 1]), at(corners[t + 2])];
    const cross = b.sub(a).cross(c.sub(a));
    for (let i = 0; i < 3; ++i) sums[corners[t + i]].add(cross);
  }
  return sums.map((n) => n.normalize());
}

/** Angles, degrees, ascending, between the surface's own normals and those that engines morph. */
function normalErrors(meshes, xyz) {
  const { attributes, morphAttributes } = meshes[0].geometry;
  const exact = exactNormals(xyz, meshes.flatMap((mesh) => [...mesh.geometry.index.array]));
  const [sum, part] = [new three.Vector3(), new three.Vector3()];
  return exact.map((normal, i) => {
    sum.fromBufferAttribute(attributes.normal, i);
    meshes[0].morphTargetInfluences.forEach((weight, k) => sum.addScaledVector(part.fromBufferAttribute(morphAttributes.normal[k], i), weight));
    return (sum.angleTo(normal) * 180) / Math.PI;
  }).sort((a, b) => a - b);
}

/** The same for normals that stay those at rest. */
function stillErrors(rest, xyz, meshes) {
  const corners = meshes.flatMap((mesh) => [...mesh.geometry.index.array]);
  const before = exactNormals(rest, corners);
  return exactNormals(xyz, corners).map((normal, i) => (normal.angleTo(before[i]) * 180) / Math.PI);
}

/** One profile of one basis; returns the largest distance, mm. */
async function check(basis, words, tolerance, targets, clamped) {
  const path = join(folder, 'lungs.glb');
  supine('export', basis, '-o', path, '--breath', String(BREATH), ...words);
  await validate(path);
  const { mesh, meshes } = await open(path);
  assert.deepEqual(meshes.map((m) => m.material.name), ['left', 'right']);
  const extras = mesh.userData.supine;
  assert.equal(mesh.morphTargetInfluences.length, targets);
  assert.deepEqual(Object.keys(mesh.morphTargetDictionary), mesh.userData.targetNames);
  const random = randomSource(77);
  const pairs = randomDirections(10, 20241).map((g, i) => [g, i % 2 ? BREATH * random() : BREATH]);
  const truth = evaluate(basis, [[[0, 1, 0], 0], ...pairs]);
  let worst = largestDistance(morphed(mesh), truth[0].xyz); // weights as stored: at rest
  const [angles, still] = [[], []];
  assert.ok(normalErrors(meshes, truth[0].xyz).at(-1) < 1, 'the normals at rest are not the surface\'s');
  mesh.morphTargetInfluences.fill(0); // engines may turn the base's normals with the surface: they are its own
  assert.ok(normalErrors(meshes, morphed(mesh)).at(-1) < 0.1, 'the base has other normals than its surface');
  pairs.forEach(([g, mL], i) => {
    const { s, weights } = weightsFor(extras, g, mL);
    assert.ok(Math.abs(s / truth[i + 1].scale - 1) < 1e-9 || extras.lossPercent > 0);
    if (clamped) assert.ok(weights.every((w) => w >= 0 && w <= 1), `weights ${weights}`);
    mesh.morphTargetInfluences.splice(0, targets, ...weights);
    if (mL === BREATH) {
      angles.push(...normalErrors(meshes, truth[i + 1].xyz));
      still.push(...stillErrors(truth[0].xyz, truth[i + 1].xyz, meshes));
    }
    worst = Math.max(worst, largestDistance(morphed(mesh), truth[i + 1].xyz));
  });
  const mean = (list) => list.reduce((sum, x) => sum + x, 0) / list.length;
  const at95 = (list) => list.sort((a, b) => a - b)[Math.floor(0.95 * list.length)];
  console.log(`  normals at ${BREATH} mL: ${mean(angles).toFixed(2)} degrees mean, ${at95(angles).toFixed(2)} at the 95th percentile; unmoved ${mean(still).toFixed(2)} and ${at95(still).toFixed(2)}`);
  assert.ok(mean(angles) < 1 && at95(angles) < 3, 'normals are off');
  const least = largestDistance(truth[0].xyz, truth[1].xyz);
  assert.ok(least > 100 * tolerance, 'nothing moved, so nothing was tested');
  assert.ok(worst < tolerance, `${words.join(' ')}: ${worst} mm off`);
  console.log(`${words.join(' ')}: ${targets} targets, ${statSync(path).size} bytes, ` +
    `${worst.toExponential(2)} mm`);
}

/** The clip plays: it is there, turns the patient, and moves the lungs. */
async function checkAnimation(basis) {
  const path = join(folder, 'animated.glb');
  supine('export', basis, '-o', path, '--animate'); // clamp-safe, for engines that know no other
  await validate(path);
  const { gltf, mesh } = await open(path);
  assert.equal(gltf.animations.length, 1);
  const mixer = new three.AnimationMixer(gltf.scene);
  mixer.clipAction(gltf.animations[0]).play();
  // At 1.5 s the patient lies on the back, at the top of a 500 mL breath; at 13.5 s on the belly.
  for (const [seconds, gravity] of [[1.5, [0, 1, 0]], [13.5, [0, -1, 0]]]) {
    mixer.setTime(seconds);
    gltf.scene.updateMatrixWorld(true);
    assert.ok(mesh.morphTargetInfluences.every((w) => w >= 0 && w <= 1));
    const down = new three.Vector3(...gravity).transformDirection(mesh.matrixWorld);
    assert.ok(down.distanceTo(new three.Vector3(0, -1, 0)) < 1e-5, 'gravity is not down');
    const middle = new three.Box3().setFromPoints([...morphed(mesh)].flatMap((_, i, all) => (i % 3 ? [] : [new three.Vector3(all[i], all[i + 1], all[i + 2])]))).getCenter(new three.Vector3());
    assert.ok(middle.length() < 60, `at ${seconds} s the lungs' middle is ${middle.length()} mm off the origin`); // they are smaller than at full
    gltf.scene.getObjectByName('patient').quaternion.identity();
    const moved = [mesh, mesh.parent].filter((node) => node.name !== 'patient').map((node) => [node, node.position.clone()]);
    for (const [node] of moved) node.position.set(0, 0, 0); // as the patient's own coordinates have them
    gltf.scene.updateMatrixWorld(true);
    const [truth] = evaluate(basis, [[gravity, 500]]);
    const off = largestDistance(morphed(mesh), truth.xyz);
    assert.ok(off < FLOAT_MM, `animation at ${seconds} s: ${off} mm off`);
    for (const [node, place] of moved) node.position.copy(place);
  }
}

/** What is inside: its parts have names, lungs are seen through, and each goes where `deform` says. */
async function checkInside(basis, words, tolerance, rigid = []) {
  const [points, ball, inside, path, moved] =
    ['points.csv', 'ball.ply', 'inside.safetensors', 'inside.glb', 'moved.csv'].map((n) => join(folder, n));
  writeFileSync(points, 'name,x,y,z\nnodule,-80,-120,-90\nfiducial,70,-160,-60\n');
  supine('phantom', '-o', ball, '--vertices', '100', '--volume', '5000'); // a mesh within the lungs
  supine('embed', basis, points, ball, ...rigid, '-o', inside);
  supine('export', basis, '--inside', inside, '-o', path, ...words);
  await validate(path);
  const { gltf, meshes } = await open(path);
  gltf.scene.traverse((node) => { if (node.name !== 'patient') node.position.set(0, 0, 0); }); // the middle that animations turn about
  gltf.scene.updateMatrixWorld(true);
  const named = Object.fromEntries(meshes.map((m) => [m.material.name, m]));
  assert.deepEqual(Object.keys(named), ['left', 'right', 'nodule', 'fiducial', 'ball']);
  assert.ok(named.left.material.transparent && named.left.material.opacity < 0.5);
  assert.ok(!named.nodule.material.transparent);
  assert.deepEqual(named.nodule.userData.parts, ['nodule', 'fiducial', 'ball']);
  const extras = named.left.userData.supine;
  const all = [named.left, named.nodule];
  for (const gravity of [[0, -1, 0], [0.6, 0, -0.8]]) {
    supine('deform', inside, '--gravity', gravity.join(','), '--volume', 'scan+300', '-o', moved);
    const rows = readFileSync(moved, 'utf8').trim().split('\n').slice(1).map((row) => row.split(','));
    const { weights } = weightsFor(extras, gravity, 300);
    all.forEach((m) => m.morphTargetInfluences.splice(0, weights.length, ...weights));
    const xyz = morphed(named.nodule);
    for (const part of ['nodule', 'fiducial', 'ball']) {
      const corners = new Set(named[part].geometry.index.array);
      const mean = (at) => at.map((p) => p / at.length).reduce((a, b) => a + b, 0);
      const truth = rows.filter((row) => row[0] === part);
      for (let k = 0; k < 3; ++k) { // a ball's middle is its point
        const [is, wanted] = [mean([...corners].map((c) => xyz[3 * c + k])), mean(truth.map((row) => +row[2 + k]))];
        assert.ok(Math.abs(is - wanted) < tolerance, `${part}: ${is} and not ${wanted}`);
      }
      if (rigid.includes(part)) { // which morph targets shift and do not turn
        const [first] = corners;
        const { array } = named[part].geometry.attributes.position;
        const across = (at, c) => Math.hypot(...[0, 1, 2].map((k) => at[3 * c + k] - at[3 * first + k]));
        for (const c of corners) assert.ok(Math.abs(across(xyz, c) - across(array, c)) < tolerance, `${part} is deformed`);
      }
    }
  }
}

const mesh = join(folder, 'lungs.ply');
const modes = join(folder, 'modes.safetensors');
const many = join(folder, 'harmonics.safetensors');
supine('phantom', '-o', mesh, '--vertices', '600');
supine('precompute', mesh, '--law', 'paper', '-o', modes);
supine('precompute', mesh, '--law', 'paper', '-o', many, '--band', '3', '--modes', 'harmonics');
for (const [basis, raw, eight] of [[modes, 4, 4], [many, 16, 8]]) {
  for (const [extra, tolerance] of [[[], FLOAT_MM], [['--quantise'], QUANTISED_MM]]) {
    await check(basis, ['--profile', 'raw', ...extra], tolerance, raw, false);
    await check(basis, ['--profile', '8', ...extra], tolerance, eight, false);
    await check(basis, ['--profile', 'clamp-safe', ...extra], tolerance, raw, true);
    await check(basis, ['--profile', '8,clamp-safe', ...extra], tolerance, eight, true);
  }
}
await checkAnimation(modes);
await checkInside(modes, [], 2 * FLOAT_MM); // the table has three decimals
await checkInside(modes, [], 2 * FLOAT_MM, ['--rigid', 'ball']);
await checkInside(modes, ['--quantise', '--animate'], 2 * FLOAT_MM);
