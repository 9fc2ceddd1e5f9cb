// SPDX-License-Identifier: MIT
// Mark vertices (probes): list them with their values, and measure the distance between the last two.

const PROBES_MOST = 8;

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
    button.addEventListener('click', () => {
      state.probes.splice(number, 1);
      redraw();
    });
    item.append(document.createElement('span'), button);
    list.append(item);
  }
  state.probes.forEach((vertex, i) => {
    const value = probeValue(vertex);
    const place = placeText(placeOf(basis, state.moment, vertex));
    const shown = value === null ? '' : `  ${valueText(value)}`;
    const text = `${i + 1}  ${basis.lungNames[lungOf(basis, vertex)]}${shown}  ${place}`;
    const line = list.children[i].firstChild;
    if (line.textContent !== text) line.textContent = text;
  });
  const between = () => {
    const places = (moment) => state.probes.slice(-2).map((vertex) => placeOf(basis, moment, vertex));
    const apart = ([a, b]) => Math.hypot(...a.map((x, i) => x - b[i]));
    const n = state.probes.length;
    const [now, was] = [state.moment, state.from].map((moment) => apart(places(moment)).toFixed(1));
    return `${n - 1} to ${n}: ${now} mm; ${fromWhere()} ${was} mm`;
  };
  write(
    'probes-text',
    state.probes.length === 0
      ? 'Click or tap the lungs to place a probe. Two probes measure the distance between them.'
      : state.probes.length === 1
        ? 'Place a second probe to measure the distance.'
        : between(),
  );
  $('probes-clear').hidden = state.probes.length === 0;
}

function addProbe(found) {
  if (found?.part !== undefined) choose(found.part);
  if (!found || found.part !== undefined || state.probes.length === PROBES_MOST) return;
  const moment = found.pane === 'pinned' ? state.pinned : state.moment;
  state.probes.push(nearestVertex(basis, picture.read(moment)[0], found.at));
  redraw();
}
