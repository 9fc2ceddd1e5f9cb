// SPDX-License-Identifier: MIT
// Run the C library as WebAssembly, one instance for each basis. Nothing allocates after a basis is open, so that the
// memory never grows and the arrays never move.

// Bytes reserved for C structs and buffers.
const STATE = 128;
const POSE = 8 * (256 + 3 * 16 + 1 + 16);
const VOLUMES = 8 * 16;
const MESSAGE = 512;
const TEXT = 2 * MESSAGE; // a message, and what to do
const REMEDY = 4 + 4 + 32 + 4;
const ERROR = 4 + MESSAGE + 3 * REMEDY;
const OPTIONS = 16;
const EXACT = 1; // SUPINE_STORAGE_EXACT
const FRAME = 24; // SUPINE_GL_FRAME_FLOATS
const KINDS_OF_VOLUME = { rest: 1, full: 2, scan: 3 }; // supine_volume_kind
const JAVASCRIPT = 2; // SUPINE_WORDS_JAVASCRIPT
// Bytes of supine_doubt_task; most fiducials, and most vertices of a covariance.
const TASK = 24;
const FIDUCIALS = 300;
const TOGETHER = 64;
const NOT_FINITE = 'the pose has a weight or a gain that is not finite: give a smaller gain';
/** Metadata "checksum" of a file that open() completes (its option `seal`). */
export const UNSEALED = 'xxh64:0000000000000000';
// Byte offsets of members of the C struct supine_basis_info in WebAssembly, where pointers and sizes have 4 bytes.
const INFO = { vertices: 0, lungs: 16, begin: 20, hasVolume: 25, names: 56 };
// Byte offsets of members of supine_fact, its size, and the largest number of facts.
const FACT = { value: 0, name: 24, unit: 28, origin: 32, source: 36, text: 40, size: 208, most: 32 };
// Types of tensors, in the order of supine_dtype.
const TYPES = [Uint8Array, Uint32Array, Float32Array, Float64Array, Int16Array, Int8Array, Uint16Array];
const STATUS = [
  'ok',
  'argument',
  'memory',
  'read',
  'format',
  'mesh',
  'open surface',
  'unsupported',
  'write',
  'numerical',
];

export class SupineError extends Error {
  constructor(message, status) {
    super(message);
    this.name = 'SupineError';
    this.status = STATUS[status];
  }
}

const refusal = (message) => new SupineError(message, STATUS.indexOf('argument'));

/** Return a state that was given as an object; refuse other values and unknown members. */
function members(state) {
  const isObject = typeof state === 'object' && state !== null;
  if (!isObject || Array.isArray(state) || ArrayBuffer.isView(state)) {
    throw refusal('a state must be a text such as prone:rest, or an object { gravity, volume }');
  }
  const unknown = Object.keys(state).find((key) => !['gravity', 'volume', 'gain'].includes(key));
  if (unknown !== undefined) {
    throw refusal(`a state has no member '${unknown}': give a text such as prone:rest, or { gravity, volume }`);
  }
  const { volume = '', gain } = state;
  if (typeof volume !== 'string') throw refusal('the volume of a state must be a text such as rest+500');
  if (gain !== undefined && volume !== '') throw refusal('a state has a volume and a gain: give one of them');
  return state;
}

/** Return a finite number as it is. Refuse what JavaScript would convert to one, such as null, '' and []. */
function number(value, name) {
  if (typeof value !== 'number') throw refusal(`${name} has ${JSON.stringify(value) ?? typeof value}: give a number`);
  if (!Number.isFinite(value)) throw refusal(`${name} is ${value}: give a finite number`);
  return value;
}

/** Divide the sums of a target by the number of its vertices. */
function meanOf({ count, at, move, ...target }) {
  const mean = move.map((x) => x / count);
  const [expectedError, movedError] = [target.expectedError, target.movedError].map((sum) => Math.sqrt(sum / count));
  return { ...target, at: at.map((x) => x / count), move: mean, mm: Math.hypot(...mean), expectedError, movedError };
}

class Basis {
  #c;
  #basis;
  #hasVolume;
  #uniforms;
  #frames;
  #state;
  #pose;
  #nextState;
  #nextPose;
  #volumes;
  #text;
  #error;
  #positions;
  #normals;
  #expected;
  #facts;
  #doubt; // memory for what is asked of the field of the expected error; undefined unless it was asked for
  #drawn; // prepared samples, and the state that they are of
  #isChecked = false; // whether the pose is that of the state, which poseScan does not set
  #hasErrors = false; // whether the pose is that of the state alone, without a gain
  #sinceFindings = []; // of the last state `since`

  constructor(instance, bytes, options) {
    this.#c = instance.exports;
    this.#c._initialize();
    this.#reserve();
    this.#open(bytes, options);
    const info = this.#c.supine_basis_get_info(this.#basis);
    this.vertexCount = this.#word(info + INFO.vertices);
    this.#positions = this.#allocate(12 * this.vertexCount);
    this.#normals = this.#allocate(12 * this.vertexCount);
    this.#expected = this.#allocate(4 * this.vertexCount);
    this.#facts = this.#allocate(FACT.size * FACT.most);
    this.#readLungs(info);
    this.#makeUniforms();
    if (options.doubt) this.#reserveDoubt();

    // The memory does not grow any more, so that these views stay valid.
    this.positions = this.#view(Float32Array, this.#positions, 3 * this.vertexCount);
    this.normals = this.#view(Float32Array, this.#normals, 3 * this.vertexCount);
    this.vertices = this.tensor('vertices').data;
    this.triangles = this.tensor('triangles').data;
    this.#hasVolume = this.#view(Uint8Array, info + INFO.hasVolume, 1)[0] !== 0;
    this.#readMetadata();
    this.deform(); // the pose is still all 0: the reference surface
  }

  /** Reserve memory for C structs: first those with doubles, in sizes that are multiples of 8, for alignment. */
  #reserve() {
    const size = 2 * (STATE + POSE) + VOLUMES + TEXT + ERROR;
    this.#state = this.#allocate(size);
    this.#pose = this.#state + STATE;
    this.#nextState = this.#pose + POSE;
    this.#nextPose = this.#nextState + STATE;
    this.#volumes = this.#nextPose + POSE;
    this.#text = this.#volumes + VOLUMES;
    this.#error = this.#text + TEXT;
    this.#view(Uint8Array, this.#state, size).fill(0);
  }

  /** Copy the bytes of a file, and open them. */
  #open(bytes, { allowFolds, exact, seal }) {
    const file = this.#allocate(bytes.length);
    this.#view(Uint8Array, file, bytes.length).set(bytes);
    if (seal) this.#seal(file, bytes.length);
    // A supine_basis_options: its size, then storage and simd, and the bools without_normals and allow_folds.
    this.#view(Uint32Array, this.#volumes, 4).set([OPTIONS, exact ? EXACT : 0, 0, allowFolds ? 1 << 8 : 0]);
    const { supine_basis_open_memory_with: open } = this.#c;
    this.#check(open(file, bytes.length, this.#volumes, this.#text, this.#error));
    this.#basis = this.#word(this.#text);
  }

  /** Replace the metadata "checksum" of a file that was made in memory, UNSEALED, by that of its content. */
  #seal(at, size) {
    const file = this.#view(Uint8Array, at, size);
    const header = new TextDecoder('latin1').decode(file.subarray(8, 8 + this.#word(at)));
    this.#check(this.#c.supine_safetensors_open_memory(at, size, this.#write('made'), this.#nextPose, this.#error));
    const made = this.#word(this.#nextPose);
    this.#c.supine_safetensors_print_checksum(made, this.#text);
    this.#c.supine_safetensors_close(made);
    const sealed = new Uint8Array(this.#c.memory.buffer);
    sealed.copyWithin(at + 8 + header.indexOf(UNSEALED), this.#text, this.#text + UNSEALED.length);
  }

  #readLungs(info) {
    const lungs = this.#word(info + INFO.lungs);
    const [begin, names] = [this.#word(info + INFO.begin), this.#word(info + INFO.names)];
    this.lungs = {};
    for (let i = 0; i < lungs; ++i) {
      const name = this.#string(this.#word(names + 4 * i));
      this.lungs[name] = [this.#word(begin + 4 * i), this.#word(begin + 4 * i + 4)];
    }
  }

  #readMetadata() {
    this.metadata = {};
    const pairs = this.#c.supine_basis_all_metadata(this.#basis, this.#text);
    for (let at = pairs, end = pairs + 8 * this.#word(this.#text); at < end; at += 8) {
      this.metadata[this.#string(this.#word(at))] = this.#string(this.#word(at + 4));
    }
  }

  /** Reserve memory for what supine.glsl takes in a pose: weights and gains or, of clusters, frames. */
  #makeUniforms() {
    const [modes, , orders] = this.tensor('modes').shape;
    const lungs = Object.keys(this.lungs).length;
    const clusters = this.tensor('cluster_vectors')?.shape[0] ?? 0;
    const weights = 4 * Math.ceil(modes / 4) * (orders > 1 ? lungs : 1);
    this.#uniforms = clusters > 0 ? null : { weights, at: this.#allocate(4 * (weights + 3 * lungs)), gains: 3 * lungs };
    this.#frames = { count: FRAME * clusters, at: this.#allocate(4 * FRAME * clusters + 4) };
  }

  tensor(name) {
    // A supine_tensor: name, dtype, rank, shape[4], data
    const at = this.#c.supine_basis_tensor(this.#basis, this.#write(name));
    if (at === 0) return undefined;
    const [, type, rank, a, b, c, d, data] = this.#view(Uint32Array, at, 8);
    const shape = [a, b, c, d].slice(0, rank);
    const count = shape.reduce((product, size) => product * size, 1);
    return { shape, data: this.#view(TYPES[type], data, count) };
  }

  pose(state) {
    this.#makePose(state);
    this.#take();
    this.#isChecked = true;
    this.#hasErrors = state.gain === undefined;
    this.#sinceFindings = [];
    return this;
  }

  poseScan() {
    this.#check(this.#c.supine_basis_scan_pose(this.#basis, this.#nextPose, this.#error));
    this.#take();
    this.#isChecked = false;
    this.#hasErrors = false;
    this.#sinceFindings = [];
    return this;
  }

  /** Write a state and its pose to #nextState and #nextPose. */
  #makePose(state) {
    this.#read(state);
    const { supine_basis_pose: pose, supine_basis_pose_gain: poseGain } = this.#c;
    if (state.gain === undefined) {
      this.#check(pose(this.#basis, this.#nextState, this.#nextPose, this.#error));
    } else {
      this.#check(poseGain(this.#basis, this.#nextState, number(state.gain, 'gain'), this.#nextPose, this.#error));
    }
  }

  /** Make the pose of the state from which displacements are asked, and judge it, or make that of the scan. Return the
   * address of the state; 0 for the scan. */
  #poseSince(since) {
    if (since === undefined) {
      this.#check(this.#c.supine_basis_scan_pose(this.#basis, this.#nextPose, this.#error));
      return 0;
    }
    if (since?.gain !== undefined) throw refusal('the expected error from a gain is unknown: give a volume');
    this.#makePose(since);
    this.#sinceFindings = this.#judge(this.#nextState, this.#nextPose);
    return this.#nextState;
  }

  /** Make the next state and pose the current ones. */
  #take() {
    const memory = new Uint8Array(this.#c.memory.buffer);
    memory.copyWithin(this.#state, this.#nextState, this.#nextState + STATE + POSE);
  }

  gravityOfRotation(rotation, up, axes = 'lps') {
    const [turn, high] = [Array.from(rotation, (x) => number(x, 'rotation')), Array.from(up, (x) => number(x, 'up'))];
    if (high.length !== 3) throw refusal('up must be three numbers');
    this.#view(Float64Array, this.#nextPose, 9).set(turn.slice(0, 9));
    this.#view(Float64Array, this.#volumes, 3).set(high);
    const { supine_posture_rotation: find } = this.#c;
    const name = this.#write(axes);
    this.#check(find(this.#nextPose, turn.length, this.#volumes, name, this.#nextState, this.#error));
    return Array.from(this.#view(Float64Array, this.#nextState, 3));
  }

  at(vertex) {
    const status = this.#c.supine_deform_range(this.#basis, this.#pose, vertex, vertex + 1, this.#text);
    this.#check(status, `vertex ${vertex} is not one of 0 to ${this.vertexCount - 1}, or the pose is not finite`);
    return Array.from(this.#view(Float32Array, this.#text, 3));
  }

  get uniforms() {
    const { at, weights, gains } = this.#uniforms;
    const status = this.#c.supine_gl_weights(this.#basis, this.#pose, at, at + 4 * weights);
    this.#check(status, 'supine.glsl has no pose of the scan of collapsed lungs: give another state');
    const [all, of] = [this.#view(Float32Array, at, weights), this.#view(Float32Array, at + 4 * weights, gains)];
    return { weights: all.slice(), gains: of.slice() };
  }

  get frames() {
    const { at, count } = this.#frames;
    if (count === 0) return undefined;
    this.#evaluate(this.#c.supine_gl_frames(this.#basis, this.#pose, at));
    return this.#view(Float32Array, at, count).slice();
  }

  simulatedRange(gravity, kind) {
    if (this.tensor('simulated_range') === undefined) return undefined;
    this.#read({ gravity });
    const { supine_simulated_range: find } = this.#c;
    this.#check(find(this.#basis, this.#nextState, KINDS_OF_VOLUME[kind], this.#volumes, this.#error));
    return Array.from(this.#view(Float64Array, this.#volumes, 2));
  }

  deform() {
    this.#evaluate(this.#c.supine_deform(this.#basis, this.#pose, this.#positions));
    return this.positions;
  }

  deformLit() {
    this.#evaluate(this.#c.supine_deform_lit(this.#basis, this.#pose, this.#positions, this.#normals));
    return this.positions;
  }

  get volumes() {
    if (!this.#hasVolume) this.#check(STATUS.indexOf('open surface'), 'the surface is open and encloses no volume');
    this.#evaluate(this.#c.supine_basis_volumes(this.#basis, this.#pose, this.#volumes));
    const volumes = this.#view(Float64Array, this.#volumes, 16);
    return Object.fromEntries(Object.keys(this.lungs).map((name, i) => [name, volumes[i]]));
  }

  get facts() {
    const at = this.#facts;
    const count = this.#c.supine_basis_facts(this.#basis, at);
    return Array.from({ length: count }, (_, i) => this.#fact(at + FACT.size * i));
  }

  #fact(at) {
    const [name, unit, origin, source] = this.#view(Uint32Array, at + FACT.name, 4);
    const [value, low, high] = this.#view(Float64Array, at + FACT.value, 3);
    this.#c.supine_fact_print(at, this.#text, TEXT);
    return {
      name: this.#string(name), text: this.#string(at + FACT.text), value, low, high, unit: this.#string(unit),
      source: this.#string(this.#c.supine_fact_source_name(source)), origin: this.#string(origin),
      line: this.#string(this.#text), caveat: this.#c.supine_fact_is_caveat(at) !== 0,
    };
  }

  get findings() {
    return [...(this.#isChecked ? this.#judge(this.#state, this.#pose) : []), ...this.#sinceFindings];
  }

  #judge(state, pose) {
    const status = this.#c.supine_basis_check(this.#basis, state, pose, this.#error);
    return status === 0 ? [] : [{ warning: true, text: this.#string(this.#error + 4) }];
  }

  get caveats() {
    this.#c.supine_basis_caveats(this.#basis, this.#facts, FACT.size * FACT.most);
    return this.#string(this.#facts);
  }

  get error() {
    return this.#c.supine_basis_error(this.#basis, this.#pose);
  }

  expectedError(since) {
    return this.#expectedErrorFrom(this.#poseSince(since));
  }

  #expectedErrorFrom(from) {
    this.#needErrors();
    this.#check(this.#c.supine_expected_error(this.#basis, this.#state, from, this.#expected, this.#error));
    return this.#view(Float32Array, this.#expected, this.vertexCount);
  }

  #needErrors() {
    if (this.#hasErrors) return;
    const unsupported = STATUS.indexOf('unsupported');
    throw new SupineError('the expected error of a gain or of poseScan is unknown: pose a state', unsupported);
  }

  anotherDay(sameSession) {
    return this.#c.supine_expected_another_day(sameSession);
  }

  #reserveDoubt() {
    const { supine_doubt_space: field, supine_doubt_frame_space: frame, supine_doubt_mend_space: mend } = this.#c;
    const each = 3 * TOGETHER;
    const of = this.#basis;
    const sizes = [TASK / 8, field(of, 1), frame(of, FIDUCIALS), mend(of), FIDUCIALS, each + each * each];
    const at = sizes.map((size) => this.#allocate(8 * size));
    this.#doubt = { task: at[0], field: at[1], frame: at[2], mend: at[3], list: at[4], numbers: at[5] };
  }

  /** Prepare the field of the expected error in the state of the pose; return its address. */
  #prepareDoubt(since, anotherDay = false) {
    if (this.#doubt === undefined) throw refusal('no memory is reserved for this: open the basis with { doubt: true }');
    this.#needErrors();
    const from = this.#poseSince(since);
    this.#drawn = undefined; // the field is in the same memory
    const { task, field } = this.#doubt;
    this.#view(Uint32Array, task, 6).set([this.#basis, 1, this.#state, from, anotherDay ? 1 : 0, 0]);
    this.#check(this.#c.supine_doubt_prepare(task, field, this.#text, this.#error));
    return this.#word(this.#text);
  }

  /** Write vertices, `words` numbers for each, to the reserved list. */
  #list(vertices, most, words) {
    if (vertices.length > most) throw refusal(`${vertices.length} vertices: give at most ${most}`);
    const rows = Array.from(vertices, (vertex) => [number(vertex, 'vertex'), 0].slice(0, words));
    this.#view(Uint32Array, this.#doubt.list, words * vertices.length).set(rows.flat());
    return this.#doubt.list;
  }

  covariance(vertices, { since, anotherDay } = {}) {
    const field = this.#prepareDoubt(since, anotherDay);
    const [count, { numbers }] = [3 * vertices.length, this.#doubt];
    const list = this.#list(vertices, TOGETHER, 2);
    const matrix = numbers + 8 * count;
    this.#check(this.#c.supine_doubt_covariance(field, count / 3, list, numbers, matrix, this.#error));
    const [mean, covariance] = [this.#view(Float64Array, numbers, count), this.#view(Float64Array, matrix, count ** 2)];
    return { mean: mean.slice(), covariance: covariance.slice() };
  }

  registration(fiducials, { since, anotherDay } = {}) {
    const field = this.#prepareDoubt(since, anotherDay);
    const list = this.#list(fiducials, FIDUCIALS, 1);
    const { frame, numbers } = this.#doubt;
    this.#check(this.#c.supine_doubt_frame_prepare(field, fiducials.length, list, frame, this.#text, this.#error));
    this.#c.supine_doubt_frame_motion(frame, numbers, numbers + 8 * 9);
    this.#evaluate(this.#c.supine_doubt_frame_errors(frame, 0, this.vertexCount, this.#expected));
    const motion = Array.from(this.#view(Float64Array, numbers, 12));
    const error = this.#view(Float32Array, this.#expected, this.vertexCount);
    return { rotation: motion.slice(0, 9), translation: motion.slice(9), error };
  }

  sample(index, { seed = 0, anotherDay = false } = {}) {
    const drawn = this.#prepareSamples(anotherDay);
    const [of, at] = [BigInt(number(seed, 'seed')), number(index, 'index')];
    this.#check(this.#c.supine_doubt_sample(drawn.field, 0, of, at, this.#positions, this.#error));
    this.#check(this.#c.supine_doubt_mend_sample(drawn.mend, this.#positions, this.#error));
    return this.positions;
  }

  /** Prepare samples of the pose, unless the last ones were of it. */
  #prepareSamples(anotherDay) {
    const bytes = this.#doubt && this.#view(Uint8Array, this.#state, STATE).join();
    const key = `${bytes} ${anotherDay}`;
    if (this.#drawn?.key !== key) {
      const field = this.#prepareDoubt(undefined, anotherDay);
      this.#check(this.#c.supine_doubt_mend_prepare(field, 0, this.#doubt.mend, this.#text, this.#error));
      this.#drawn = { key, field, mend: this.#word(this.#text) };
    }
    return this.#drawn;
  }

  /** Return the expected error, or NaN for each vertex of another simulator's fields, whose error is unknown. */
  #expectedOrUnknown(from) {
    try {
      return this.#expectedErrorFrom(from);
    } catch (error) {
      if (error.status !== 'unsupported') throw error;
      return new Float32Array(this.vertexCount).fill(NaN);
    }
  }

  targets(since) {
    const after = this.deform().slice();
    const sigma = this.#expectedOrUnknown(0).slice();
    const moved = this.#expectedOrUnknown(this.#poseSince(since));
    this.#evaluate(this.#c.supine_deform(this.#basis, this.#nextPose, this.#positions));
    const made = this.#emptyTargets();
    (this.tensor('part')?.data ?? []).forEach((index, v) => {
      const target = made[index];
      if (target.count++ === 0) target.lung = Object.keys(this.lungs).find((name) => v < this.lungs[name][1]);
      for (let k = 0; k < 3; ++k) {
        target.at[k] += after[3 * v + k];
        target.move[k] += after[3 * v + k] - this.positions[3 * v + k];
      }
      target.expectedError += sigma[v] ** 2;
      target.movedError += moved[v] ** 2;
    });
    this.deform();
    return made.filter(({ count }) => count > 0).map(meanOf)
      .map((target) => ({ ...target, anotherDayError: this.anotherDay(target.expectedError) }));
  }

  /** Return a target for each name of the file, with sums that are still 0. */
  #emptyTargets() {
    const names = new TextDecoder().decode(this.tensor('names')?.data ?? new Uint8Array()).split('\n');
    const anatomy = this.tensor('anatomy')?.data ?? [];
    const sums = () => ({ at: [0, 0, 0], move: [0, 0, 0], mm: 0, expectedError: 0, movedError: 0, count: 0 });
    return names.map((name, i) => ({ name, anatomy: anatomy[i] === 1, lung: '', ...sums() }));
  }

  /** Write a state to #nextState. The default posture is supine; the default volume is the default of the basis. */
  #read(state) {
    const isText = typeof state === 'string';
    const { gravity = [0, 1, 0], volume = '' } = isText ? {} : members(state);
    this.#view(Uint8Array, this.#nextState, STATE).fill(0);
    const isList = typeof gravity === 'object' && gravity !== null;
    const three = isList ? Array.from(gravity, (x) => number(x, 'gravity')) : [];
    if (three.length !== 3) throw refusal('gravity must be three numbers');
    this.#view(Float64Array, this.#nextState, 3).set(three);
    const { supine_state_parse: parse, supine_state_parse_volume: parseVolume } = this.#c;
    if (isText) this.#check(parse(this.#write(state), this.#nextState, this.#error));
    else if (volume !== '') this.#check(parseVolume(this.#write(volume), this.#nextState, this.#error));
  }

  #write(text) {
    const bytes = new TextEncoder().encode(`${text}\0`);
    if (bytes.length > MESSAGE) throw refusal(`the text has ${bytes.length - 1} bytes: give at most ${MESSAGE - 1}`);
    this.#view(Uint8Array, this.#text, bytes.length).set(bytes);
    return this.#text;
  }

  #string(at) {
    const bytes = new Uint8Array(this.#c.memory.buffer, at);
    return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
  }

  #check(status, message) {
    if (status === 0) return;
    if (!message) {
      new Uint8Array(this.#c.memory.buffer).copyWithin(this.#text, this.#error + 4, this.#error + 4 + MESSAGE);
      this.#c.supine_remedies_add(this.#error + 4 + MESSAGE, JAVASCRIPT, this.#text, TEXT);
    }
    throw new SupineError(message || this.#string(this.#text), status);
  }

  #evaluate(status) {
    this.#check(status, NOT_FINITE);
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

let beside; // promise of the module compiled from supine.wasm beside this file; undefined if it failed

/** Return the bytes of a file: read it in node, or fetch it. */
async function read(path) {
  const url = path instanceof URL ? path : undefined;
  const isRemote = (url?.protocol ?? path).toString().startsWith('http');
  const files = !isRemote && globalThis.process?.getBuiltinModule?.('node:fs');
  try {
    return files ? files.readFileSync(path) : await bytesOf(await fetch(path));
  } catch (error) {
    if (error instanceof SupineError) throw error;
    throw new SupineError(`${path}: cannot be read: ${error.message}`, STATUS.indexOf('read'));
  }
}

/** Return the bytes of what open() takes. */
async function bytesOf(source) {
  const given = await source;
  if (typeof given === 'string' || given instanceof URL) return bytesOf(await read(given));
  if (given?.ok === false) {
    throw new SupineError(`${given.url}: the server says ${given.status}`, STATUS.indexOf('read'));
  }
  if (ArrayBuffer.isView(given)) return new Uint8Array(given.buffer, given.byteOffset, given.byteLength);
  if (/ArrayBuffer\]$/.test(Object.prototype.toString.call(given))) return new Uint8Array(given);
  if (typeof given?.arrayBuffer === 'function') return new Uint8Array(await given.arrayBuffer());
  throw refusal('open takes a path, the bytes of a basis file, a Blob, a Response, or a promise of one of them');
}

async function load() {
  return WebAssembly.compile(await bytesOf(new URL('./supine.wasm', import.meta.url)));
}

/** Return the compiled library: what is given as `wasm`, or supine.wasm beside this file. */
async function moduleOf(wasm) {
  if (wasm instanceof WebAssembly.Module) return wasm;
  if (wasm !== undefined) return WebAssembly.compile(wasm);
  beside ??= load();
  try {
    return await beside;
  } catch (error) {
    beside = undefined; // the next call tries again
    throw error;
  }
}

export async function open(source, { wasm, allowFolds = false, exact = false, seal = false, doubt = false } = {}) {
  const [bytes, module] = [await bytesOf(source), await moduleOf(wasm)];
  // The C library imports functions that write to files, for printf. Refuse every call.
  const none = () => 52; // the error ENOSYS of WASI
  const imports = { wasi_snapshot_preview1: { fd_close: none, fd_seek: none, fd_write: none } };
  return new Basis(await WebAssembly.instantiate(module, imports), bytes, { allowFolds, exact, seal, doubt });
}
