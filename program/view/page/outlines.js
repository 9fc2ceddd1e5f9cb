// SPDX-License-Identifier: MIT
// Draw the outlines of the lungs in an axial and a coronal plane, over the outlines in the state from which
// displacements are measured. Gravity points down in the pictures unless it is nearly normal to the plane.

/** Return the lines along which the surface crosses the plane at `at` mm on an axis. A line is a list of points [u, v]
 * on the other two axes, mm. It is closed unless it meets a hole of the surface. */
function linesAcross({ corners, vertices }, places, axis, at) {
  const [first, second] = [0, 1, 2].filter((i) => i !== axis);
  const links = new Map(); // for each edge that crosses the plane, the edges that share a triangle with it
  const points = new Map(); // for each edge, the point where it crosses the plane
  for (let t = 0; t < corners.length; t += 3) {
    const over = [0, 1, 2].map((i) => places[3 * corners[t + i] + axis] > at);
    if (over[0] === over[1] && over[1] === over[2]) continue;
    const ends = [];
    for (let i = 0; i < 3; ++i) {
      const j = (i + 1) % 3;
      if (over[i] === over[j]) continue;
      const [a, b] = [Math.min(corners[t + i], corners[t + j]), Math.max(corners[t + i], corners[t + j])];
      const edge = a * vertices + b;
      const part = (at - places[3 * a + axis]) / (places[3 * b + axis] - places[3 * a + axis]);
      points.set(edge, [first, second].map((k) => places[3 * a + k] + part * (places[3 * b + k] - places[3 * a + k])));
      ends.push(edge);
    }
    ends.forEach((edge, i) => links.set(edge, [...(links.get(edge) ?? []), ends[1 - i]]));
  }
  const lines = [];
  for (const start of links.keys()) {
    const line = [];
    for (let edge = start; edge !== undefined && points.has(edge);) {
      line.push(points.get(edge));
      points.delete(edge);
      edge = links.get(edge).find((next) => points.has(next));
    }
    if (line.length > 2) lines.push(line);
  }
  return lines;
}

/** The two section planes. A drag in the picture of one plane moves the other plane.
 *     axis  index of the axis normal to the plane
 *     sign  1 if the plane's second axis points down in the picture, -1 if it points up
 *     ends  letters at the ends of the plane's axes */
const PLANES = [
  { name: 'axial', axis: 2, sign: 1, ends: { L: [1, 0], R: [-1, 0], P: [0, 1], A: [0, -1] } },
  { name: 'coronal', axis: 1, sign: -1, ends: { L: [1, 0], R: [-1, 0], H: [0, 1], F: [0, -1] } },
];

class Outlines {
  /** Make a canvas for each plane. `redraw` requests a new drawing. */
  constructor(parent, basis, state, redraw) {
    Object.assign(this, { basis, state, kept: {} });
    this.canvases = PLANES.map((plane, i) => {
      const canvas = document.createElement('canvas');
      canvas.tabIndex = 0;
      canvas.setAttribute('role', 'slider');
      canvas.setAttribute('aria-orientation', 'vertical');
      const move = (mm) => {
        const { low, high } = state.body;
        const { axis } = PLANES[1 - i];
        state.slices[1 - i] = Math.max(low[axis] + 1, Math.min(high[axis] - 1, state.slices[1 - i] + mm));
        redraw();
      };
      onDrag(canvas, (dx, dy) => move((this.across[i][0] * dx + this.across[i][1] * dy) / this.scale));
      canvas.addEventListener('keydown', (event) => {
        const arrow = ARROWS[event.key];
        if (!arrow) return;
        event.preventDefault();
        move(3 * (arrow[0] - arrow[1]));
      });
      parent.append(canvas);
      return canvas;
    });
    this.across = [[0, 1], [0, 1]]; // direction of each section plane's second axis on its canvas, a unit vector (x right, y down)
  }

  /** Return the position of plane `i` of PLANES as text. */
  placeWords(i) {
    const { state: { slices, body } } = this;
    return i === 0 ? `axial, ${(body.high[2] - slices[0]).toFixed(0)} mm from the apex` : `coronal, ${(slices[1] - body.low[1]).toFixed(0)} mm from the front`;
  }

  /** Draw the outlines in the state `now`, and dashed outlines in the state `from`. */
  show(now, from) {
    const { basis, state, kept } = this;
    if (kept.from !== from) Object.assign(kept, { from, before: placesOf(basis, from) });
    if (kept.now !== now) Object.assign(kept, { now, places: placesOf(basis, now) });
    PLANES.forEach((plane, i) => {
      this.draw(i, linesAcross(basis, kept.before, plane.axis, state.slices[i]), linesAcross(basis, kept.places, plane.axis, state.slices[i]), now.gravity);
      const { axis } = PLANES[1 - i];
      const canvas = this.canvases[i];
      canvas.setAttribute('aria-label', `Outlines, ${this.placeWords(i)}; a drag or the arrow keys move the ${PLANES[1 - i].name} plane`);
      canvas.setAttribute('aria-valuemin', state.body.low[axis].toFixed(0));
      canvas.setAttribute('aria-valuemax', state.body.high[axis].toFixed(0));
      canvas.setAttribute('aria-valuenow', state.slices[1 - i].toFixed(0));
      canvas.setAttribute('aria-valuetext', this.placeWords(1 - i));
    });
  }

  draw(i, before, after, gravity) {
    const { axis, sign, ends } = PLANES[i];
    const { body, slices } = this.state;
    const others = [0, 1, 2].filter((k) => k !== axis);
    const context = freshContext(this.canvases[i]);
    const { width, height } = sizeOf(this.canvases[i]);
    const middle = others.map((k) => (body.low[k] + body.high[k]) / 2);
    this.scale = (Math.min(width, height - 30) / 2 - 16) / Math.max(...body.half);
    const { scale } = this;
    const along = [gravity[others[0]], sign * gravity[others[1]]];
    const size = Math.hypot(...along);
    // direction, within the section plane, that points down in the picture: gravity, unless nearly normal to the plane
    const [a, b] = size < 0.3 ? [0, 1] : along.map((x) => x / size);
    const turned = (u, v) => [u * b - sign * v * a, u * a + sign * v * b];
    const place = ([u, v]) => {
      const [x, y] = turned(u - middle[0], v - middle[1]);
      return [width / 2 + scale * x, 16 + (height - 30) / 2 + scale * y];
    };
    this.across[i] = turned(0, 1);
    const path = (lines) => {
      context.beginPath();
      for (const line of lines) {
        line.forEach((point, j) => context[j ? 'lineTo' : 'moveTo'](...place(point)));
        context.closePath();
      }
    };
    context.lineWidth = 2;
    context.strokeStyle = context.fillStyle = css('--gravity');
    path(after);
    context.globalAlpha = 0.1;
    context.fill('evenodd');
    context.globalAlpha = 1;
    context.stroke();
    context.setLineDash([4, 3]);
    context.lineWidth = 1.5;
    context.strokeStyle = css('--ink');
    path(before);
    context.stroke();
    context.setLineDash([]);
    context.strokeStyle = css('--accent'); // line where the other section plane crosses this one
    context.globalAlpha = 0.8;
    context.beginPath();
    for (const side of [-1, 1]) context[side < 0 ? 'moveTo' : 'lineTo'](...place([middle[0] + side * body.half[0] * 1.12, slices[1 - i]]));
    context.stroke();
    context.globalAlpha = 1;
    context.fillStyle = css('--ink');
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    context.font = '12px system-ui, sans-serif';
    context.fillText(this.placeWords(i), width / 2, 8, width);
    context.fillRect(6, height - 4, 40 * scale, 2);
    context.textAlign = 'left';
    context.fillText('4 cm', 6, height - 13);
    context.textAlign = 'center';
    context.font = '700 12px system-ui, sans-serif';
    for (const [letter, end] of Object.entries(ends)) {
      const [x, y] = place(end.map((e, k) => middle[k] + e * (body.half[others[k]] + 10 / scale)));
      context.fillText(letter, Math.max(8, Math.min(width - 8, x)), Math.max(22, Math.min(height - 8, y)));
    }
  }
}
