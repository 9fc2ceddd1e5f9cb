// SPDX-License-Identifier: MIT
// Read and show the structures inside the lungs: named parts, which are points or meshes. A vertex is displaced along
// an axis by the sum over the modes of weight times fields[axis][vertex][mode], times a factor of its lung ("gain").

const BALL_RADIUS = 7; // radius of the ball drawn at a point, mm
const DOT_RADIUS = 1.5; // radius of the balls drawn at the points of anatomy, mm

/** Read the parts inside the lungs from the page, and open them with the run-time library. */
async function takeInside(basis, shared, options) {
  const { inside, modes: k } = basis;
  const { vertices: n } = inside;
  inside.places = takePlaces('inside-vertices', n, basis.placeUnit, basis.middle);
  inside.counts = takeCounts('inside-coefficients', 3 * n, k);
  inside.of = takeTensor('inside-parts', Uint32Array);
  const corners = takeTriangles('inside-triangles', inside.triangles);
  const rigid = Uint32Array.from(inside.rigidRanges);
  const tensors = {
    vertices: [[n, 3], inside.places],
    triangles: [[inside.triangles, 3], corners],
    lung: [[n], lungsOfVertices(inside.lungBegin)],
    coefficients: [[n, 3, k], coefficientsFrom(inside.counts, n, 3, k, inside.unit)],
    part: [[n], inside.of],
    ...namesOf(inside),
    ...shared,
    ...takeSquares(basis, 'inside-'),
    rigid: [[rigid.length / 2, 2], rigid.length ? rigid : undefined],
  };
  inside.library = await open(basisFile(tensors, metadataOf(basis, inside.metadata)), options);
  sortInside(inside, corners);
}

/** Return the tensors with the names of the parts, and whether each is anatomy. */
function namesOf({ names, anatomy }) {
  const text = new TextEncoder().encode(names.join('\n'));
  const large = Uint8Array.from(names, (_, part) => Number(anatomy.includes(part)));
  return { names: [[text.length], text], anatomy: [[names.length], large] };
}

/** Return the vertices in the order in which they are drawn: points before meshes, and targets before anatomy, so that
 * each kind needs one draw call. */
function drawnOrder(inside, corners, isLarge) {
  const { vertices: n, rigidRanges } = inside;
  const meshed = new Uint8Array(n);
  for (const corner of corners) meshed[corner] = 1;
  // Sorting must not split a rigid part
  for (let i = 0; i < rigidRanges.length; i += 2) meshed.fill(1, rigidRanges[i], rigidRanges[i + 1]);
  const order = Uint32Array.from({ length: n }, (_, i) => i);
  order.sort((a, b) => meshed[a] - meshed[b] || isLarge(a) - isLarge(b) || a - b);
  inside.points = n - meshed.reduce((sum, x) => sum + x, 0);
  // Points of targets
  inside.balls = order.subarray(0, inside.points).reduce((sum, vertex) => sum + 1 - isLarge(vertex), 0);
  return order;
}

/** Sort vertices and meshes for drawing. `order` has the library's index of each vertex drawn, `members` the vertices
 * drawn of each part, and `rigid` the parts that keep their shape. */
function sortInside(inside, corners) {
  const { vertices: n, of, places } = inside;
  const large = new Set(inside.anatomy);
  const isLarge = (vertex) => Number(large.has(of[vertex]));
  const order = drawnOrder(inside, corners, isLarge);
  const rank = new Uint32Array(n);
  order.forEach((from, to) => {
    rank[from] = to;
  });
  inside.order = order;
  inside.reference = new Float32Array(4 * n); // reference position, mm, and lung
  inside.part = new Float32Array(n);
  inside.members = inside.names.map(() => []); // vertices of each part
  order.forEach((from, to) => {
    inside.reference.set([...places.subarray(3 * from, 3 * from + 3), lungOf(inside, from)], 4 * to);
    inside.part[to] = of[from];
    inside.members[of[from]].push(to);
  });
  inside.rigid = inside.rigidRanges.filter((_, i) => i % 2 === 0).map((vertex) => of[vertex]);
  const meshOf = (part) => {
    const own = [];
    for (let t = 0; t < corners.length; t += 3) {
      if (part === null ? !isLarge(corners[t]) : of[corners[t]] === part) own.push(...corners.subarray(t, t + 3));
    }
    return own.map((corner) => rank[corner]);
  };
  const meshes = [null, ...inside.anatomy].map(meshOf); // of all targets, then of each structure that is anatomy
  inside.corners = Uint32Array.from(meshes.flat());
  inside.targetCorners = meshes[0].length;
  const begin = (i) => meshes.slice(0, i + 1).reduce((sum, { length }) => sum + length, 0);
  inside.shells = inside.anatomy.map((part, i) => ({
    part,
    colour: i % ANATOMY_COLOURS.length,
    begin: begin(i),
    count: meshes[i + 1].length,
  }));
  inside.shells = inside.shells.filter(({ count }) => count > 0);
  inside.normals = normalsOf(inside);
}

/** Return the unit normals of the meshes' vertices before deformation; 0 for points. */
function normalsOf({ reference, vertices, corners }) {
  const normals = new Float32Array(3 * vertices);
  const at = (v) => [...reference.subarray(4 * v, 4 * v + 3)];
  for (let t = 0; t < corners.length; t += 3) {
    const [a, b, c] = [at(corners[t]), at(corners[t + 1]), at(corners[t + 2])];
    const n = cross(
      b.map((x, i) => x - a[i]),
      c.map((x, i) => x - a[i]),
    );
    for (let j = 0; j < 3; ++j) for (let i = 0; i < 3; ++i) normals[3 * corners[t + j] + i] += n[i];
  }
  for (let i = 0; i < normals.length; i += 3) {
    const size = Math.hypot(normals[i], normals[i + 1], normals[i + 2]) || 1;
    for (let j = 0; j < 3; ++j) normals[i + j] /= size;
  }
  return normals;
}

/** Return the position of a vertex drawn at a moment, mm. */
function insidePlace({ library, order }, moment, vertex) {
  const places = placesIn(library, moment);
  return [...places.subarray(3 * order[vertex], 3 * order[vertex] + 3)];
}

/** Return the positions of a part's vertices at a moment, mm. */
const insidePlaces = (inside, moment, part) =>
  inside.members[part].map((vertex) => insidePlace(inside, moment, vertex));

/** Return the CSS colour of a part that is anatomy; undefined for a target. */
const anatomyColour = ({ anatomy }, part) =>
  anatomy.includes(part) ? ANATOMY_COLOURS[anatomy.indexOf(part) % ANATOMY_COLOURS.length] : undefined;

/** Return the positions of all vertices of anatomy, mm, in the state `moment` of the lungs; 0 for those of targets. */
function anatomyPlaces(inside, moment) {
  const places = new Float32Array(3 * inside.vertices);
  for (const { part } of inside.shells)
    insidePlaces(inside, moment, part).forEach((place, i) => places.set(place, 3 * inside.members[part][i]));
  return places;
}

/** Return the lines along which the meshes of anatomy cross the plane at `at` mm on an axis: for each mesh its part,
 * its colour and the result of linesAcross. `places` is the result of anatomyPlaces. */
const anatomyLines = ({ shells, corners, vertices }, places, axis, at) =>
  shells.map(({ part, colour, begin, count }) => ({
    part,
    colour: ANATOMY_COLOURS[colour],
    lines: linesAcross({ corners: corners.subarray(begin, begin + count), vertices }, places, axis, at),
  }));

/** Return the vertex of a part that is nearest to the position `place`, mm. */
function insideNearest(inside, part, moment, place) {
  let [best, least] = [inside.members[part][0], Infinity];
  insidePlaces(inside, moment, part).forEach((at, j) => {
    const far = Math.hypot(...at.map((x, i) => x - place[i]));
    if (far < least) [best, least] = [inside.members[part][j], far];
  });
  return best;
}

/** Return what the parts are: anatomy, such as lobes and airways, is called structures. */
function kindWords({ names, anatomy }) {
  if (!anatomy.length) return 'Targets';
  return anatomy.length === names.length ? 'Structures' : 'Targets and structures';
}

/** Largest number of rows in the table of parts; a search by name finds other parts. */
const ROWS_SHOWN = 200;

/** Table of the targets, the parts inside the lungs: name, distance, direction and expected error. A click on a name
 * chooses the target that the sentence is about; `choose` is called with its index. */
class TargetTable {
  constructor(inside, state, choose) {
    Object.assign(this, { inside, state, choose, rows: [], pointed: -1, moved: null });
    $('targets').hidden = false;
    for (const id of ['targets-title', 'inside-name']) write(id, kindWords(inside));
    $('inside-scroll').ariaLabel = `List of ${kindWords(inside).toLowerCase()}`;
    $('inside-find').hidden = inside.names.length <= 20;
    $('inside-find').addEventListener('input', () => this.list());
    this.list();
  }

  /** List the parts whose names contain the search text. */
  list() {
    const words = $('inside-find').value.trim().toLowerCase();
    const found = this.inside.names.flatMap((name, part) => (name.toLowerCase().includes(words) ? [part] : []));
    const { length } = this.inside.names;
    write(
      'inside-count',
      found.length === length && length <= ROWS_SHOWN
        ? ''
        : `listed: ${Math.min(found.length, ROWS_SHOWN)} of ${length}`,
    );
    this.rows = found.slice(0, ROWS_SHOWN).map((part) => this.row(part));
    $('inside-rows').replaceChildren(...this.rows.map(({ row }) => row));
    this.press();
    if (this.moved) this.show(this.moved);
  }

  row(part) {
    const [row, head, button, ...cells] = ['tr', 'th', 'button', 'td', 'td', 'td', 'td'].map((tag) =>
      document.createElement(tag),
    );
    head.scope = 'row';
    button.type = 'button';
    button.dir = 'auto';
    button.textContent = this.inside.names[part] || '(no name)';
    const colour = anatomyColour(this.inside, part);
    if (colour) button.style.setProperty('--own', colour);
    button.addEventListener('click', () => this.choose(part));
    head.append(button);
    row.append(head, ...cells);
    return { part, row, button, cells };
  }

  /** Mark the chosen target's row. */
  press() {
    for (const { part, button, row } of this.rows) {
      button.setAttribute('aria-pressed', String(this.state.chosen === part));
      row.classList.toggle('chosen', this.state.chosen === part);
      if (this.state.chosen === part) $('inside-scroll').scrollTop = row.offsetTop - $('inside-rows').offsetTop - 32;
    }
  }

  /** Write the numbers of every row; `moved` is the result of movedBetween. */
  show(moved) {
    this.moved = moved;
    for (const { part, row, cells } of this.rows) {
      const target = moved.targets[part];
      const told = isTold(target);
      const ring = ringOf(target, this.state.day);
      row.classList.toggle('untold', !told);
      const texts = [
        `${target.mm.toFixed(1)} mm`,
        moved.largest < 0.05
          ? 'the reference'
          : told
            ? wayWords(target.move, 3, moved.now.gravity)
            : withinWords(target.error),
        target.error === null ? 'unknown' : `${target.error.toFixed(1)} mm`,
        ring.error === null ? 'unknown' : `within ${ring.error.toFixed(1)}\u00a0mm, ${ring.day}`,
      ];
      cells.forEach((cell, i) => {
        if (cell.textContent !== texts[i]) cell.textContent = texts[i];
      });
    }
  }
}
