// SPDX-License-Identifier: GPL-3.0-or-later
// GLB files: Khronos' validator reports nothing, and three.js gives the positions of the C evaluator, with morph
// weights computed from Y_lm(g) as the extras of the file describe.
import assert from 'node:assert/strict';
import { readFileSync, statSync } from 'node:fs';
import { join } from 'node:path';
import {
  breathingFieldsBasis,
  deformed,
  evaluate,
  fieldsBasis,
  folder,
  inOrder,
  largestDistance,
  load,
  loadCommon,
  matchPoints,
  randomDirections,
  randomSource,
  supine,
} from './support.mjs';
import { harmonics } from './harmonics.mjs';

const validator = loadCommon('gltf-validator');
const three = await load('three/build/three.module.js');
const { GLTFLoader } = await load('three/examples/jsm/loaders/GLTFLoader.js');
const { MeshoptDecoder } = await load('three/examples/jsm/libs/meshopt_decoder.module.js');

const PLAIN_MM = 0.001;
const COUNTS_MM = 0.1; // tolerance: positions and targets are each rounded to 0.045 mm
const FIELDS_MM = 0.2; // tolerance of fields, whose more than 20 targets are each rounded
const BREATH = 1000; // largest volume above rest, mL

/** Assert that the validator finds neither errors nor warnings. */
async function validate(path) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(path)));
  assert.deepEqual(
    report.issues.messages.filter((message) => message.severity <= 1),
    [],
    path,
  );
}

async function open(path) {
  const bytes = readFileSync(path);
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
  const gltf = await new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).parseAsync(buffer, '');
  const meshes = [];
  gltf.scene.traverse((object) => {
    if (object.isMesh) meshes.push(object);
  });
  return {
    gltf,
    meshes,
    lungs: ['left', 'right'].map((side) => gltf.scene.getObjectByName(`${side}_lung`)),
    extras: gltf.userData.supine,
  };
}

const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const sum = (list) => list.reduce((total, x) => total + x, 0);

/** Return coefficients f [7] for a lung with mode weights v, from its extras. If its displacements are multiplied by
 * x, y and z along the axes, its volume grows by f . (x, y, z, yz, xz, xy, xyz) mL. */
function volumeForm({ linear, quadratic, cubic }, v) {
  const k = v.length;
  const form = new Float64Array(7);
  for (let axis = 0; axis < linear.length / k; ++axis) {
    for (let a = 0; a < k; ++a) {
      form[axis] += linear[axis * k + a] * v[a];
      for (let b = 0; b < k; ++b) form[3 + axis] += quadratic[(axis * k + a) * k + b] * v[a] * v[b];
    }
  }
  cubic.forEach((c, i) => {
    form[6] += c * v[Math.floor(i / k / k)] * v[Math.floor(i / k) % k] * v[i % k];
  });
  return form;
}

const formAt = (f, [x, y, z]) =>
  x * f[0] + y * f[1] + z * f[2] + y * z * f[3] + x * z * f[4] + x * y * f[5] + x * y * z * f[6];

/** Find the root of a monotonic function near `from` by the secant method. */
function root(f, from) {
  let [a, b] = [0.9 * from, from];
  for (let i = 0; i < 50 && f(b) !== f(a); ++i) [a, b] = [b, b - (f(b) * (b - a)) / (f(b) - f(a))];
  return b;
}

/** Find [s, t] so that a lung whose displacements along axis a are multiplied by s + bend[a] t holds `mL` more than the
 * reference surface. At rest it holds `rest` mL more, with s = r and t = 0. Elsewhere s = r q and t = bent(q). */
function gainsFor(form, bend, rest, mL) {
  const even = (volume) => root((s) => formAt(form, [s, s, s]) - volume, volume / (form[0] + form[1] + form[2]));
  if (bend.every((c) => c === 0)) return [even(mL), 0];
  const r = even(rest);
  const bent = (q) => 2 * r * (q <= 1 ? (q ** 3 - q) / 2 : (q - 1) / q ** 6);
  const q = root(
    (at) =>
      formAt(
        form,
        bend.map((c) => r * at + c * bent(at)),
      ) - mL,
    mL / rest,
  );
  return [r * q, bent(q)];
}

/** Return the morph weights of each lung and the factor s of its displacements, for a gravity and a volume in mL above
 * rest, as the extras describe. */
function weightsFor(extras, lungs, gravity, mL) {
  const [y, y2] = [harmonics(extras.band, gravity), harmonics(2, gravity)];
  const v = extras.modes.map((row) => extras.modeUnit * dot(row, y));
  const own = lungs.map((lung) => lung.userData.supine);
  const forms = own.map((lung) => volumeForm(lung, v));
  const rests = own.map((lung) => dot(lung.resting ?? [0], y2));
  let gains;
  if (extras.byLung) {
    const full = own.map((lung) => Math.max(0, -gravity[2]) ** 2 * extras.fullUprightGain * lung.referenceVolume);
    const part = mL / (sum(full) - sum(rests));
    gains = own.map((_, i) => gainsFor(forms[i], extras.bend, rests[i], rests[i] + part * (full[i] - rests[i])));
  } else {
    const all = forms[0].map((_, i) => sum(forms.map((f) => f[i])));
    gains = own.map(() => gainsFor(all, extras.bend, rests[0], rests[0] + mL));
  }
  return own.map(({ offset, unit }, i) => ({
    s: gains[i][0],
    weights: offset.map((o, j) => (gains[i][Math.floor(j / v.length)] * v[j % v.length] - o) / unit[j]),
  }));
}

const setWeights = (meshes, weights) =>
  meshes.forEach((mesh, i) => mesh.morphTargetInfluences.splice(0, weights[i].length, ...weights[i]));

/** Return the positions of a mesh morphed by three.js, in the patient's axes and mm. */
function morphed(mesh, { middle, millimetresPerUnit }) {
  const count = mesh.geometry.attributes.position.count;
  const xyz = new Float64Array(3 * count);
  const point = new three.Vector3();
  for (let i = 0; i < count; ++i) {
    mesh
      .getVertexPosition(i, point)
      .multiplyScalar(millimetresPerUnit)
      .add(new three.Vector3(...middle));
    point.toArray(xyz, 3 * i);
  }
  return xyz;
}

const together = (meshes, extras) => Float64Array.from(meshes.flatMap((mesh) => [...morphed(mesh, extras)]));

/** Return the unit normal of each vertex, from its triangles weighted by area. */
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

/** Return the angles in degrees between the morphed normals of a lung and those of its morphed
 * surface. */
function normalErrors(mesh, extras) {
  const { attributes, morphAttributes, index } = mesh.geometry;
  const [made, part] = [new three.Vector3(), new three.Vector3()];
  return exactNormals(morphed(mesh, extras), index.array).map((normal, i) => {
    made.fromBufferAttribute(attributes.normal, i);
    mesh.morphTargetInfluences.forEach((weight, k) =>
      made.addScaledVector(part.fromBufferAttribute(morphAttributes.normal[k], i), weight),
    );
    return (made.angleTo(normal) * 180) / Math.PI;
  });
}

const mean = (list) => sum(list) / list.length;
const at95 = (list) => list.sort((a, b) => a - b)[Math.floor(0.95 * list.length)];

/** Check positions, displacement factors and normals in random states. */
async function check(basis, words, tolerance) {
  const path = join(folder, 'lungs.glb');
  supine('export', basis, '-o', path, '--breath', `${BREATH}mL`, ...words);
  await validate(path);
  const { lungs, meshes, extras } = await open(path);
  assert.deepEqual(
    meshes.map((m) => m.material.name),
    ['left lung', 'right lung', 'table', 'gravity'],
  );
  assert.equal(extras.basis.lungs, 'left,right');
  lungs.forEach((lung) => assert.deepEqual(Object.keys(lung.morphTargetDictionary), lung.userData.targetNames));
  const random = randomSource(77);
  const pairs = randomDirections(10, 20241).map((g, i) => [g, i % 2 ? BREATH * random() : BREATH]);
  const truth = evaluate(basis, [[[0, 1, 0], 0], ...pairs]);
  // With the morph weights stored in the file, the lungs are supine at rest. Match their vertices to those of the
  // basis.
  const order = words.includes('--plain')
    ? truth[0].xyz.map((_, i) => i).slice(0, truth[0].xyz.length / 3)
    : matchPoints(together(lungs, extras), truth[0].xyz, tolerance);
  let worst = largestDistance(together(lungs, extras), inOrder(truth[0].xyz, [...order]));
  const rest = lungs.flatMap((lung) => normalErrors(lung, extras));
  assert.ok(
    Math.max(...rest) < 2 && mean(rest) < 0.6,
    `normals at rest are ${Math.max(...rest)} degrees off, ${mean(rest)} in the mean`,
  );
  const angles = [];
  pairs.forEach(([g, mL], i) => {
    const wanted = weightsFor(extras, lungs, g, mL);
    assert.ok(Math.abs(wanted[0].s / truth[i + 1].scale - 1) < 1e-6, `${wanted[0].s}, not ${truth[i + 1].scale}`);
    for (const { weights } of wanted)
      assert.ok(
        weights.every((w) => w >= 0 && w <= 1),
        `weights ${weights}`,
      );
    setWeights(
      lungs,
      wanted.map(({ weights }) => weights),
    );
    worst = Math.max(worst, largestDistance(together(lungs, extras), inOrder(truth[i + 1].xyz, [...order])));
    if (mL === BREATH) angles.push(...lungs.flatMap((lung) => normalErrors(lung, extras)));
  });
  console.log(
    `${words.join(' ')}: ${lungs[0].morphTargetInfluences.length} targets, ${statSync(path).size} bytes, ` +
      `${worst.toExponential(2)} mm, normals at ${BREATH} mL ${mean(angles).toFixed(2)} degrees mean, ` +
      `${at95(angles).toFixed(2)} at the 95th percentile`,
  );
  assert.ok(
    largestDistance(truth[0].xyz, truth[1].xyz) > 100 * tolerance,
    'the lungs did not move, so nothing was tested',
  );
  assert.ok(worst < tolerance, `${words.join(' ')}: ${worst} mm off`);
  const mostMean = words.includes('--plain') ? 1 : 1.25; // limit of the mean error of normals, degrees
  assert.ok(mean(angles) < mostMean && at95(angles) < 3, 'normals are off');
}

/** Check positions of another simulator's fields, whose gain is 1, and that breaths are refused. */
async function checkFields(basis) {
  const path = join(folder, 'fields.glb');
  supine('export', basis, '-o', path);
  await validate(path);
  const { lungs, extras } = await open(path);
  assert.match(extras.gains, /^s = 1 and t = 0/);
  assert.ok(extras.modes.length > 20 && extras.breathVolume === undefined && extras.volume === undefined);
  const gravities = [[0, 1, 0], [0, -1, 0], ...randomDirections(5, 8)];
  const truth = evaluate(
    basis,
    gravities.map((g) => [g, 0]),
  );
  const order = matchPoints(together(lungs, extras), truth[0].xyz, COUNTS_MM);
  gravities.forEach((g, i) => {
    const v = extras.modes.map((row) => extras.modeUnit * dot(row, harmonics(extras.band, g)));
    setWeights(
      lungs,
      lungs.map(
        ({
          userData: {
            supine: { offset, unit },
          },
        }) => v.map((x, k) => (x - offset[k]) / unit[k]),
      ),
    );
    const off = largestDistance(together(lungs, extras), inOrder(truth[i].xyz, order));
    assert.ok(off < FIELDS_MM, `fields along ${g}: ${off} mm off`);
  });
  for (const option of [['--breath', '700mL'], ['--animate']])
    assert.throws(() => supine('export', basis, ...option, '-o', path), /no breaths: leave --breath and --animate out/);
}

/** Return the weights of the morph targets of each lung of another simulator's fields over gravity and volume at which
 * it holds `volumes`, mL, as the extras describe. */
function simulatedWeights({ band, order, modes, modeUnit }, lungs, gravity, volumes) {
  const y = harmonics(band, gravity);
  return lungs.map(({ userData: { supine: own } }, lung) => {
    const at = (x) => {
      const t = [1, x];
      for (let n = 2; n <= order; ++n) t.push(2 * x * t[n - 1] - t[n - 2]);
      return modes.map(
        (row) => modeUnit * sum(row.map((c, j) => c * y[Math.floor(j / (order + 1))] * t[j % (order + 1)])),
      );
    };
    const x = root((t) => own.referenceVolume + formAt(volumeForm(own, at(t)), [1, 1, 1]) - volumes[lung], 0.5);
    return at(x).map((v, k) => (v - own.offset[k]) / own.unit[k]);
  });
}

/** Check that the limits of the extras hold `volumes` along gravity, mL, as the simulations did. */
function checkLimits(lungs, gravity, volumes) {
  lungs.forEach(({ userData: { supine: own } }, lung) => {
    const y = harmonics(Math.sqrt(own.limits.length / 2) - 1, gravity);
    const [low, high] = [0, y.length].map((at) => own.referenceVolume + dot(y, own.limits.slice(at, at + y.length)));
    assert.ok(low < volumes[lung] && volumes[lung] < high && high - low < 2500, `lung ${lung}: ${low} to ${high} mL`);
  });
}

/** Check positions of another simulator's fields over gravity and volume, whose lungs have weights of their own,
 * against those of 'supine deform'. */
async function checkBreathingFields(storage) {
  const [basis, path] = ['breathing.safetensors', 'breathing.glb'].map((name) => join(folder, name));
  breathingFieldsBasis(basis, 1000, storage);
  supine('export', basis, '-o', path, '--animate', '--breath', '400mL');
  await validate(path);
  const { gltf, lungs, extras } = await open(path);
  assert.match(extras.gains, /^s = 1 and t = 0/);
  assert.ok(extras.order > 0 && extras.breathVolume === 400 && gltf.animations.length === 5);
  // A total, which is shared as in the simulations
  const order = matchPoints(together(lungs, extras), evaluate(basis, [[[0, 1, 0], 0.001]])[0].xyz, FIELDS_MM);
  let worst = 0;
  for (const [gravity, volumes] of [
    [
      [0, 1, 0],
      [2700, 3300],
    ],
    [
      [0, -1, 0],
      [3500, 3400],
    ],
    [
      [1, 0, 0],
      [2800, 4000],
    ],
    [
      [0, 0, -1],
      [3700, 4200],
    ],
    [
      [0.48, -0.6, 0.64],
      [3200, 3600],
    ],
  ]) {
    checkLimits(lungs, gravity, volumes);
    const weights = simulatedWeights(extras, lungs, gravity, volumes);
    for (const w of weights)
      assert.ok(
        w.every((x) => x >= 0 && x <= 1),
        `weights ${w}`,
      );
    setWeights(lungs, weights);
    const truth = deformed(
      basis,
      '--gravity',
      gravity.join(),
      '--volume',
      `left=${volumes[0]}mL,right=${volumes[1]}mL`,
    );
    worst = Math.max(worst, largestDistance(together(lungs, extras), inOrder(truth, order)));
  }
  console.log(
    `fields over volume, ${storage}: ${lungs[0].morphTargetInfluences.length} targets, ` +
      `${statSync(path).size} bytes, ${worst.toExponential(2)} mm`,
  );
  assert.ok(worst < FIELDS_MM, `${storage}: ${worst} mm off`);
}

/** Check that each clip turns gravity downwards, keeps the lungs above the table, and gives the
 * same positions as the library. */
async function checkAnimations(basis) {
  const path = join(folder, 'animated.glb');
  supine('export', basis, '-o', path, '--animate');
  await validate(path);
  const { gltf, lungs, extras } = await open(path);
  const order = matchPoints(together(lungs, extras), evaluate(basis, [[[0, 1, 0], 0]])[0].xyz, COUNTS_MM);
  assert.deepEqual(
    gltf.animations.map((clip) => clip.name),
    ['turning', 'supine', 'left side', 'prone', 'right side'],
  );
  // At 1.5 s, all clips are at the peak of a breath of 500 mL. The first clip is then supine, and at 13.5 s prone.
  for (const [clip, seconds, gravity] of [
    [0, 1.5, [0, 1, 0]],
    [0, 13.5, [0, -1, 0]],
    [1, 1.5, [0, 1, 0]],
    [2, 1.5, [1, 0, 0]],
    [3, 1.5, [0, -1, 0]],
    [4, 1.5, [-1, 0, 0]],
  ]) {
    const mixer = new three.AnimationMixer(gltf.scene);
    mixer.clipAction(gltf.animations[clip]).play();
    mixer.setTime(seconds);
    gltf.scene.updateMatrixWorld(true);
    const down = new three.Vector3(...gravity).transformDirection(lungs[0].matrixWorld);
    assert.ok(
      down.distanceTo(new three.Vector3(0, -1, 0)) < 1e-5,
      `${gltf.animations[clip].name}: gravity is not down`,
    );
    const box = new three.Box3().setFromObject(gltf.scene.getObjectByName('patient'), true);
    // The centre of the full lungs is the origin, and these are less full.
    const offCentre = box.getCenter(new three.Vector3()).length(); // m
    assert.ok(offCentre < 0.06, 'the lungs are not centred at the origin');
    assert.ok(
      box.min.y > new three.Box3().setFromObject(gltf.scene.getObjectByName('table')).max.y,
      'the lungs are not above the table',
    );
    const off = largestDistance(together(lungs, extras), inOrder(evaluate(basis, [[gravity, 500]])[0].xyz, order));
    assert.ok(off < COUNTS_MM, `${gltf.animations[clip].name} at ${seconds} s: ${off} mm off`);
    mixer.stopAllAction();
  }
}

/** Check that lungs have the colour of tissue, which says nothing of displacements. */
async function checkColours(basis) {
  const path = join(folder, 'coloured.glb');
  supine('export', basis, '-o', path, '--plain');
  const { lungs } = await open(path);
  for (const { geometry, material } of lungs)
    assert.ok(!geometry.attributes.color && material.color.r > 1.5 * material.color.b);
}

const mesh = join(folder, 'lungs.ply');
supine('phantom', '-o', mesh, '--vertices', '600');
const [modes, paper, many] = ['modes', 'paper', 'harmonics'].map((name) => join(folder, `${name}.safetensors`));
supine('precompute', mesh, '-o', modes);
supine('precompute', mesh, '--law', 'paper', '-o', paper);
supine('precompute', mesh, '--law', 'paper', '-o', many, '--band', '3', '--modes', 'harmonics');
for (const basis of [modes, paper, many]) {
  await check(basis, [], COUNTS_MM);
  await check(basis, ['--plain'], PLAIN_MM);
}
await checkAnimations(modes);
const fields = join(folder, 'vectors.safetensors');
fieldsBasis(fields, 600);
await checkFields(fields);
for (const storage of ['modes', 'clusters']) await checkBreathingFields(storage);
await checkColours(modes);

/* The animated file of the default phantom, which demonstrations use, has at most 500 kB. */
const [demoMesh, demo, demoFile] = ['demo.ply', 'demo.safetensors', 'demo.glb'].map((name) => join(folder, name));
supine('phantom', '-o', demoMesh);
supine('precompute', demoMesh, '-o', demo);
supine('export', demo, '-o', demoFile, '--animate');
assert.ok(statSync(demoFile).size <= 500_000, `${statSync(demoFile).size} bytes`);
await validate(demoFile);
assert.equal((await open(demoFile)).lungs.length, 2);
