// SPDX-License-Identifier: MIT
// Show the state in the controls, the colour bar and the colours of the theme.

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
  changed(
    'pressed',
    buttons.findIndex(({ posture }) => posture.name === name),
    (pressed) => {
      buttons.forEach(({ button }, i) => button.setAttribute('aria-pressed', String(i === pressed)));
      // Where the cards are in one row that scrolls
      if (pressed >= 0) $('cards').scrollLeft = buttons[pressed].button.offsetLeft - $('cards').offsetLeft - 104;
    },
  );
  write(
    'gravity',
    `gravity  L ${gravity[0].toFixed(2)}  P ${gravity[1].toFixed(2)}  H ${gravity[2].toFixed(2)}`
      .replaceAll('-', '\u2212')
      .replaceAll('\u22120.00', '0.00'),
  );
  for (const id of Object.keys(SLIDERS)) setSlider(id);
  write('depth-value', volumeWords());
  changed('playing', state.playing, () => {
    $('play').setAttribute('aria-pressed', String(state.playing));
    $('play').setAttribute('aria-label', state.playing ? 'Pause the breath' : 'Play the breath');
  });
  const held = state.moment?.held?.map((ml, lung) => `${basis.lungNames[lung]} ${ml.toFixed(0)} mL`).join('   ');
  write('held', `${held} (gas and tissue)`);
  const eye = compose(cameraTurn(), modelTurn());
  changed('patient', [...eye, isDark()].join(), () => onStage(() => drawSilhouette($('patient'), eye)));
  const [side, share] = Object.entries(ENDS)
    .map(([letter, end]) => [letter, rotate(eye, end)[2]])
    .sort((a, b) => b[1] - a[1])[0];
  showDoubt();
  write('seen', share > 0.8 ? `seen ${VIEWS[side].toLowerCase()}` : '');
}

function legendTitle() {
  const { name } = state.from;
  return {
    plain: '',
    displacement: `Displacement from ${name}`,
    difference: `Difference from ${postureWords(gravityOf(state.pinnedQ))}`,
    expansion: `Growth of area from ${name}`,
  }[state.kind];
}

function showLegend() {
  drawLegend(state.kind, state.range, legendTitle(), basis.colours[KINDS[state.kind].map]);
  write('kind-text', KIND_TEXT[state.kind].replace('FROM', fromWhere()));
  write('pinned', `other posture: ${postureWords(gravityOf(state.pinnedQ))}`);
  for (const input of document.getElementsByName('kind')) input.checked = input.value === state.kind;
  for (const input of document.getElementsByName('frame')) input.checked = (input.value === 'room') === state.room;
  for (const id of CHECKBOXES) $(id).checked = state[id];
  $('coloured').checked = state.kind !== 'plain';
  for (const input of document.getElementsByName('since'))
    input.checked = Number(input.value) === basis.froms.indexOf(state.from);
  state.opacity.forEach((opacity, lung) => {
    for (const input of document.getElementsByName(`lung-${lung}`)) input.checked = Number(input.value) === opacity;
  });
  $('cut-axis').value = String(state.cut.axis);
  $('cut').disabled = state.cut.axis < 0;
  $('cut').value = state.cut.at;
  fill($('cut'));
}

function showTheme() {
  $('theme').textContent = isDark() ? 'Light' : 'Dark';
  readTheme();
  for (const { icon, posture } of buttons)
    drawSilhouette(icon, compose(turn([1, 0, 0], -RIGHT_ANGLE), tilted(posture.q, posture.tilt)));
  told = null; // outlines are drawn in the colours of the theme
}
