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

/** Set a slider, the number beside it and its accessible text. */
function setSlider(id, value, text, digits = 0) {
  const slider = $(id);
  if (slider.written === text) return;
  const number = $(`${id}-number`);
  if (document.activeElement !== number) number.value = value.toFixed(digits);
  slider.written = text;
  slider.value = value;
  slider.setAttribute('aria-valuetext', text);
  fill(slider);
}

/** Call act(value) when a slider or the number beside it changes; the value is clamped to its range. */
function onSlider(id, act) {
  const take = (input) => {
    const value = input.valueAsNumber;
    const slider = $(id);
    if (Number.isFinite(value)) act(Math.max(Number(slider.min), Math.min(Number(slider.max), value)));
  };
  $(id).addEventListener('input', () => take($(id)));
  for (const [type, then] of [
    ['change', take],
    ['blur', () => {}],
  ]) {
    $(`${id}-number`).addEventListener(type, () => {
      $(id).written = ''; // makes setSlider replace a typed text that is not a number or is out of range
      then($(`${id}-number`));
    });
  }
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
