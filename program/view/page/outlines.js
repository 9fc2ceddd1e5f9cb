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
      points.set(
        edge,
        [first, second].map((k) => places[3 * a + k] + part * (places[3 * b + k] - places[3 * a + k])),
      );
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

/** Section planes by their normal axis: name, and name of the plane's position. */
const PLANES = [
  { name: 'sagittal', from: 'right' },
  { name: 'coronal', from: 'front' },
  { name: 'axial', from: 'apex' },
];

/** Return the two section planes that show the lungs as the picture does for a direction of gravity: the axial plane,
 * and the coronal or sagittal plane that contains gravity. Each is {axis, right, up, from}: the index of its normal's
 * axis, the body's directions that point right and up in the drawing, and the side that it is seen from. Gravity
 * points down; the head is on the left or, if the patient stands, at the top. */
function planesFor(gravity) {
  const lengthwise = Math.abs(gravity[0]) >= Math.abs(gravity[1]) ? 1 : 0;
  return [2, lengthwise].map((axis) => {
    const flat = gravity.map((g, i) => (i === axis ? 0 : -g));
    const standing = Math.hypot(...flat) < 0.3 || (axis !== 2 && Math.abs(flat[2]) > 0.8);
    const head = flat[2] < 0 ? ENDS.F : ENDS.H;
    const upright = axis === 2 ? ENDS.A : head;
    const up = standing ? upright : unit(flat);
    let towards = [ENDS.R, ENDS.A, ENDS.F][axis]; // the side that the plane is seen from
    if (axis !== 2 && !standing && cross(up, towards)[2] > 0) towards = towards.map((x) => -x);
    const [side] = Object.entries(ENDS).find(([, end]) => dot(end, towards) > 0.9);
    return { axis, up, right: cross(up, towards), from: VIEWS[side].toLowerCase() };
  });
}

class Outlines {
  /** Make a canvas for each plane. `redraw` requests a new drawing. */
  constructor(parent, basis, state, redraw) {
    Object.assign(this, { basis, state, kept: {}, planes: planesFor(state.gravity), scale: 1 });
    this.canvases = [0, 1].map((i) => {
      const canvas = document.createElement('canvas');
      canvas.tabIndex = 0;
      canvas.setAttribute('role', 'slider');
      canvas.setAttribute('aria-orientation', 'vertical');
      const move = (mm) => {
        // a drag in one drawing moves the plane of the other
        const { low, high } = state.body;
        const { axis } = this.planes[1 - i];
        state.slices = this.at.with(axis, Math.max(low[axis] + 1, Math.min(high[axis] - 1, this.at[axis] + mm)));
        redraw();
      };
      onDrag(canvas, (dx, dy) => {
        const { axis } = this.planes[1 - i];
        move((this.planes[i].right[axis] * dx - this.planes[i].up[axis] * dy) / this.scale);
      });
      canvas.addEventListener('keydown', (event) => {
        const arrow = ARROWS[event.key];
        if (!arrow) return;
        event.preventDefault();
        move(3 * (arrow[0] - arrow[1]));
      });
      parent.append(canvas);
      return canvas;
    });
  }

  /** Return the position of the plane with a normal axis as text. */
  placeWords(axis) {
    const {
      at,
      state: {
        body: { low, high },
      },
    } = this;
    const { name, from } = PLANES[axis];
    return `${name}, ${Math.abs(at[axis] - (axis === 2 ? high : low)[axis]).toFixed(0)} mm from the ${from}`;
  }

  /** Draw the outlines in the state `now`, and dashed outlines in the state `from`, through `target` (see
   * targetsBetween) or, if it is null, through the middle of a lung, unless the user has moved the planes. The target
   * is drawn as a ball of radius `radius`, mm, unless that is 0, and anatomy as contours. */
  show(now, from, target, radius) {
    const { basis, state, kept } = this;
    const [box] = basis.lungBoxes;
    this.planes = planesFor(now.gravity);
    this.at = state.slices ?? target?.at ?? [box.centre[0], basis.torso.centre[1], box.centre[2] - 0.3 * box.half[2]];
    if (kept.from !== from) Object.assign(kept, { from, before: placesOf(basis, from) });
    if (kept.now !== now)
      Object.assign(kept, {
        now,
        places: placesOf(basis, now),
        large: basis.inside && anatomyPlaces(basis.inside, now),
      });
    this.planes.forEach((plane, i) => {
      this.draw(
        i,
        ...[kept.before, kept.places].map((places) => linesAcross(basis, places, plane.axis, this.at[plane.axis])),
        target,
        radius,
      );
      const { axis } = this.planes[1 - i];
      const canvas = this.canvases[i];
      canvas.setAttribute(
        'aria-label',
        `Outlines, ${this.placeWords(plane.axis)}; a drag or the arrow keys move the ${PLANES[axis].name} plane`,
      );
      canvas.setAttribute('aria-valuemin', state.body.low[axis].toFixed(0));
      canvas.setAttribute('aria-valuemax', state.body.high[axis].toFixed(0));
      canvas.setAttribute('aria-valuenow', this.at[axis].toFixed(0));
      canvas.setAttribute('aria-valuetext', this.placeWords(axis));
    });
  }

  draw(i, before, after, target, radius) {
    const { axis, right, up } = this.planes[i];
    const { body } = this.state;
    const others = [0, 1, 2].filter((k) => k !== axis);
    const context = freshContext(this.canvases[i]);
    const { width, height } = sizeOf(this.canvases[i]);
    const reach = (way) => way.reduce((sum, x, k) => sum + Math.abs(x) * body.half[k], 0);
    if (i === 0)
      this.scale = Math.min(
        ...this.planes.flatMap((plane) => [(width - 44) / 2 / reach(plane.right), (height - 84) / 2 / reach(plane.up)]),
      );
    const { scale } = this;
    const middle = (height - 40) / 2;
    const place = (at) => {
      const off = at.map((x, k) => x - body.centre[k]);
      return [width / 2 + scale * dot(off, right), middle - scale * dot(off, up)];
    };
    const inPlane = ([u, v]) => place(body.centre.with(others[0], u).with(others[1], v));
    const path = (lines) => {
      context.beginPath();
      for (const line of lines) {
        line.forEach((point, j) => context[j ? 'lineTo' : 'moveTo'](...inPlane(point)));
        context.closePath();
      }
    };
    context.strokeStyle = context.fillStyle = css('--ink');
    path(after);
    context.globalAlpha = 0.1;
    context.fill('evenodd');
    context.globalAlpha = 1;
    context.lineWidth = 1.7;
    context.stroke();
    context.setLineDash([4, 3]);
    context.lineWidth = 1;
    path(before);
    context.stroke();
    context.setLineDash([]);
    for (const { part, colour, lines } of this.basis.inside
      ? anatomyLines(this.basis.inside, this.kept.large, axis, this.at[axis])
      : []) {
      path(lines);
      context.strokeStyle = part === this.state.chosen ? css('--change') : colour;
      context.lineWidth = 1.3;
      context.stroke();
    }
    if (target && radius > 0) drawTrace(context, place(target.was), place(target.at), radius * scale, 0);
    this.label(i, context, [width / 2, middle], reach);
  }

  /** Write the directions of the body around an outline, a scale bar, and the name of the plane. */
  label(i, context, [centre, middle], reach) {
    const { axis, right, up, from } = this.planes[i];
    const { width, height } = sizeOf(this.canvases[i]);
    const { scale } = this;
    const text = (words, x, y, align, colour = '--soft', font = '12px') => {
      [context.textAlign, context.textBaseline, context.fillStyle, context.font] = [
        align,
        'middle',
        css(colour),
        `${font} system-ui, sans-serif`,
      ];
      context.fillText(words, x, y, width);
    };
    for (const [letter, end] of Object.entries(ENDS)) {
      const [x, y] = [dot(end, right), -dot(end, up)];
      if (end[axis] || Math.hypot(x, y) < 0.7) continue;
      text(
        letter,
        centre + x * (scale * reach(right) + 12),
        middle + y * (scale * reach(up) + 13),
        'center',
        '--ink',
        '600 12px',
      );
    }
    context.fillStyle = css('--ink');
    context.fillRect(0, height - 29, 40 * scale, 1.5);
    text('4 cm', 40 * scale + 6, height - 28, 'left');
    text(`${PLANES[axis].name}, ${from}`, 0, height - 9, 'left');
  }
}
