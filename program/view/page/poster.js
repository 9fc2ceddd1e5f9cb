// SPDX-License-Identifier: MIT
// If WebGL 2 is missing, draw the surface on a 2-D canvas, farthest triangles first. Unlike Picture, a Poster has no
// light, lines, arrows, structures inside the lungs or picking.

class Poster {
  constructor(canvas, basis) {
    Object.assign(this, { basis, context: canvas.getContext('2d'), places: {}, gpuTime: NaN, picking: null });
  }

  deform(name, moment) {
    this.places[name] = placesOf(this.basis, moment);
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

  paint({
    state,
    origin,
    toEye: m,
    projection,
    box: [left, bottom, width, height],
    canvasHeight,
    range,
    map,
    opacity,
    measure,
    plain,
  }) {
    const {
      context,
      basis: { corners, cornerBegin, vertices, colours },
    } = this;
    const [now, from] = [this.places[state], this.places[origin]];
    const screen = new Float32Array(3 * vertices);
    for (let v = 0; v < vertices; ++v) {
      const [x, y, z] = [0, 1, 2].map(
        (i) => m[i] * now[3 * v] + m[4 + i] * now[3 * v + 1] + m[8 + i] * now[3 * v + 2] + m[12 + i],
      );
      screen[3 * v] = left + ((1 - (projection[0] * x) / z) / 2) * width;
      screen[3 * v + 1] = canvasHeight - bottom - ((1 - (projection[5] * y) / z) / 2) * height;
      screen[3 * v + 2] = z;
    }
    const across = (places, t, i) => places[3 * corners[t + 1] + i] - places[3 * corners[t] + i];
    const down = (places, t, i) => places[3 * corners[t + 2] + i] - places[3 * corners[t] + i];
    const normal = (places, t) =>
      cross(
        [0, 1, 2].map((i) => across(places, t, i)),
        [0, 1, 2].map((i) => down(places, t, i)),
      );
    const value = (t) => {
      if (measure === 1) return 100 * (Math.hypot(...normal(now, t)) / Math.hypot(...normal(from, t)) - 1);
      const at = 3 * corners[t];
      return Math.hypot(now[at] - from[at], now[at + 1] - from[at + 1], now[at + 2] - from[at + 2]);
    };
    /** Return how far a triangle turns away from the viewer, 0 to 1. */
    const edge = (t) => {
      const n = normal(now, t);
      const eye = [0, 1, 2].map((i) => m[i] * n[0] + m[4 + i] * n[1] + m[8 + i] * n[2]);
      return 1 - Math.abs(eye[2]) / (Math.hypot(...eye) || 1);
    };
    const seen = [];
    opacity.forEach((amount, lung) => {
      if (amount > 0)
        for (let t = cornerBegin[lung]; t < cornerBegin[lung + 1]; t += 3)
          if (plain || across(screen, t, 0) * down(screen, t, 1) < across(screen, t, 1) * down(screen, t, 0))
            seen.push(t);
    });
    seen.sort((a, b) => screen[3 * corners[a] + 2] - screen[3 * corners[b] + 2]);
    for (const t of seen) {
      const f = plain ? edge(t) : 0;
      const at = 4 * Math.round(255 * Math.max(0, Math.min(1, (value(t) - range.begin) / (range.end - range.begin))));
      context.fillStyle = context.strokeStyle = plain // the shell of surface.frag.glsl
        ? `rgb(${[
            [235, 255],
            [168, 242],
            [158, 237],
          ]
            .map(([pink, white]) => Math.round(pink + f * (white - pink)))
            .join(' ')} / ${(0.1 + 0.75 * f ** 2.2).toFixed(3)})`
        : `rgb(${colours[map].subarray(at, at + 3).join(' ')})`;
      context.beginPath();
      for (let i = 0; i < 3; ++i)
        context[i ? 'lineTo' : 'moveTo'](screen[3 * corners[t + i]], screen[3 * corners[t + i] + 1]);
      context.closePath();
      context.fill();
      if (!plain) context.stroke(); // closes the gaps between neighbouring triangles
    }
  }
}
