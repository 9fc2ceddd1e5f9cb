// SPDX-License-Identifier: MIT
// Compute positions and normals on the graphics card. For each state of the lungs (gravity and volume), one pass over
// the vertices stores positions by transform feedback, and a second pass the normals of the triangles around each
// vertex. A change of the camera needs no such pass.

const ARROWS_SHOWN = 500;
const FRAME_TEXELS = 6; // of the frame of a cluster (supine_gl_frames)
const WIDTH = 2048; // width of the textures that hold lists, texels
const contentColours = () => 2 + ANATOMY_COLOURS.length; // of targets, of the chosen one, and of anatomy

class Deformer extends Device {
  /** Return what capture() needs to deform vertices: the shader program, a texture of their coefficients, [axes,
   * vertices, modes], as `counts` of steps of `unit`, mm, in rows padded to an even number, and `array`, the vertex
   * array. */
  deformed(counts, vertices, axes, unit, array) {
    const {
      gl,
      basis: { modes, lungs, order },
    } = this;
    const vectors = Math.ceil(modes / 4);
    const rows = axes * vertices;
    const height = Math.ceil((rows * vectors) / WIDTH) || 1;
    const stride = counts.length / rows;
    const texels = new Int16Array(4 * WIDTH * height);
    for (let i = 0; i < rows; ++i) texels.set(counts.subarray(stride * i, stride * i + modes), 4 * vectors * i);
    const text = [
      `#define SUPINE_LUNGS ${lungs}`,
      `#define SUPINE_BY_LUNG ${order > 0 ? 1 : 0}`,
      `#define SUPINE_VECTORS ${vectors}`,
      `#define AXES ${axes}`,
      source('supine.glsl'),
      source('doubt.glsl'),
      source('vertex.vert.glsl'),
    ];
    return {
      ...this.program('vertex.vert.glsl', null, ['moved'], text.join('\n')),
      array,
      count: vertices,
      vertices,
      every: 1,
      doubt: this.doubtOf(vertices),
      unit,
      coefficients: this.texture(gl.RGBA16I, gl.RGBA_INTEGER, gl.SHORT, WIDTH, height, texels),
    };
  }

  /** Return what capture() needs to deform the vertices of clusters: the shader program, the texture of the clusters'
   * frames, a row of six texels for each, and `array`, the vertex array. */
  clustered(array) {
    const { gl, basis } = this;
    const text = ['supine.glsl', 'doubt.glsl', 'cluster.vert.glsl'].map(source).join('\n');
    return {
      ...this.program('cluster.vert.glsl', null, ['moved'], text),
      array,
      count: basis.vertices,
      every: 1,
      doubt: this.doubtOf(basis.vertices),
      frames: this.texture(gl.RGBA32F, gl.RGBA, gl.FLOAT, FRAME_TEXELS, basis.clusters, null),
    };
  }

  /** Return the texture with a vector for each vertex, which doubt.glsl reads. */
  doubtOf(vertices) {
    const { gl } = this;
    const rows = Math.ceil(vertices / WIDTH) || 1;
    return { rows, map: this.texture(gl.RGB32F, gl.RGB, gl.FLOAT, WIDTH, rows, null) };
  }

  /** Make the inputs of the shader that deforms the surface, for all vertices and for the few vertices that have
   * arrows. */
  makeInputs() {
    const { gl, basis } = this;
    const { clusters, clustered, direction, vector, vertices } = basis;
    const reference = new Float32Array(4 * vertices);
    for (let i = 0; i < vertices; ++i)
      reference.set([...basis.surface.subarray(3 * i, 3 * i + 3), lungOf(basis, i)], 4 * i);
    const every = Math.max(1, Math.floor(vertices / ARROWS_SHOWN));
    this.fewCount = Math.ceil(vertices / every);
    const few = (values, size) => values.filter((_, i) => Math.floor(i / size) % every === 0);
    const own = (pick) => {
      // the second attribute of vertices
      if (clusters > 0) return [this.buffer(pick(clustered, 4)), 3, 8, 0, 0, gl.SHORT];
      return vector ? null : [this.buffer(pick(direction, 3)), 3, 12, 0];
    };
    const inputs = (pick) => this.array([[this.buffer(pick(reference, 4)), 4, 16, 0], own(pick)]);
    const all = inputs((values) => values);
    this.inputs =
      clusters > 0 ? this.clustered(all) : this.deformed(basis.counts, vertices, vector ? 3 : 1, basis.unit, all);
    this.fewInputs = { ...this.inputs, array: inputs(few), count: this.fewCount, every };
    this.makeFans();
  }

  /** Make the inputs of normal.vert.glsl: for each vertex, the other two corners of each triangle around it. */
  makeFans() {
    const {
      gl,
      basis: { corners, vertices },
    } = this;
    const begin = new Uint32Array(vertices + 1);
    for (const corner of corners) ++begin[corner + 1];
    for (let v = 0; v < vertices; ++v) begin[v + 1] += begin[v];
    const rows = Math.ceil(corners.length / WIDTH) || 1;
    const pairs = new Uint32Array(2 * WIDTH * rows);
    const filled = begin.slice();
    corners.forEach((corner, i) => {
      const first = i - (i % 3);
      pairs.set([corners[first + ((i + 1) % 3)], corners[first + ((i + 2) % 3)]], 2 * filled[corner]++);
    });
    this.fans = this.texture(gl.RG32UI, gl.RG_INTEGER, gl.UNSIGNED_INT, WIDTH, rows, pairs);
    this.places = this.texture(gl.RGBA32F, gl.RGBA, gl.FLOAT, WIDTH, Math.ceil(vertices / WIDTH), null);
    const ranges = new Float32Array(2 * vertices).map((_, i) => begin[Math.floor(i / 2) + (i % 2)]);
    this.fanInputs = { ...this.turning, array: this.array([[this.buffer(ranges), 2, 8, 0]]), count: vertices };
  }

  /** Make the shader programs for structures inside the lungs, and buffers for the vertices of the structures and of
   * the ball that marks a point. */
  makeInside() {
    const {
      gl,
      basis: { inside },
    } = this;
    this.content = this.program('content.vert.glsl', 'surface.frag.glsl');
    this.contentPicker = this.program('content.vert.glsl', 'content_pick.frag.glsl');
    const counts = inside.counts.slice(); // in the order of drawing
    const stride = counts.length / (3 * inside.vertices);
    inside.order.forEach((from, to) => {
      for (let first = 0; first < 3 * inside.vertices; first += inside.vertices) {
        counts.set(inside.counts.subarray(stride * (first + from), stride * (first + from + 1)), stride * (first + to));
      }
    });
    this.insideInputs = this.deformed(
      counts,
      inside.vertices,
      3,
      inside.unit,
      this.array([[this.buffer(inside.reference), 4, 16, 0]]),
    );
    this.insideParts = this.buffer(inside.part);
    this.insideNormals = this.buffer(inside.normals);
    this.insideIndices = this.buffer(inside.corners, gl.STATIC_DRAW, gl.ELEMENT_ARRAY_BUFFER);
    const [rings, sides] = inside.points > 2000 ? [4, 6] : [9, 18]; // coarser balls for many points
    const at = (i, j) => {
      const [a, b] = [(Math.PI * i) / rings, (2 * Math.PI * j) / sides];
      return [Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)];
    };
    const ball = [];
    for (let i = 0; i < rings; ++i)
      for (let j = 0; j < sides; ++j)
        ball.push(...at(i, j), ...at(i + 1, j), ...at(i + 1, j + 1), ...at(i, j), ...at(i + 1, j + 1), ...at(i, j + 1));
    this.ball = { buffer: this.buffer(new Float32Array(ball)), count: ball.length / 3 };
    this.targetMap = this.texture(gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, contentColours(), 1, null);
  }

  /** Make the buffers of the deformed surface: positions, and normals with areas, four floats each. */
  makeOutputs() {
    const { gl, basis } = this;
    this.indices = this.buffer(basis.corners, gl.STATIC_DRAW, gl.ELEMENT_ARRAY_BUFFER);
    this.edges = null;
    this.states = {};
    this.arrays = {};
  }

  state(name) {
    const { gl, basis } = this;
    const room = 16 * WIDTH * Math.ceil(basis.vertices / WIDTH); // whole rows of the texture `places`
    this.states[name] ??= {
      moved: this.buffer(room, gl.DYNAMIC_COPY),
      turned: this.buffer(room, gl.DYNAMIC_COPY),
      few: this.buffer(16 * this.fewCount, gl.DYNAMIC_COPY),
      inside: basis.inside ? this.buffer(16 * basis.inside.vertices, gl.DYNAMIC_COPY) : null,
    };
    return this.states[name];
  }

  /** Run the shader program of `inputs` on their vertices, and store its output in the buffer `target`. `moment` is the
   * state of the lungs if the inputs are those of deformed() or clustered(), otherwise null. `shift` is added to the
   * positions, mm, or null. */
  capture(moment, inputs, target, shift) {
    const { gl } = this;
    const { program, array, count, frames } = inputs;
    gl.useProgram(program);
    if (frames) this.useFrames(moment, inputs);
    else if (moment) this.useModes(moment, inputs);
    if (moment) this.useDoubt(inputs, shift);
    gl.bindBuffer(gl.ARRAY_BUFFER, null); // WebGL refuses to write a buffer that is bound elsewhere
    gl.bindVertexArray(array);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, this.feedback);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, target);
    gl.enable(gl.RASTERIZER_DISCARD);
    gl.beginTransformFeedback(gl.POINTS);
    gl.drawArrays(gl.POINTS, 0, count);
    gl.endTransformFeedback();
    gl.disable(gl.RASTERIZER_DISCARD);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, null);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
    gl.bindVertexArray(null);
  }

  /** Set the uniforms and the texture of deformed() for the state `moment`. */
  useModes({ weights, gains }, { at, coefficients, vertices, unit }) {
    const { gl } = this;
    gl.uniform4fv(at.supine_weights, weights);
    gl.uniform3fv(at.supine_gains, gains);
    gl.uniform1i(at.vertices, vertices);
    gl.uniform1f(at.unit, unit);
    gl.uniform1i(at.coefficients, 2);
    gl.activeTexture(gl.TEXTURE2);
    gl.bindTexture(gl.TEXTURE_2D, coefficients);
    gl.activeTexture(gl.TEXTURE0);
  }

  /** Fill the texture of clustered() for the state `moment`. */
  useFrames(moment, { at, frames }) {
    const { gl, basis } = this;
    gl.uniform1i(at.supine_frames, 2);
    gl.activeTexture(gl.TEXTURE2);
    gl.bindTexture(gl.TEXTURE_2D, frames);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, FRAME_TEXELS, basis.clusters, gl.RGBA, gl.FLOAT, moment.frames);
    gl.activeTexture(gl.TEXTURE0);
  }

  /** Set the uniforms and the texture of doubt.glsl: vectors [vertices, 3] that are added to the positions, or null. */
  useDoubt({ at, every, doubt: kept }, shift) {
    const { gl } = this;
    gl.uniform1i(at.every, every);
    gl.uniform1i(at.doubted, shift ? 1 : 0);
    gl.uniform1i(at.doubt, 3);
    gl.activeTexture(gl.TEXTURE3);
    gl.bindTexture(gl.TEXTURE_2D, kept.map);
    if (shift && kept.shift !== shift) {
      const texels = new Float32Array(3 * WIDTH * kept.rows);
      texels.set(shift);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, WIDTH, kept.rows, gl.RGB, gl.FLOAT, texels);
      kept.shift = shift;
    }
    gl.activeTexture(gl.TEXTURE0);
  }

  /** Deform the surface and the structures inside the lungs to the state `moment`, and store both under the name
   * `name`. `shift` has vectors that are added to the positions of both, mm, or is null. */
  deform(name, moment, shift = null) {
    const { moved, turned, few, inside } = this.state(name);
    this.captureSurface(moment, moved, turned, shift?.surface);
    this.capture(moment, this.fewInputs, few, shift?.surface);
    if (inside) this.captureInside(moment, inside, shift?.inside);
  }

  /** Compute the positions of the surface's vertices, then their normals, which a shader sums over the triangles. */
  captureSurface(moment, moved, turned, shift) {
    const {
      gl,
      basis: { vertices },
    } = this;
    this.capture(moment, this.inputs, moved, shift);
    gl.bindTexture(gl.TEXTURE_2D, this.places);
    gl.bindBuffer(gl.PIXEL_UNPACK_BUFFER, moved);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, WIDTH, Math.ceil(vertices / WIDTH), gl.RGBA, gl.FLOAT, 0);
    gl.bindBuffer(gl.PIXEL_UNPACK_BUFFER, null);
    gl.useProgram(this.turning.program);
    gl.uniform1i(this.turning.at.fans, 1);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.fans);
    gl.activeTexture(gl.TEXTURE0);
    this.capture(null, this.fanInputs, turned);
  }

  /** Deform the structures inside the lungs by the modes in the shader. In a rigid structure, the motion of a vertex
   * depends on all the others: compute the vertices of these structures here, and overwrite those of the shader. */
  captureInside(moment, target, shift) {
    const {
      gl,
      basis: { inside },
    } = this;
    this.capture(moment.within, this.insideInputs, target, shift);
    gl.bindBuffer(gl.ARRAY_BUFFER, target);
    for (const part of inside.rigid) {
      const [first] = inside.members[part];
      const at = (p, i) => [...p.map((x, k) => x + (shift?.[3 * (first + i) + k] ?? 0)), 1];
      const places = insidePlaces(inside, moment, part).flatMap(at);
      gl.bufferSubData(gl.ARRAY_BUFFER, 16 * first, new Float32Array(places));
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
  }

  /** Deform the surface to the state `moment`; read back positions, mm LPS, and unit normals of its vertices. */
  read(moment) {
    const { gl, basis } = this;
    const targets = [0, 1].map(() => this.buffer(16 * WIDTH * Math.ceil(basis.vertices / WIDTH), gl.DYNAMIC_READ));
    this.captureSurface(moment, ...targets);
    return targets.map((target) => this.take(target, basis.vertices));
  }

  /** Deform the structures inside the lungs to the state `moment`, and read back the positions of their vertices, mm
   * LPS. `shift` is added to them, if there is one. */
  readInside(moment, shift) {
    const {
      gl,
      basis: { inside },
    } = this;
    const target = this.buffer(16 * inside.vertices, gl.DYNAMIC_READ);
    this.captureInside(moment, target, shift);
    return this.take(target, inside.vertices);
  }
}
