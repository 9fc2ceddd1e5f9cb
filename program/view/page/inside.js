// SPDX-License-Identifier: MIT
// Read and show the structures inside the lungs: named parts, which are points or meshes. A vertex is displaced along
// an axis by the sum over the modes of weight times fields[axis][vertex][mode], times a factor of its lung ("gain").

const BALL_RADIUS = 7; // radius of the ball drawn at a point, mm
const DOT_RADIUS = 1.5; // radius of the balls drawn at the points of anatomy, mm

/** Read the parts inside the lungs from the page. Sort points before meshes, so that each kind needs one draw call. */
function takeInside(basis) {
  const { inside, modes: k, placeUnit, middle } = basis;
  const { vertices: n } = inside;
  Object.assign(inside, { modes: k, order: basis.order });
  const [places, fields, of, corners] = [takeRows('inside-vertices', n, 3, placeUnit, middle), takeRows('inside-coefficients', 3 * n, k, inside.unit),
    takeTensor('inside-parts', Uint32Array), takeTriangles('inside-triangles', inside.triangles)];
  const meshed = new Uint8Array(n);
  for (const corner of corners) meshed[corner] = 1;
  of.forEach((part, i) => { meshed[i] ||= Number(inside.rigid.includes(part)); }); // as in a mesh: sorting must not split a rigid part
  const large = new Set(inside.anatomy);
  const isLarge = (vertex) => Number(large.has(of[vertex]));
  const order = Uint32Array.from({ length: n }, (_, i) => i).sort((a, b) => meshed[a] - meshed[b] || isLarge(a) - isLarge(b) || a - b);
  const rank = new Uint32Array(n);
  order.forEach((from, to) => { rank[from] = to; });
  inside.points = meshed.indexOf(1) < 0 ? n : n - meshed.reduce((sum, x) => sum + x, 0);
  inside.balls = order.subarray(0, inside.points).reduce((sum, vertex) => sum + 1 - isLarge(vertex), 0); // points of targets, which come first
  inside.reference = new Float32Array(4 * n); // reference position, mm, and lung
  inside.fields = new Float32Array(3 * k * n);
  inside.part = new Float32Array(n);
  inside.members = inside.names.map(() => []); // vertices of each part
  order.forEach((from, to) => {
    inside.reference.set([...places.subarray(3 * from, 3 * from + 3), lungOf(inside, from)], 4 * to);
    for (let first = 0; first < 3 * n; first += n) inside.fields.set(fields.subarray(k * (first + from), k * (first + from + 1)), k * (first + to));
    inside.part[to] = of[from];
    inside.members[of[from]].push(to);
  });
  const meshOf = (part) => {
    const own = [];
    for (let t = 0; t < corners.length; t += 3) if (part === null ? !isLarge(corners[t]) : of[corners[t]] === part) own.push(...corners.subarray(t, t + 3));
    return own.map((corner) => rank[corner]);
  };
  const meshes = [null, ...inside.anatomy].map(meshOf); // of all targets, then of each structure that is anatomy
  inside.corners = Uint32Array.from(meshes.flat());
  inside.targetCorners = meshes[0].length;
  inside.shells = inside.anatomy.map((part, i) => ({ part, colour: i % ANATOMY_COLOURS.length, begin: meshes.slice(0, i + 1).reduce((sum, { length }) => sum + length, 0), count: meshes[i + 1].length })).filter(({ count }) => count > 0);
  inside.normals = normalsOf(inside);
}

/** Return the unit normals of the meshes' vertices before deformation; 0 for points. */
function normalsOf({ reference, vertices, corners }) {
  const normals = new Float32Array(3 * vertices);
  const at = (v) => [...reference.subarray(4 * v, 4 * v + 3)];
  for (let t = 0; t < corners.length; t += 3) {
    const [a, b, c] = [at(corners[t]), at(corners[t + 1]), at(corners[t + 2])];
    const n = cross(b.map((x, i) => x - a[i]), c.map((x, i) => x - a[i]));
    for (let j = 0; j < 3; ++j) for (let i = 0; i < 3; ++i) normals[3 * corners[t + j] + i] += n[i];
  }
  for (let i = 0; i < normals.length; i += 3) {
    const size = Math.hypot(normals[i], normals[i + 1], normals[i + 2]) || 1;
    for (let j = 0; j < 3; ++j) normals[i + j] /= size;
  }
  return normals;
}

/** Return the position, mm, of a vertex displaced by the modes, even if its part is rigid. */
function fieldPlace(inside, moment, vertex) {
  const { reference, fields, vertices, modes: k } = inside;
  const lung = reference[4 * vertex + 3];
  const weights = weightsOf(inside, moment, lung);
  return [0, 1, 2].map((axis) => {
    let sum = 0;
    for (let m = 0, at = (axis * vertices + vertex) * k; m < k; ++m) sum += weights[m] * fields[at + m];
    return reference[4 * vertex + axis] + moment.gains[3 * lung + axis] * sum;
  });
}

/** Return the rows of the rotation that maps old to new positions of points with the least sum of squared distances.
 * `h` is the 3 x 3 sum of outer products of old and new positions, each relative to the mean position. The quaternion
 * of the rotation is the eigenvector of the largest eigenvalue of a symmetric matrix, found by power iteration as in
 * runtime/rigid.c. */
function rotationOf(h) {
  const m = [[h[0] + h[4] + h[8], h[5] - h[7], h[6] - h[2], h[1] - h[3]], [h[5] - h[7], h[0] - h[4] - h[8], h[1] + h[3], h[6] + h[2]],
    [h[6] - h[2], h[1] + h[3], h[4] - h[0] - h[8], h[5] + h[7]], [h[1] - h[3], h[6] + h[2], h[5] + h[7], h[8] - h[0] - h[4]]];
  const shift = Math.hypot(...m.flat());
  let q = [1, 0.03, 0.02, 0.01];
  for (let step = 0; step < 200 && shift > 0; ++step) {
    const next = m.map((row, a) => shift * q[a] + row.reduce((sum, x, b) => sum + x * q[b], 0));
    q = next.map((x) => x / Math.hypot(...next));
  }
  const [w, x, y, z] = q;
  return [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]];
}

/** Return the positions of a part's vertices in the state `moment` of the lungs, mm. The modes displace each vertex. A
 * rigid part instead moves by the rotation and translation that fit these displacements best. */
function insidePlaces(inside, moment, part) {
  const members = inside.members[part];
  const to = members.map((vertex) => fieldPlace(inside, moment, vertex));
  if (!inside.rigid.includes(part)) return to;
  const from = members.map((vertex) => [0, 1, 2].map((axis) => inside.reference[4 * vertex + axis]));
  const [before, after] = [from, to].map((places) => [0, 1, 2].map((axis) => places.reduce((sum, p) => sum + p[axis], 0) / places.length));
  const h = new Array(9).fill(0);
  from.forEach((p, i) => { for (let k = 0; k < 9; ++k) h[k] += (p[Math.floor(k / 3)] - before[Math.floor(k / 3)]) * (to[i][k % 3] - after[k % 3]); });
  const rotation = rotationOf(h);
  return from.map((p) => rotation.map((row, axis) => after[axis] + row.reduce((sum, x, k) => sum + x * (p[k] - before[k]), 0)));
}

/** Return the position of a vertex of a rigid or deformable part, mm. */
function insidePlace(inside, moment, vertex) {
  return inside.rigid.includes(inside.part[vertex]) ? insidePlaces(inside, moment, inside.part[vertex])[vertex - inside.members[inside.part[vertex]][0]] : fieldPlace(inside, moment, vertex);
}

/** Return the CSS colour of a part that is anatomy; undefined for a target. */
const anatomyColour = ({ anatomy }, part) => (anatomy.includes(part) ? ANATOMY_COLOURS[anatomy.indexOf(part) % ANATOMY_COLOURS.length] : undefined);

/** Return the positions of all vertices of anatomy, mm, in the state `moment` of the lungs; 0 for those of targets. */
function anatomyPlaces(inside, moment) {
  const places = new Float32Array(3 * inside.vertices);
  for (const { part } of inside.shells) insidePlaces(inside, moment, part).forEach((place, i) => places.set(place, 3 * inside.members[part][i]));
  return places;
}

/** Return the lines along which the meshes of anatomy cross the plane at `at` mm on an axis: for each mesh its colour and
 * the result of linesAcross. `places` is the result of anatomyPlaces. */
const anatomyLines = ({ shells, corners, vertices }, places, axis, at) => shells.map(({ colour, begin, count }) => (
  { colour: ANATOMY_COLOURS[colour], lines: linesAcross({ corners: corners.subarray(begin, begin + count), vertices }, places, axis, at) }));

/** Return the vertex of a part that is nearest to the position `place`, mm. */
function insideNearest(inside, part, moment, place) {
  let [best, least] = [inside.members[part][0], Infinity];
  insidePlaces(inside, moment, part).forEach((at, j) => {
    const far = Math.hypot(...at.map((x, i) => x - place[i]));
    if (far < least) [best, least] = [inside.members[part][j], far];
  });
  return best;
}

/** Largest number of rows in the table of parts; a search by name finds other parts. */
const ROWS_SHOWN = 200;

/** Table of the targets, the parts inside the lungs: name, distance, direction and expected error. A click on a name
 * chooses the target that the sentence is about; `choose` is called with its index. */
class TargetTable {
  constructor(inside, state, choose) {
    Object.assign(this, { inside, state, choose, rows: [], pointed: -1, moved: null });
    $('targets').hidden = false;
    $('inside-find').hidden = inside.names.length <= 20;
    $('inside-find').addEventListener('input', () => this.list());
    this.list();
  }

  /** List the parts whose names contain the search text. */
  list() {
    const words = $('inside-find').value.trim().toLowerCase();
    const found = this.inside.names.flatMap((name, part) => (name.toLowerCase().includes(words) ? [part] : []));
    const { length } = this.inside.names;
    write('inside-count', found.length === length && length <= ROWS_SHOWN ? '' : `listed: ${Math.min(found.length, ROWS_SHOWN)} of ${length}`);
    this.rows = found.slice(0, ROWS_SHOWN).map((part) => this.row(part));
    $('inside-rows').replaceChildren(...this.rows.map(({ row }) => row));
    this.press();
    if (this.moved) this.show(this.moved);
  }

  row(part) {
    const [row, head, button, ...cells] = ['tr', 'th', 'button', 'td', 'td', 'td'].map((tag) => document.createElement(tag));
    head.scope = 'row';
    button.type = 'button';
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
      const target = targetOf(this.inside, part, moved);
      const told = isTold(target);
      row.classList.toggle('untold', !told);
      const texts = [`${target.mm.toFixed(1)} mm`, moved.largest < 0.05 ? 'the reference' : told ? wayWords(target.move, 3, moved.now.gravity) : withinWords(target.error), target.error === null ? 'unknown' : `${target.error.toFixed(1)} mm`];
      cells.forEach((cell, i) => { if (cell.textContent !== texts[i]) cell.textContent = texts[i]; });
    }
  }
}
