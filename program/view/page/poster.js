// SPDX-License-Identifier: MIT
// If WebGL 2 is missing, draw the surface on a 2-D canvas, farthest triangles first. Unlike Picture, a Poster has no
// light, lines, arrows, structures inside the lungs or picking.

/** Return the normal of a triangle, twice its area long; t is the index of its first corner. */
function normalOf(places, corners, t) {
  const [a, b, c] = [0, 1, 2].map((i) => places.subarray(3 * corners[t + i], 3 * corners[t + i] + 3));
  return cross(
    [0, 1, 2].map((i) => b[i] - a[i]),
    [0, 1, 2].map((i) => c[i] - a[i]),
  );
}

const areaOf = (places, corners, t) => Math.hypot(...normalOf(places, corners, t));

/** Return how far a triangle with the normal n turns away from the viewer, 0 to 1; m is the matrix to the eye. */
function turnedAway(m, n) {
  const eye = [0, 1, 2].map((i) => m[i] * n[0] + m[4 + i] * n[1] + m[8 + i] * n[2]);
  return 1 - Math.abs(eye[2]) / (Math.hypot(...eye) || 1);
}

/** Return the colour of the shell of surface.frag.glsl where it turns away by f. */
function shellColour(f) {
  const [pink, white] = [
    [235, 168, 158],
    [255, 242, 237],
  ];
  const mixed = pink.map((x, i) => Math.round(x + f * (white[i] - x)));
  return `rgb(${mixed.join(' ')} / ${(0.1 + 0.75 * f ** 2.2).toFixed(3)})`;
}

class Poster {
  constructor(canvas, basis) {
    Object.assign(this, { basis, context: canvas.getContext('2d'), places: {}, gpuTime: NaN, picking: null });
  }

  deform(name, moment, shift = null) {
    const places = placesOf(this.basis, moment);
    this.places[name] = shift?.surface ? places.map((x, i) => x + shift.surface[i]) : places;
  }

  read(moment) {
    return [placesOf(this.basis, moment)];
  }

  pick() {}

  picked() {}

  draw(panes) {
    this.context.clearRect(0, 0, this.context.canvas.width, this.context.canvas.height);
    for (const pane of panes) this.paint(pane);
  }

  paint(pane) {
    const { state, origin, range, map, measure, plain } = pane;
    const { corners, colours } = this.basis;
    const [now, from] = [this.places[state], this.places[origin]];
    const screen = this.project(pane, now);
    const value = (t) => {
      if (measure === 1) return 100 * (areaOf(now, corners, t) / areaOf(from, corners, t) - 1);
      const at = 3 * corners[t];
      return Math.hypot(now[at] - from[at], now[at + 1] - from[at + 1], now[at + 2] - from[at + 2]);
    };
    const colour = (t) => {
      if (plain) return shellColour(turnedAway(pane.toEye, normalOf(now, corners, t)));
      const share = Math.max(0, Math.min(1, (value(t) - range.begin) / (range.end - range.begin)));
      const at = 4 * Math.round(255 * share);
      return `rgb(${colours[map].subarray(at, at + 3).join(' ')})`;
    };
    for (const t of this.visible(pane, screen)) this.fill(screen, t, colour(t), plain);
  }

  /** Return the places of all vertices in the picture, pixels, and their depths. */
  project({ toEye: m, projection, box: [left, bottom, width, height], canvasHeight }, now) {
    const { vertices } = this.basis;
    const screen = new Float32Array(3 * vertices);
    for (let v = 0; v < vertices; ++v) {
      const [x, y, z] = [0, 1, 2].map(
        (i) => m[i] * now[3 * v] + m[4 + i] * now[3 * v + 1] + m[8 + i] * now[3 * v + 2] + m[12 + i],
      );
      screen[3 * v] = left + ((1 - (projection[0] * x) / z) / 2) * width;
      screen[3 * v + 1] = canvasHeight - bottom - ((1 - (projection[5] * y) / z) / 2) * height;
      screen[3 * v + 2] = z;
    }
    return screen;
  }

  /** Return the first corners of the triangles that are seen, the farthest first. All triangles of a shell are. */
  visible({ opacity, plain }, screen) {
    const { corners, cornerBegin } = this.basis;
    const seen = [];
    opacity.forEach((amount, lung) => {
      if (amount > 0)
        for (let t = cornerBegin[lung]; t < cornerBegin[lung + 1]; t += 3)
          if (plain || normalOf(screen, corners, t)[2] < 0) seen.push(t);
    });
    return seen.sort((a, b) => screen[3 * corners[a] + 2] - screen[3 * corners[b] + 2]);
  }

  /** Fill a triangle; `plain` leaves the gaps between neighbouring triangles open. */
  fill(screen, t, colour, plain) {
    const { context } = this;
    const { corners } = this.basis;
    context.fillStyle = context.strokeStyle = colour;
    context.beginPath();
    for (let i = 0; i < 3; ++i)
      context[i ? 'lineTo' : 'moveTo'](screen[3 * corners[t + i]], screen[3 * corners[t + i] + 1]);
    context.closePath();
    context.fill();
    if (!plain) context.stroke();
  }
}
