// SPDX-License-Identifier: MIT
// Run the C library as WebAssembly, one instance for each basis. Nothing allocates after a basis is open, so that the
// memory never grows and the arrays never move.

// Bytes reserved for C structs and buffers.
const STATE = 128, POSE = 8 * (256 + 3 * 16 + 1 + 16), VOLUMES = 8 * 16, TEXT = 512, VALUE = 32, ERROR = 4 + 512 + 4 + VALUE, OPTIONS = 16;
// What to do about an error, after its message: words for each supine_remedy of this library, in the order of the enum.
const REMEDIES = ['', ", or use a basis that 'supine precompute' made without --scanned none and --law paper"];
// Byte offsets of members of the C struct supine_basis_info in WebAssembly, where pointers and sizes have 4 bytes.
const INFO = { vertices: 0, lungs: 16, begin: 20, hasVolume: 25, names: 56, normals: 100 };
const TYPES = [Uint8Array, Uint32Array, Float32Array, Float64Array, Int16Array, Int8Array, Uint16Array]; // in the order of supine_dtype
const STATUS = ['ok', 'argument', 'memory', 'read', 'format', 'mesh', 'open surface', 'unsupported', 'write', 'numerical'];

export class SupineError extends Error {
  constructor(message, status) {
    super(message);
    this.name = 'SupineError';
    this.status = STATUS[status];
  }
}

const refusal = (message) => new SupineError(message, STATUS.indexOf('argument'));

class Basis {
  #c; #basis; #lit; #hasVolume; #state; #pose; #nextState; #nextPose; #volumes; #text; #error; #positions; #normals; #expected;

  constructor(instance, bytes, { allowFolds = false }) {
    this.#c = instance.exports;
    this.#c._initialize();
    const size = 2 * (STATE + POSE) + VOLUMES + TEXT + ERROR;
    this.#state = this.#allocate(size); // first the structs with doubles, in sizes that are multiples of 8, for alignment
    this.#pose = this.#state + STATE;
    this.#nextState = this.#pose + POSE;
    this.#nextPose = this.#nextState + STATE;
    this.#volumes = this.#nextPose + POSE;
    this.#text = this.#volumes + VOLUMES;
    this.#error = this.#text + TEXT;
    this.#view(Uint8Array, this.#state, size).fill(0);
    const file = this.#allocate(bytes.length);
    this.#view(Uint8Array, file, bytes.length).set(bytes);
    // A supine_basis_options: its size, then storage and simd, and the bools without_normals and allow_folds.
    this.#view(Uint32Array, this.#volumes, 4).set([OPTIONS, 0, 0, allowFolds ? 1 << 8 : 0]);
    this.#check(this.#c.supine_basis_open_memory_with(file, bytes.length, this.#volumes, this.#text, this.#error));
    this.#basis = this.#word(this.#text);
    const info = this.#c.supine_basis_get_info(this.#basis);
    this.vertexCount = this.#word(info + INFO.vertices);
    this.#positions = this.#allocate(12 * this.vertexCount);
    this.#normals = this.#allocate(12 * this.vertexCount);
    this.#expected = this.#allocate(4 * this.vertexCount);

    // The memory does not grow any more, so that these views stay valid.
    this.positions = this.#view(Float32Array, this.#positions, 3 * this.vertexCount);
    this.normals = this.#view(Float32Array, this.#normals, 3 * this.vertexCount);
    this.vertices = this.tensor('vertices').data;
    this.triangles = this.tensor('triangles').data;
    this.#lit = this.#word(info + INFO.normals) > 0;
    this.#hasVolume = this.#view(Uint8Array, info + INFO.hasVolume, 1)[0] !== 0;
    const lungs = this.#word(info + INFO.lungs);
    const [begin, names] = [this.#word(info + INFO.begin), this.#word(info + INFO.names)];
    this.lungs = {};
    for (let i = 0; i < lungs; ++i) {
      this.lungs[this.#string(this.#word(names + 4 * i))] = [this.#word(begin + 4 * i), this.#word(begin + 4 * i + 4)];
    }
    this.metadata = {};
    const pairs = this.#c.supine_basis_all_metadata(this.#basis, this.#text);
    for (let at = pairs, end = pairs + 8 * this.#word(this.#text); at < end; at += 8) {
      this.metadata[this.#string(this.#word(at))] = this.#string(this.#word(at + 4));
    }
    this.deform(); // the pose is still all 0: the reference surface
  }

  tensor(name) {
    const at = this.#c.supine_basis_tensor(this.#basis, this.#write(name)); // a supine_tensor: name, dtype, rank, shape[4], data
    if (at === 0) return undefined;
    const [, type, rank, a, b, c, d, data] = this.#view(Uint32Array, at, 8);
    const shape = [a, b, c, d].slice(0, rank);
    return { shape, data: this.#view(TYPES[type], data, shape.reduce((product, size) => product * size, 1)) };
  }

  pose(state) {
    this.#read(state);
    const fixed = state.gain !== undefined;
    if (fixed) this.#number(state.gain, 'gain');
    if (fixed) {
      const status = this.#c.supine_basis_weights(this.#basis, this.#nextState, this.#nextPose);
      this.#check(status, STATUS[status] === 'unsupported' ? 'displacements of this basis depend on the volume: give a volume instead of a gain'
        : 'gravity is zero or not finite: give a vector with a direction');
      this.#c.supine_pose_fill(this.#nextPose, state.gain);
    } else {
      this.#check(this.#c.supine_basis_pose(this.#basis, this.#nextState, this.#nextPose, this.#error));
    }
    new Uint8Array(this.#c.memory.buffer).copyWithin(this.#state, this.#nextState, this.#nextState + STATE + POSE);
    return this;
  }

  deform() {
    this.#evaluate(this.#c.supine_deform(this.#basis, this.#pose, this.#positions));
    return this.positions;
  }

  deformLit() {
    if (this.#lit) {
      this.#evaluate(this.#c.supine_deform_lit(this.#basis, this.#pose, this.#positions, this.#normals));
    } else {
      this.deform();
      this.#c.supine_normals(this.#basis, this.#positions, this.#normals);
    }
    return this.positions;
  }

  get volumes() {
    if (!this.#hasVolume) throw new SupineError('the surface is open and encloses no volume', STATUS.indexOf('open surface'));
    this.#evaluate(this.#c.supine_basis_volumes(this.#basis, this.#pose, this.#volumes));
    const volumes = this.#view(Float64Array, this.#volumes, 16);
    return Object.fromEntries(Object.keys(this.lungs).map((name, i) => [name, volumes[i]]));
  }

  get error() {
    return this.#c.supine_basis_error(this.#basis, this.#pose);
  }

  expectedError(since) {
    if (since !== undefined) this.#read(since);
    const from = since === undefined ? 0 : this.#nextState;
    this.#check(this.#c.supine_expected_error(this.#basis, this.#state, from, this.#expected, this.#error));
    return this.#view(Float32Array, this.#expected, this.vertexCount);
  }

  /** Return expectedError(since), or NaN for each vertex of another simulator's fields, whose error is unknown. */
  #expectedOrUnknown(since) {
    try {
      return this.expectedError(since);
    } catch (error) {
      if (error.status !== 'unsupported') throw error;
      return new Float32Array(this.vertexCount).fill(NaN);
    }
  }

  targets(since) {
    const after = this.deform().slice();
    const sigma = this.#expectedOrUnknown(since);
    this.#check(since === undefined ? this.#c.supine_basis_scan_pose(this.#basis, this.#nextPose, this.#error)
      : this.#c.supine_basis_pose(this.#basis, this.#nextState, this.#nextPose, this.#error));
    this.#evaluate(this.#c.supine_deform(this.#basis, this.#nextPose, this.#positions));
    const [part, names] = [this.tensor('part')?.data ?? [], this.tensor('names')?.data ?? new Uint8Array()];
    const anatomy = this.tensor('anatomy')?.data ?? [];
    const made = new TextDecoder().decode(names).split('\n').map((name, i) => ({ name, anatomy: anatomy[i] === 1, lung: '', at: [0, 0, 0], move: [0, 0, 0], mm: 0, expectedError: 0, count: 0 }));
    part.forEach((index, v) => {
      const target = made[index];
      if (target.count++ === 0) target.lung = Object.keys(this.lungs).find((name) => v < this.lungs[name][1]);
      for (let k = 0; k < 3; ++k) {
        target.at[k] += after[3 * v + k];
        target.move[k] += after[3 * v + k] - this.positions[3 * v + k];
      }
      target.expectedError += sigma[v] ** 2;
    });
    this.deform();
    return made.filter(({ count }) => count > 0).map(({ count, at, move, expectedError, ...target }) => {
      const mean = move.map((x) => x / count);
      return { ...target, at: at.map((x) => x / count), move: mean, mm: Math.hypot(...mean), expectedError: Math.sqrt(expectedError / count) };
    });
  }

  /** Write a state to #nextState. The default posture is supine; the default volume is the default of the basis. */
  #read(state) {
    const isText = typeof state === 'string';
    if (!isText && (typeof state !== 'object' || state === null || Array.isArray(state) || ArrayBuffer.isView(state))) {
      throw refusal('a state must be a text such as prone:rest, or an object { gravity, volume }');
    }
    const unknown = isText ? undefined : Object.keys(state).find((key) => !['gravity', 'volume', 'gain'].includes(key));
    if (unknown !== undefined) throw refusal(`a state has no member '${unknown}': give a text such as prone:rest, or { gravity, volume }`);
    const { gravity = [0, 1, 0], volume = '' } = isText ? {} : state;
    if (typeof volume !== 'string') throw refusal('the volume of a state must be a text such as rest+500');
    if (state.gain !== undefined && volume !== '') throw refusal('a state has a volume and a gain: give one of them');
    this.#view(Uint8Array, this.#nextState, STATE).fill(0);
    const three = Array.from(gravity, Number);
    if (three.length !== 3) throw refusal('gravity must be three numbers');
    this.#view(Float64Array, this.#nextState, 3).set(three);
    if (isText) this.#check(this.#c.supine_state_parse(this.#write(state), this.#nextState, this.#error));
    else if (volume !== '') this.#check(this.#c.supine_state_parse_volume(this.#write(volume), this.#nextState, this.#error));
  }

  #write(text) {
    const bytes = new TextEncoder().encode(`${text}\0`);
    if (bytes.length > TEXT) throw new SupineError(`the text has ${bytes.length - 1} bytes: give at most ${TEXT - 1}`, STATUS.indexOf('argument'));
    this.#view(Uint8Array, this.#text, bytes.length).set(bytes);
    return this.#text;
  }

  #string(at) {
    const bytes = new Uint8Array(this.#c.memory.buffer, at);
    return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
  }

  #check(status, message) {
    if (status === 0) return;
    const remedy = REMEDIES[this.#word(this.#error + 4 + TEXT)] ?? '';
    throw new SupineError(message || this.#string(this.#error + 4) + remedy, status);
  }

  #evaluate(status) {
    this.#check(status, 'the pose has a weight or a gain that is not finite: give a smaller gain');
  }

  #number(value, name) {
    if (!Number.isFinite(value)) throw new SupineError(`${name} is ${value}: give a finite number`, STATUS.indexOf('argument'));
  }

  #allocate(size) {
    const at = this.#c.malloc(size);
    if (at === 0) throw new SupineError(`out of memory: ${size} bytes`, STATUS.indexOf('memory'));
    return at;
  }

  #view(Type, at, count) {
    return new Type(this.#c.memory.buffer, at, count);
  }

  #word(at) {
    return this.#view(Uint32Array, at, 1)[0];
  }
}

let beside; // promise of the module compiled from supine.wasm beside this file

async function load() {
  const url = new URL('./supine.wasm', import.meta.url);
  const files = url.protocol === 'file:' && globalThis.process?.getBuiltinModule?.('node:fs');
  return WebAssembly.compile(files ? files.readFileSync(url) : await (await fetch(url)).arrayBuffer());
}

export async function open(source, { wasm, allowFolds = false } = {}) {
  const bytes = ArrayBuffer.isView(source) ? new Uint8Array(source.buffer, source.byteOffset, source.byteLength) : new Uint8Array(source);
  const module = wasm === undefined ? await (beside ??= load()) : wasm instanceof WebAssembly.Module ? wasm : await WebAssembly.compile(wasm);
  // The C library imports functions that write to files, for printf. Refuse every call.
  const none = () => 52; // the error ENOSYS of WASI
  const instance = await WebAssembly.instantiate(module, { wasi_snapshot_preview1: { fd_close: none, fd_seek: none, fd_write: none } });
  return new Basis(instance, bytes, { allowFolds });
}
