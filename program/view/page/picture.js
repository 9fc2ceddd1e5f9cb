// SPDX-License-Identifier: MIT
// Draw the lungs with WebGL 2, and find the point under the pointer.

class Picture extends Solids {
  constructor(canvas, basis) {
    super(canvas, basis);
    this.turning = this.program('normal.vert.glsl', null, ['turned']);
    this.surface = this.program('surface.vert.glsl', 'surface.frag.glsl');
    this.picker = this.program('surface.vert.glsl', 'pick.frag.glsl');
    this.solid = this.program('solid.vert.glsl', 'solid.frag.glsl');
    this.feedback = this.gl.createTransformFeedback();
    this.makeInputs();
    if (basis.inside) this.makeInside();
    this.makeOutputs();
    this.makePick();
    this.maps = Object.fromEntries(Object.keys(basis.colours).map((name) => [name, this.makeMap(name)]));
    this.arrow = this.makeArrow();
    this.table = this.makeTable();
    this.torso = this.makeTorso();
    this.arms = { down: undefined };
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
    // "nothing here": a NaN whose lowest bits are 0 instead of the index of a structure plus 1
    gl.clearBufferuiv(gl.COLOR, 0, [0x7fc00000, 0, 0, 0]);
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
    // A new buffer, because reading into the old one would wait
    this.pickBits = this.buffer(16, gl.STREAM_READ, gl.PIXEL_PACK_BUFFER);
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
    pane.opacity.forEach((opacity, lung) => {
      if (opacity === 1) this.drawLung(lung, gl.TRIANGLES);
    });
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
}
