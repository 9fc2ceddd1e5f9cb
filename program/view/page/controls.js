// SPDX-License-Identifier: MIT
// Handle mouse and touch input, and update the panel's controls and the colour bar.

const $ = (id) => document.getElementById(id);

/** Call drag(dx, dy, shifts) when one pointer moves; `shifts` is true if the shift key or another button is down.
 * Call pinch(ratio, dx, dy, x, y) when two pointers move, and tap(event) when a pointer is released where it was
 * pressed. Distances are CSS pixels. Return a function that tells whether a drag is under way. */
function onDrag(element, drag, pinch, tap) {
  const pointers = new Map();
  let far = 0; // distance that the pointers have moved since the first was pressed, CSS pixels
  const spread = () => {
    const [a, b] = [...pointers.values()];
    return { size: Math.hypot(a.x - b.x, a.y - b.y), x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 };
  };
  element.addEventListener('pointerdown', (event) => {
    element.setPointerCapture(event.pointerId);
    if (pointers.size === 0) far = 0;
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  element.addEventListener('pointermove', (event) => {
    const last = pointers.get(event.pointerId);
    if (!last) return;
    const before = pointers.size === 2 ? spread() : null;
    const [dx, dy] = [event.clientX - last.x, event.clientY - last.y];
    far += Math.abs(dx) + Math.abs(dy);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (pointers.size === 1) drag(dx, dy, event.buttons > 1 || event.shiftKey);
    else if (before && pinch && before.size > 0) {
      const after = spread();
      pinch(after.size / before.size, after.x - before.x, after.y - before.y, after.x, after.y);
    }
  });
  element.addEventListener('pointerup', (event) => {
    if (pointers.delete(event.pointerId) && pointers.size === 0 && far < 6 && event.button === 0) tap?.(event);
  });
  element.addEventListener('pointercancel', (event) => pointers.delete(event.pointerId));
  element.addEventListener('contextmenu', (event) => event.preventDefault());
  return () => pointers.size > 0 && far >= 6;
}

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** Set the style of a slider's track: its filled part ends at the thumb. */
function fill(slider) {
  slider.style.setProperty('--filled', `${(100 * (slider.value - slider.min)) / (slider.max - slider.min)}%`);
}

/** Set the text of an element if it has changed. */
function write(id, text) {
  const element = $(id);
  if (element.written === text) return; // comparing with textContent would be slower
  element.written = text;
  element.textContent = text;
}

/** Show what is wrong with the input of a field, beside it, until something else is typed; an empty text removes it. */
function complain(field, text) {
  const id = `${field.id}-trouble`;
  if (!$(id)) {
    if (!text) return;
    const note = Object.assign(document.createElement('p'), { id, className: 'trouble', role: 'alert' });
    field.closest('.slider, .row, .card').append(note);
    field.setAttribute('aria-describedby', id);
    field.addEventListener('input', () => complain(field, ''));
  }
  $(id).hidden = !text;
  field.setAttribute('aria-invalid', String(Boolean(text)));
  write(id, text);
}

/** Return the number typed in a field if `accept` returns true for it. Otherwise say that it is wrong, with `wants` and
 * the number `shown` instead, and return null. The field then has the number that is shown. */
function typedIn(field, accept, wants, shown) {
  const right = accept(field.valueAsNumber);
  complain(field, right ? '' : notTaken(field.ariaLabel, field.value, wants, shown));
  if (right) return field.valueAsNumber;
  field.value = shown;
  return null;
}

/** Sliders, with a number beside each. */
const SLIDERS = {
  tilt: {
    get: (s) => s.standing.tilt,
    set: (s, value) => s.settle(s.standing.q, value, 0),
    words: (value) => `${round(value, 1)} degrees`,
  },
  depth: {
    get: (s) => s.depth,
    set: (s, value) => Object.assign(s, { playing: false, depth: value }),
    words: (value) => amount(value),
  },
  tidal: {
    get: (s) => s.tidal,
    set: (s, value) => Object.assign(s, { tidal: value, depth: s.playing ? s.depth : s.expired + value }),
    words: (value) => amount(value),
  },
  rate: {
    get: (s) => s.rate,
    set: (s, value) => Object.assign(s, { rate: value }),
    words: (value) => `${round(value, 1)} per minute`,
  },
};

/** Show the value of a slider, in the number beside it and as accessible text too. */
function setSlider(id) {
  const { get, words } = SLIDERS[id];
  const [value, slider, number] = [get(state), $(id), $(`${id}-number`)];
  const text = words(value);
  if (slider.written === text) return;
  if (document.activeElement !== number) number.value = parseFloat(text);
  slider.written = text;
  slider.value = value;
  slider.setAttribute('aria-valuetext', text);
  fill(slider);
}

/** Follow a slider and the number beside it; call `then` after a change. */
function bindSlider(id, then) {
  const [slider, number] = [$(id), $(`${id}-number`)];
  const take = (value) => {
    SLIDERS[id].set(state, value);
    slider.written = ''; // makes setSlider replace a number that was typed otherwise
    then();
  };
  slider.addEventListener('input', () => {
    complain(number, '');
    take(slider.valueAsNumber);
  });
  number.addEventListener('change', () => {
    const limits = state.limits[id];
    const accept = (x) => Number.isFinite(limitedTo(limits, x));
    const shown = parseFloat(SLIDERS[id].words(SLIDERS[id].get(state)));
    const typed = typedIn(number, accept, rangeWords(limits), shown);
    if (typed !== null) take(limitedTo(limits, typed));
  });
  number.addEventListener('blur', () => {
    slider.written = '';
    redraw();
  });
}

function makePostureButtons(choose) {
  return POSTURES.map((posture, i) => {
    const button = document.createElement('button');
    button.type = 'button';
    button.dataset.posture = posture.name;
    button.title = `${posture.name} (${i + 1})`;
    const icon = document.createElement('canvas');
    icon.setAttribute('aria-hidden', 'true');
    const [name, answer] = ['strong', 'small'].map((tag) => document.createElement(tag));
    name.textContent = posture.label;
    button.className = 'card';
    button.append(name, icon, answer);
    button.addEventListener('click', () => choose(i));
    $('postures').append(button);
    return { button, icon, posture, answer };
  });
}

/** Show the colour bar and its ticks. An end of the bar is pointed if values lie beyond it. */
function drawLegend(kind, range, title, colours) {
  $('legend').hidden = kind === 'plain';
  $('colours').style.background = gradient(colours);
  $('colours').classList.toggle('beyond', range.beyond);
  $('colours').classList.toggle('beneath', range.beyond && range.begin < 0);
  write('legend-title', title);
  write('legend-unit', KINDS[kind].unit);
  const size = range.end - range.begin;
  const first = Math.ceil(range.begin / range.step - 1e-9);
  const count = Math.floor(range.end / range.step + 1e-9) - first;
  $('ticks').replaceChildren(
    ...Array.from({ length: count + 1 }, (_, i) => {
      const tick = document.createElement('span');
      tick.style.left = `${(100 * ((first + i) * range.step - range.begin)) / size}%`;
      tick.textContent = plain((first + i) * range.step);
      return tick;
    }),
  );
  for (const [id, value] of [
    ['range-begin', range.begin],
    ['range-end', range.end],
  ]) {
    if (document.activeElement !== $(id)) $(id).value = Number(value.toPrecision(4));
  }
  write('range-unit', KINDS[kind].unit);
}

/** Return a position in the patient, mm, as text: "L 97  P 12  F 45 mm". */
function placeText([x, y, z]) {
  const part = (v, plus, minus) => `${v >= 0 ? plus : minus} ${Math.abs(v).toFixed(0)}`;
  return `${part(x, 'L', 'R')}  ${part(y, 'P', 'A')}  ${part(z, 'H', 'F')} mm`;
}
