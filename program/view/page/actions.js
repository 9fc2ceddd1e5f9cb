// SPDX-License-Identifier: MIT
// What the controls do, and the keys that do the same.

/** Update the colour bar and the range of its values after a change of the volume. */
const remeasure = () => {
  state.measure();
  showLegend();
};

function play() {
  if (!basis.breathes) return;
  state.playing = !state.playing;
  remeasure();
  const part = Math.max(0, Math.min(1, (state.depth - state.expired) / state.tidal));
  if (state.playing) state.phase = Math.acos(1 - 2 * part) / (2 * Math.PI);
  touch();
}

const change = (act) => () => {
  act();
  showLegend();
  touch();
};

const pin = change(() => {
  state.pinnedQ = state.goal;
});

const colourBy = (kind) => change(() => state.colourBy(kind))();

const measureFrom = (from) =>
  change(() => {
    state.from = from;
    kept = null;
    state.measure();
  })();

const holdStill = (room) =>
  change(() => {
    state.room = room;
  })();

const flip = (name) =>
  change(() => {
    state[name] = !state[name];
  })();

const reset = () => {
  state.camera = { ...FIRST_CAMERA };
  redraw();
};

/** Bind the text field of the posture. */
function bindPosture() {
  $('posture-name').addEventListener('change', () => {
    const field = $('posture-name');
    const found = postureFrom(field.value);
    complain(field, found ? '' : notTaken('Posture', field.value, POSTURE_WANTED, postureText(gravityOf(state.goal))));
    if (!found) return;
    state.settle(found.q, found.tilt, 0.7);
    touch();
  });
  // Replace a typed text that may be invalid.
  $('posture-name').addEventListener('blur', () => {
    last.posture = null;
    redraw();
  });
}

function bindSliders() {
  for (const id of Object.keys(SLIDERS)) {
    bindSlider(id, () => {
      remeasure();
      touch();
    });
  }
}

/** Bind the keys of the picture. */
function bindKeys() {
  canvas.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const posture = POSTURES[Number(event.key) - 1];
    const kinds = Object.keys(KINDS);
    const keys = {
      n: pin,
      c: () => colourBy(kinds[(kinds.indexOf(state.kind) + 1) % kinds.length]),
      g: () => flip('ghost'),
      w: () => flip('wires'),
      b: () => flip('beside'),
      s: () => holdStill(!state.room),
      i: () => inside && flip('inside'),
      0: reset,
    };
    if (posture) buttons[Number(event.key) - 1].button.click();
    else if (event.key === ' ') {
      event.preventDefault();
      play();
    } else if (keys[event.key]) keys[event.key]();
    else if (VIEWS[event.key.toUpperCase()] && event.key.length === 1) lookFrom(event.key.toUpperCase());
  });
}

/** Bind the field of an end of the range of the colours. */
function bindRange(end, accept, wants) {
  const field = $(`range-${end}`);
  field.addEventListener('change', () => {
    const { begin, end: last } = state.range;
    const typed = typedIn(field, accept, wants(), Number(state.range[end].toPrecision(4)));
    if (typed === null) return;
    change(() => {
      state.ownRanges[state.kind] = { begin, end: last, [end]: typed };
    })();
  });
}

/** Bind buttons, checkboxes and fields. */
function bindButtons() {
  $('play').addEventListener('click', play);
  $('pin').addEventListener('click', pin);
  $('reset').addEventListener('click', reset);
  for (const id of CHECKBOXES) $(id).addEventListener('change', () => flip(id));
  $('coloured').addEventListener('change', () => colourBy($('coloured').checked ? 'displacement' : 'plain'));
  for (const input of document.getElementsByName('kind')) input.addEventListener('change', () => colourBy(input.value));
  for (const input of document.getElementsByName('frame'))
    input.addEventListener('change', () => holdStill(input.value === 'room'));
  $('cut-axis').addEventListener(
    'change',
    change(() => {
      state.cut.axis = Number($('cut-axis').value);
    }),
  );
  $('cut').addEventListener(
    'input',
    change(() => {
      state.cut.at = $('cut').valueAsNumber;
    }),
  );
  bindRange('begin', (x) => x < state.range.end, () => `a number below ${plain(state.range.end)}`);
  bindRange('end', (x) => x > state.range.begin, () => `a number above ${plain(state.range.begin)}`);
  for (const input of document.getElementsByName('day'))
    input.addEventListener('change', () => {
      state.day = input.value;
      redraw();
    });
  $('range-auto').addEventListener(
    'click',
    change(() => {
      delete state.ownRanges[state.kind];
    }),
  );
  $('probes-clear').addEventListener('click', () => {
    state.probes = [];
    redraw();
  });
}
