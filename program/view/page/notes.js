// SPDX-License-Identifier: MIT
// Draw notes over the picture on a 2-D canvas: gravity, the traces and names of targets, a lens that enlarges the trace
// of the chosen one, and marked points.

/** Return the position on the canvas, units of notes, of a point in the patient's axes, mm; null if it is behind the
 * viewer. `ratio` is the number of pixels of the canvas for each unit. */
function project(pane, [x, y, z], ratio) {
  const m = pane.toEye;
  const eye = [0, 1, 2].map((i) => m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i]);
  if (eye[2] >= 0) return null;
  const [left, bottom, width, height] = pane.box;
  const ndc = [0, 1].map((i) => (pane.projection[5 * i] * eye[i]) / -eye[2]);
  return [
    (left + ((ndc[0] + 1) / 2) * width) / ratio,
    (pane.canvasHeight - bottom - ((ndc[1] + 1) / 2) * height) / ratio,
  ];
}

/** Return a name as the picture shows it: cut at a character if it has more than `longest`. */
function shortName(name, longest = 28) {
  const characters = Array.from(new Intl.Segmenter().segment(name), ({ segment }) => segment);
  return characters.length > longest ? `${characters.slice(0, longest - 1).join('')}\u2026` : name;
}

/** Draw a line with the head of an arrow at its end. */
function drawArrow(context, [x, y], [u, v], head) {
  const size = Math.hypot(u - x, v - y);
  const [dx, dy] = [(u - x) / size, (v - y) / size];
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(u - dx * head, v - dy * head);
  context.stroke();
  context.beginPath();
  context.moveTo(u, v);
  for (const side of [-0.5, 0.5]) context.lineTo(u - head * dx + side * head * dy, v - head * dy - side * head * dx);
  context.fill();
}

/** Draw the trace of a target: a dashed circle where it was, a ring around where it is, as far away as the expected
 * error, an arrow, and a ball at `seen`, where it is or could be. Positions and sizes are pixels. */
function drawTrace(context, was, at, radius, ring, seen = at) {
  const circle = ([x, y], r) => {
    context.beginPath();
    context.arc(x, y, r, 0, 2 * Math.PI);
  };
  context.fillStyle = context.strokeStyle = css('--change');
  context.lineWidth = 1.5;
  for (const [alpha, place, r] of [
    [0.25, at, radius + ring],
    [0.85, seen, radius],
  ]) {
    context.globalAlpha = alpha;
    circle(place, r);
    context.fill();
  }
  context.globalAlpha = 1;
  if (ring > 0) {
    circle(at, radius + ring);
    context.stroke();
  }
  context.strokeStyle = context.fillStyle = css('--ink');
  context.lineWidth = 1.2;
  context.setLineDash([3, 2.5]);
  circle(was, radius);
  context.globalAlpha = 0.22;
  context.fill();
  context.globalAlpha = 1;
  context.stroke();
  context.setLineDash([]);
  context.lineWidth = radius > 20 ? 2.5 : 1.5;
  if (Math.hypot(at[0] - was[0], at[1] - was[1]) > 4)
    drawArrow(context, was, at, Math.min(radius > 20 ? 13 : 7, 0.6 * Math.hypot(at[0] - was[0], at[1] - was[1])));
}

const LENS_WIDE = 720; // width of a picture in which the lens has its words beside it, units of notes
const SWITCHES = [290, 30]; // width and height of the switches under the lens, units of notes

/** The canvas with the notes. `taken` has the boxes [left, top, right, bottom] that names may not cover. */
class Notes {
  constructor(canvas) {
    this.canvas = canvas;
  }

  text(words, x, y, { align = 'left', colour = '--ink', font = '13px' } = {}) {
    const { context } = this;
    Object.assign(context, {
      textAlign: align,
      textBaseline: 'middle',
      font: `${font} system-ui, sans-serif`,
      lineJoin: 'round',
      strokeStyle: css('--paper-solid'),
      fillStyle: colour.startsWith('--') ? css(colour) : colour,
    });
    context.lineWidth = 3;
    context.strokeText(words, x, y);
    context.fillText(words, x, y);
  }

  /** Draw gravity as an arrow around (x, y) in a picture of this width, 80 units long if it is in the plane of the
   * picture. */
  gravity(pane, x, y, width) {
    const { context } = this;
    const [gx, gy] = rotate(pane.turn, pane.gravity);
    const size = Math.hypot(gx, gy);
    context.strokeStyle = context.fillStyle = css('--ink');
    context.lineWidth = 3;
    if (size > 0.15) {
      drawArrow(context, [x - 40 * gx, y + 40 * gy], [x + 40 * gx, y - 40 * gy], 11);
      this.text('gravity', x, y - 40 * Math.abs(gy) - 12, { align: 'center', font: '12px' });
    } else {
      const words = `gravity, ${rotate(pane.turn, pane.gravity)[2] > 0 ? 'towards you' : 'away from you'}`;
      context.font = '12px system-ui, sans-serif';
      const half = context.measureText(words).width / 2 + 10; // with a margin to the edge of the picture
      this.text(words, Math.max(half, Math.min(width - half, x)), y - 16, {
        align: 'center',
        font: '12px',
      });
    }
  }

  /** Draw a target's name, in a colour, and a line from it to the target. A name that would cover a taken box moves
   * down, up or to the other side; without a free place it is left to the table. */
  name(at, lines, { width, height }, colour) {
    const { context, taken } = this;
    const wide = Math.max(
      ...lines.map((line, i) => {
        context.font = `${i ? '12px' : '600 13px'} system-ui, sans-serif`;
        return context.measureText(line).width;
      }),
    );
    const away = width < LENS_WIDE ? 30 : 60;
    let side = at[0] + away + 10 + wide < width ? 1 : -1;
    const place = [at[0] + side * away, at[1] + 4];
    const box = () => [
      place[0] - (side < 0 ? wide : 0),
      place[1] - 9,
      place[0] + (side > 0 ? wide : 0),
      place[1] + 16 * lines.length - 7,
    ];
    const covers = ([left, top, right, bottom]) =>
      left < box()[2] && right > box()[0] && top < box()[3] && bottom > box()[1];
    const inside = ([left, top, right, bottom]) => left > 0 && top > 0 && right < width && bottom < height;
    const fits = () => inside(box()) && !taken.some(covers);
    for (let steps = 1; steps < 200 && !fits(); ++steps) {
      // near the target on either side first, then farther
      if (steps % 2 === 0) side = -side;
      place[0] = at[0] + side * away;
      place[1] = at[1] + 4 + 8 * Math.ceil(steps / 4) * (steps % 4 < 2 ? 1 : -1);
    }
    if (!fits()) return;
    taken.push(box());
    context.strokeStyle = css('--soft');
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(at[0] + side * 6, at[1]);
    context.lineTo(place[0] - side * 5, place[1]);
    context.stroke();
    lines.forEach((line, i) =>
      this.text(line, place[0], place[1] + 16 * i, {
        align: side > 0 ? 'left' : 'right',
        colour: i ? '--ink' : colour,
        font: i ? '12px' : '600 13px',
      }),
    );
  }

  /** Draw the chosen target's trace, and enlarged in a circle at the upper right, with its numbers beside it or, if the
   * picture is narrow, its name and distance below. Return the place under the lens, from the right
   * and from the top; null if the target's error is unknown. */
  lens(pane, target, radius, from, ratio, { width, height, grown: unit }) {
    const { context, taken } = this;
    const places = [target.was, target.at, placeInDoubt(state.chosen, target.at)];
    const [was, at, seen] = places.map((p) => project(pane, p, ratio));
    if (!was || !at || !seen) return null;
    const scale = 1 / (pane.pixel * unit); // units for each mm
    const narrow = width < LENS_WIDE;
    const size = Math.min(92, height * 0.2, width * 0.15);
    const middle = [width - size - (narrow ? 10 : 172), size + 12];
    const ring = ringOf(target, state.day);
    const error = ring.error ?? 0;
    const grown = (0.92 * size) / Math.max(radius + error + 0.5 * target.mm, 10); // pixels for each mm in the lens
    drawTrace(context, was, at, Math.max(4, radius * scale), 0, seen);
    context.fillStyle = context.strokeStyle = css('--line');
    context.lineWidth = 1;
    for (const side of [-1, 1]) {
      // lines from the trace to the circle
      const [dx, dy] = [middle[0] - at[0], middle[1] - at[1]];
      const far = Math.hypot(dx, dy);
      context.beginPath();
      context.moveTo(at[0] - (side * dy * 9) / far, at[1] + (side * dx * 9) / far);
      context.lineTo(middle[0] - (side * dy * size) / far, middle[1] + (side * dx * size) / far);
      context.stroke();
    }
    context.save();
    context.beginPath();
    context.arc(...middle, size, 0, 2 * Math.PI);
    context.fillStyle = css('--paper-solid');
    context.fill();
    context.strokeStyle = css('--edge');
    context.stroke();
    context.clip();
    const centre = [0, 1].map((k) => (was[k] + at[k]) / 2);
    const inLens = (p) => p.map((x, k) => middle[k] + ((x - centre[k]) / scale) * grown);
    drawTrace(context, inLens(was), inLens(at), radius * grown, error * grown, inLens(seen));
    context.restore();
    const below = narrow ? [10, middle[1] + size + 38] : [width - middle[0] - size, middle[1] + size + 6];
    taken.push([middle[0] - size, 0, width, below[1]]);
    taken.push([width - below[0] - SWITCHES[0], below[1], width, below[1] + SWITCHES[1]]);
    if (narrow) {
      this.text(shortName(target.name), width - 10, middle[1] + size + 12, {
        align: 'right',
        colour: '--change',
        font: '600 12px',
      });
      this.text(`${target.mm.toFixed(1)} mm`, width - 10, middle[1] + size + 28, { align: 'right', font: '600 12px' });
      return ring.error === null ? null : below;
    }
    const ways = isTold(target) ? wayWords(target.move, 3, pane.gravity).split(', ') : [withinWords(target.error)];
    const lines = [
      [shortName(target.name, 15), '--change', '650 14px'],
      [`${target.mm.toFixed(1)} mm`, '--ink', isTold(target) ? '650 14px' : '12px'],
      ...ways.map((way) => [way, '--ink', '12px']),
      [`dashed: ${from}`, '--soft', '12px'],
      [`ring: within ${errorText(error)},`, '--soft', '12px'],
      [ring.day, '--soft', '12px'],
    ].slice(0, ring.error === null ? -2 : undefined);
    lines.forEach(([words, colour, font], i) =>
      this.text(words, middle[0] + size + 12, middle[1] - size + 18 + 18 * i, { colour, font }),
    );
    return ring.error === null ? null : below;
  }
}

function nearestVertex(basis, xyz, place) {
  let best = -1;
  let least = Infinity;
  for (let i = 0; i < basis.vertices; ++i) {
    const square = (xyz[3 * i] - place[0]) ** 2 + (xyz[3 * i + 1] - place[1]) ** 2 + (xyz[3 * i + 2] - place[2]) ** 2;
    if (square < least) [best, least] = [i, square];
  }
  return best;
}
