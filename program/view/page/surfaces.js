// SPDX-License-Identifier: MIT
// Draw the surfaces of the lungs and the structures inside them.

const NO_CUT = [0, 0, 0, 1e10];

class Surfaces extends Deformer {
  /** Return the vertex array that draws the stored state `name`, with displacements from the stored state `origin`. */
  shown(name, origin) {
    const { gl } = this;
    const key = `${name} ${origin}`;
    if (!this.arrays[key]) {
      const [at, from] = [this.state(name), this.state(origin)];
      this.arrays[key] = this.array([
        [at.moved, 3, 16, 0],
        [at.turned, 4, 16, 0],
        [from.moved, 3, 16, 0],
        [from.turned, 4, 16, 0],
      ]);
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
    this.edges = {
      buffer: this.buffer(pairs.subarray(0, count), gl.STATIC_DRAW, gl.ELEMENT_ARRAY_BUFFER),
      begin: [...begin, count],
    };
  }

  makeMap(name) {
    const { gl } = this;
    const made = this.texture(gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, 256, 1, this.basis.colours[name]);
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.LINEAR);
    return made;
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
    // Rises towards the viewer
    const depth = (lung) => [2, 6, 10].reduce((sum, i, k) => sum + pane.toEye[i] * basis.lungBoxes[lung].centre[k], 0);
    const lungs = pane.opacity
      .map((opacity, lung) => ({ opacity, lung }))
      .filter((l) => l.opacity > 0)
      .sort((a, b) => b.opacity - a.opacity || depth(a.lung) - depth(b.lung));
    const set = (name, value) => gl.uniform1f(surface.at[name], value);
    this.usePane(surface, pane, [0, 0, 1, 1]);
    gl.uniform2f(surface.at.range, pane.range.begin, pane.range.end);
    set('spacing', pane.contours ? pane.range.step : 0);
    set('dark', pane.dark ? 1 : 0);
    set('flatly', 0);
    gl.uniform4fv(surface.at.rise, pane.rise);
    /** Draw the lungs in the state from which displacements are measured: a translucent shell (1) or outline (2). */
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
      if (opacity < 1 && pane.plain) {
        this.drawShell(lung, set);
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

  /** Draw a lung as a shell through which its own folds and the content are seen: the far side first. */
  drawShell(lung, set) {
    const { gl } = this;
    set('ghost', 4);
    gl.depthMask(false);
    gl.enable(gl.CULL_FACE);
    for (const side of [gl.FRONT, gl.BACK]) {
      gl.cullFace(side);
      this.drawLung(lung, gl.TRIANGLES);
    }
    gl.disable(gl.CULL_FACE);
    gl.depthMask(true);
  }

  /** Draw structures inside the lungs with a shader program that usePane has set up: meshes, and points as balls of
   * radius `radius`, mm. `which` is null for all targets, or one of inside.shells, or 'dots' for the points of
   * anatomy. */
  drawInside(program, pane, radius, which) {
    const {
      gl,
      basis: { inside },
    } = this;
    const now = this.state(pane.state).inside;
    const array = (kind, shape, each, first) => {
      const key = `${kind} ${pane.state}`;
      this.arrays[key] ??= this.array([
        ...shape,
        [now, 3, 16, 16 * first, each],
        [this.insideParts, 1, 4, 4 * first, each],
      ]);
      gl.bindVertexArray(this.arrays[key]);
    };
    const ball = [
      [this.ball.buffer, 3, 12, 0],
      [this.ball.buffer, 3, 12, 0],
    ];
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
    const {
      gl,
      content,
      basis: { inside },
    } = this;
    this.usePane(content, pane, [0, 0, 1, 1]);
    gl.bindTexture(gl.TEXTURE_2D, this.targetMap);
    gl.texSubImage2D(
      gl.TEXTURE_2D,
      0,
      0,
      0,
      contentColours(),
      1,
      gl.RGBA,
      gl.UNSIGNED_BYTE,
      new Uint8Array(pane.targetTints.flatMap((tint) => [...tint.map((x) => 255 * x), 255])),
    );
    gl.uniform4fv(content.at.cut, NO_CUT); // only the lungs are cut
    gl.uniform1f(content.at.chosen, pane.chosen);
    gl.uniform2f(content.at.range, 0, contentColours() - 1);
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
}
