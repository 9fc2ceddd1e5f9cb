// SPDX-License-Identifier: MIT
// What is written over the picture: the ends of the body's axes, and probes.

/** Where a point of the body is on a pane, CSS pixels; null behind the viewer. */
function project(pane, [x, y, z], ratio) {
  const m = pane.toEye;
  const eye = [0, 1, 2].map((i) => m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i]);
  if (eye[2] >= 0) return null;
  const [left, bottom, width, height] = pane.box;
  const ndc = [0, 1].map((i) => (pane.projection[5 * i] * eye[i]) / -eye[2]);
  return { x: (left + ((ndc[0] + 1) / 2) * width) / ratio, y: (pane.canvasHeight - bottom - ((ndc[1] + 1) / 2) * height) / ratio };
}

const placed = (element, at, shown) => {
  element.hidden = !shown;
  if (shown) element.style.transform = `translate(${at.x.toFixed(1)}px, ${at.y.toFixed(1)}px) translate(-50%, -50%)`;
};

/** L, R, A, P, H and F around the lungs of each pane, always within the picture; those that point at
 * the viewer or away are left out. */
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

  show(panes, { centre, half }, ratio) {
    this.sets.forEach((set, i) => {
      const pane = panes[i];
      const middle = pane && project(pane, centre, ratio);
      Object.values(ENDS).forEach((end, j) => {
        const beyond = pane && dot(end, pane.gravity) > 0.8 ? 0.95 : 0.26; // past the arrow
        const at = middle && project(pane, centre.map((c, k) => c + end[k] * (half[k] + beyond * Math.max(...half))), ratio);
        const far = at && Math.hypot(at.x - middle.x, at.y - middle.y) > 0.16 * Math.min(pane.box[2], pane.box[3]) / ratio;
        if (at) { // at the picture's edge where it would be beyond
          at.x = Math.max(pane.box[0] / ratio + 15, Math.min((pane.box[0] + pane.box[2]) / ratio - 15, at.x));
          at.y = Math.max(15, Math.min(pane.canvasHeight / ratio - 15, at.y));
        }
        placed(set[j], at, Boolean(far));
      });
    });
  }
}

/** The lung of a vertex. */
const lungOf = (basis, vertex) => basis.lungBegin.findLastIndex((begin) => vertex >= begin);

/** The vertex nearest a place. */
function nearestVertex(basis, xyz, place) {
  let best = -1;
  let least = Infinity;
  for (let i = 0; i < basis.vertices; ++i) {
    const square = (xyz[3 * i] - place[0]) ** 2 + (xyz[3 * i + 1] - place[1]) ** 2 + (xyz[3 * i + 2] - place[2]) ** 2;
    if (square < least) [best, least] = [i, square];
  }
  return best;
}
