// SPDX-License-Identifier: MIT
// Draw the notes that belong to the state of the page: gravity, targets, probes, and names of two postures.

const NOTES_WIDE = 1300; // CSS pixels; on a wider picture notes grow with it
const NARROW = 520; // width of a picture with names alone, units of notes
const FEW = 6; // structures that are all named

/** Draw the name of a structure, how far it moves, and an arrow if that is seen. */
function drawName(pane, target, part, unit, size) {
  const [was, at] = [target.was, target.at].map((p) => project(pane, p, unit));
  if (!was || !at) return;
  const large = anatomyColour(inside, part);
  notes.context.strokeStyle = notes.context.fillStyle = css('--ink');
  notes.context.lineWidth = 1.5;
  if (!large && Math.hypot(at[0] - was[0], at[1] - was[1]) > 6) drawArrow(notes.context, was, at, 6);
  const moves = `${target.mm.toFixed(1)} mm${isTold(target) ? '' : `, ${withinWords(target.error)}`}`;
  const says = target.mm < 0.05 ? 'the reference' : moves;
  const colour = part === state.chosen ? '--change' : (large ?? '--ink');
  notes.name(at, [shortName(target.name), ...(size.width < NARROW ? [] : [says])], size, colour);
}

/** Draw the chosen target enlarged by a lens, and the names of others if there are few. Return the place under the
 * lens, [from the right, from the top]; null without a lens. */
function drawTargets(pane, between, unit, size) {
  const parts = between.map((_, part) => part).filter((part) => inside.members[part].length);
  const named = between.length <= FEW ? parts : parts.filter((part) => part === state.chosen);
  let below = null;
  for (const part of named.sort((a, b) => (b === state.chosen) - (a === state.chosen))) {
    const target = between[part];
    const magnified = part === state.chosen && target.mm > 0.05 && !anatomyColour(inside, part);
    if (magnified) below = notes.lens(pane, target, radii[part], originName(), unit, size);
    else drawName(pane, target, part, unit, size);
  }
  return below;
}

/** Put the switches of the day and of the doubt at the place under the lens. */
function placeSwitches(below, between, grown) {
  if (below) {
    changed('day', ringOf(between[state.chosen], state.day).day, (day) => {
      for (const input of document.getElementsByName('day')) input.checked = DAYS[input.value] === day;
    });
  }
  changed('below', below?.map((x) => `${Math.round(x * grown)}px`).join(' '), (place) => {
    $('day').hidden = !place;
    if (place || !state.turning) [$('rings').style.right, $('rings').style.top] = place?.split(' ') ?? ['', ''];
  });
}

/** Draw the notes over the picture. Their unit is a CSS pixel, times `grown` on a wide picture. */
function drawNotes() {
  const canvas = sizeOf(notes.canvas);
  const grown = Math.max(1, canvas.width / NOTES_WIDE);
  const [width, height] = [canvas.width / grown, canvas.height / grown];
  const unit = ratio() * grown;
  const pane = panes.at(-1);
  notes.context = freshContext(notes.canvas);
  notes.context.scale(grown, grown);
  notes.taken = [];
  const [x, y] = width < LENS_WIDE ? [34, height - 150] : [width - 44, height - 92]; // beside the lens's words
  notes.gravity(pane, x, y, width);
  notes.taken.push([x - 34, y - 62, x + 34, y + 44]);
  const isShown = inside && state.inside && state.moment && !state.turning;
  const between = isShown ? targetsBetween(inside, state.moment, originMoment()) : [];
  placeSwitches(drawTargets(pane, between, unit, { width, height, grown }), between, grown);
  state.probes.forEach((vertex, i) => {
    const at = project(pane, placeOf(basis, state.moment, vertex), unit);
    if (at) notes.text(`\u25cf ${i + 1}`, ...at, { font: '700 13px' });
  });
  if (state.beside)
    [state.pinnedQ, state.goal].forEach((q, i) =>
      notes.text(postureWords(gravityOf(q)), width * (0.25 + 0.5 * i), height - 16, {
        align: 'center',
        font: '600 14px',
      }),
    );
}
