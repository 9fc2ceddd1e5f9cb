// SPDX-License-Identifier: MIT
// Draw the notes that belong to the state of the page: gravity, targets, probes, and names of two postures.

const NOTES_WIDE = 1300; // CSS pixels; on a wider picture notes grow with it

/** Draw the notes over the picture. Their unit is a CSS pixel, times `grown` on a wide picture. */
function drawNotes() {
  const size = sizeOf(notes.canvas);
  const grown = Math.max(1, size.width / NOTES_WIDE);
  const [width, height] = [size.width / grown, size.height / grown];
  const unit = ratio() * grown;
  const pane = panes.at(-1);
  notes.context = freshContext(notes.canvas);
  notes.context.scale(grown, grown);
  notes.taken = [];
  const small = width < 520;
  let below = null; // place under the lens, [from the right, from the top]
  const [x, y] = width < LENS_WIDE ? [34, height - 150] : [width - 44, height - 92]; // beside the lens's words
  notes.gravity(pane, x, y, width);
  notes.taken.push([x - 34, y - 62, x + 34, y + 44]);
  const isShown = inside && state.inside && state.moment && !state.turning;
  const between = isShown ? targetsBetween(inside, state.moment, originMoment()) : [];
  if (isShown) {
    const few = inside.names.length <= 6;
    for (const part of inside.names.map((_, i) => i).sort((a, b) => (b === state.chosen) - (a === state.chosen))) {
      if (!few && part !== state.chosen) break;
      if (!inside.members[part].length) continue;
      const target = between[part];
      const large = anatomyColour(inside, part);
      if (part === state.chosen && target.mm > 0.05 && !large)
        below = notes.lens(pane, target, radii[part], originName(), unit, { width, height, grown });
      else {
        const [was, at] = [target.was, target.at].map((p) => project(pane, p, unit));
        if (!was || !at) continue;
        notes.context.strokeStyle = notes.context.fillStyle = css('--ink');
        notes.context.lineWidth = 1.5;
        if (!large && Math.hypot(at[0] - was[0], at[1] - was[1]) > 6) drawArrow(notes.context, was, at, 6);
        const moves = `${target.mm.toFixed(1)} mm${isTold(target) ? '' : `, ${withinWords(target.error)}`}`;
        const says = target.mm < 0.05 ? 'the reference' : moves;
        const colour = part === state.chosen ? '--change' : (large ?? '--ink');
        notes.name(at, [shortName(target.name), ...(small ? [] : [says])], { width, height }, colour);
      }
    }
  }
  if (below) {
    changed('day', ringOf(between[state.chosen], state.day).day, (day) => {
      for (const input of document.getElementsByName('day')) input.checked = DAYS[input.value] === day;
    });
  }
  changed('below', below?.map((x) => `${Math.round(x * grown)}px`).join(' '), (place) => {
    $('day').hidden = !place;
    if (place || !state.turning) [$('rings').style.right, $('rings').style.top] = place?.split(' ') ?? ['', ''];
  });
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
