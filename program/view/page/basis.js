// SPDX-License-Identifier: MIT
// Read the basis from the page. Compute the weights of the modes from gravity, and the gains of the lungs (factors
// that multiply the displacement along each axis) from a volume, like the run-time library.

function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const padding = text.endsWith('==') ? 2 : text.endsWith('=') ? 1 : 0;
  const bytes = new Uint8Array((text.length / 4) * 3 - padding);
  const piece = 1 << 16;
  for (let from = 0, to = 0; from < text.length; from += piece) {
    const part = atob(text.slice(from, from + piece));
    for (let i = 0; i < part.length; ++i) bytes[to++] = part.charCodeAt(i);
  }
  return bytes;
}

/** Return the bytes of a tensor, and remove from the page the element that has them as text. */
function takeBytes(name) {
  const element = document.getElementById(`tensor-${name}`);
  const text = element.textContent;
  element.remove();
  return fromBase64(text);
}

/** Return a tensor of numbers. Refuse those that are not finite, or 2^30 or more, like the run-time library. */
function takeTensor(name, Numbers) {
  const numbers = new Numbers(takeBytes(name).buffer);
  if (!numbers.every((x) => Math.abs(x) < 2 ** 30)) throw new Error(`tensor '${name}' has a number that is not finite, or 2^30 or more: make the page again`);
  return numbers;
}

/** Decompress a tensor of 16-bit integers. Its rows are padded to an even number of columns. */
function takeCounts(name, rows, columns, filter) {
  const stride = 4 * Math.ceil(columns / 2);
  const bytes = new Uint8Array(rows * stride);
  MeshoptDecoder.decodeVertexBuffer(bytes, rows, stride, takeBytes(name), filter);
  return new Int16Array(bytes.buffer);
}

/** Return a quantised tensor as numbers: middle[column] plus `unit` times the stored integer. */
function takeRows(name, rows, columns, unit, middle = new Array(columns).fill(0)) {
  const counts = takeCounts(name, rows, columns);
  const numbers = new Float32Array(rows * columns);
  const stride = counts.length / rows;
  for (let i = 0; i < rows; ++i) for (let k = 0; k < columns; ++k) numbers[i * columns + k] = middle[k] + unit * counts[i * stride + k];
  return numbers;
}

/** Decompress a tensor of `count` triangles to vertex indices. */
function takeTriangles(name, count) {
  const corners = new Uint32Array(3 * count);
  MeshoptDecoder.decodeIndexBuffer(new Uint8Array(corners.buffer), 3 * count, 4, takeBytes(name));
  return corners;
}

/** Convert RGB colours in hexadecimal digits to RGBA bytes. */
function readColours(text) {
  const bytes = new Uint8Array((text.length / 6) * 4).fill(255);
  for (let i = 0; i < text.length; i += 2) bytes[4 * Math.floor(i / 6) + (i % 6) / 2] = parseInt(text.slice(i, i + 2), 16);
  return bytes;
}

function readBasis() {
  const basis = JSON.parse(document.getElementById('basis').textContent);
  for (const [name, text] of Object.entries(basis.colours)) basis.colours[name] = readColours(text);
  Object.assign(basis.colours, { expansion: divergingMap(), plain: new Uint8Array(1024).map((_, i) => [184, 196, 212, 255][i % 4]) });
  const { vertices: n } = basis;
  basis.surface = takeRows('vertices', n, 3, basis.placeUnit, basis.middle);
  const directions = basis.vector ? [] : takeCounts('direction', n, 4, 'OCTAHEDRAL');
  basis.direction = Float32Array.from({ length: directions.length / 4 * 3 }, (_, i) => directions[4 * Math.floor(i / 3) + (i % 3)] / 32767);
  basis.fields = basis.metadata.route === 'fields'; // made from another simulator's fields
  basis.breathes = !basis.fields || basis.order > 0; // fields of gravity alone have no volumes and no breaths
  if (basis.clusters > 0) takeClusters(basis);
  else basis.coefficients = takeRows('coefficients', (basis.vector ? 3 : 1) * n, basis.modes, basis.unit);
  basis.corners = takeTriangles('triangles', basis.triangles);
  basis.mixes = takeTensor('modes', Float64Array);
  basis.linear = takeTensor('volume_linear', Float64Array);
  basis.quadratic = takeTensor('volume_quadratic', Float64Array);
  basis.cubic = takeTensor('volume_cubic', Float64Array);
  basis.resting = basis.hasResting ? takeTensor('resting_volume', Float64Array) : null;
  basis.byLung = basis.resting?.length > 9;
  basis.lungs = basis.lungBegin.length - 1;
  if (basis.order > 0) basis.simulated = takeSimulated(basis);
  const names = (basis.metadata.lungs ?? '').split(',');
  basis.lungNames = Array.from({ length: basis.lungs }, (_, i) => (names[i] ? `${names[i]} lung` : `lung ${i}`));
  const same = (a, b) => ['weights', 'gains'].every((key) => a[key].every((x, i) => Math.abs(x - b[key][i]) < 1e-6));
  basis.froms = basis.froms.filter((from, i) => !basis.froms.slice(0, i).some((other) => same(from, other)));
  basis.lungBoxes = basis.lungNames.map((_, lung) => boundsOf(Array.from({ length: basis.lungBegin[lung + 1] - basis.lungBegin[lung] }, (_, i) => basis.surface.subarray(3 * (basis.lungBegin[lung] + i), 3 * (basis.lungBegin[lung] + i) + 3))));
  const [low, high] = ['low', 'high'].map((end, i) => [0, 1, 2].map((axis) => Math[i ? 'max' : 'min'](...basis.lungBoxes.map((box) => box[end][axis]))));
  const box = { low: [...low], high: [...high] };
  if (basis.lungs === 1) [low[0], high[0]] = [Math.min(low[0], -high[0]), Math.max(high[0], -low[0])]; // room for the other lung
  basis.torso = { ...box, centre: low.map((x, i) => (x + high[i]) / 2), half: low.map((x, i) => (high[i] - x) / 2) };
  if (basis.inside) takeInside(basis);
  return basis;
}

// Numbers of a cluster for each mode, and of its frame, like runtime/cluster_row.h and runtime/clusters.h.
const [CLUSTER_NUMBERS, CLUSTER_SLOPE, CLUSTER_PATTERN, FRAME] = [18, 3, 12, 24];

/** Read the clusters of vertices that move alike: for each vertex its two scalars a and its cluster, four integers; for
 * each cluster, [clusters, modes, 18], a vector m, the rows of a matrix B, and two vectors P. A vertex at p moves by
 * m + B p + a_0 P_0 + a_1 P_1 in each mode. */
function takeClusters(basis) {
  basis.clustered = takeCounts('clusters', basis.vertices, 3);
  basis.clusterVectors = takeTensor('cluster_vectors', Float32Array);
  basis.clusterLung = new Uint8Array(basis.clusters);
  for (let v = 0; v < basis.vertices; ++v) basis.clusterLung[basis.clustered[4 * v + 2]] = lungOf(basis, v);
}

const framesKept = new WeakMap(); // result of framesOf for each moment, which never changes

/** Return the frames of all clusters in a state of the lungs, [clusters, 24]: b, the columns of A, Q_0 and Q_1, four
 * numbers each. A vertex at p with the scalars a moves to b + A p + a_0 Q_0 + a_1 Q_1. */
function framesOf(basis, moment) {
  if (!framesKept.has(moment)) {
    const frames = new Float32Array(FRAME * basis.clusters);
    const weights = basis.lungNames.map((_, lung) => weightsOf(basis, moment, lung));
    basis.clusterLung.forEach((lung, c) => frames.set(frameOf(basis, c, weights[lung], moment.gains.slice(3 * lung, 3 * lung + 3)), FRAME * c));
    framesKept.set(moment, frames);
  }
  return framesKept.get(moment);
}

/** Return the frame of a cluster for the weights of the modes and the gains of its lung. */
function frameOf({ modes, clusterVectors }, cluster, weights, gains) {
  const sum = new Float64Array(CLUSTER_NUMBERS);
  for (let k = 0, at = cluster * modes * CLUSTER_NUMBERS; k < modes; ++k, at += CLUSTER_NUMBERS) {
    for (let i = 0; i < CLUSTER_NUMBERS; ++i) sum[i] += weights[k] * clusterVectors[at + i];
  }
  const frame = new Float64Array(FRAME);
  for (let axis = 0; axis < 3; ++axis) {
    frame[axis] = gains[axis] * sum[axis];
    for (let column = 0; column < 3; ++column) frame[4 + 4 * column + axis] = Number(axis === column) + gains[axis] * sum[CLUSTER_SLOPE + 3 * axis + column];
    for (let s = 0; s < 2; ++s) frame[16 + 4 * s + axis] = gains[axis] * sum[CLUSTER_PATTERN + 3 * s + axis];
  }
  return frame;
}

const recurrences = new Map(); // result of recurrenceOf for each largest degree
/** Return the constants of the recurrence in harmonics() for all degrees up to `band`. They are computed once. tops[m]
 * is the start, the constant polynomial of degree m and order m; `steps` has the factors from a degree to the next. */
function recurrenceOf(band) {
  if (!recurrences.has(band)) {
    const tops = new Float64Array(band + 1);
    const steps = new Float64Array((band + 1) ** 2); // index l * l + l + m: factor from degree l to l + 1 at order m
    for (let m = 0; m <= band; ++m) {
      tops[m] = m === 0 ? Math.sqrt(1 / (4 * Math.PI)) : tops[m - 1] * (m === 1 ? Math.sqrt(3) : Math.sqrt((2 * m + 1) / (2 * m)));
      for (let l = m; l <= band; ++l) steps[l * l + l + m] = Math.sqrt((4 * (l + 1) ** 2 - 1) / ((l + 1 - m) * (l + 1 + m)));
    }
    recurrences.set(band, { tops, steps });
  }
  return recurrences.get(band);
}

/** Return the real spherical harmonics of a unit vector up to degree `band`, Y_lm at index l*l + l + m: orthonormal,
 * without Condon-Shortley phase. Y_lm is a polynomial q in z, from a recurrence in l, times the real (m >= 0) or
 * imaginary (m < 0) part of (x + i y)^|m|. */
function harmonics(band, [x, y, z]) {
  const values = new Float64Array((band + 1) ** 2);
  const { tops, steps } = recurrenceOf(band);
  let re = 1;
  let im = 0;
  for (let m = 0; m <= band; ++m) {
    if (m > 0) {
      const next = re * x - im * y;
      im = re * y + im * x;
      re = next;
    }
    let before = 0;
    let q = tops[m];
    for (let l = m; l <= band; ++l) {
      const at = l * l + l;
      values[at - m] = q * im;
      values[at + m] = q * re;
      const next = steps[at + m] * (z * q - before);
      before = q / steps[at + m];
      q = next;
    }
  }
  return values;
}

/** Return the part of the weights of a moment that belongs to a lung: fields over gravity and volume have weights of each
 * lung, [lungs, modes], all other bases the same weights for all. */
const weightsOf = ({ modes, order }, { weights }, lung) => (order > 0 ? weights.slice(lung * modes, (lung + 1) * modes) : weights);

/** Return the weights of the modes for gravity along a unit vector. */
function weightsFor(basis, gravity) {
  const y = harmonics(basis.band, gravity);
  return Float64Array.from({ length: basis.modes }, (_, k) => {
    let sum = 0;
    for (let i = 0; i < y.length; ++i) sum += basis.mixes[k * y.length + i] * y[i];
    return sum;
  });
}

/** Return the coefficients f of the volume of a lung at the weights `w` of the modes. At the gains x, y, z, the volume
 * of the lung minus that of its reference surface is f . (x, y, z, yz, xz, xy, xyz), mL. */
function lungForm(basis, lung, w) {
  const k = basis.modes;
  const dot = (tensor, at) => { let sum = 0; for (let i = 0; i < k; ++i) sum += tensor[at + i] * w[i]; return sum; };
  const square = (tensor, at) => { let sum = 0; for (let i = 0; i < k; ++i) sum += w[i] * dot(tensor, at + i * k); return sum; };
  const form = new Float64Array(7);
  for (let axis = 0; axis < 3; ++axis) {
    const row = lung * 3 + axis;
    form[axis] = dot(basis.linear, row * k);
    form[3 + axis] = square(basis.quadratic, row * k * k);
  }
  for (let i = 0; i < k; ++i) form[6] += w[i] * square(basis.cubic, (lung * k + i) * k * k);
  return form;
}

const formAt = (f, [x, y, z]) => x * f[0] + y * f[1] + z * f[2] + y * z * f[3] + x * z * f[4] + x * y * f[5] + x * y * z * f[6];

/** Return the coefficients c of a lung's change of volume, c[0] s + c[1] s^2 + c[2] s^3, if all displacements are
 * multiplied by s. `f` are those of formAt. */
const cubicOf = (f) => [f[0] + f[1] + f[2], f[3] + f[4] + f[5], f[6]];

const cubicAt = (c, s) => s * (c[0] + s * (c[1] + s * c[2]));
const cubicSlope = (c, s) => c[0] + s * (2 * c[1] + 3 * s * c[2]);

/** Return the s nearest to 0 at which c[0] s + c[1] s^2 + c[2] s^3 has an extremum, among s > 0 if `side` is 1 and
 * among s < 0 if it is -1. If there is none, return an infinite number. */
function cubicTurn(c, side) {
  const discriminant = c[1] * c[1] - 3 * c[0] * c[2];
  if (discriminant < 0) return side * Infinity;
  const q = -(c[1] + (c[1] < 0 ? -1 : 1) * Math.sqrt(discriminant));
  const ahead = [q / (3 * c[2]), c[0] / q].map((root) => root * side).filter((d) => d > 0);
  return side * Math.min(Infinity, ...ahead);
}

/** Return the factor s at which c[0] s + c[1] s^2 + c[2] s^3 is `volume`, mL, on the branch through s = 0; NaN if the
 * surface folds before it reaches that volume. */
function scaleForVolume(c, volume) {
  if (volume === 0) return 0;
  const side = volume / c[0] > 0 ? 1 : -1;
  let far = cubicTurn(c, side);
  if (Number.isFinite(far)) {
    if (Math.abs(cubicAt(c, far)) < Math.abs(volume)) return NaN;
  } else {
    far = volume / c[0];
    while (Number.isFinite(far) && Math.abs(cubicAt(c, far)) < Math.abs(volume)) far *= 2; // ends at infinity
    if (!Number.isFinite(far)) return NaN;
    far *= 2;
  }
  let [low, high] = side > 0 ? [0, far] : [far, 0];
  const rising = cubicAt(c, high) > cubicAt(c, low);
  let s = volume / c[0];
  for (let i = 0; i < 200; ++i) {
    if (!(s > low && s < high)) s = low + (high - low) / 2;
    const residual = cubicAt(c, s) - volume;
    if (residual === 0 || s === low || s === high) return s;
    if (residual > 0 === rising) high = s;
    else low = s;
    const next = s - residual / cubicSlope(c, s);
    if (Math.abs(next - s) <= 1e-15 * Math.abs(s)) return s;
    s = next;
  }
  return s;
}

/** Return the gains (factors of a lung's displacement along x, y and z) as multiples of the gain at rest. `sigma` tells
 * the volume: 0 at full inflation, 1 at rest, more below rest. The multiple is sigma + 2 bend[axis] e, where e is
 * (sigma^3 - sigma) / 2 above rest and (sigma - 1) / sigma^6 below rest, like supine_volume_bend. */
function pathAt(bend, sigma) {
  const cube = sigma * sigma * sigma;
  const e = sigma <= 1 ? (cube - sigma) / 2 : (sigma - 1) / (cube * cube);
  return bend.map((c) => sigma + 2 * c * e);
}

// Limit of the position on the path of pathAt, and limit of gains, like those of the run-time library.
const [pathMost, gainMost] = [64, 2 ** 20];

/** Return the gains (factors of the displacement along x, y and z) at which a lung has the volume `volume`; NaN if its
 * surface folds before, or if it is out of reach. pathAt gives their ratios, with the constant bend[axis] of each axis. At rest, the lung has the
 * volume `rest`. Both volumes are mL above the reference volume. `form` is the result of lungForm. */
function gainsForVolume(form, bend, rest, volume) {
  const straight = bend.every((c) => c === 0) || volume === rest;
  const scale = scaleForVolume(cubicOf(form), straight ? volume : rest);
  const at = (sigma) => pathAt(bend, sigma).map((ratio) => scale * ratio);
  const none = [NaN, NaN, NaN];
  if (!Number.isFinite(volume) || !(Math.abs(scale) < gainMost)) return none;
  if (straight) return [scale, scale, scale];
  const side = Math.sign(volume);
  const step = volume / rest > 0 ? 1 / 16 : -1 / 16;
  let [near, far, held] = [0, 0, 0];
  while (side * held < side * volume) {
    const before = held;
    near = far;
    far += step;
    held = formAt(form, at(far));
    if (!(side * held > side * before) || Math.abs(far) > pathMost) return none;
  }
  for (let halving = 0; halving < 60; ++halving) {
    const middle = (near + far) / 2;
    if (side * formAt(form, at(middle)) < side * volume) near = middle;
    else far = middle;
  }
  return at(near);
}

const sumOf = (values) => values.reduce((sum, x) => sum + x, 0);

/** Return {rest, full}: the volumes of the lungs at rest and at full inflation for a direction of gravity, mL above
 * the reference volumes. Both have an element for each lung. But if all lungs have the same gains, the only element of
 * `rest` is the total. If rest is unknown, this is the total in the scan. */
function volumesFor(basis, gravity) {
  const y = harmonics(2, gravity);
  const rows = basis.resting ? basis.resting.length / y.length : 1;
  const rest = Array.from({ length: rows }, (_, row) => (basis.resting ? y.reduce((sum, x, i) => sum + x * basis.resting[row * y.length + i], 0) : basis.scanVolume));
  const up = Math.max(0, -gravity[2]) ** 2;
  return { rest, full: basis.references.map((ml) => (Number(basis.metadata.full_upright_gain) || 0) * up * ml) };
}

/** Return the volume of all lungs at rest for gravity along a unit vector, mL above the reference volume. */
const restFor = (basis, gravity) => sumOf(volumesFor(basis, gravity).rest);

/** Return the volume of each lung if all lungs together have the volume `total`, mL above the reference volumes. Above
 * rest, every lung is inflated by the same fraction of the difference between its volumes at full inflation and at
 * rest. Below rest, the volumes of all lungs have shrunk by the same factor. */
function shareOut({ references }, { rest, full }, total) {
  const [all, resting] = [sumOf(references), sumOf(rest)];
  const part = (total - resting) / (sumOf(full) - resting);
  const shrunk = (all + total) / (all + resting);
  return references.map((ml, lung) => (total >= resting ? rest[lung] + part * (full[lung] - rest[lung]) : (ml + rest[lung]) * shrunk - ml));
}

/** Return the gains [x, y, z] of each lung, the factors of its displacement along the axes, at which all lungs
 * together have the volume `total`, mL above the reference volume. `forms` has the result of lungForm for each lung.
 * */
function gainsFor(basis, forms, volumes, total) {
  if (basis.byLung) return shareOut(basis, volumes, total).map((ml, lung) => gainsForVolume(forms[lung], basis.bend, volumes.rest[lung], ml));
  const gains = gainsForVolume(forms[0].map((_, i) => sumOf(forms.map((f) => f[i]))), [0, 0, 0], 0, total);
  return forms.map(() => gains);
}

/** Return a moment: {gravity, weights, gains, held, folds}, the state of the lungs for a direction of gravity and a
 * volume `depth` mL above rest. `weights` are those of the modes, `gains` the factors of the displacement of each lung
 * along x, y, z, `held` the volume (gas and tissue) of each lung, mL, and `above` is `depth`. `folds`: whether the
 * surface folds before.
 * Another simulator's fields of gravity alone are not scaled to a volume. */
function momentFor(basis, gravity, depth) {
  if (basis.order > 0) return simulatedMoment(basis, gravity, depth);
  const weights = weightsFor(basis, gravity);
  const forms = basis.references.map((_, lung) => lungForm(basis, lung, weights));
  const volumes = volumesFor(basis, gravity);
  const gains = basis.fields ? forms.map(() => [1, 1, 1]) : gainsFor(basis, forms, volumes, sumOf(volumes.rest) + depth);
  const held = gains.map((gain, lung) => basis.references[lung] + formAt(forms[lung], gain));
  return { gravity, weights, gains: Float64Array.from(gains.flat()), held, above: depth, folds: !gains.flat().every(Number.isFinite) };
}

function lungOf({ lungBegin }, vertex) {
  let lung = 0;
  while (vertex >= lungBegin[lung + 1]) ++lung;
  return lung;
}

/** Write the displacement of a vertex of the surface by mode k at weight and gain 1, mm, to `out`. */
function modeOf({ clusters, clustered, clusterVectors, coefficients, direction, modes, surface, vector, vertices }, vertex, k, out) {
  const [x, y, z] = surface.subarray(3 * vertex, 3 * vertex + 3);
  for (let axis = 0; axis < 3; ++axis) {
    if (clusters > 0) {
      const at = (clustered[4 * vertex + 2] * modes + k) * CLUSTER_NUMBERS;
      const [slope, pattern] = [at + CLUSTER_SLOPE + 3 * axis, at + CLUSTER_PATTERN + axis];
      out[axis] = clusterVectors[at + axis] + clusterVectors[slope] * x + clusterVectors[slope + 1] * y + clusterVectors[slope + 2] * z
        + clustered[4 * vertex] * clusterVectors[pattern] + clustered[4 * vertex + 1] * clusterVectors[pattern + 3];
    } else {
      out[axis] = vector ? coefficients[(axis * vertices + vertex) * modes + k] : coefficients[vertex * modes + k] * direction[3 * vertex + axis];
    }
  }
}

/** Write the displacement of a vertex of the surface by the modes at their weights, mm, before the gains multiply it,
 * to `out`. The basis has no clusters. */
function fieldOf({ coefficients, direction, modes, vector, vertices }, weights, vertex, out) {
  for (let axis = 0; axis < 3; ++axis) {
    if (axis > 0 && !vector) {
      out[axis] = out[0];
      continue;
    }
    out[axis] = 0;
    for (let k = 0, at = (axis * vertices + vertex) * modes; k < modes; ++k) out[axis] += weights[k] * coefficients[at + k];
  }
  if (!vector) for (let axis = 0; axis < 3; ++axis) out[axis] *= direction[3 * vertex + axis];
}

/** Compute the positions of the vertices `begin` to `end`, by default of all, in a state of the lungs, mm. */
function placesOf(basis, moment, begin = 0, end = basis.vertices) {
  return basis.clusters > 0 ? clusterPlaces(basis, framesOf(basis, moment), begin, end) : modePlaces(basis, moment, begin, end);
}

function clusterPlaces({ clustered, surface }, frames, begin, end) {
  const places = new Float32Array(3 * (end - begin));
  for (let v = begin; v < end; ++v) {
    const at = FRAME * clustered[4 * v + 2];
    for (let axis = 0; axis < 3; ++axis) {
      let x = frames[at + axis];
      for (let column = 0; column < 3; ++column) x += frames[at + 4 + 4 * column + axis] * surface[3 * v + column];
      for (let s = 0; s < 2; ++s) x += frames[at + 16 + 4 * s + axis] * clustered[4 * v + s];
      places[3 * (v - begin) + axis] = x;
    }
  }
  return places;
}

function modePlaces(basis, moment, begin, end) {
  const places = new Float32Array(3 * (end - begin));
  const field = [0, 0, 0];
  let lung = lungOf(basis, begin);
  let weights = weightsOf(basis, moment, lung);
  for (let v = begin; v < end; ++v) {
    if (v >= basis.lungBegin[lung + 1]) {
      lung = lungOf(basis, v);
      weights = weightsOf(basis, moment, lung);
    }
    fieldOf(basis, weights, v, field);
    for (let axis = 0; axis < 3; ++axis) places[3 * (v - begin) + axis] = basis.surface[3 * v + axis] + moment.gains[3 * lung + axis] * field[axis];
  }
  return places;
}

/** Compute the position of a vertex in a state of the lungs, mm. */
const placeOf = (basis, moment, vertex) => Array.from(placesOf(basis, moment, vertex, vertex + 1));

/** Compute the positions of the corners of up to 3000 triangles, mm. They suffice to choose the range of the colours.
 * */
function samplePlaces(basis, moment) {
  const stride = 3 * Math.max(1, Math.ceil(basis.corners.length / 3 / 3000));
  const places = [];
  for (let t = 0; t < basis.corners.length; t += stride) {
    for (let i = 0; i < 3; ++i) places.push(placeOf(basis, moment, basis.corners[t + i]));
  }
  return places;
}
