// SPDX-License-Identifier: MIT
// Read the lungs from the page: decompress their numbers, and rebuild from them the basis files in memory that the
// run-time library (supine.js) opens. The shaders take the numbers as the page stores them.

function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const padding = [2, 1].find((n) => text.endsWith('='.repeat(n))) ?? 0;
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
  const text = element.textContent.replace(/\s/g, '');
  element.remove();
  return fromBase64(text);
}

/** Return a tensor of numbers, as the page stores it; undefined if the page has none of this name. */
function takeTensor(name, Numbers) {
  return document.getElementById(`tensor-${name}`) ? new Numbers(takeBytes(name).buffer) : undefined;
}

/** Decompress a tensor of 16-bit integers. Its rows are padded to an even number of columns. */
function takeCounts(name, rows, columns, filter) {
  const stride = 4 * Math.ceil(columns / 2);
  const bytes = new Uint8Array(rows * stride);
  MeshoptDecoder.decodeVertexBuffer(bytes, rows, stride, takeBytes(name), filter);
  return new Int16Array(bytes.buffer);
}

/** Return quantised positions as numbers: middle[axis] plus `unit` times the stored integer. */
function takePlaces(name, rows, unit, middle) {
  const counts = takeCounts(name, rows, 3);
  return Float32Array.from({ length: 3 * rows }, (_, i) => {
    const axis = i % 3;
    return middle[axis] + unit * counts[4 * Math.floor(i / 3) + axis];
  });
}

/** Return coefficients [vertices, axes, modes], mm, from counts of steps of `unit`, [axes, vertices, padded modes]. */
function coefficientsFrom(counts, vertices, axes, modes, unit) {
  const numbers = new Float32Array(vertices * axes * modes);
  const stride = counts.length / (axes * vertices);
  for (let v = 0, to = 0; v < vertices; ++v) {
    for (let axis = 0; axis < axes; ++axis) {
      const from = (axis * vertices + v) * stride;
      for (let k = 0; k < modes; ++k) numbers[to++] = unit * counts[from + k];
    }
  }
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
  for (let i = 0; i < text.length; i += 2)
    bytes[4 * Math.floor(i / 6) + (i % 6) / 2] = parseInt(text.slice(i, i + 2), 16);
  return bytes;
}

const DTYPES = new Map([
  [Uint8Array, 'U8'],
  [Uint16Array, 'U16'],
  [Int16Array, 'I16'],
  [Uint32Array, 'U32'],
  [Float32Array, 'F32'],
  [Float64Array, 'F64'],
]);

/** Return a safetensors file in memory, for open() of supine.js with `seal`. `tensors` has [shape, numbers] by name;
 * those whose numbers are undefined are left out. */
function basisFile(tensors, metadata) {
  const header = { __metadata__: { ...metadata, checksum: UNSEALED } };
  const kept = Object.entries(tensors).filter(([, [, numbers]]) => numbers !== undefined);
  kept.sort(([, [, a]], [, [, b]]) => b.BYTES_PER_ELEMENT - a.BYTES_PER_ELEMENT); // so that each is aligned
  let at = 0;
  for (const [name, [shape, numbers]] of kept) {
    const end = at + numbers.byteLength;
    header[name] = { dtype: DTYPES.get(numbers.constructor), shape, data_offsets: [at, end] };
    at = end;
  }
  const text = new TextEncoder().encode(JSON.stringify(header));
  const begin = 8 + 8 * Math.ceil(text.length / 8);
  const file = new Uint8Array(begin + at).fill(32, 0, begin); // the header is padded with spaces
  new DataView(file.buffer).setBigUint64(0, BigInt(begin - 8), true);
  file.set(text, 8);
  for (const [name, [, { buffer, byteOffset, byteLength }]] of kept) {
    file.set(new Uint8Array(buffer, byteOffset, byteLength), begin + header[name].data_offsets[0]);
  }
  return file;
}

/** Return the tensors that the surface and the structures inside it have in common, as basisFile takes them. */
function takeShared({ modes, band, order, lungBegin }) {
  const lungs = lungBegin.length - 1;
  const harmonics = (band + 1) ** 2;
  const second = 9; // harmonics of the volumes that depend on posture
  const shapes = {
    modes: [modes, harmonics, order + 1],
    volume_linear: [lungs, 3, modes],
    volume_quadratic: [lungs, 3, modes, modes],
    volume_cubic: [lungs, modes, modes, modes],
    resting_volume: [lungs, second],
    full_volume: [lungs, second],
    volume_range: [27, lungs, 2],
    simulated_range: [lungs, 2],
    lungs_hilum: [lungs, 3, modes],
  };
  const taken = Object.entries(shapes).map(([name, shape]) => [name, [shape, takeTensor(name, Float64Array)]]);
  const limits = takeTensor('simulated_limits', Float64Array);
  const shares = takeTensor('simulated_shares', Float64Array);
  return {
    ...Object.fromEntries(taken),
    simulated_limits: [[lungs, 2, (limits?.length ?? 0) / lungs / 2], limits],
    simulated_shares: [[lungs, second, (shares?.length ?? 0) / lungs / second], shares],
  };
}

/** Return the tensors lungs_squares and lungs_box, for expected errors of vertices that are not all of the lungs'. */
function takeSquares({ modes, lungBegin }, prefix) {
  return {
    lungs_squares: [[lungBegin.length - 1, 3, modes, modes], takeTensor(`${prefix}lungs_squares`, Float64Array)],
    lungs_box: [[2, 3], takeTensor(`${prefix}lungs_box`, Float64Array)],
  };
}

/** Return the lung of each vertex. */
const lungsOfVertices = (begin) => {
  const lung = new Uint8Array(begin.at(-1));
  for (let i = 0; i < begin.length - 1; ++i) lung.fill(i, begin[i], begin[i + 1]);
  return lung;
};

/** Return what the files in memory state about themselves: volumes of the lungs as in the file that was exported. */
const metadataOf = (basis, metadata) => ({
  ...metadata,
  content: metadata.content ?? 'page',
  reference_volume_ml: basis.references.join(),
});

/** Take the vertices of the surface, and return the tensors of its basis. */
function takeSurface(basis) {
  const { vertices: n, modes, clusters, vector } = basis;
  basis.surface = takePlaces('vertices', n, basis.placeUnit, basis.middle);
  basis.corners = takeTriangles('triangles', basis.triangles);
  const tensors = {
    vertices: [[n, 3], basis.surface],
    triangles: [[basis.triangles, 3], basis.corners],
    lung: [[n], lungsOfVertices(basis.lungBegin)],
  };
  if (!vector) {
    const directions = takeCounts('direction', n, 4, 'OCTAHEDRAL');
    basis.direction = Float32Array.from(
      { length: 3 * n },
      (_, i) => directions[4 * Math.floor(i / 3) + (i % 3)] / 32767,
    );
    tensors.direction = [[n, 3], basis.direction];
  }
  if (clusters > 0) {
    const rows = takeCounts('clusters', n, 3); // two scalars and the cluster of each vertex
    basis.clustered = rows;
    tensors.cluster_vectors = [[clusters, modes, 18], takeTensor('cluster_vectors', Float32Array)];
    tensors.cluster_scalars = [[n, 2], Int16Array.from({ length: 2 * n }, (_, i) => rows[4 * (i >> 1) + (i % 2)])];
    tensors.clusters = [[n], Uint16Array.from({ length: n }, (_, v) => rows[4 * v + 2])];
  } else {
    const axes = vector ? 3 : 1;
    basis.counts = takeCounts('coefficients', axes * n, modes);
    const shape = vector ? [n, 3, modes] : [n, modes];
    tensors.coefficients = [shape, coefficientsFrom(basis.counts, n, axes, modes, basis.unit)];
  }
  basis.fitErrors = document.getElementById('tensor-error_vertices') !== null; // of another simulator's fields
  if (basis.fitErrors) {
    const counts = takeCounts('error_vertices', n, 1);
    tensors.error_vertices = [[n], Float32Array.from({ length: n }, (_, v) => basis.errorUnit * counts[2 * v])];
    const harmonics = takeTensor('error_gravity', Float64Array);
    tensors.error_gravity = [[2 * basis.band + 4, (basis.band + 2) ** 2], harmonics];
    const factors = takeTensor('error_volume', Float64Array);
    tensors.error_volume = [[factors?.length], factors];
  }
  return tensors;
}

/** Name the lungs, and find the boxes of the lungs and of the torso. */
function findBoxes(basis) {
  basis.lungs = basis.lungBegin.length - 1;
  const names = (basis.metadata.lungs ?? '').split(',');
  basis.lungNames = Array.from({ length: basis.lungs }, (_, i) => (names[i] ? `${names[i]} lung` : `lung ${i}`));
  basis.lungBoxes = basis.lungNames.map((_, lung) => {
    const [begin, end] = [basis.lungBegin[lung], basis.lungBegin[lung + 1]];
    return boundsOf(
      Array.from({ length: end - begin }, (_, i) => basis.surface.subarray(3 * (begin + i), 3 * (begin + i) + 3)),
    );
  });
  const corner = (end, most) => [0, 1, 2].map((axis) => most(...basis.lungBoxes.map((box) => box[end][axis])));
  const [low, high] = [corner('low', Math.min), corner('high', Math.max)];
  const box = { low: [...low], high: [...high] };
  if (basis.lungs === 1) {
    [low[0], high[0]] = [Math.min(low[0], -high[0]), Math.max(high[0], -low[0])]; // room for the other lung
  }
  const centre = low.map((x, i) => (x + high[i]) / 2);
  basis.torso = { ...box, centre, half: low.map((x, i) => (high[i] - x) / 2), outline: basis.outline };
}

/** Read the lungs from the page, and open them with the run-time library. */
async function readBasis() {
  const basis = JSON.parse(document.getElementById('basis').textContent);
  ANATOMY_COLOURS.push(...basis.anatomyColours);
  for (const [name, text] of Object.entries(basis.colours)) basis.colours[name] = readColours(text);
  const plain = new Uint8Array(1024).map((_, i) => [184, 196, 212, 255][i % 4]);
  Object.assign(basis.colours, { expansion: divergingMap(), plain });
  basis.fields = basis.metadata.route === 'fields'; // made from another simulator's fields
  basis.breathes = !basis.fields || basis.order > 0; // fields of gravity alone have no volumes and no breaths
  const wasm = await WebAssembly.compile(takeBytes('wasm'));
  const [shared, own] = [takeShared(basis), takeSurface(basis)];
  const options = { wasm, exact: true, seal: true, doubt: true };
  const tensors = { ...own, ...shared, ...takeSquares(basis, '') };
  basis.library = await open(basisFile(tensors, metadataOf(basis, basis.metadata)), options);
  findBoxes(basis);
  if (basis.inside) await takeInside(basis, shared, options);
  basis.froms = takeFroms(basis);
  return basis;
}

function lungOf({ lungBegin }, vertex) {
  let lung = 0;
  while (vertex >= lungBegin[lung + 1]) ++lung;
  return lung;
}
