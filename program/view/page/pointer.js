// SPDX-License-Identifier: MIT
// Show the point under the pointer, and turn, shift and zoom the picture by the pointer.

let pointer = null; // position of the pointer on the canvas, CSS pixels
let asked = true; // whether a lookup of the point under the pointer began since the pointer or the picture changed
let wanted = null; // {at, then}: position of a click, CSS pixels, and the callback for the point found there
// {pane, then}: name of the pane and callback of the lookup now on the graphics card; null before any
let question = null;

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
  const [x, y] = [
    Math.max(4, Math.min(pointer.x + 16, canvas.clientWidth - tip.offsetWidth - 8)),
    Math.max(8, pointer.y - tip.offsetHeight - 10),
  ];
  tip.style.transform = `translate(${x}px, ${y}px)`;
  if (!Number.isFinite(found.value)) $('needle').hidden = true;
  $('needle').style.left =
    `${100 * Math.min(1, Math.max(0, (found.value - range.begin) / (range.end - range.begin)))}%`;
}

/** Return the position and displacement, mm, of the vertex nearest to the position `at` in a part inside the lungs. */
function insideAt({ part, at, pane }) {
  const moment = pane === 'pinned' ? state.pinned : state.moment;
  const vertex = insideNearest(inside, part, moment, at);
  const [place, from] = [insidePlace(inside, moment, vertex), insidePlace(inside, originMoment(), vertex)];
  return { place, displacement: Math.hypot(...place.map((x, i) => x - from[i])) };
}

/** Request the point at a position on the canvas, CSS pixels; `then` receives the result of Picture.picked(). */
function ask(at, then) {
  pointer = at;
  wanted = { at, then };
}

function within(x, y) {
  const box = canvas.getBoundingClientRect();
  return { x: x - box.left, y: y - box.top };
}

/** Bind drags, pinches, taps, the wheel and the moving pointer. */
function bindDrags() {
  const dragging = onDrag(
    canvas,
    (dx, dy, moves) => (moves ? shift(dx, dy) : orbit(dx * 0.008, dy * 0.008)),
    (size, dx, dy, x, y) => {
      shift(dx, dy);
      zoom(size, within(x, y));
    },
    (event) => {
      const at = within(event.clientX, event.clientY);
      if (event.detail < 2) ask(at, addProbe);
    },
  );
  canvas.addEventListener(
    'wheel',
    (event) => {
      event.preventDefault();
      zoom(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0015)), within(event.clientX, event.clientY));
    },
    { passive: false },
  );
  for (const type of ['pointermove', 'pointerdown']) {
    canvas.addEventListener(type, (event) => {
      // On a touch screen, only a tap shows the value at a point
      if (event.pointerType === 'touch' && type === 'pointermove') return;
      pointer = dragging() ? null : { x: event.offsetX, y: event.offsetY };
      asked = false;
    });
  }
  canvas.addEventListener('pointerleave', (event) => {
    if (event.pointerType !== 'touch') pointer = null;
  });
}

/** Turn the view about the point of a double click. */
function bindDoubleClick() {
  canvas.addEventListener('dblclick', (event) =>
    ask(within(event.clientX, event.clientY), (found) => {
      if (!found) return;
      if (found.part === undefined)
        state.probes.pop(); // the probe that the first click placed
      else choose(found.part);
      state.camera.pivot = found.at;
      state.camera.pan = [0, 0];
      redraw();
    }),
  );
}
