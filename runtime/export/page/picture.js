// SPDX-License-Identifier: MIT
// Everything on the graphics card. A change of gravity or volume costs two passes over the vertices
// there, positions and normals, both kept by transform feedback; turning the camera costs neither.

const source = (id) => document.getElementById(id).textContent;

class Picture {
  constructor(canvas, basis) {
    const gl = canvas.getContext('webgl2', { antialias: true, alpha: true, premultipliedAlpha: true, powerPreference: 'high-performance' });
    if (!gl) throw new Error('This browser offers no WebGL 2, which the lungs are drawn with.');
    this.gl = gl;
    this.canvas = canvas;
    this.basis = basis;
    this.moving = this.program('position.vert.glsl', null, 'moved');
    this.turning = this.program('normal.vert.glsl', null, 'normal');
    this.surface = this.program('surface.vert.glsl', 'surface.frag.glsl');
    this.picker = this.program('surface.vert.glsl', 'pick.frag.glsl');
    this.solid = this.program('solid.vert.glsl', 'solid.frag.glsl');
    this.feedback = gl.createTransformFeedback();
    this.makeInputs();
    this.makeRings();
    this.makeOutputs();
    this.makePick();
    this.maps = { displacement: this.makeMap('displacement'), difference: this.makeMap('difference') };
    this.arrow = this.makeArrow();
    this.timer = gl.getExtension('EXT_disjoint_timer_query_webgl2');
    this.timing = null;
    this.gpuTime = NaN;
  }

  program(vertex, fragment, output) {
    const { gl } = this;
    const program = gl.createProgram();
    const attach = (type, text) => {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, `#version 300 es\n${text}`);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(`${vertex}: ${gl.getShaderInfoLog(shader)}`);
      gl.attachShader(program, shader);
    };
    attach(gl.VERTEX_SHADER, (vertex === 'position.vert.glsl' ? source('supine.glsl') : '') + source(vertex));
    attach(gl.FRAGMENT_SHADER, fragment ? source(fragment) : 'precision highp float; void main() {}');
    if (output) gl.transformFeedbackVaryings(program, [output], gl.SEPARATE_ATTRIBS);
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

  /** A vertex array; each attribute is [buffer, size, stride, offset], whole numbers where `whole`. */
  array(attributes, whole = false) {
    const { gl } = this;
    const made = gl.createVertexArray();
    gl.bindVertexArray(made);
    attributes.forEach(([buffer, size, stride, offset], i) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.enableVertexAttribArray(i);
      if (whole) gl.vertexAttribIPointer(i, size, gl.UNSIGNED_INT, stride, offset);
      else gl.vertexAttribPointer(i, size, gl.FLOAT, false, stride, offset);
    });
    gl.bindVertexArray(null);
    return made;
  }

  /** Rest, direction and up to 16 coefficients; missing ones read (0, 0, 0, 1) and get weight 0. */
  makeInputs() {
    const { basis } = this;
    const k = basis.modes;
    this.rest = this.buffer(basis.rest);
    const coefficients = this.buffer(basis.coefficients);
    const attributes = [[this.rest, 3, 12, 0], [this.buffer(basis.direction), 3, 12, 0]];
    for (let first = 0; first < k; first += 4) attributes.push([coefficients, Math.min(4, k - first), 4 * k, 4 * first]);
    this.inputs = this.array(attributes);
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

  /** For each vertex the two others of its triangles, in a texture, and where its own begin. */
  makeRings() {
    const { gl, basis } = this;
    const { corners } = basis;
    const spans = new Uint32Array(2 * basis.vertices);
    for (const v of corners) ++spans[2 * v + 1];
    for (let v = 1; v < basis.vertices; ++v) spans[2 * v] = spans[2 * v - 2] + spans[2 * v - 1];
    const width = Math.min(4096, gl.getParameter(gl.MAX_TEXTURE_SIZE));
    const height = Math.max(1, Math.ceil(corners.length / width));
    const pairs = new Uint32Array(2 * width * height);
    const next = Uint32Array.from({ length: basis.vertices }, (_, v) => spans[2 * v]);
    for (let t = 0; t < corners.length; t += 3) {
      for (let i = 0; i < 3; ++i) {
        const at = 2 * next[corners[t + i]]++;
        pairs[at] = corners[t + ((i + 1) % 3)];
        pairs[at + 1] = corners[t + ((i + 2) % 3)];
      }
    }
    this.ring = this.texture(gl.RG32UI, gl.RG_INTEGER, gl.UNSIGNED_INT, width, height, pairs);
    this.spans = this.array([[this.buffer(spans), 2, 8, 0]], true);
  }

  /** Positions (four floats each, also as a texture), normals, pinned positions. */
  makeOutputs() {
    const { gl, basis } = this;
    this.width = Math.min(2048, basis.vertices);
    this.height = Math.ceil(basis.vertices / this.width);
    const room = 16 * this.width * this.height;
    this.moved = this.buffer(room, gl.DYNAMIC_COPY);
    this.pinned = this.buffer(room, gl.DYNAMIC_COPY);
    this.normals = this.buffer(12 * basis.vertices, gl.DYNAMIC_COPY);
    this.places = this.texture(gl.RGBA32F, gl.RGBA, gl.FLOAT, this.width, this.height, null);
    const shown = [[this.moved, 3, 16, 0], [this.normals, 3, 12, 0]];
    const indices = this.buffer(basis.corners, gl.STATIC_DRAW, gl.ELEMENT_ARRAY_BUFFER);
    this.shown = { displacement: this.array([...shown, [this.rest, 3, 12, 0]]), difference: this.array([...shown, [this.pinned, 3, 16, 0]]) };
    for (const array of Object.values(this.shown)) {
      gl.bindVertexArray(array);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, indices);
    }
    gl.bindVertexArray(null);
  }

  /** One pixel that holds floats' bits. */
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
    const made = this.texture(gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, 256, 1, new Uint8Array(colourMap(name).buffer));
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.LINEAR);
    return made;
  }

  /** An arrow of length 1 along -z, from the origin. */
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
    return { array: this.array([[this.buffer(new Float32Array(places)), 3, 12, 0], [this.buffer(new Float32Array(normals)), 3, 12, 0]]), count: places.length / 3 };
  }

  /** Runs a program over every vertex into a buffer. */
  capture(program, array, target) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, null); // a buffer that is written may have no second use
    gl.bindVertexArray(array);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, this.feedback);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, target);
    gl.enable(gl.RASTERIZER_DISCARD);
    gl.beginTransformFeedback(gl.POINTS);
    gl.drawArrays(gl.POINTS, 0, this.basis.vertices);
    gl.endTransformFeedback();
    gl.disable(gl.RASTERIZER_DISCARD);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, null);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
    gl.bindVertexArray(null);
  }

  capturePositions(moment, target) {
    const { gl, moving } = this;
    const weights = new Float32Array(16);
    weights.set(moment.weights);
    gl.useProgram(moving.program);
    gl.uniform4fv(moving.at.supine_weights, weights);
    this.capture(moving, this.inputs, target);
  }

  /** Deforms the lungs; with `pinned`, also what differences are measured from. */
  deform(moment, pinned) {
    const { gl } = this;
    this.capturePositions(moment, this.moved);
    if (pinned) this.capturePositions(pinned, this.pinned);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.places);
    gl.bindBuffer(gl.PIXEL_UNPACK_BUFFER, this.moved);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, this.width, this.height, gl.RGBA, gl.FLOAT, 0);
    gl.bindBuffer(gl.PIXEL_UNPACK_BUFFER, null);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.ring);
    gl.useProgram(this.turning.program);
    gl.uniform1i(this.turning.at.positions, 0);
    gl.uniform1i(this.turning.at.ring, 1);
    this.capture(this.turning, this.spans, this.normals);
    gl.activeTexture(gl.TEXTURE0);
  }

  /** Positions on the graphics card, xyz of each vertex, mm LPS. */
  readPositions(moment) {
    const { gl, basis } = this;
    const target = this.buffer(16 * basis.vertices, gl.DYNAMIC_READ);
    this.capturePositions(moment, target);
    const four = new Float32Array(4 * basis.vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, target);
    gl.getBufferSubData(gl.ARRAY_BUFFER, 0, four);
    gl.deleteBuffer(target);
    return new Float32Array(3 * basis.vertices).map((_, i) => four[4 * Math.floor(i / 3) + (i % 3)]);
  }

  drawSurface(program, view, lens) {
    const { gl } = this;
    gl.useProgram(program.program);
    gl.uniformMatrix4fv(program.at.toEye, false, view.toEye);
    gl.uniformMatrix4fv(program.at.projection, false, view.projection);
    gl.uniform4fv(program.at.lens, lens);
    gl.bindVertexArray(this.shown[view.kind]);
    gl.drawElements(gl.TRIANGLES, this.basis.corners.length, gl.UNSIGNED_INT, 0);
    gl.bindVertexArray(null);
  }

  draw(view) {
    const { gl, surface, solid, canvas } = this;
    this.beginTiming();
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.bindTexture(gl.TEXTURE_2D, this.maps[view.kind]);
    gl.useProgram(surface.program);
    gl.uniform1i(surface.at.colours, 0);
    gl.uniform1f(surface.at.range, view.range.end);
    gl.uniform1f(surface.at.step_mm, view.contours ? view.range.step / 2 : 0);
    gl.uniform1f(surface.at.dark, view.dark ? 1 : 0);
    this.drawSurface(surface, view, [0, 0, 1, 1]);
    gl.useProgram(solid.program);
    gl.uniformMatrix4fv(solid.at.toEye, false, view.arrowToEye);
    gl.uniformMatrix4fv(solid.at.projection, false, view.projection);
    gl.uniform3fv(solid.at.tint, view.tint);
    gl.bindVertexArray(this.arrow.array);
    gl.drawArrays(gl.TRIANGLES, 0, this.arrow.count);
    gl.bindVertexArray(null);
    this.endTiming();
  }

  /** Asks what is at a place of the canvas, from -1 to 1 each way. The answer is `picked` a frame or
   * two later, so that no frame waits for it. */
  pick(view, x, y) {
    const { gl, canvas } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.pickPlace);
    gl.viewport(0, 0, 1, 1);
    gl.clearBufferuiv(gl.COLOR, 0, [0x7fc00000, 0, 0, 0]); // not a number
    gl.clearBufferfv(gl.DEPTH, 0, [1]);
    gl.enable(gl.DEPTH_TEST);
    this.drawSurface(this.picker, view, [x, y, canvas.width, canvas.height]);
    this.pickBits = this.buffer(16, gl.STREAM_READ, gl.PIXEL_PACK_BUFFER); // a used one would be waited for
    gl.readPixels(0, 0, 1, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, 0);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    this.picking = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }

  /** {value, at}, null where nothing was, undefined where no answer has come. */
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
    return Number.isNaN(value) ? null : { value, at };
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
