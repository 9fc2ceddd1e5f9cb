// SPDX-License-Identifier: MIT
// Draw what surrounds the lungs: arrows of displacements, the table, the patient's body, and a headset's note.

class Solids extends Surfaces {
  /** Return an arrow of length 1 from the origin along -z. */
  makeArrow() {
    const places = [];
    const normals = [];
    const sides = 40;
    const ring = (i, r, z) => [r * Math.cos((2 * Math.PI * i) / sides), r * Math.sin((2 * Math.PI * i) / sides), z];
    const quad = (i, r0, z0, r1, z1) => {
      const slope = (r1 - r0) / Math.hypot(r1 - r0, z1 - z0);
      for (const [j, r, z] of [
        [i, r0, z0],
        [i, r1, z1],
        [i + 1, r1, z1],
        [i, r0, z0],
        [i + 1, r1, z1],
        [i + 1, r0, z0],
      ]) {
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
    return {
      places: this.buffer(new Float32Array(places)),
      normals: this.buffer(new Float32Array(normals)),
      count: places.length / 3,
    };
  }

  /** Return the vertex array of a box from -1 to 1 along each axis. */
  makeTable() {
    const [places, normals] = [[], []];
    for (let axis = 0; axis < 3; ++axis) {
      for (const side of [-1, 1]) {
        for (const [a, b] of [
          [-1, -1],
          [1, -1],
          [1, 1],
          [-1, -1],
          [1, 1],
          [-1, 1],
        ]) {
          const corner = [a, b];
          places.push(...[0, 1, 2].map((i) => (i === axis ? side : corner.shift())));
          normals.push(...[0, 1, 2].map((i) => (i === axis ? side : 0)));
        }
      }
    }
    return this.array([
      [this.buffer(new Float32Array(places)), 3, 12, 0],
      [this.buffer(new Float32Array(normals)), 3, 12, 0],
    ]);
  }

  /** Return the vertex array, indices and their count of the patient's body, a tube of its outline. */
  makeTorso() {
    const {
      gl,
      basis: {
        torso: { centre, half },
      },
    } = this;
    const sides = 48;
    const rings = torsoRings(this.basis.torso);
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
    return {
      array: this.array([
        [this.buffer(new Float32Array(places)), 3, 12, 0],
        [this.buffer(new Float32Array(normals)), 3, 12, 0],
      ]),
      indices: this.buffer(new Uint32Array(indices), gl.STATIC_DRAW, gl.ELEMENT_ARRAY_BUFFER),
      count: indices.length,
    };
  }

  /** Make the vertex array of the patient's arms, if it was made for another way down. */
  makeArms(down) {
    const {
      gl,
      arms,
      basis: { torso },
    } = this;
    if (arms.down === String(down)) return;
    for (const old of arms.buffers ?? []) gl.deleteBuffer(old);
    if (arms.array) gl.deleteVertexArray(arms.array);
    const tubes = armsOf(torso, down).map((line) =>
      tubeOf(
        line.map(([x, y, z, radius]) => [x + torso.centre[0], y + torso.centre[1], z + torso.centre[2], radius]),
        16,
      ),
    );
    const first = tubes[0].places.length / 3;
    const [places, normals] = ['places', 'normals'].map((key) =>
      this.buffer(new Float32Array(tubes.flatMap((tube) => tube[key]))),
    );
    const corners = tubes.flatMap((tube, i) => tube.corners.map((corner) => corner + i * first));
    const indices = this.buffer(new Uint32Array(corners), gl.STATIC_DRAW, gl.ELEMENT_ARRAY_BUFFER);
    Object.assign(arms, {
      down: String(down),
      buffers: [places, normals, indices],
      array: this.array([
        [places, 3, 12, 0],
        [normals, 3, 12, 0],
      ]),
      indices,
      count: corners.length,
    });
  }

  /** Draw arrows that show displacements at some vertices. */
  drawArrows(pane) {
    const { gl, solid } = this;
    const key = `arrows ${pane.state} ${pane.origin}`;
    this.arrays[key] ??= this.array([
      [this.arrow.places, 3, 12, 0],
      [this.arrow.normals, 3, 12, 0],
      [this.state(pane.origin).few, 3, 16, 0, 1],
      [this.state(pane.state).few, 3, 16, 0, 1],
    ]);
    this.usePane(solid, pane);
    gl.uniform1f(solid.at.thick, pane.radius * 0.09);
    gl.bindVertexArray(this.arrays[key]);
    for (const [order, alpha] of [
      [gl.GREATER, 0.35],
      [gl.LEQUAL, 1],
    ]) {
      // draw arrows faint where the surface hides them
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
    this.note ??= {
      program: this.program('note.vert.glsl', 'note.frag.glsl'),
      array: this.array([[this.buffer(new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1])), 2, 8, 0]]),
      map: this.texture(gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, 1024, 256, null),
      text: null,
    };
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
      for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
        gl.texParameteri(gl.TEXTURE_2D, side, gl.LINEAR);
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
}
