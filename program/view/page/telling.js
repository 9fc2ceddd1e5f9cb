// SPDX-License-Identifier: MIT
// Write the texts that describe the lungs once the posture has settled.

let holds = null; // Holds
let outlines = null; // Outlines
let radii = null; // RMS distance of each target's vertices from their mean, mm

let since = 0; // time when what the texts should describe last changed, ms
let next = null; // what the texts should describe

const alike = (a, b) =>
  a &&
  b &&
  a.depth === b.depth &&
  a.from === b.from &&
  a.chosen === b.chosen &&
  a.day === b.day &&
  dot(a.gravity, b.gravity) > Math.cos(0.03);

/** Return the height of the centre of each lung, mm, measured opposite to gravity. */
const lungHeights = (gravity) => basis.lungBoxes.map(({ centre }) => -dot(gravity, centre));

/** Once the posture has settled, write the texts, bars, cards and outlines that describe the lungs. During a breath,
 * and while a tracker moves the patient, they describe the end of an expiration. */
function tellSettled(now) {
  const depth = state.playing || state.live ? state.expired : state.depth;
  const wish = { gravity: state.gravity, depth, from: state.from, chosen: state.chosen, day: state.day };
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
  const above = Math.round(moment.above)
    ? `${amount(Math.abs(moment.above))} ${moment.above < 0 ? 'below' : 'above'} ${restOrScan()}`
    : '';
  const sentence = sentenceOf(basis, moved, target, state.gravity, above);
  writeSentence($('finding'), sentence);
  write('meaning', sentence.meaning);
  write('surface-text', surfaceWords(moved));
  table?.show(moved);
  if (inside) write('targets-title', `${kindWords(inside)}, ${postureWords(state.gravity)}`);
  tellVolumes(moment, moved);
  outlines.show(moment, state.from, target, inside && anatomyColour(inside, state.chosen) ? 0 : radii?.[state.chosen]);
  write('outlines-title', target && !state.slices ? `Outlines through ${target.name}` : 'Outlines');
  write(
    'outlines-text',
    `Dashed: ${state.from.name}. Solid: ${postureWords(state.gravity)}${above && `, ${above}`}. Drag to move a slice.`,
  );
  for (const { posture, answer } of buttons) {
    const there = momentFor(basis, gravityOf(tilted(posture.q, posture.tilt)), depth);
    const far = there.folds ? null : movedBetween(basis, there, state.from);
    answer.textContent = far ? answerOf(far, inside ? far.targets[state.chosen] : null) : 'out of reach';
    answer.classList.toggle('told', !/error|reach|reference/.test(answer.textContent));
  }
  redraw();
}

/** Return how far the surface has moved, in words. */
function surfaceWords({ mean, p95, largest, error }) {
  if (largest < 0.05) return `This is ${state.from.name}.`;
  const rounded = error < 0.05 ? 'below 0.05' : error?.toFixed(1);
  const stated = error === null ? '' : `; ${errorName(basis)} ${rounded} mm`;
  const most = `95 % within ${p95.toFixed(1)}, at most ${largest.toFixed(1)}${stated}`;
  return `${mean.toFixed(1)} mm on average from ${state.from.name}, ${most}.`;
}

function tellVolumes(moment, { from }) {
  $('holds-section').hidden = !moment.held;
  if (!moment.held) return;
  const measured =
    told.depth === 0 && from.name === 'supine at rest' ? PUBLISHED[postureText(state.gravity)] : undefined;
  holds.show(basis, moment.held, told.depth, from.held, lungHeights(state.gravity));
  const volumes = basis.library.facts.filter(
    ({ name, source }) => source === 'collapsed' || name.startsWith('volume at rest'),
  );
  write('holds-source', volumes.map(({ source, origin }) => `${source} ${origin}`).join('; '));
  const band = basis.metadata.resting_spread ? ' Band: one SD between people.' : '';
  const published = measured ? ` Published change: ${measured}.` : '';
  write('holds-text', `Tick: ${from.name}. Dot: now.${band}${published}`);
}

const limitWords = ([low, high]) =>
  `${restOrScan()} ${[low, high].map((ml) => `${ml < 0 ? '\u2212' : '+'}${Math.abs(ml).toFixed(0)}`).join(' to ')} mL`;

/** Return the breath and the volume now, in words. */
function volumeWords() {
  const breath = `${amount(state.tidal)}, ${state.rate} a minute`;
  if (!Math.round(state.depth)) return breath;
  return `${breath}; now ${restOrScan()} ${state.depth < 0 ? '\u2212' : '+'} ${amount(Math.abs(state.depth))}`;
}
