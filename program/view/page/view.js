// SPDX-License-Identifier: MIT
// Compute the views of the picture (panes): cameras, the table under the patient, and where a point on the canvas is.

const VIEW_ANGLE = 0.5; // vertical field of view of the camera, radians
const tangent = Math.tan(VIEW_ANGLE / 2);

const ratio = () => canvas.width / Math.max(1, sizeOf(canvas).width);

const blend = () => state.roomBlend * state.roomBlend * (3 - 2 * state.roomBlend);

const modelTurn = (q = state.q) => slerp(IDENTITY, q, blend());

const cameraTurn = () =>
  compose(turn([1, 0, 0], state.camera.elevation - RIGHT_ANGLE), turn([0, 0, 1], state.camera.azimuth));

const distanceNow = (aspect) =>
  (state.body.radius * 1.6 * Math.max(1, 0.8 / aspect)) / Math.sin(VIEW_ANGLE / 2) / state.camera.zoom;

function makePane(name, moment, q, box) {
  const aspect = box[2] / box[3];
  const distance = distanceNow(aspect);
  const { pan } = state.camera;
  const {
    body: { centre, radius, low, high },
  } = state;
  const pivot = state.camera.pivot ?? centre;
  const toRoom = compose(cameraTurn(), modelTurn(q));
  const away = rotate(toRoom, pivot);
  // 0.1: raises the lungs, to show the table
  const offset = [pan[0] - away[0], pan[1] - away[1] + 0.1 * radius * blend(), -away[2] - distance];
  const { gravity } = moment;
  const reach = 4 * radius + Math.hypot(...pivot.map((x, i) => x - centre[i]));
  const { axis, at } = state.cut;
  const kind = KINDS[state.kind];
  const tableToEye = tableOf(
    gravity,
    toRoom,
    offset,
    Math.min(2.3 * radius, 0.85 * tangent * aspect * (distance * state.camera.zoom - 0.5 * radius)),
  );
  const { torso } = basis;
  return {
    name,
    distance,
    state: name,
    origin: state.kind === 'difference' ? 'pinned' : 'from',
    box,
    canvasHeight: canvas.height,
    toEye: rigid(toRoom, offset),
    turn: toRoom,
    projection: perspective(VIEW_ANGLE, aspect, Math.max(distance - reach, distance * 0.02), distance + reach),
    gravity,
    measure: kind.measure,
    map: kind.map,
    plain: state.kind === 'plain',
    range: state.range,
    fade: [-3.6, -1.2].map((z) => torso.centre[2] + z * torso.half[2]),
    pixel: (2 * tangent * distance * ratio()) / box[3],
    inside: state.inside,
    chosen: state.chosen,
    targetTints: [...['accent', 'change'].map((tint) => themes.stage[tint]), ...ANATOMY_COLOURS].map(rgb),
    contours: state.contours && state.kind !== 'plain',
    dark: rgb(themes.stage.back)[1] < 0.5,
    ink: [...rgb(themes.stage.ink), 1],
    radius,
    rise: riseOf(gravity),
    opacity: state.opacity,
    wires: state.wires,
    ghost: state.ghost,
    arrows: state.arrows,
    tableToEye,
    tableTint: [...rgb(themes.stage.table), 0.3],
    cut: axis < 0 ? NO_CUT : [...[0, 1, 2].map((i) => (i === axis ? 1 : 0)), low[axis] + at * (high[axis] - low[axis])],
  };
}

/** Return the height of points above the lowest of the lungs, as a share of the lungs' height: a vector and an offset
 * (surface.frag.glsl). */
function riseOf(gravity) {
  const { centre, half } = state.body;
  const reach = gravity.reduce((sum, g, i) => sum + Math.abs(g) * half[i], 0);
  const up = gravity.map((g) => -g / (2 * reach));
  return [...up, 0.5 - dot(up, centre)];
}

/** Return the matrix from the box [-1, 1]^3 to the table under the patient's body, in camera coordinates; null if the
 * patient stands. The table tilts with the patient; `length` is half its length, mm. */
function tableOf(gravity, toRoom, offset, length) {
  const down = downOf(gravity);
  if (!down) return null;
  const { radius } = state.body;
  const { centre, half } = basis.torso;
  const wide = Math.hypot(2 * half[0] * down[1], 1.5 * half[1] * down[0]); // half the table's width, mm
  const far = reachDown(basis.torso, armsOf(basis.torso, down), down) + 0.12 * radius;
  const at = rotate(
    toRoom,
    centre.map((c, i) => c + down[i] * far),
  ).map((x, i) => x + offset[i]);
  const columns = [cross(down, [0, 0, 1]).map((x) => wide * x), [0, 0, length], down.map((x) => 0.12 * radius * x)].map(
    (v) => rotate(toRoom, v),
  );
  return new Float32Array([...columns[0], 0, ...columns[1], 0, ...columns[2], 0, ...at, 1]);
}

function makePanes() {
  const [w, h] = [canvas.width, canvas.height];
  if (!state.beside) return [makePane('now', state.moment, state.q, [0, 0, w, h])];
  const half = Math.floor(w / 2);
  return [
    makePane('pinned', state.pinned, state.pinnedQ, [0, 0, half, h]),
    makePane('now', state.moment, state.q, [half, 0, w - half, h]),
  ];
}

/** Return the pane (the view of one state) at a position on the canvas, CSS pixels, and the coordinates x and y of
 * the position in the pane, -1 to 1. */
function paneAt({ x, y }) {
  const [px, py] = [x * ratio(), canvas.height - y * ratio()];
  const pane = panes.find(({ box }) => px >= box[0] && px < box[0] + box[2]) ?? panes[0];
  return { pane, x: (2 * (px - pane.box[0])) / pane.box[2] - 1, y: (2 * (py - pane.box[1])) / pane.box[3] - 1 };
}
