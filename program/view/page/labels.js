// SPDX-License-Identifier: MIT
// Place labels over the picture: letters at the ends of the body's axes, marked vertices, and names of structures.

/** Return the position on the canvas, CSS pixels, of a point in the patient's axes, mm; null if it is behind the
 * viewer. `ratio` is the number of pixels of the canvas for each CSS pixel. */
function project(pane, [x, y, z], ratio) {
  const m = pane.toEye;
  const eye = [0, 1, 2].map((i) => m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i]);
  if (eye[2] >= 0) return null;
  const [left, bottom, width, height] = pane.box;
  const ndc = [0, 1].map((i) => (pane.projection[5 * i] * eye[i]) / -eye[2]);
  return { x: (left + ((ndc[0] + 1) / 2) * width) / ratio, y: (pane.canvasHeight - bottom - ((ndc[1] + 1) / 2) * height) / ratio };
}

const placed = (element, at, shown) => {
  const where = shown ? `translate(${at.x.toFixed(1)}px, ${at.y.toFixed(1)}px) translate(-50%, -50%)` : '';
  if (element.where === where) return;
  element.where = where;
  element.hidden = !shown;
  if (shown) element.style.transform = where;
};

const LETTER_RADIUS = 12; // radius of a letter with the space around it, CSS pixels
const ARROW_RADIUS = 13;  // radius of the head of gravity's arrow, CSS pixels

/** Return the position of a letter, moved off a plate: a box, such as the colour bar, that covers a part of the
 * picture. Of the moves up, down, right and left that stay in the picture, take the shortest. */
function offPlate(at, plate, box) {
  const r = LETTER_RADIUS;
  if (at.x < plate.left - r || at.x > plate.right + r || at.y < plate.top - r || at.y > plate.bottom + r) return at;
  const candidates = [{ x: at.x, y: plate.top - r }, { x: at.x, y: plate.bottom + r }, { x: plate.right + r, y: at.y }, { x: plate.left - r, y: at.y }]
    .filter(({ x, y }) => x >= box.left + r && x <= box.right - r && y >= box.top + r && y <= box.bottom - r);
  const far = ({ x, y }) => Math.hypot(x - at.x, y - at.y);
  return candidates.reduce((best, place) => (far(place) < far(best) ? place : best), candidates[0] ?? at);
}

/** Return the position of a letter, moved to the side of the arrow [from, to] if it would overlap the arrow. */
function offArrow(at, [from, to], box) {
  const [dx, dy] = [to.x - from.x, to.y - from.y];
  const along = Math.max(0, Math.min(1, ((at.x - from.x) * dx + (at.y - from.y) * dy) / Math.max(dx * dx + dy * dy, 1e-9)));
  const [nx, ny] = [from.x + along * dx, from.y + along * dy];
  const far = LETTER_RADIUS + ARROW_RADIUS;
  if (Math.hypot(at.x - nx, at.y - ny) >= far) return at;
  const size = Math.hypot(dx, dy) || 1;
  const side = (at.x - nx) * -dy + (at.y - ny) * dx < 0 ? -1 : 1;
  const beside = (sign) => ({ x: nx - (sign * far * dy) / size, y: ny + (sign * far * dx) / size });
  const inside = ({ x, y }) => x >= box.left + 12 && x <= box.right - 12 && y >= box.top + 12 && y <= box.bottom - 12;
  return inside(beside(side)) ? beside(side) : beside(-side);
}

/** The letters L, R, A, P, H and F around the lungs in each pane of the picture. They avoid the plates (boxes over the
 * picture) and the arrow of gravity. They are hidden on axes that point towards the viewer or away. */
class Letters {
  constructor(parent, panes) {
    this.sets = Array.from({ length: panes }, () => Object.keys(ENDS).map((letter) => {
      const element = document.createElement('span');
      element.className = 'letter';
      element.textContent = letter;
      element.hidden = true;
      parent.append(element);
      return element;
    }));
  }

  show(panes, { centre, half }, ratio, plates) { // half: half of each edge of the lungs' bounding box, mm
    this.sets.forEach((set, i) => {
      const pane = panes[i];
      const middle = pane && project(pane, centre, ratio);
      const box = pane && { left: pane.box[0] / ratio, right: (pane.box[0] + pane.box[2]) / ratio, top: 0, bottom: pane.canvasHeight / ratio };
      const arrow = pane?.arrowEnds.map((end) => project(pane, end, ratio));
      Object.values(ENDS).forEach((end, j) => {
        // gap between the letter and the lungs' box, in longest half edges of the box; larger where gravity's arrow is
        const beyond = pane && dot(end, pane.gravity) > 0.8 ? 0.95 : 0.26;
        let at = middle && project(pane, centre.map((c, k) => c + end[k] * (half[k] + beyond * Math.max(...half))), ratio);
        const far = at && Math.hypot(at.x - middle.x, at.y - middle.y) > 0.16 * Math.min(pane.box[2], pane.box[3]) / ratio;
        if (at) { // keep the letter in the picture, clear of the plates and of gravity's arrow
          at.x = Math.max(box.left + 15, Math.min(box.right - 15, at.x));
          at.y = Math.max(15, Math.min(box.bottom - 15, at.y));
          const off = () => { for (const plate of plates) at = offPlate(at, plate, box); };
          off(); // once more after offArrow, which may have moved the letter onto a plate
          if (arrow[0] && arrow[1]) at = offArrow(at, arrow, box);
          off();
        }
        placed(set[j], at, Boolean(far));
        if (far) set[j].classList.toggle('behind', pane.toEye[2] * end[0] + pane.toEye[6] * end[1] + pane.toEye[10] * end[2] < -0.35);
      });
    });
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
