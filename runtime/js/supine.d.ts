// SPDX-License-Identifier: MIT
/** A posture and a volume, as text ("prone", "left:rest+500", "full-300", "2600mL") or as an object. `gravity` is the
 * direction in which things fall, in the patient's axes; the default is supine, [0, 1, 0]. `volume` is a text without a
 * posture; the default is rest if the basis has a volume at rest. `gain` replaces the volume: it multiplies all
 * displacements from the reference surface. Other members, arrays and numbers are refused. */
export type State = string | { gravity?: ArrayLike<number>; volume?: string; gain?: number };

/** The numbers of a tensor of the file: a view, row-major. */
export interface Tensor {
  shape: number[];
  data: Uint8Array | Uint32Array | Float32Array | Float64Array | Int16Array | Int8Array | Uint16Array;
}

/** A named structure: the mean position `at` of its vertices, its displacement `move`, the length `mm` of this
 * displacement, and expected errors (3-D RMS): of the position in the session of the scan (`expectedError`) and on another
 * day (`anotherDayError`), and of the displacement (`movedError`). Lengths are in mm. `anatomy` is true for a large part,
 * such as airways, vessels or a lobe, of which these are means, and false for a target. */
export interface Target {
  name: string;
  lung: string;
  at: number[];
  move: number[];
  mm: number;
  expectedError: number;
  anotherDayError: number;
  movedError: number;
  anatomy: boolean;
}

/** What a basis assumes or was given. `value` has the unit `unit`; `low` and `high` are one standard deviation to either
 * side; numbers that there are not are NaN. `text` holds words, such as the state in the scan. `origin` continues `source`:
 * "assumed" "from healthy people". `line` is value and source as one text. Views must name facts with a `caveat`. */
export interface Fact {
  name: string;
  text: string;
  value: number;
  low: number;
  high: number;
  unit: string;
  source: 'given' | 'measured' | 'fitted' | 'simulated' | 'assumed' | 'computed' | 'collapsed';
  origin: string;
  line: string;
  caveat: boolean;
}

/** What a check tells of an input: a warning, or a note for information. */
export interface Finding {
  warning: boolean;
  text: string;
}

/** An open basis and its posed surface. Arrays are views of WebAssembly memory that never moves: write only to
 * `positions` and `normals`. Lengths are in mm, volumes in mL, axes are LPS: +x left, +y posterior, +z head. */
export interface Basis {
  readonly vertexCount: number;
  /** Reference positions [3 N], mm. */
  readonly vertices: Float32Array;
  /** Indices of vertices [3 M]. */
  readonly triangles: Uint32Array;
  /** The vertices of each lung: index of the first, and index after the last. */
  readonly lungs: Record<string, [number, number]>;
  readonly metadata: Record<string, string>;
  /** What the basis assumes and was given, in the order of supine_basis_facts. */
  readonly facts: Fact[];
  /** All facts with a caveat as one line, which views of the lungs must show. */
  readonly caveats: string;
  /** What the checks tell of the pose, and of the last state `since` that a function took in it: with `allowFolds`, why
   * lungs cannot hold it; otherwise it is refused. A state `since` has no gain. */
  readonly findings: Finding[];
  /** Positions [3 N], mm, of the last `deform` or `deformLit`; at first the reference positions. */
  readonly positions: Float32Array;
  /** Unit normals [3 N] of the last `deformLit`. */
  readonly normals: Float32Array;
  /** Volume of each lung in the pose, gas and tissue, mL. Throws if the surface is open. */
  readonly volumes: Record<string, number>;
  /** Bound on the position error of any vertex that storage and rounding cause in the pose, mm. */
  readonly error: number;
  /** Get a tensor of the file by its name, such as "coefficients"; undefined if the file lacks it. */
  tensor(name: string): Tensor | undefined;
  /** Set the pose to a state, in a few microseconds. If the state is refused, the pose does not change.
   * @throws SupineError */
  pose(state: State): this;
  /** Set the pose to that of the scan. For fields of another simulator it is the given surface.
   * @throws SupineError */
  poseScan(): this;
  /** Compute gravity, for a state, for a body that an engine or a headset has rotated.
   * @param rotation  from the axes of the body's object to those of the world: a unit quaternion W, X, Y, Z, or a matrix
   * of 9 numbers, row by row
   * @param up  direction in the world that points up, such as [0, 1, 0]
   * @param axes  axes of the object: lps (default), unity, unreal, three or headset; supine_posture_rotation in C says
   * where each has the patient's left, back and head
   * @throws SupineError */
  gravityOfRotation(rotation: ArrayLike<number>, up: ArrayLike<number>, axes?: string): number[];
  /** Compute the position of one vertex in the pose, mm. */
  at(vertex: number): number[];
  /** The uniforms supine_weights and supine_gains of supine.glsl in the pose. Throws if the basis has clusters. */
  readonly uniforms: { weights: Float32Array; gains: Float32Array };
  /** The texture supine_frames of supine.glsl in the pose, [clusters, 24]; undefined if the basis has no clusters. */
  readonly frames: Float32Array | undefined;
  /** Return the lowest and the highest volume of all lungs that another simulator computed for a direction of gravity,
   * mL above that at rest, at full inflation or in the scan; undefined if the basis has no such volumes.
   * @throws SupineError */
  simulatedRange(gravity: ArrayLike<number>, kind: 'rest' | 'full' | 'scan'): number[] | undefined;
  /** Compute `positions` of the pose and return them. */
  deform(): Float32Array;
  /** Compute `positions` and `normals` of the pose and return `positions`. Normals are weighted sums of the file's
   * vectors for normals or, if it has none, are computed from the triangles. */
  deformLit(): Float32Array;
  /** Compute the expected error [N] of the vertices in the pose, mm (3-D RMS): of their positions in the session of the
   * scan, or of their displacements from the state `since`. The next call overwrites the result. It is unknown of a pose
   * with a gain, and of poseScan.
   * @throws SupineError */
  expectedError(since?: State): Float32Array;
  /** Return the expected error of a position on another day than that of the scan, mm, from that in its session. */
  anotherDay(sameSession: number): number;
  /** Compute the predicted positions [3 n], mm, of at most 64 vertices in the pose, and the covariance [3 n, 3 n] of their
   * errors, mm^2, by rows: what is asked of several points together, as of a distance, follows from it. Equations:
   * <supine/doubt.h>. Needs the option `doubt` of `open`, as the next two do. @throws SupineError */
  covariance(vertices: ArrayLike<number>, options?: DoubtOptions): { mean: Float64Array; covariance: Float64Array };
  /** Register the pose at 3 to 300 vertices, spread around the targets: find the rigid motion, rotation [3, 3] by rows and
   * translation in mm, that moves their positions closest to those in the scan, and the expected error [N] that is then
   * left, mm. The next call overwrites `error`. @throws SupineError */
  registration(fiducials: ArrayLike<number>, options?: DoubtOptions):
    { rotation: number[]; translation: number[]; error: Float32Array };
  /** Compute plausible lungs around those of the pose, in `positions`: number `index` of those that `seed` draws, the same
   * as of 'supine deform --samples'. Lungs have the volumes of the pose. The first sample of a pose takes longer.
   * @throws SupineError */
  sample(index: number, options?: { seed?: number; anotherDay?: boolean }): Float32Array;
  /** Compute where each named structure of a basis made by 'supine embed' is in the pose, and how far it has moved from
   * the state `since`, or from the scan. `positions` are then those of the pose.
   * @throws SupineError */
  targets(since?: State): Target[];
}

/** A failure that the library reports, with its message. */
export class SupineError extends Error {
  readonly status:
    'argument' | 'memory' | 'read' | 'format' | 'mesh' | 'open surface' | 'unsupported' | 'write' | 'numerical';
}

/** What `open` takes: the bytes of a basis file; a Blob or a Response with them; a path (in node) or an address. */
export type Source = ArrayBufferLike | ArrayBufferView | Blob | Response | string | URL;

export interface OpenOptions {
  /** supine.wasm, as bytes or compiled, if it is not beside this module. */
  wasm?: BufferSource | WebAssembly.Module;
  /** Compute poses with volumes that lungs cannot hold, or at which the surface folds, instead of refusing them. */
  allowFolds?: boolean;
  /** Keep coefficients as in the file, instead of the smallest storage with an error of at most 0.005 mm. */
  exact?: boolean;
  /** Replace the checksum UNSEALED of a file that was made in memory by that of its content. */
  seal?: boolean;
  /** Reserve memory for `covariance`, `registration` and `sample`: 24 bytes a vertex and lung, and 0.8 MB. */
  doubt?: boolean;
}

/** State whose positions are exact, if it is not the scan's, and whether the lungs are those of another day. */
export interface DoubtOptions {
  since?: State;
  anotherDay?: boolean;
}

/** Metadata "checksum" of a file that `open` completes with its option `seal`. */
export const UNSEALED: string;

/** Open a basis file: check all of its bytes, and copy them. After a failure, for example to fetch supine.wasm, a
 * further call tries again. @throws SupineError */
export function open(source: Source | Promise<Source>, options?: OpenOptions): Promise<Basis>;
