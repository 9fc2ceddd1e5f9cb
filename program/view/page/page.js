// SPDX-License-Identifier: MIT
// Connect the state of the page, the picture and the controls.

const CHECKBOXES = [...SHOWN, 'inside']; // ids of checkboxes; each sets the field of State with the same name
const VIEW_ANGLE = 0.5; // vertical field of view of the camera, radians
const KIND_TEXT = {
  displacement: 'Distance of each point from its position FROM.',
  difference: 'Distance of each point from its position in the other posture at the same breath.',
  expansion: 'Growth of the surface area around each point, relative to its area FROM.',
  plain: '',
};

/** Compute the bounding box and sphere of positions. */
function boundsOf(places) {
  const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
  for (const place of places) {
    for (let i = 0; i < 3; ++i) [low[i], high[i]] = [Math.min(low[i], place[i]), Math.max(high[i], place[i])];
  }
  const centre = low.map((x, i) => (x + high[i]) / 2);
  const radius = places.reduce((most, [x, y, z]) => Math.max(most, Math.hypot(x - centre[0], y - centre[1], z - centre[2])), 0);
  return { centre, low, high, half: low.map((x, i) => (high[i] - x) / 2), radius: radius || 1 };
}

const colourReader = document.createElement('canvas').getContext('2d');
/** Return red, green and blue, 0 to 1, of a CSS colour, which may be a system colour. */
const rgb = (name) => {
  colourReader.fillStyle = name;
  return [1, 3, 5].map((i) => parseInt(colourReader.fillStyle.slice(i, i + 2), 16) / 255);
};

async function start() {
  const basis = await readBasis();
  const state = new State(basis);
  takeLink(location.hash, state);
  state.measure(); // the URL may have set a larger volume, which changes the ranges of the colour bar
  const canvas = $('picture');
  let picture = pictureOn(canvas, basis);
  const notes = new Notes($('notes'));
  const { inside } = basis;
  const fromWhere = () => state.from.name.replace(/^the /, 'in the '); // for example "in the scan"
  const restOrScan = basis.hasRest ? 'rest' : 'the scan';
  const redraw = () => { unseen = true; };
  const tangent = Math.tan(VIEW_ANGLE / 2);
  let stale = true;     // whether the vertices are out of date
  let unseen = true;    // whether the picture is out of date: the next frame draws it
  let pointer = null;   // position of the pointer on the canvas, CSS pixels
  let asked = true;     // whether a lookup of the point under the pointer began since the pointer or the picture changed
  let wanted = null;    // {at, then}: position of a click, CSS pixels, and the callback for the point found there
  let question = null;  // {pane, then}: name of the pane and callback of the lookup now on the graphics card; null before any
  let before = null;    // time of the last frame, ms; null if the last frame was not drawn
  let streak = 0;       // number of frames drawn without a pause
  let frameTime = NaN;  // smoothed time between frames, ms
  let idle = null;      // timer that writes the view to the URL
  let panes = [];
  const radii = inside?.members.map((members, part) => { // RMS distance of a target's vertices from their mean, mm
    const places = members.map((v) => [...inside.reference.subarray(4 * v, 4 * v + 3)]);
    const { centre } = boundsOf(places);
    return members.length === 1 ? BALL_RADIUS : Math.sqrt(places.reduce((sum, p) => sum + p.reduce((square, x, i) => square + (x - centre[i]) ** 2, 0), 0) / members.length);
  });

  const ratio = () => canvas.width / Math.max(1, sizeOf(canvas).width);
  const blend = () => state.roomBlend * state.roomBlend * (3 - 2 * state.roomBlend);
  const modelTurn = (q = state.q) => slerp(IDENTITY, q, blend());
  const cameraTurn = () => compose(turn([1, 0, 0], state.camera.elevation - RIGHT_ANGLE), turn([0, 0, 1], state.camera.azimuth));
  const isDark = () => document.documentElement.dataset.theme === 'dark';

  const distanceNow = (aspect) => (state.body.radius * 1.6 * Math.max(1, 0.8 / aspect)) / Math.sin(VIEW_ANGLE / 2) / state.camera.zoom;

  function makePane(name, moment, q, box) {
    const aspect = box[2] / box[3];
    const distance = distanceNow(aspect);
    const { pan } = state.camera;
    const { body: { centre, radius, low, high } } = state;
    const pivot = state.camera.pivot ?? centre;
    const toRoom = compose(cameraTurn(), modelTurn(q));
    const away = rotate(toRoom, pivot);
    const offset = [pan[0] - away[0], pan[1] - away[1] + 0.1 * radius * blend(), -away[2] - distance]; // 0.1: raises the lungs, to show the table
    const { gravity } = moment;
    const reach = 4 * radius + Math.hypot(...pivot.map((x, i) => x - centre[i]));
    const { axis, at } = state.cut;
    const kind = KINDS[state.kind];
    const tableToEye = tableOf(gravity, toRoom, offset, Math.min(2.3 * radius, 0.85 * tangent * aspect * (distance * state.camera.zoom - 0.5 * radius)));
    const { torso } = basis;
    return {
      name, distance, state: name, origin: state.kind === 'difference' ? 'pinned' : 'from', box, canvasHeight: canvas.height,
      toEye: rigid(toRoom, offset), turn: toRoom, projection: perspective(VIEW_ANGLE, aspect, Math.max(distance - reach, distance * 0.02), distance + reach),
      gravity, measure: kind.measure, map: kind.map, plain: state.kind === 'plain', range: state.range, fade: [-3.6, -1.2].map((z) => torso.centre[2] + z * torso.half[2]),
      pixel: (2 * tangent * distance * ratio()) / box[3], inside: state.inside, chosen: state.chosen, targetTints: [...['accent', 'change'].map((tint) => themes.stage[tint]), ...ANATOMY_COLOURS].map(rgb), contours: state.contours && state.kind !== 'plain',
      dark: rgb(themes.stage.back)[1] < 0.5, ink: [...rgb(themes.stage.ink), 1], radius, rise: riseOf(gravity),
      opacity: state.opacity, wires: state.wires, ghost: state.ghost, arrows: state.arrows,
      tableToEye, tableTint: [...rgb(themes.stage.table), 0.3],
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
    const at = rotate(toRoom, centre.map((c, i) => c + down[i] * far)).map((x, i) => x + offset[i]);
    const columns = [cross(down, [0, 0, 1]).map((x) => wide * x), [0, 0, length], down.map((x) => 0.12 * radius * x)].map((v) => rotate(toRoom, v));
    return new Float32Array([...columns[0], 0, ...columns[1], 0, ...columns[2], 0, ...at, 1]);
  }

  function makePanes() {
    const [w, h] = [canvas.width, canvas.height];
    if (!state.beside) return [makePane('now', state.moment, state.q, [0, 0, w, h])];
    const half = Math.floor(w / 2);
    return [makePane('pinned', state.pinned, state.pinnedQ, [0, 0, half, h]), makePane('now', state.moment, state.q, [half, 0, w - half, h])];
  }

  /** Return the pane (the view of one state) at a position on the canvas, CSS pixels, and the coordinates x and y of
   * the position in the pane, -1 to 1. */
  function paneAt({ x, y }) {
    const [px, py] = [x * ratio(), canvas.height - y * ratio()];
    const pane = panes.find(({ box }) => px >= box[0] && px < box[0] + box[2]) ?? panes[0];
    return { pane, x: (2 * (px - pane.box[0])) / pane.box[2] - 1, y: (2 * (py - pane.box[1])) / pane.box[3] - 1 };
  }

  /** Show the point under the pointer if the graphics card has found it. Request it again if the picture or the pointer
   * has changed since the last request. */
  function point() {
    const found = picture.picked();
    if (found) found.pane = question.pane;
    if (found !== undefined) question.then?.(found);
    if (!pointer) showPointed(null);
    else if (found !== undefined) showPointed(found);
    const at = wanted?.at ?? (asked ? null : pointer);
    if (at && panes.length && !picture.picking) {
      const { pane, x, y } = paneAt(at);
      picture.pick(pane, x, y);
      question = { pane: pane.name, then: wanted?.then };
      asked = !wanted;
      wanted = null;
    }
  }

  const valueText = (value) => `${value.toFixed(KINDS[state.kind].unit === 'mm' ? 2 : 1)} ${KINDS[state.kind].unit}`.replace('-', '\u2212');

  function showPointed(found) {
    const tip = $('pointed');
    tip.hidden = $('needle').hidden = !found;
    if (!found) return;
    const { range } = state;
    if (found.part === undefined) {
      tip.firstChild.textContent = valueText(found.value);
      tip.lastChild.textContent = `${basis.lungNames[found.lung]}   ${placeText(found.at)}`;
    } else {
      Object.assign(found, insideAt(found));
      tip.firstChild.textContent = `${inside.names[found.part]}  moved ${found.displacement.toFixed(2)} mm`;
      tip.lastChild.textContent = placeText(found.place);
    }
    const [x, y] = [Math.max(4, Math.min(pointer.x + 16, canvas.clientWidth - tip.offsetWidth - 8)), Math.max(8, pointer.y - tip.offsetHeight - 10)];
    tip.style.transform = `translate(${x}px, ${y}px)`;
    if (!Number.isFinite(found.value)) $('needle').hidden = true;
    $('needle').style.left = `${100 * Math.min(1, Math.max(0, (found.value - range.begin) / (range.end - range.begin)))}%`;
  }

  /** Return the state from which displacements are measured. */
  const originMoment = () => (state.kind === 'difference' ? state.pinned : state.from);
  const originName = () => (state.kind === 'difference' ? postureWords(gravityOf(state.pinnedQ)) : state.from.name);
  /** Return the value that the colour at a marked vertex shows; null if it has none. */
  function probeValue(vertex) {
    if (state.kind === 'expansion') return null;
    const [at, from] = [state.moment, originMoment()].map((moment) => placeOf(basis, moment, vertex));
    return Math.hypot(...at.map((x, i) => x - from[i]));
  }

  function showProbes() {
    const list = $('probes');
    while (list.children.length > state.probes.length) list.lastChild.remove();
    while (list.children.length < state.probes.length) {
      const item = document.createElement('li');
      const button = document.createElement('button');
      const number = list.children.length;
      button.type = 'button';
      button.className = 'quiet';
      button.textContent = 'Remove';
      button.setAttribute('aria-label', `Remove probe ${number + 1}`);
      button.addEventListener('click', () => { state.probes.splice(number, 1); redraw(); });
      item.append(document.createElement('span'), button);
      list.append(item);
    }
    state.probes.forEach((vertex, i) => {
      const value = probeValue(vertex);
      const text = `${i + 1}  ${basis.lungNames[lungOf(basis, vertex)]}${value === null ? '' : `  ${valueText(value)}`}  ${placeText(placeOf(basis, state.moment, vertex))}`;
      const line = list.children[i].firstChild;
      if (line.textContent !== text) line.textContent = text;
    });
    const between = () => {
      const places = (moment) => state.probes.slice(-2).map((vertex) => placeOf(basis, moment, vertex));
      const apart = ([a, b]) => Math.hypot(...a.map((x, i) => x - b[i]));
      const n = state.probes.length;
      return `${n - 1} to ${n}: ${apart(places(state.moment)).toFixed(1)} mm; ${fromWhere()} ${apart(places(state.from)).toFixed(1)} mm`;
    };
    write('probes-text', state.probes.length === 0 ? 'Click or tap the lungs to place a probe. Two probes measure the distance between them.' : state.probes.length === 1 ? 'Place a second probe to measure the distance.' : between());
    $('probes-clear').hidden = state.probes.length === 0;
  }

  const choose = (part) => {
    state.chosen = part;
    state.picked = true;
    table.press();
    told = null;
    redraw();
  };
  const table = inside && new TargetTable(inside, state, choose);

  /** Return the position and displacement, mm, of the vertex nearest to the position `at` in a part inside the lungs. */
  function insideAt({ part, at, pane }) {
    const moment = pane === 'pinned' ? state.pinned : state.moment;
    const vertex = insideNearest(inside, part, moment, at);
    const [place, from] = [insidePlace(inside, moment, vertex), insidePlace(inside, originMoment(), vertex)];
    return { place, displacement: Math.hypot(...place.map((x, i) => x - from[i])) };
  }

  /** Draw the notes over the picture. */
  function drawNotes() {
    const { width, height } = sizeOf(notes.canvas);
    const pane = panes.at(-1);
    notes.context = freshContext(notes.canvas);
    notes.taken = [];
    const small = width < 520;
    const [x, y] = [small ? 34 : width - 44, height - (small ? 100 : 92)];
    notes.gravity(pane, x, y);
    notes.taken.push([x - 34, y - 62, x + 34, y + 44]);
    if (inside && state.inside && state.moment && !state.turning) {
      const between = targetsBetween(inside, state.moment, originMoment());
      const few = inside.names.length <= 6;
      for (const part of inside.names.map((_, i) => i).sort((a, b) => (b === state.chosen) - (a === state.chosen))) {
        if (!few && part !== state.chosen) break;
        if (!inside.members[part].length) continue;
        const target = between[part];
        const large = anatomyColour(inside, part);
        if (part === state.chosen && target.mm > 0.05 && !large) notes.lens(pane, target, radii[part], originName(), ratio(), { width, height });
        else {
          const [was, at] = [target.was, target.at].map((p) => project(pane, p, ratio()));
          if (!was || !at) continue;
          notes.context.strokeStyle = notes.context.fillStyle = css('--ink');
          notes.context.lineWidth = 1.5;
          if (!large && Math.hypot(at[0] - was[0], at[1] - was[1]) > 6) drawArrow(notes.context, was, at, 6);
          const moves = `${target.mm.toFixed(1)} mm${isTold(target) ? '' : `, ${withinWords(target.error)}`}`;
          const says = target.mm < 0.05 ? 'the reference' : moves;
          notes.name(at, [shortName(target.name), ...(small ? [] : [says])], { width, height }, large ?? '--ink');
        }
      }
    }
    state.probes.forEach((vertex, i) => {
      const at = project(pane, placeOf(basis, state.moment, vertex), ratio());
      if (at) notes.text(`\u25cf ${i + 1}`, ...at, { font: '700 13px' });
    });
    if (state.beside) [state.pinnedQ, state.goal].forEach((q, i) => notes.text(postureWords(gravityOf(q)), width * (0.25 + 0.5 * i), height - 16, { align: 'center', font: '600 14px' }));
  }

  /** Request the point at a position on the canvas, CSS pixels; `then` receives the result of Picture.picked(). */
  function ask(at, then) {
    pointer = at;
    wanted = { at, then };
  }

  function addProbe(found) {
    if (found?.part !== undefined) choose(found.part);
    if (!found || found.part !== undefined || state.probes.length === 8) return;
    const moment = found.pane === 'pinned' ? state.pinned : state.moment;
    state.probes.push(nearestVertex(basis, picture.read(moment)[0], found.at));
    redraw();
  }

  const buttons = makePostureButtons((i) => {
    state.settle(POSTURES[i].q, POSTURES[i].tilt, 0.7);
    touch();
  });

  const amount = (value) => `${value.toFixed(0)} mL`;

  const holds = new Holds($('holds'), basis);
  const outlines = new Outlines($('outlines'), basis, state, () => { told = null; redraw(); });

  /** Return the height of the centre of each lung, mm, measured opposite to gravity. */
  const lungHeights = (gravity) => basis.lungBoxes.map(({ centre }) => -dot(gravity, centre));

  let told = null; // {gravity, depth, from, chosen}: what the texts describe; null makes them be written again
  let since = 0;   // time when what the texts should describe last changed, ms
  let next = null; // what the texts should describe
  const alike = (a, b) => a && b && a.depth === b.depth && a.from === b.from && a.chosen === b.chosen && dot(a.gravity, b.gravity) > Math.cos(0.03);

  /** Once the posture has settled, write the texts, bars, cards and outlines that describe the lungs. During a breath,
   * and while a tracker moves the patient, they describe the end of an expiration. */
  function tellSettled(now) {
    const depth = state.playing || state.live ? state.expired : state.depth;
    const wish = { gravity: state.gravity, depth, from: state.from, chosen: state.chosen };
    if (!alike(wish, next)) [next, since] = [wish, now];
    if (alike(wish, told) || state.turning || now - since < (state.live ? 700 : 0)) return;
    told = wish;
    const moment = momentFor(basis, state.gravity, depth);
    if (moment.folds) return;
    const moved = movedBetween(basis, moment, state.from);
    if (inside && !state.picked) {
      told.chosen = next.chosen = state.chosen = firstTarget(inside, moved);
      table.press();
    }
    const target = inside ? moved.targets[state.chosen] : null;
    const above = Math.round(moment.above) ? `${amount(Math.abs(moment.above))} ${moment.above < 0 ? 'below' : 'above'} ${restOrScan}` : '';
    const sentence = sentenceOf(basis, moved, target, state.gravity, above);
    writeSentence($('finding'), sentence);
    write('meaning', sentence.meaning);
    write('surface-text', moved.largest < 0.05 ? `This is ${state.from.name}.` : `${moved.mean.toFixed(1)} mm on average from ${state.from.name}, 95 % within ${moved.p95.toFixed(1)}, at most ${moved.largest.toFixed(1)}${moved.error === null ? '' : `; expected error ${moved.error.toFixed(1)} mm`}.`);
    table?.show(moved);
    write('targets-title', `Targets, ${whereWords(state.gravity).replace(/^./, (c) => c.toLowerCase())}`);
    tellVolumes(moment, moved);
    outlines.show(moment, state.from, target, inside && anatomyColour(inside, state.chosen) ? 0 : radii?.[state.chosen]);
    write('outlines-title', target && !state.slices ? `Outlines through ${target.name}` : 'Outlines');
    write('outlines-text', `Dashed: ${state.from.name}. Solid: ${postureWords(state.gravity)}${above && `, ${above}`}. Drag to move a slice.`);
    for (const { posture, answer } of buttons) {
      const there = momentFor(basis, gravityOf(tilted(posture.q, posture.tilt)), depth);
      const far = there.folds ? null : movedBetween(basis, there, state.from);
      answer.textContent = far ? answerOf(far, inside ? far.targets[state.chosen] : null) : 'out of reach';
      answer.classList.toggle('told', !/error|reach|reference/.test(answer.textContent));
    }
    redraw();
  }

  function tellVolumes(moment, { from }) {
    $('holds-section').hidden = !moment.held;
    if (!moment.held) return;
    const measured = told.depth === 0 && from.name === 'supine at rest' ? PUBLISHED[postureText(state.gravity)] : undefined;
    holds.show(basis, moment.held, told.depth, from.held, lungHeights(state.gravity));
    write('holds-source', basis.facts.filter(({ name, source }) => source === 'collapsed' || name.startsWith('volume at rest')).map(({ source, origin }) => `${source} ${origin}`).join('; '));
    write('holds-text', `Tick: ${from.name}. Dot: now.${basis.metadata.resting_spread ? ' Band: one SD between people.' : ''}${measured ? ` Published change: ${measured}.` : ''}`);
  }

  const limitWords = ([low, high]) => `${restOrScan} ${[low, high].map((ml) => `${ml < 0 ? '\u2212' : '+'}${Math.abs(ml).toFixed(0)}`).join(' to ')} mL`;

  const volumeWords = () => `${amount(state.tidal)}, ${state.rate} a minute${Math.round(state.depth) ? `; now ${restOrScan} ${state.depth < 0 ? '\u2212' : '+'} ${amount(Math.abs(state.depth))}` : ''}`;

  const last = {};
  /** Call act(value) if `value` has changed since the last call for the same name `what`. `last` stores the values,
   * because reading them from the page is slower. */
  const changed = (what, value, act) => {
    if (last[what] === value) return;
    last[what] = value;
    act(value);
  };

  function showState() {
    const gravity = state.gravity;
    const name = postureText(gravityOf(state.goal));
    changed('posture', name, () => {
      if (document.activeElement !== $('posture-name')) $('posture-name').value = name;
    });
    changed('pressed', buttons.findIndex(({ posture }) => posture.name === name), (pressed) => {
      buttons.forEach(({ button }, i) => button.setAttribute('aria-pressed', String(i === pressed)));
      if (pressed >= 0) $('postures').scrollLeft = buttons[pressed].button.offsetLeft - $('postures').offsetLeft - 104; // where the cards are in one row that scrolls
    });
    write('gravity', `gravity  L ${gravity[0].toFixed(2)}  P ${gravity[1].toFixed(2)}  H ${gravity[2].toFixed(2)}`.replaceAll('-', '\u2212').replaceAll('\u22120.00', '0.00'));
    setSlider('tilt', state.standing.tilt, `${state.standing.tilt} degrees`);
    setSlider('depth', state.depth, amount(state.depth), 0);
    write('depth-value', volumeWords());
    setSlider('tidal', state.tidal, amount(state.tidal), 0);
    setSlider('rate', state.rate, `${state.rate} per minute`);
    changed('playing', state.playing, () => {
      $('play').setAttribute('aria-pressed', String(state.playing));
      $('play').setAttribute('aria-label', state.playing ? 'Pause the breath' : 'Play the breath');
    });
    const held = state.moment?.held?.map((ml, lung) => `${basis.lungNames[lung]} ${ml.toFixed(0)} mL`).join('   ');
    write('held', `${held} (gas and tissue)`);
    const eye = compose(cameraTurn(), modelTurn());
    changed('patient', [...eye, isDark()].join(), () => onStage(() => drawSilhouette($('patient'), eye)));
    const [side, share] = Object.entries(ENDS).map(([letter, end]) => [letter, rotate(eye, end)[2]]).sort((a, b) => b[1] - a[1])[0];
    write('seen', share > 0.8 ? `seen ${VIEWS[side].toLowerCase()}` : '');
  }

  function legendTitle() {
    const { name } = state.from;
    return { plain: '', displacement: `Displacement from ${name}`, difference: `Difference from ${postureWords(gravityOf(state.pinnedQ))}`, expansion: `Growth of area from ${name}` }[state.kind];
  }

  function showLegend() {
    drawLegend(state.kind, state.range, legendTitle(), basis.colours[KINDS[state.kind].map]);
    write('kind-text', KIND_TEXT[state.kind].replace('FROM', fromWhere()));
    write('pinned', `other posture: ${postureWords(gravityOf(state.pinnedQ))}`);
    for (const input of document.getElementsByName('kind')) input.checked = input.value === state.kind;
    for (const input of document.getElementsByName('frame')) input.checked = (input.value === 'room') === state.room;
    for (const id of CHECKBOXES) $(id).checked = state[id];
    $('coloured').checked = state.kind !== 'plain';
    for (const input of document.getElementsByName('since')) input.checked = Number(input.value) === basis.froms.indexOf(state.from);
    state.opacity.forEach((opacity, lung) => { for (const input of document.getElementsByName(`lung-${lung}`)) input.checked = Number(input.value) === opacity; });
    $('cut-axis').value = String(state.cut.axis);
    $('cut').disabled = state.cut.axis < 0;
    $('cut').value = state.cut.at;
    fill($('cut'));
  }

  function showTheme() {
    $('theme').textContent = isDark() ? 'Light' : 'Dark';
    readTheme();
    for (const { icon, posture } of buttons) drawSilhouette(icon, compose(turn([1, 0, 0], -RIGHT_ANGLE), tilted(posture.q, posture.tilt)));
    told = null; // outlines are drawn in the colours of the theme
  }

  const touch = () => { stale = unseen = true; };

  function frame(now) {
    requestAnimationFrame(frame);
    if (!picture || inHeadset) return;
    point();
    const moving = state.advance(before === null ? 0 : (now - before) / 1000);
    if (moving) stale = unseen = true;
    if (!unseen) {
      if (state.moment) tellSettled(now);
      before = null;
      streak = 0;
      return;
    }
    streak += 1;
    if (streak > 3) frameTime = streak === 4 ? now - before : 0.9 * frameTime + 0.1 * (now - before);
    before = now;
    if (stale) {
      const good = state.compute();
      const { limited } = state.moment ?? {};
      $('message').hidden = good && !limited;
      if (good && limited) {
        $('message').className = 'plate';
        $('message').textContent = `In this posture ${limitWords(limited)} was simulated: the nearest volume is shown.`;
      }
      if (!good) {
        $('message').className = 'trouble plate';
        $('message').textContent = `No breath of ${amount(state.depth)} in this posture: ${state.trouble}.`;
      }
      deform();
    }
    if (state.moment) draw();
    if (state.moment && (state.playing || state.live)) tellSettled(now);
    asked = false;
    showState();
    stale = unseen = false;
    const gpu = Number.isNaN(picture.gpuTime) ? '' : `, drawing ${picture.gpuTime.toFixed(1)} ms`;
    if (!Number.isNaN(frameTime)) {
      $('frame-time').hidden = false;
      write('frame-time', `frame ${frameTime.toFixed(1)} ms${gpu}`);
    }
    clearTimeout(idle);
    idle = setTimeout(keepLink, 400);
  }

  let kept = null; // the Picture or Poster that stores the lungs in the state `from`
  function deform() {
    if (!state.moment) return;
    if (kept !== picture) {
      picture.deform('from', state.from);
      kept = picture;
    }
    picture.deform('now', state.moment);
    if (state.kind === 'difference' || state.beside) picture.deform('pinned', state.pinned);
  }

  function draw() {
    panes = makePanes();
    picture.draw(panes);
    onStage(drawNotes);
    if (state.probes.length || $('probes').children.length || !$('probes-text').textContent) showProbes();
  }

  let inHeadset = false;
  /** Advance the state to the time `now`, ms, and return the view of the lungs (pane) for a headset; null before the
   * first state is computed. */
  function headsetFrame(now) {
    if (state.advance(inHeadset && before !== null ? (now - before) / 1000 : 0) || stale || !inHeadset || dot(state.gravity, state.moment.gravity) < 1 - 1e-9) {
      state.compute();
      deform();
      showState();
    }
    if (state.moment) tellSettled(now);
    inHeadset = true;
    before = now;
    stale = false;
    return state.moment && picture ? makePane('now', state.moment, state.q, [0, 0, 1, 1]) : null;
  }
  const headset = {
    getPicture: () => picture, frame: headsetFrame, sentence: () => $('finding').textContent,
    over: () => { inHeadset = false; before = null; touch(); },
  };
  offerXr('immersive-vr', $('vr'), state, headset);
  offerXr('immersive-ar', $('ar'), state, headset);

  function keepLink() {
    try {
      history.replaceState(null, '', `#${linkOf(state)}`);
    } catch {
      // Some browsers refuse to change the URL of a page that was opened from a file.
    }
  }

  /** Turn the camera about the lungs by angles, radians. */
  const orbit = (dx, dy) => {
    state.camera.azimuth += dx;
    state.camera.elevation = Math.max(-RIGHT_ANGLE, Math.min(RIGHT_ANGLE, state.camera.elevation + dy));
    redraw();
  };
  const boxSize = () => ({ width: sizeOf(canvas).width / (state.beside ? 2 : 1), height: sizeOf(canvas).height });
  /** Shift the picture by distances in CSS pixels. */
  const shift = (dx, dy) => {
    const { width, height } = boxSize();
    const mm = (2 * tangent * distanceNow(width / height)) / height;
    state.camera.pan = [state.camera.pan[0] + dx * mm, state.camera.pan[1] - dy * mm];
    redraw();
  };
  /** Zoom by a ratio, towards the position `at` on the canvas, CSS pixels. A point that is seen there, as far away as
   * the camera's pivot, does not move on the canvas. */
  const zoom = (ratioOfSizes, at) => {
    const { width, height } = boxSize();
    const aspect = width / height;
    const first = distanceNow(aspect);
    state.camera.zoom = Math.max(0.4, Math.min(20, state.camera.zoom * ratioOfSizes));
    const grown = distanceNow(aspect) - first;
    if (at && panes.length) {
      const { x, y } = paneAt(at);
      state.camera.pan = [state.camera.pan[0] + x * tangent * aspect * grown, state.camera.pan[1] + y * tangent * grown];
    }
    redraw();
  };
  const within = (x, y) => {
    const box = canvas.getBoundingClientRect();
    return { x: x - box.left, y: y - box.top };
  };
  const dragging = onDrag(canvas, (dx, dy, moves) => (moves ? shift(dx, dy) : orbit(dx * 0.008, dy * 0.008)),
    (size, dx, dy, x, y) => { shift(dx, dy); zoom(size, within(x, y)); },
    (event) => {
      const at = within(event.clientX, event.clientY);
      if (event.detail < 2) ask(at, addProbe);
    });
  canvas.addEventListener('dblclick', (event) => ask(within(event.clientX, event.clientY), (found) => {
    if (!found) return;
    if (found.part === undefined) state.probes.pop(); // the probe that the first click placed
    else choose(found.part);
    state.camera.pivot = found.at;
    state.camera.pan = [0, 0];
    redraw();
  }));
  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    zoom(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0015)), within(event.clientX, event.clientY));
  }, { passive: false });
  for (const type of ['pointermove', 'pointerdown']) {
    canvas.addEventListener(type, (event) => {
      if (event.pointerType === 'touch' && type === 'pointermove') return; // on a touch screen, only a tap shows the value at a point
      pointer = dragging() ? null : { x: event.offsetX, y: event.offsetY };
      asked = false;
    });
  }
  canvas.addEventListener('pointerleave', (event) => { if (event.pointerType !== 'touch') pointer = null; });
  canvas.addEventListener('keydown', (event) => {
    const arrow = ARROWS[event.key];
    if (arrow && event.shiftKey) shift(-arrow[0] * 24, -arrow[1] * 24);
    else if (arrow) orbit(arrow[0] * 0.09, arrow[1] * 0.09);
    if (event.key === '+' || event.key === '=') zoom(1.12);
    if (event.key === '-') zoom(1 / 1.12);
    if (arrow) event.preventDefault();
  });
  const lookFrom = (letter) => {
    const [x, y, z] = rotate(modelTurn(state.goal), ENDS[letter]).map((part) => Math.round(1e9 * part) / 1e9); // direction to the viewer, in the room's axes
    Object.assign(state.camera, { azimuth: Math.atan2(0 - x, 0 - y), elevation: Math.asin(Math.max(-1, Math.min(1, z))), pan: [0, 0] });
    redraw();
  };

  /** Turn the patient (or gravity, if the view is fixed to the patient) by a drag of the silhouette, angles in
   * radians. */
  const spin = (dx, dy) => {
    const sense = state.room ? 1 : -1;
    for (const [axis, angle] of [[[0, 1, 0], dx], [[1, 0, 0], dy]]) {
      const inBody = rotate(inverse(compose(cameraTurn(), modelTurn())), axis);
      state.roll(rotate(state.q, inBody), sense * angle);
    }
    touch();
  };
  onDrag($('patient'), (dx, dy) => spin(dx / 66, dy / 66));
  $('patient').addEventListener('keydown', (event) => {
    const arrow = ARROWS[event.key];
    if (!arrow) return;
    event.preventDefault();
    const step = ((event.shiftKey ? 1 : 5) * Math.PI) / 180;
    spin(arrow[0] * step, arrow[1] * step);
  });

  /** Update the colour bar and the range of its values after a change of the volume. */
  const remeasure = () => { state.measure(); showLegend(); };
  const slide = (id, act) => onSlider(id, (value) => { act(value); touch(); });
  slide('tilt', (value) => state.settle(state.standing.q, value, 0));
  slide('depth', (value) => { state.playing = false; state.depth = value; remeasure(); });
  slide('tidal', (value) => { state.tidal = value; if (!state.playing) state.depth = state.expired + value; remeasure(); });
  slide('rate', (value) => { state.rate = value; });
  $('posture-name').addEventListener('change', () => {
    const found = postureFrom($('posture-name').value);
    $('posture-trouble').hidden = Boolean(found);
    if (!found) {
      write('posture-trouble', `No posture \u201c${$('posture-name').value}\u201d. Type supine, prone, left, right, upright, inverted, a tilt such as supine+15, a roll such as supine@30, or gravity such as 0.6:0:-0.8.`);
      return;
    }
    state.settle(found.q, found.tilt, 0.7);
    touch();
  });
  $('posture-name').addEventListener('blur', () => { last.posture = null; redraw(); }); // replaces a typed text that may be invalid
  const play = () => {
    if (!basis.breathes) return;
    state.playing = !state.playing;
    remeasure();
    const part = Math.max(0, Math.min(1, (state.depth - state.expired) / state.tidal));
    if (state.playing) state.phase = Math.acos(1 - 2 * part) / (2 * Math.PI);
    touch();
  };
  const change = (act) => () => { act(); showLegend(); touch(); };
  const pin = change(() => { state.pinnedQ = state.goal; });
  const colourBy = (kind) => change(() => state.colourBy(kind))();
  const measureFrom = (from) => change(() => {
    state.from = from;
    kept = null;
    state.measure();
  })();
  const holdStill = (room) => change(() => { state.room = room; })();
  const flip = (name) => change(() => { state[name] = !state[name]; })();
  const reset = () => { state.camera = { ...FIRST_CAMERA }; redraw(); };
  $('play').addEventListener('click', play);
  $('pin').addEventListener('click', pin);
  $('reset').addEventListener('click', reset);
  for (const id of CHECKBOXES) $(id).addEventListener('change', () => flip(id));
  $('coloured').addEventListener('change', () => colourBy($('coloured').checked ? 'displacement' : 'plain'));
  if (basis.froms.length > 1) {
    const group = document.createElement('div');
    Object.assign(group, { id: 'since', role: 'radiogroup', ariaLabel: 'Displacements are measured' });
    basis.froms.forEach((from, i) => {
      const [label, input, words] = ['label', 'input', 'span'].map((tag) => document.createElement(tag));
      Object.assign(input, { type: 'radio', name: 'since', value: i });
      words.textContent = `from ${from.name}`;
      input.addEventListener('change', () => measureFrom(from));
      label.append(input, words);
      group.prepend(label);
    });
    document.querySelector(inside ? '#targets .head' : '#surface-section .head').append(group);
  }
  for (const input of document.getElementsByName('kind')) input.addEventListener('change', () => colourBy(input.value));
  for (const input of document.getElementsByName('frame')) input.addEventListener('change', () => holdStill(input.value === 'room'));
  $('cut-axis').addEventListener('change', change(() => { state.cut.axis = Number($('cut-axis').value); }));
  $('cut').addEventListener('input', change(() => { state.cut.at = $('cut').valueAsNumber; }));
  for (const id of ['range-begin', 'range-end']) {
    $(id).addEventListener('change', change(() => {
      const [begin, end] = [$('range-begin').valueAsNumber, $('range-end').valueAsNumber];
      if (end > begin) state.ownRanges[state.kind] = { begin, end };
    }));
  }
  $('range-auto').addEventListener('click', change(() => { delete state.ownRanges[state.kind]; }));
  $('probes-clear').addEventListener('click', () => { state.probes = []; redraw(); });
  for (const [letter, name] of Object.entries(VIEWS)) {
    const button = document.createElement('button');
    button.type = 'button';
    button.textContent = letter;
    button.title = `${name} (${letter.toLowerCase()})`;
    button.setAttribute('aria-label', `${letter}: ${name.toLowerCase()}`);
    button.addEventListener('click', () => lookFrom(letter));
    $('views').append(button);
  }
  basis.lungNames.forEach((name, lung) => {
    const row = document.createElement('div');
    row.className = 'lung';
    row.append(name);
    const choice = document.createElement('div');
    choice.className = 'choice';
    choice.setAttribute('role', 'radiogroup');
    choice.setAttribute('aria-label', name);
    for (const [words, opacity] of [['Whole', 1], ['Faded', FADED], ['Hidden', 0]]) {
      const label = document.createElement('label');
      const input = document.createElement('input');
      Object.assign(input, { type: 'radio', name: `lung-${lung}`, value: opacity, checked: opacity === state.opacity[lung] });
      input.addEventListener('change', change(() => { state.opacity = state.opacity.with(lung, opacity); }));
      const text = document.createElement('span');
      text.textContent = words;
      label.append(input, text);
      choice.append(label);
    }
    row.append(choice);
    $('lungs').append(row);
  });
  $('theme').addEventListener('click', () => {
    document.documentElement.dataset.theme = isDark() ? 'light' : 'dark';
    showTheme();
    redraw();
  });
  $('full').hidden = !document.fullscreenEnabled;
  $('full').addEventListener('click', () => (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen()));
  const picturePng = () => savePicture(canvas, draw, document.title,
    [`${state.beside ? `${postureWords(gravityOf(state.pinnedQ))} and beside it ` : ''}${postureWords(gravityOf(state.goal))}, ${$('depth-value').textContent}`, 'computed, not for diagnosis'],
    state.kind === 'plain' ? null : { ...state.range, title: `${legendTitle()}, ${KINDS[state.kind].unit}` }, basis.colours[KINDS[state.kind].map]);
  $('save').addEventListener('click', async () => {
    const link = document.createElement('a');
    link.href = URL.createObjectURL(await picturePng());
    link.download = `${document.title.replace(/[^\w.-]+/g, '-')}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  });
  window.addEventListener('beforeprint', () => {
    draw();
    const paper = Object.assign(document.createElement('canvas'), { width: canvas.width, height: canvas.height });
    const context = paper.getContext('2d');
    context.fillStyle = themes.stage.back;
    context.fillRect(0, 0, paper.width, paper.height);
    for (const layer of [canvas, $('notes')]) context.drawImage(layer, 0, 0, paper.width, paper.height);
    $('stage').style.backgroundImage = `url(${paper.toDataURL()})`;
  });
  window.addEventListener('afterprint', () => { $('stage').style.backgroundImage = ''; });
  $('link').addEventListener('click', async () => {
    keepLink();
    try {
      await navigator.clipboard.writeText(location.href);
      write('link', 'Copied');
    } catch {
      write('link', 'See the address bar');
    }
    setTimeout(() => write('link', 'Copy link'), 2000);
  });
  window.addEventListener('hashchange', () => {
    takeLink(location.hash, state);
    table?.press();
    told = null;
    remeasure();
    touch();
  });
  canvas.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const posture = POSTURES[Number(event.key) - 1];
    const kinds = Object.keys(KINDS);
    const keys = {
      n: pin, c: () => colourBy(kinds[(kinds.indexOf(state.kind) + 1) % kinds.length]), g: () => flip('ghost'), w: () => flip('wires'),
      b: () => flip('beside'), s: () => holdStill(!state.room), i: () => inside && flip('inside'), 0: reset,
    };
    if (posture) buttons[Number(event.key) - 1].button.click();
    else if (event.key === ' ') { event.preventDefault(); play(); }
    else if (keys[event.key]) keys[event.key]();
    else if (VIEWS[event.key.toUpperCase()] && event.key.length === 1) lookFrom(event.key.toUpperCase());
  });

  if (!basis.breathes) for (const part of document.querySelectorAll('.breath, section[aria-labelledby=breath-title]')) part.hidden = true;
  for (const [id, most] of [['depth', state.depthMax], ['tidal', state.tidalMax]]) for (const end of [id, `${id}-number`]) $(end).max = most;
  for (const end of ['depth', 'depth-number']) $(end).min = state.depthMin;
  for (const end of ['tidal', 'tidal-number']) $(end).min = $(end).step = state.tidal / 50;
  for (const end of ['depth', 'depth-number']) $(end).step = state.tidal / 100;
  for (const end of ['tidal-number', 'depth-number']) $(end).step = 'any';
  document.querySelector('[name=kind][value=expansion]').disabled = basis.words === 0;
  write('depth-name', `Above ${restOrScan}`);
  write('ghost-name', 'Ghost of the reference');
  write('patient-fit', basis.metadata.patient ? `fitted to this patient: ${basis.metadata.patient}` : '');
  write('state', basis.fields ? `another simulator\u2019s fields of gravity${basis.order > 0 ? ' and volume' : ''}, compressed: error ${errorOf(basis)}` : `at ${basis.hasRest ? 'rest, after a quiet expiration' : 'the volume of the scan'}`);
  write('caveats', basis.caveats);
  $('credit').hidden = !basis.metadata.attribution;
  write('credit', `Lungs: ${basis.metadata.attribution}`);
  $('inside').disabled = !inside;
  showFacts(basis);

  const resize = () => {
    const pixels = Math.min(2, window.devicePixelRatio || 1);
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * pixels));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * pixels));
    if (state.moment && picture && !inHeadset) draw(); // resizing clears the canvas; redraw before it is shown
    redraw();
  };
  new ResizeObserver(resize).observe(canvas);
  canvas.addEventListener('webglcontextlost', (event) => {
    event.preventDefault(); // lets the browser restore the context
    picture = null;
    tell('The browser has lost its connection to the graphics card. Reload the page if the picture does not come back.');
  });
  canvas.addEventListener('webglcontextrestored', () => {
    picture = pictureOn(canvas, basis);
    touch();
  });
  resize();
  showTheme();
  showLegend();
  requestAnimationFrame(frame);

  /* Interface for tests, benchmarks and the console. Gravity is a vector in the patient's axes (x left, y back,
   * z head); volumes are mL above rest. */
  return {
    get picture() { return picture; },
    panes: () => panes,
    /** Return the positions of the vertices, computed by the graphics card, mm LPS. */
    positions: (gravity, volume) => picture.read(momentFor(basis, unit(gravity), volume))[0],
    /** Return the unit normals of the vertices, computed by the graphics card. */
    normals: (gravity, volume) => picture.read(momentFor(basis, unit(gravity), volume))[1],
    /** Return the positions of the vertices of structures inside the lungs, computed by the graphics card, mm LPS. They
     * are in the order of basis.inside: points first, then meshes. */
    insidePositions: (gravity, volume) => picture.readInside(momentFor(basis, unit(gravity), volume)),
    moment: (gravity, volume) => momentFor(basis, unit(gravity), volume),
    /** Do the CPU part of the work of one frame. */
    frameScript: () => { state.compute(); panes = makePanes(); onStage(drawNotes); showState(); },
    sentenceOf, movedBetween, armsOf, downOf, torsoRings, planesFor, linesAcross, placesOf, rangeEnd, tickStep, postureText, postureFrom, gravityOf, picturePng, basis, state, touch,
  };
}

/** Return a Picture, or a Poster if the browser has no WebGL 2, that draws on a canvas. */
function pictureOn(canvas, basis) {
  try {
    return new Picture(canvas, basis);
  } catch (error) {
    if (canvas.getContext('2d') === null) throw error;
    return new Poster(canvas, basis);
  }
}

/** Return the error of the displacement by the modes, in words. */
const errorOf = ({ metadata, fields, order }) => metadata.error_rms_percent && `${Number(metadata.error_rms_percent).toPrecision(2)} % RMS${fields ? `, ${Number(metadata.error_max_mm).toPrecision(2)} mm at most, each direction${order > 0 ? ' and volume' : ''} from the others` : ' from the full solve, on held-out directions'}`;

function showFacts(basis) {
  const { metadata } = basis;
  const facts = [
    ['surface', `${basis.lungNames.join(' and ')}, ${basis.vertices.toLocaleString('en')} vertices${basis.wholeVertices > basis.vertices ? ` of ${basis.wholeVertices.toLocaleString('en')}` : ''}`],
    ['field', `${basis.modes} ${metadata.modes === 'harmonics' ? 'harmonics' : 'modes'} of band ${basis.band}`],
    ['error', errorOf(basis)],
    ...basis.facts.map(({ name, line }) => [name, line]), ['force', metadata.force],
    ['made by', metadata.made_by], ['credit', metadata.attribution],
  ];
  $('facts').replaceChildren(...facts.filter(([, value]) => value).flatMap(([name, value]) => {
    const [term, text] = [document.createElement('dt'), document.createElement('dd')];
    term.textContent = name;
    text.textContent = value;
    return [term, text];
  }));
}

function tell(text) {
  $('message').hidden = false;
  $('message').className = '';
  $('message').textContent = text;
}

document.documentElement.dataset.theme = matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light';
try {
  if (!MeshoptDecoder.supported) throw new Error('This browser has no WebAssembly, which reads the lungs. Open the page in another browser.');
  await MeshoptDecoder.ready;
  window.supine = await start();
} catch (error) {
  tell(error.message);
  throw error;
}
