// SPDX-License-Identifier: MIT
// Draw with WebGL 2. For each state of the lungs (gravity and volume), one pass over the vertices stores positions on
// the graphics card by transform feedback, and a second pass the normals of the triangles around each vertex. A change
// of the camera needs no such pass.

const source = (id) => document.getElementById(id).textContent;

const NO_CUT = [0, 0, 0, 1e10];
const ARROWS_SHOWN = 500;
const CONTENT_COLOURS = 2 + ANATOMY_COLOURS.length; // of targets, of the chosen one, and of anatomy
const FRAME_TEXELS = 6; // of the frame of a cluster (supine_gl_frames)
const WIDTH = 2048; // width of the textures that hold lists, texels

class Picture {
  constructor(canvas, basis) {
    const gl = canvas.getContext('webgl2', { antialias: true, alpha: true, premultipliedAlpha: true, powerPreference: 'high-performance' });
    if (!gl) throw new Error('This browser has no WebGL 2. Open the page in another browser.');
    this.gl = gl;
    this.canvas = canvas;
    this.basis = basis;
    this.turning = this.program('normal.vert.glsl', null, ['turned']);
    this.surface = this.program('surface.vert.glsl', 'surface.frag.glsl');
    this.picker = this.program('surface.vert.glsl', 'pick.frag.glsl');
    this.solid = this.program('solid.vert.glsl', 'solid.frag.glsl');
    this.feedback = gl.createTransformFeedback();
    this.makeInputs();
    if (basis.inside) this.makeInside();
    this.makeOutputs();
    this.makePick();
    this.maps = Object.fromEntries(Object.keys(basis.colours).map((name) => [name, this.makeMap(name)]));
    this.arrow = this.makeArrow();
    this.table = this.makeTable();
    this.torso = this.makeTorso();
    this.arms = { down: undefined };
    this.timer = gl.getExtension('EXT_disjoint_timer_query_webgl2');
    this.timing = null;
    this.gpuTime = NaN;
  }

  /** Return what capture() needs to deform vertices: the shader program, a texture of their coefficients, [axes, vertices,
   * modes], as `counts` of steps of `unit`, mm, in rows padded to an even number, and `array`, the vertex array. */
  deformed(counts, vertices, axes, unit, array) {
    const { gl, basis: { modes, lungs, order } } = this;
    const vectors = Math.ceil(modes / 4);
    const rows = axes * vertices;
    const height = Math.ceil((rows * vectors) / WIDTH) || 1;
    const stride = counts.length / rows;
    const texels = new Int16Array(4 * WIDTH * height);
    for (let i = 0; i < rows; ++i) texels.set(counts.subarray(stride * i, stride * i + modes), 4 * vectors * i);
    const text = [`#define SUPINE_LUNGS ${lungs}`, `#define SUPINE_BY_LUNG ${order > 0 ? 1 : 0}`, `#define SUPINE_VECTORS ${vectors}`, `#define AXES ${axes}`, source('supine.glsl'), source('vertex.vert.glsl')];
    return { ...this.program('vertex.vert.glsl', null, ['moved'], text.join('\n')), array, count: vertices, vertices, every: 1, unit,
      coefficients: this.texture(gl.RGBA16I, gl.RGBA_INTEGER, gl.SHORT, WIDTH, height, texels) };
  }

  /** Return what capture() needs to deform the vertices of clusters: the shader program, the texture of the clusters'
   * frames, a row of six texels for each, and `array`, the vertex array. */
  clustered(array) {
    const { gl, basis } = this;
    const text = `${source('supine.glsl')}\n${source('cluster.vert.glsl')}`;
    return { ...this.program('cluster.vert.glsl', null, ['moved'], text), array, count: basis.vertices,
      frames: this.texture(gl.RGBA32F, gl.RGBA, gl.FLOAT, FRAME_TEXELS, basis.clusters, null) };
  }

  program(vertex, fragment, outputs, text = source(vertex)) {
    const { gl } = this;
    const program = gl.createProgram();
    const attach = (type, text) => {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, `#version 300 es\nprecision highp float;\nprecision highp int;\n${text}`);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(`${vertex}: ${gl.getShaderInfoLog(shader)}`);
      gl.attachShader(program, shader);
    };
    attach(gl.VERTEX_SHADER, text);
    attach(gl.FRAGMENT_SHADER, fragment ? source(fragment) : 'void main() {}');
    if (outputs) gl.transformFeedbackVaryings(program, outputs, gl.SEPARATE_ATTRIBS);
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(`${vertex}: ${gl.getProgramInfoLog(program)}`);
    const at = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); ++i) {
      const name = gl.getActiveUniform(program, i).name.replace('[0]', '');
      at[name] = gl.getUniformLocation(program, name);
    }
    return { program, at };
  }

  buffer(data, usage = this.gl.STATIC_DRAW, target = this.gl.ARRAY_BUFFER) {
    const { gl } = this;
    const made = gl.createBuffer();
    gl.bindBuffer(target, made);
    gl.bufferData(target, data, usage);
    return made;
  }

  /** Return a vertex array. Each attribute is [buffer, size, stride, offset, divisor, type], or null if it is not used. The
   * shader reads integers as floats. */
  array(attributes) {
    const { gl } = this;
    const made = gl.createVertexArray();
    gl.bindVertexArray(made);
    attributes.forEach((attribute, i) => {
      if (!attribute) return;
      const [buffer, size, stride, offset, divisor = 0, type = gl.FLOAT] = attribute;
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, size, type, false, stride, offset);
      gl.vertexAttribDivisor(i, divisor);
    });
    gl.bindVertexArray(null);
    return made;
  }

  /** Make the inputs of the shader that deforms the surface, for all vertices and for the few vertices that have
   * arrows. */
  makeInputs() {
    const { gl, basis } = this;
    const { clusters, clustered, direction, vector, vertices } = basis;
    const reference = new Float32Array(4 * vertices);
    for (let i = 0; i < vertices; ++i) reference.set([...basis.surface.subarray(3 * i, 3 * i + 3), lungOf(basis, i)], 4 * i);
    const every = Math.max(1, Math.floor(vertices / ARROWS_SHOWN));
    this.fewCount = Math.ceil(vertices / every);
    const few = (values, size) => values.filter((_, i) => Math.floor(i / size) % every === 0);
    const own = (pick) => { // the second attribute of vertices
      if (clusters > 0) return [this.buffer(pick(clustered, 4)), 3, 8, 0, 0, gl.SHORT];
      return vector ? null : [this.buffer(pick(direction, 3)), 3, 12, 0];
    };
    const inputs = (pick) => this.array([[this.buffer(pick(reference, 4)), 4, 16, 0], own(pick)]);
    const all = inputs((values) => values);
    this.inputs = clusters > 0 ? this.clustered(all) : this.deformed(basis.counts, vertices, vector ? 3 : 1, basis.unit, all);
    this.fewInputs = { ...this.inputs, array: inputs(few), count: this.fewCount, every };
    this.makeFans();
  }

  /** Make the inputs of normal.vert.glsl: for each vertex, the other two corners of each triangle around it. */
  makeFans() {
    const { gl, basis: { corners, vertices } } = this;
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
    const { gl, basis: { inside } } = this;
    this.content = this.program('content.vert.glsl', 'surface.frag.glsl');
    this.contentPicker = this.program('content.vert.glsl', 'content_pick.frag.glsl');
    const counts = inside.counts.slice(); // in the order of drawing
    const stride = counts.length / (3 * inside.vertices);
    inside.order.forEach((from, to) => {
      for (let first = 0; first < 3 * inside.vertices; first += inside.vertices) {
        counts.set(inside.counts.subarray(stride * (first + from), stride * (first + from + 1)), stride * (first + to));
      }
    });
    this.insideInputs = this.deformed(counts, inside.vertices, 3, inside.unit, this.array([[this.buffer(inside.reference), 4, 16, 0]]));
    this.insideParts = this.buffer(inside.part);
    this.insideNormals = this.buffer(inside.normals);
    this.insideIndices = this.buffer(inside.corners, gl.STATIC_DRAW, gl.ELEMENT_ARRAY_BUFFER);
    const [rings, sides] = inside.points > 2000 ? [4, 6] : [9, 18]; // coarser balls for many points
    const at = (i, j) => {
      const [a, b] = [(Math.PI * i) / rings, (2 * Math.PI * j) / sides];
      return [Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)];
    };
    const ball = [];
    for (let i = 0; i < rings; ++i) for (let j = 0; j < sides; ++j) ball.push(...at(i, j), ...at(i + 1, j), ...at(i + 1, j + 1), ...at(i, j), ...at(i + 1, j + 1), ...at(i, j + 1));
    this.ball = { buffer: this.buffer(new Float32Array(ball)), count: ball.length / 3 };
    this.targetMap = this.texture(gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, CONTENT_COLOURS, 1, null);
  }

  texture(internal, format, type, width, height, data) {
    const { gl } = this;
    const made = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, made);
    gl.texStorage2D(gl.TEXTURE_2D, 1, internal, width, height);
    if (data) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, format, type, data);
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.NEAREST);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    return made;
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
    this.states[name] ??= { moved: this.buffer(room, gl.DYNAMIC_COPY), turned: this.buffer(room, gl.DYNAMIC_COPY), few: this.buffer(16 * this.fewCount, gl.DYNAMIC_COPY), inside: basis.inside ? this.buffer(16 * basis.inside.vertices, gl.DYNAMIC_COPY) : null };
    return this.states[name];
  }

  /** Return the vertex array that draws the stored state `name`, with displacements from the stored state `origin`. */
  shown(name, origin) {
    const { gl } = this;
    const key = `${name} ${origin}`;
    if (!this.arrays[key]) {
      const [at, from] = [this.state(name), this.state(origin)];
      this.arrays[key] = this.array([[at.moved, 3, 16, 0], [at.turned, 4, 16, 0], [from.moved, 3, 16, 0], [from.turned, 4, 16, 0]]);
    }
    return this.arrays[key];
  }

  /** Make the list of edges as pairs of vertices, lung by lung. The two triangles at an edge of a closed surface
   * contain it in opposite directions; only the pair with the larger index last is listed. */
  makeEdges() {
    const { gl, basis } = this;
    const { corners } = basis;
    const pairs = new Uint32Array(2 * corners.length);
    const begin = [];
    let count = 0;
    for (let t = 0; t < corners.length; t += 3) {
      while (begin.length < basis.lungs && t >= basis.cornerBegin[begin.length]) begin.push(count);
      for (let i = 0; i < 3; ++i) {
        const [a, b] = [corners[t + i], corners[t + ((i + 1) % 3)]];
        if (a < b) {
          pairs[count++] = a;
          pairs[count++] = b;
        }
      }
    }
    this.edges = { buffer: this.buffer(pairs.subarray(0, count), gl.STATIC_DRAW, gl.ELEMENT_ARRAY_BUFFER), begin: [...begin, count] };
  }

  /** Make the framebuffer to which pick() draws the point under the pointer: one pixel with the bits of four floats. */
  makePick() {
    const { gl } = this;
    this.picking = null;
    this.pickPlace = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.pickPlace);
    const pixel = this.texture(gl.RGBA32UI, gl.RGBA_INTEGER, gl.UNSIGNED_INT, 1, 1, null);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, pixel, 0);
    const depth = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, 1, 1);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  makeMap(name) {
    const { gl } = this;
    const made = this.texture(gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, 256, 1, this.basis.colours[name]);
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.LINEAR);
    return made;
  }

  /** Return an arrow of length 1 from the origin along -z. */
  makeArrow() {
    const places = [];
    const normals = [];
    const sides = 40;
    const ring = (i, r, z) => [r * Math.cos((2 * Math.PI * i) / sides), r * Math.sin((2 * Math.PI * i) / sides), z];
    const quad = (i, r0, z0, r1, z1) => {
      const slope = (r1 - r0) / Math.hypot(r1 - r0, z1 - z0);
      for (const [j, r, z] of [[i, r0, z0], [i, r1, z1], [i + 1, r1, z1], [i, r0, z0], [i + 1, r1, z1], [i + 1, r0, z0]]) {
        places.push(...ring(j, r, z));
        normals.push(...ring(j, 1, 0).slice(0, 2), slope);
      }
    };
    for (let i = 0; i < sides; ++i) {
      quad(i, 0, 0, 0.045, 0);
      quad(i, 0.045, 0, 0.045, -0.6);
      quad(i, 0.045, -0.6, 0.14, -0.6);
      quad(i, 0.14, -0.6, 0.001, -1);
    }
    return { places: this.buffer(new Float32Array(places)), normals: this.buffer(new Float32Array(normals)), count: places.length / 3 };
  }

  /** Return the vertex array of a box from -1 to 1 along each axis. */
  makeTable() {
    const [places, normals] = [[], []];
    for (let axis = 0; axis < 3; ++axis) {
      for (const side of [-1, 1]) {
        for (const [a, b] of [[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]]) {
          const corner = [a, b];
          places.push(...[0, 1, 2].map((i) => (i === axis ? side : corner.shift())));
          normals.push(...[0, 1, 2].map((i) => (i === axis ? side : 0)));
        }
      }
    }
    return this.array([[this.buffer(new Float32Array(places)), 3, 12, 0], [this.buffer(new Float32Array(normals)), 3, 12, 0]]);
  }

  /** Return the vertex array, indices and their count of the patient's body, a tube of the half widths in TORSO. */
  makeTorso() {
    const { gl, basis: { torso: { centre, half } } } = this;
    const sides = 48;
    const rings = torsoRings();
    const [places, normals, indices] = [[], [], []];
    rings.forEach(([z, rx, ry], i) => {
      const [below, above] = [rings[Math.max(0, i - 1)], rings[Math.min(rings.length - 1, i + 1)]];
      const slope = [1, 2].map((k) => ((above[k] - below[k]) * half[k - 1]) / ((above[0] - below[0]) * half[2] || 1));
      for (let j = 0; j < sides; ++j) {
        const [cos, sin] = [Math.cos((2 * Math.PI * j) / sides), Math.sin((2 * Math.PI * j) / sides)];
        places.push(centre[0] + rx * half[0] * cos, centre[1] + ry * half[1] * sin, centre[2] + z * half[2]);
        const n = [cos / (rx * half[0]), sin / (ry * half[1])];
        const size = Math.hypot(...n);
        normals.push(n[0] / size, n[1] / size, -(slope[0] * cos * cos + slope[1] * sin * sin));
        const [a, b] = [i * sides + j, i * sides + ((j + 1) % sides)];
        if (i + 1 < rings.length) indices.push(a, b, b + sides, a, b + sides, a + sides);
      }
    });
    return { array: this.array([[this.buffer(new Float32Array(places)), 3, 12, 0], [this.buffer(new Float32Array(normals)), 3, 12, 0]]),
      indices: this.buffer(new Uint32Array(indices), gl.STATIC_DRAW, gl.ELEMENT_ARRAY_BUFFER), count: indices.length };
  }

  /** Make the vertex array of the patient's arms, if it was made for another way down. */
  makeArms(down) {
    const { gl, arms, basis: { torso } } = this;
    if (arms.down === String(down)) return;
    for (const old of arms.buffers ?? []) gl.deleteBuffer(old);
    if (arms.array) gl.deleteVertexArray(arms.array);
    const tubes = armsOf(torso, down).map((line) => tubeOf(line.map(([x, y, z, radius]) => [x + torso.centre[0], y + torso.centre[1], z + torso.centre[2], radius]), 16));
    const first = tubes[0].places.length / 3;
    const [places, normals] = ['places', 'normals'].map((key) => this.buffer(new Float32Array(tubes.flatMap((tube) => tube[key]))));
    const corners = tubes.flatMap((tube, i) => tube.corners.map((corner) => corner + i * first));
    const indices = this.buffer(new Uint32Array(corners), gl.STATIC_DRAW, gl.ELEMENT_ARRAY_BUFFER);
    Object.assign(arms, { down: String(down), buffers: [places, normals, indices], array: this.array([[places, 3, 12, 0], [normals, 3, 12, 0]]), indices, count: corners.length });
  }

  /** Run the shader program of `inputs` on their vertices, and store its output in the buffer `target`. `moment` is the
   * state of the lungs if the inputs are those of deformed() or clustered(), otherwise null. */
  capture(moment, inputs, target) {
    const { gl } = this;
    const { program, array, count, frames } = inputs;
    gl.useProgram(program);
    if (frames) this.useFrames(moment, inputs);
    else if (moment) this.useModes(moment, inputs);
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
  useModes({ weights, gains }, { at, coefficients, vertices, every, unit }) {
    const { gl } = this;
    gl.uniform4fv(at.supine_weights, weights);
    gl.uniform3fv(at.supine_gains, gains);
    gl.uniform1i(at.vertices, vertices);
    gl.uniform1i(at.every, every);
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

  /** Deform the surface and the structures inside the lungs to the state `moment`, and store both under the name
   * `name`. */
  deform(name, moment) {
    const { moved, turned, few, inside } = this.state(name);
    this.captureSurface(moment, moved, turned);
    this.capture(moment, this.fewInputs, few);
    if (inside) this.captureInside(moment, inside);
  }

  /** Compute the positions of the surface's vertices, then their normals, which a shader sums over the triangles. */
  captureSurface(moment, moved, turned) {
    const { gl, basis: { vertices } } = this;
    this.capture(moment, this.inputs, moved);
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
  captureInside(moment, target) {
    const { gl, basis: { inside } } = this;
    this.capture(moment.within, this.insideInputs, target);
    gl.bindBuffer(gl.ARRAY_BUFFER, target);
    for (const part of inside.rigid) gl.bufferSubData(gl.ARRAY_BUFFER, 16 * inside.members[part][0], new Float32Array(insidePlaces(inside, moment, part).flatMap((p) => [...p, 1])));
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
  }

  /** Deform the surface to the state `moment`, and read back the positions, mm LPS, and unit normals of its vertices.
   * */
  read(moment) {
    const { gl, basis } = this;
    const targets = [0, 1].map(() => this.buffer(16 * WIDTH * Math.ceil(basis.vertices / WIDTH), gl.DYNAMIC_READ));
    this.captureSurface(moment, ...targets);
    return targets.map((target) => this.take(target, basis.vertices));
  }

  /** Deform the structures inside the lungs to the state `moment`, and read back the positions of their vertices, mm
   * LPS. */
  readInside(moment) {
    const { gl, basis: { inside } } = this;
    const target = this.buffer(16 * inside.vertices, gl.DYNAMIC_READ);
    this.captureInside(moment, target);
    return this.take(target, inside.vertices);
  }

  /** Return the first three of every four floats of a buffer on the graphics card, and delete the buffer. */
  take(target, count) {
    const { gl } = this;
    const four = new Float32Array(4 * count);
    gl.bindBuffer(gl.ARRAY_BUFFER, target);
    gl.getBufferSubData(gl.ARRAY_BUFFER, 0, four);
    gl.deleteBuffer(target);
    return new Float32Array(3 * count).map((_, i) => four[4 * Math.floor(i / 3) + (i % 3)]);
  }

  /** Use a shader program for a pane of the picture, and set its uniforms. `lens` is the part of the pane to draw: x
   * and y of its centre, -1 to 1, and magnifications in x and y. */
  usePane(program, pane, lens) {
    const { gl } = this;
    gl.useProgram(program.program);
    gl.uniformMatrix4fv(program.at.toEye, false, pane.toEye);
    gl.uniformMatrix4fv(program.at.projection, false, pane.projection);
    gl.uniform4fv(program.at.cut, pane.cut);
    if (lens) gl.uniform4fv(program.at.lens, lens);
    if (lens) gl.uniform1i(program.at.kind, pane.measure);
  }

  drawLung(lung, mode) {
    const { gl, basis } = this;
    const begin = mode === gl.LINES ? this.edges.begin : basis.cornerBegin;
    gl.drawElements(mode, begin[lung + 1] - begin[lung], gl.UNSIGNED_INT, 4 * begin[lung]);
  }

  /** Draw the surface: opaque lungs first, then the nearest layer of translucent ones. */
  drawLungs(pane) {
    const { gl, basis, surface } = this;
    const depth = (lung) => [2, 6, 10].reduce((sum, i, k) => sum + pane.toEye[i] * basis.lungBoxes[lung].centre[k], 0); // rises towards the viewer
    const lungs = pane.opacity.map((opacity, lung) => ({ opacity, lung })).filter((l) => l.opacity > 0).sort((a, b) => b.opacity - a.opacity || depth(a.lung) - depth(b.lung));
    const set = (name, value) => gl.uniform1f(surface.at[name], value);
    this.usePane(surface, pane, [0, 0, 1, 1]);
    gl.uniform2f(surface.at.range, pane.range.begin, pane.range.end);
    set('spacing', pane.contours ? pane.range.step : 0);
    set('dark', pane.dark ? 1 : 0);
    set('flatly', 0);
    gl.uniform4fv(surface.at.rise, pane.rise);
    /** Draw the lungs in the state from which displacements are measured: a translucent shell (1) or its outline (2).
     * */
    const ghost = (how) => {
      if (!pane.ghost) return;
      gl.bindVertexArray(this.shown('from', 'from'));
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.indices);
      set('ghost', how);
      set('flatly', 0);
      gl.depthMask(false);
      gl.enable(gl.CULL_FACE);
      for (const { lung } of lungs) this.drawLung(lung, gl.TRIANGLES);
      gl.disable(gl.CULL_FACE);
      gl.depthMask(true);
    };
    ghost(1);
    set('ghost', 0);
    gl.bindVertexArray(this.shown(pane.state, pane.origin));
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.indices);
    for (const { opacity, lung } of lungs) {
      const through = opacity < 1 || pane.wires;
      if (opacity < 1 && pane.plain) { // a shell through which its own folds and the content are seen
        set('ghost', 4);
        gl.depthMask(false);
        gl.enable(gl.CULL_FACE);
        for (const side of [gl.FRONT, gl.BACK]) { // the far side first
          gl.cullFace(side);
          this.drawLung(lung, gl.TRIANGLES);
        }
        gl.disable(gl.CULL_FACE);
        gl.depthMask(true);
        continue;
      }
      set('opacity', opacity);
      gl.colorMask(!through, !through, !through, !through);
      gl.enable(gl.POLYGON_OFFSET_FILL);
      gl.polygonOffset(through ? 1 : 0, through ? 1 : 0);
      this.drawLung(lung, gl.TRIANGLES);
      gl.disable(gl.POLYGON_OFFSET_FILL);
      gl.colorMask(true, true, true, true);
      if (opacity < 1 && !pane.wires) this.drawLung(lung, gl.TRIANGLES);
    }
    if (pane.wires) {
      if (!this.edges) this.makeEdges();
      gl.bindVertexArray(this.shown(pane.state, pane.origin));
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.edges.buffer);
      set('flatly', 1);
      for (const { lung } of lungs) this.drawLung(lung, gl.LINES);
    }
    ghost(2);
  }

  /** Draw structures inside the lungs with a shader program that usePane has set up: meshes, and points as balls of radius
   * `radius`, mm. `which` is null for all targets, or one of inside.shells, or 'dots' for the points of anatomy. */
  drawInside(program, pane, radius, which) {
    const { gl, basis: { inside } } = this;
    const now = this.state(pane.state).inside;
    const array = (kind, shape, each, first) => {
      const key = `${kind} ${pane.state}`;
      this.arrays[key] ??= this.array([...shape, [now, 3, 16, 16 * first, each], [this.insideParts, 1, 4, 4 * first, each]]);
      gl.bindVertexArray(this.arrays[key]);
    };
    const ball = [[this.ball.buffer, 3, 12, 0], [this.ball.buffer, 3, 12, 0]];
    gl.uniform1f(program.at.radius, radius);
    if (which === 'dots') {
      if (inside.points === inside.balls) return;
      array('dots', ball, 1, inside.balls);
      gl.drawArraysInstanced(gl.TRIANGLES, 0, this.ball.count, inside.points - inside.balls);
      return;
    }
    if (!which && inside.balls) {
      array('balls', ball, 1, 0);
      gl.drawArraysInstanced(gl.TRIANGLES, 0, this.ball.count, inside.balls);
    }
    const { begin, count } = which ?? { begin: 0, count: inside.targetCorners };
    if (count) {
      array('meshes', [null, [this.insideNormals, 3, 12, 0]], 0, 0);
      gl.vertexAttrib3f(0, 0, 0, 0);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.insideIndices);
      gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 4 * begin);
    }
  }

  /** Draw the structures inside the lungs: targets in one colour, and the chosen one in another; then anatomy, each
   * structure as a translucent shell of its own colour. */
  drawContent(pane) {
    const { gl, content, basis: { inside } } = this;
    this.usePane(content, pane, [0, 0, 1, 1]);
    gl.bindTexture(gl.TEXTURE_2D, this.targetMap);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, CONTENT_COLOURS, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(pane.targetTints.flatMap((tint) => [...tint.map((x) => 255 * x), 255])));
    gl.uniform4fv(content.at.cut, NO_CUT); // only the lungs are cut
    gl.uniform1f(content.at.chosen, pane.chosen);
    gl.uniform2f(content.at.range, 0, CONTENT_COLOURS - 1);
    gl.uniform1f(content.at.tint, -1);
    gl.uniform1f(content.at.spacing, 0);
    gl.uniform1f(content.at.dark, pane.dark ? 1 : 0);
    gl.uniform1f(content.at.opacity, 1);
    gl.uniform1f(content.at.ghost, 5);
    this.drawInside(content, pane, Math.max(BALL_RADIUS, 4 * pane.pixel), null); // radius of at least 4 pixels
    gl.uniform1f(content.at.tint, 0);
    this.drawInside(content, pane, DOT_RADIUS, 'dots');
    gl.uniform1f(content.at.ghost, 6);
    gl.depthMask(false);
    for (const shell of inside.shells) {
      gl.uniform1f(content.at.tint, shell.part === pane.chosen ? 1 : 2 + shell.colour);
      this.drawInside(content, pane, 0, shell);
    }
    gl.depthMask(true);
  }

  /** Draw arrows that show displacements at some vertices. */
  drawArrows(pane) {
    const { gl, solid } = this;
    const key = `arrows ${pane.state} ${pane.origin}`;
    this.arrays[key] ??= this.array([[this.arrow.places, 3, 12, 0], [this.arrow.normals, 3, 12, 0],
      [this.state(pane.origin).few, 3, 16, 0, 1], [this.state(pane.state).few, 3, 16, 0, 1]]);
    this.usePane(solid, pane);
    gl.uniform1f(solid.at.thick, pane.radius * 0.09);
    gl.bindVertexArray(this.arrays[key]);
    for (const [order, alpha] of [[gl.GREATER, 0.35], [gl.LEQUAL, 1]]) { // draw arrows faint where the surface hides them
      gl.depthFunc(order);
      gl.depthMask(order === gl.LEQUAL);
      gl.uniform4fv(solid.at.tint, [...pane.ink.slice(0, 3), alpha]);
      gl.drawArraysInstanced(gl.TRIANGLES, 0, this.arrow.count, this.fewCount);
    }
  }

  /** Draw the patient's torso and arms around the lungs, faint, and fading out towards the feet. */
  drawTorso(pane) {
    const { gl, surface } = this;
    this.usePane(surface, pane, [0, 0, 1, 1]);
    gl.uniform4fv(surface.at.cut, NO_CUT);
    gl.uniform2f(surface.at.range, ...pane.fade);
    gl.uniform1f(surface.at.ghost, 3);
    gl.uniform1f(surface.at.dark, pane.dark ? 1 : 0);
    this.makeArms(downOf(pane.gravity));
    gl.depthMask(false);
    for (const { array, indices, count } of [this.torso, this.arms]) {
      gl.bindVertexArray(array);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, indices);
      gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 0);
    }
    gl.depthMask(true);
  }

  drawTable(pane) {
    const { gl, solid } = this;
    this.usePane(solid, pane);
    gl.uniformMatrix4fv(solid.at.toEye, false, pane.tableToEye);
    gl.uniform4fv(solid.at.cut, NO_CUT);
    gl.uniform1f(solid.at.thick, 0);
    gl.uniform4fv(solid.at.tint, pane.tableTint);
    gl.bindVertexArray(this.table);
    gl.depthMask(false); // seen from below, the lungs shine through it
    gl.drawArrays(gl.TRIANGLES, 0, 36);
    gl.depthMask(true);
  }

  /** Draw a text, wrapped, on a panel before a headset's viewer; `at` is its place in the room, m. */
  drawNote(pane, { text, toEye, at }) {
    const { gl } = this;
    this.note ??= { program: this.program('note.vert.glsl', 'note.frag.glsl'), array: this.array([[this.buffer(new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1])), 2, 8, 0]]), map: this.texture(gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, 1024, 256, null), text: null };
    const { note } = this;
    gl.bindTexture(gl.TEXTURE_2D, note.map);
    if (note.text !== text) {
      const paper = Object.assign(document.createElement('canvas'), { width: 1024, height: 256 });
      const context = paper.getContext('2d');
      Object.assign(context, { fillStyle: '#121d2bcc', font: '600 36px system-ui, sans-serif' });
      context.fillRect(0, 0, 1024, 256);
      context.fillStyle = '#fff';
      let [line, y] = ['', 52];
      for (const word of [...text.split(' '), null]) {
        if (word !== null && context.measureText(`${line} ${word}`).width < 960) line += ` ${word}`;
        else {
          context.fillText(line.trim(), 32, y);
          [line, y] = [word ?? '', y + 46];
        }
      }
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, gl.RGBA, gl.UNSIGNED_BYTE, paper);
      for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.LINEAR);
      note.text = text;
    }
    gl.useProgram(note.program.program);
    gl.uniformMatrix4fv(note.program.at.toEye, false, toEye);
    gl.uniformMatrix4fv(note.program.at.projection, false, pane.projection);
    gl.uniform3fv(note.program.at.place, at);
    gl.uniform2f(note.program.at.size, 0.32, 0.08);
    gl.bindVertexArray(note.array);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }

  /** Draw panes (views of the lungs) to `framebuffer`, or to the canvas if `framebuffer` is null. */
  draw(panes, framebuffer = null) {
    const { gl } = this;
    this.beginTiming();
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    for (const pane of panes) {
      gl.viewport(...pane.box);
      gl.depthFunc(gl.LEQUAL);
      if (pane.fade) this.drawTorso(pane);
      if (pane.tableToEye) this.drawTable(pane);
      if (pane.inside) this.drawContent(pane); // before the lungs, which may be translucent
      gl.bindTexture(gl.TEXTURE_2D, this.maps[pane.map]);
      this.drawLungs(pane);
      if (pane.arrows) this.drawArrows(pane);
      if (pane.note?.text) this.drawNote(pane, pane.note);
    }
    gl.depthFunc(gl.LEQUAL);
    gl.disable(gl.BLEND);
    gl.bindVertexArray(null);
    this.endTiming();
  }

  /** Request the point that is seen at the position (x, y) in a pane, both from -1 to 1. The method picked() returns it
   * a frame or two later, so that no frame waits for it. */
  pick(pane, x, y) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.pickPlace);
    gl.viewport(0, 0, 1, 1);
    gl.clearBufferuiv(gl.COLOR, 0, [0x7fc00000, 0, 0, 0]); // "nothing here": a NaN whose lowest bits are 0 instead of the index of a structure plus 1
    gl.clearBufferfv(gl.DEPTH, 0, [1]);
    gl.enable(gl.DEPTH_TEST);
    this.usePane(this.picker, pane, [x, y, pane.box[2], pane.box[3]]);
    gl.bindVertexArray(this.shown(pane.state, pane.origin));
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.indices);
    pane.opacity.forEach((opacity, lung) => {
      gl.uniform1ui(this.picker.at.lung, lung);
      if (opacity > 0) this.drawLung(lung, gl.TRIANGLES);
    });
    if (pane.inside) {
      this.pickInside(pane, x, y, [...this.basis.inside.shells, 'dots'], DOT_RADIUS);
      this.pickInside(pane, x, y, [null], Math.max(BALL_RADIUS, 8 * pane.pixel)); // anatomy hides no target inside it
    }
    gl.bindVertexArray(null);
    this.pickBits = this.buffer(16, gl.STREAM_READ, gl.PIXEL_PACK_BUFFER); // a new buffer, because reading into the old one would wait
    gl.readPixels(0, 0, 1, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, 0);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    this.picking = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }

  /** Draw structures inside the lungs to the image of pick(), where opaque lungs do not hide them. `which` lists what
   * drawInside takes. */
  pickInside(pane, x, y, which, radius) {
    const { gl } = this;
    const lens = [x, y, pane.box[2], pane.box[3]];
    gl.clearBufferfv(gl.DEPTH, 0, [1]); // so that translucent lungs, and structures drawn before, hide nothing
    this.usePane(this.picker, pane, lens);
    gl.bindVertexArray(this.shown(pane.state, pane.origin));
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.indices);
    gl.colorMask(false, false, false, false);
    pane.opacity.forEach((opacity, lung) => { if (opacity === 1) this.drawLung(lung, gl.TRIANGLES); });
    gl.colorMask(true, true, true, true);
    this.usePane(this.contentPicker, pane, lens);
    for (const each of which) this.drawInside(this.contentPicker, pane, radius, each);
  }

  /** Return the point that pick() requested: null if nothing is seen there, undefined if the graphics card has not
   * finished. `at` is its position, mm LPS. A point on the surface is {value, at, lung}, where `value` is the number
   * that its colour shows. A point on a structure inside the lungs is {part, at}, where `part` is the structure's
   * index. */
  picked() {
    const { gl } = this;
    if (!this.picking || gl.getSyncParameter(this.picking, gl.SYNC_STATUS) !== gl.SIGNALED) return undefined;
    const bits = new Uint32Array(4);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.pickBits);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, bits);
    gl.deleteBuffer(this.pickBits);
    gl.deleteSync(this.picking);
    this.picking = null;
    const [value, ...at] = new Float32Array(bits.buffer);
    if (!Number.isNaN(value)) return { value, at, lung: bits[0] & 15 };
    const part = (bits[0] & 0x3fffff) - 1;
    return part < 0 ? null : { part, at };
  }

  beginTiming() {
    const { gl, timer } = this;
    if (!timer) return;
    if (this.timing && gl.getQueryParameter(this.timing, gl.QUERY_RESULT_AVAILABLE)) {
      if (!gl.getParameter(timer.GPU_DISJOINT_EXT)) this.gpuTime = gl.getQueryParameter(this.timing, gl.QUERY_RESULT) / 1e6;
      gl.deleteQuery(this.timing);
      this.timing = null;
    }
    if (this.timing) return;
    this.timing = gl.createQuery();
    this.timingNow = true;
    gl.beginQuery(timer.TIME_ELAPSED_EXT, this.timing);
  }

  endTiming() {
    if (!this.timingNow) return;
    this.gl.endQuery(this.timer.TIME_ELAPSED_EXT);
    this.timingNow = false;
  }
}
