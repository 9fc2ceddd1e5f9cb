// SPDX-License-Identifier: MIT
// Make shader programs, buffers and textures with WebGL 2, and time what the graphics card does.

const source = (id) => document.getElementById(id).textContent;

class Device {
  constructor(canvas, basis) {
    const gl = canvas.getContext('webgl2', {
      antialias: true,
      alpha: true,
      premultipliedAlpha: true,
      powerPreference: 'high-performance',
    });
    if (!gl) throw new Error('This browser has no WebGL 2. Open the page in another browser.');
    this.gl = gl;
    this.canvas = canvas;
    this.basis = basis;
    this.timer = gl.getExtension('EXT_disjoint_timer_query_webgl2');
    this.timing = null;
    this.gpuTime = NaN;
  }

  /** Compile and link a program. `vertex` and `fragment` are the ids of its sources; without a fragment shader it only
   * writes `outputs`, the names of what the vertex shader returns. Return it with the places of its uniforms. */
  program(vertex, fragment, outputs, text = source(vertex)) {
    const { gl } = this;
    const program = gl.createProgram();
    const attach = (type, body) => {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, `#version 300 es\nprecision highp float;\nprecision highp int;\n${body}`);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS))
        throw new Error(`${vertex}: ${gl.getShaderInfoLog(shader)}`);
      gl.attachShader(program, shader);
    };
    attach(gl.VERTEX_SHADER, text);
    attach(gl.FRAGMENT_SHADER, fragment ? source(fragment) : 'void main() {}');
    if (outputs) gl.transformFeedbackVaryings(program, outputs, gl.SEPARATE_ATTRIBS);
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS))
      throw new Error(`${vertex}: ${gl.getProgramInfoLog(program)}`);
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

  /** Return a vertex array. Each attribute is [buffer, size, stride, offset, divisor, type], or null if it is not
   * used. The shader reads integers as floats. */
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

  texture(internal, format, type, width, height, data) {
    const { gl } = this;
    const made = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, made);
    gl.texStorage2D(gl.TEXTURE_2D, 1, internal, width, height);
    if (data) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, format, type, data);
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(gl.TEXTURE_2D, side, gl.NEAREST);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    return made;
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

  beginTiming() {
    const { gl, timer } = this;
    if (!timer) return;
    if (this.timing && gl.getQueryParameter(this.timing, gl.QUERY_RESULT_AVAILABLE)) {
      if (!gl.getParameter(timer.GPU_DISJOINT_EXT))
        this.gpuTime = gl.getQueryParameter(this.timing, gl.QUERY_RESULT) / 1e6;
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
