// SPDX-License-Identifier: MIT
/** A posture and a volume: "prone", "left:rest+500", "full-300", "2600mL". As an object: gravity, the direction in which
 * things fall in the patient's axes (supine, [0, 1, 0], where it is left out), with a volume (the basis's default) or a
 * gain, which is free of volumes: 0 is the file's surface. */
export type State = string | { gravity?: ArrayLike<number>; volume?: string; gain?: number };

/** The numbers of a tensor of the file: a view, row-major. */
export interface Tensor {
  shape: number[];
  data: Uint8Array | Uint32Array | Float32Array | Float64Array | Int16Array;
}

/** An open basis and its posed surface. Arrays are views of WebAssembly memory that never moves: write to none but
 * `positions` and `normals`. Lengths are mm, volumes mL, axes LPS: +x left, +y posterior, +z head. */
export interface Basis {
  readonly vertexCount: number;
  /** The file's surface [3 N]. */
  readonly vertices: Float32Array;
  /** Indices of vertices [3 M]. */
  readonly triangles: Uint32Array;
  /** The vertices of each lung, from the first up to the second number. */
  readonly lungs: Record<string, [number, number]>;
  readonly metadata: Record<string, string>;
  /** Positions [3 N] of the last `deform`: the file's surface before the first. */
  readonly positions: Float32Array;
  /** Unit normals [3 N] of the last `deformLit`. */
  readonly normals: Float32Array;
  /** Volume of each lung in the pose, gas and tissue. Throws where the surface is open. */
  readonly volumes: Record<string, number>;
  /** Bound, mm, on what storage and rounding cost any vertex in the pose. */
  readonly error: number;
  /** Get a tensor of the file by name, as "coefficients"; undefined where it has none. */
  tensor(name: string): Tensor | undefined;
  /** Pose the lungs: a few microseconds. A refused state leaves the pose as it was.
   * @throws SupineError */
  pose(state: State): this;
  /** Compute `positions` of the pose and return them. */
  deform(): Float32Array;
  /** Compute `positions` and `normals` of the pose: by the file's modes of normals, else from the triangles. */
  deformLit(): Float32Array;
  /** Compute the expected error [N] of each vertex in the pose, mm (3-D RMS), counted from the scan or another state.
   * The next call overwrites it.
   * @throws SupineError */
  expectedError(since?: State): Float32Array;
}

/** What the library refused, in its words. */
export class SupineError extends Error {
  readonly status: 'argument' | 'memory' | 'read' | 'format' | 'mesh' | 'open surface' | 'unsupported' | 'write' | 'numerical';
}

/** Open the bytes of a basis file, which are checked whole and copied.
 * @param options.wasm supine.wasm, bytes or compiled, where it is not beside this module
 * @throws SupineError */
export function open(source: ArrayBufferLike | ArrayBufferView, options?: { wasm?: BufferSource | WebAssembly.Module }): Promise<Basis>;
