// SPDX-License-Identifier: MIT
// Pointer and keyboard on the two canvases, and the panel's controls.

const $ = (id) => document.getElementById(id);

/** Calls drag(dx, dy) for one pointer, pinch(ratio) for two. */
function onDrag(element, drag, pinch) {
  const pointers = new Map();
  const spread = () => {
    const [a, b] = [...pointers.values()];
    return Math.hypot(a.x - b.x, a.y - b.y);
  };
  element.addEventListener('pointerdown', (event) => {
    if (event.button !== 0) return;
    element.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  element.addEventListener('pointermove', (event) => {
    const last = pointers.get(event.pointerId);
    if (!last) return;
    const before = pointers.size === 2 ? spread() : 0;
    const [dx, dy] = [event.clientX - last.x, event.clientY - last.y];
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (pointers.size === 1) drag(dx, dy);
    else if (pointers.size === 2 && pinch && before > 0) pinch(spread() / before);
  });
  for (const end of ['pointerup', 'pointercancel']) element.addEventListener(end, (event) => pointers.delete(event.pointerId));
  return () => pointers.size > 0;
}

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** Shows how far a slider is. */
function fill(slider) {
  slider.style.setProperty('--filled', `${(100 * (slider.value - slider.min)) / (slider.max - slider.min)}%`);
}

/** Sets a slider, and says its value as `text`. */
function setSlider(slider, value, text) {
  slider.value = value;
  slider.setAttribute('aria-valuetext', text);
  fill(slider);
}

function makePostureButtons(choose) {
  return POSTURES.map((posture, i) => {
    const button = document.createElement('button');
    button.type = 'button';
    button.dataset.posture = posture.name;
    button.title = `${posture.name} (${i + 1})`;
    const icon = document.createElement('canvas');
    icon.setAttribute('aria-hidden', 'true');
    button.append(icon, posture.label);
    button.addEventListener('click', () => choose(i));
    $('postures').append(button);
    return { button, icon, posture };
  });
}

/** The colour bar and its ticks. */
function drawLegend(kind, range, pinnedName) {
  const bytes = colourMap(kind);
  const stops = Array.from({ length: 33 }, (_, i) => `rgb(${bytes.slice(4 * Math.round((i * 255) / 32), 4 * Math.round((i * 255) / 32) + 3).join(' ')})`);
  $('colours').style.background = `linear-gradient(to right, ${stops.join(', ')})`;
  $('legend-title').textContent = kind === 'displacement' ? 'Displacement from rest' : `Difference from ${pinnedName}`;
  const count = Math.round(range.end / range.step);
  $('ticks').replaceChildren(...Array.from({ length: count + 1 }, (_, i) => {
    const tick = document.createElement('span');
    tick.style.left = `${(100 * i) / count}%`;
    tick.textContent = String(Number((i * range.step).toPrecision(4)));
    return tick;
  }));
}

/** A place in the patient in words: L 97 P 12 H -45. */
function placeText([x, y, z]) {
  const part = (v, plus, minus) => `${v >= 0 ? plus : minus} ${Math.abs(v).toFixed(0)}`;
  return `${part(x, 'L', 'R')}  ${part(y, 'P', 'A')}  ${part(z, 'H', 'F')} mm`;
}
