// SPDX-License-Identifier: MIT
// Make the controls that depend on the lungs, and those of the window: saving, printing, linking.

/** Make the choice of the state from which displacements are measured, if there is one. */
function buildFroms() {
  if (basis.froms.length > 1) {
    const group = document.createElement('div');
    Object.assign(group, { id: 'since', className: 'either', role: 'radiogroup' });
    group.ariaLabel = 'Displacements are measured';
    basis.froms.forEach((from, i) => {
      const [label, input, words] = ['label', 'input', 'span'].map((tag) => document.createElement(tag));
      Object.assign(input, { type: 'radio', name: 'since', value: i });
      words.textContent = `from ${from.name}`;
      input.addEventListener('change', () => measureFrom(from));
      label.append(input, words);
      group.prepend(label);
    });
    document.querySelector(inside ? '#targets .head' : '#surface-section .head').append(group);
  }
}

/** Make the buttons of the views. */
function buildViews() {
  for (const [letter, name] of Object.entries(VIEWS)) {
    const button = document.createElement('button');
    button.type = 'button';
    button.textContent = letter;
    button.title = `${name} (${letter.toLowerCase()})`;
    button.setAttribute('aria-label', `${letter}: ${name.toLowerCase()}`);
    button.addEventListener('click', () => lookFrom(letter));
    $('views').append(button);
  }
}

/** Make the choice of how each lung is drawn. */
function buildLungs() {
  basis.lungNames.forEach((name, lung) => {
    const row = document.createElement('div');
    row.className = 'lung';
    row.append(name);
    const choice = document.createElement('div');
    choice.className = 'choice';
    choice.setAttribute('role', 'radiogroup');
    choice.setAttribute('aria-label', name);
    for (const [words, opacity] of [
      ['Whole', 1],
      ['Faded', FADED],
      ['Hidden', 0],
    ]) {
      const label = document.createElement('label');
      const input = document.createElement('input');
      Object.assign(input, {
        type: 'radio',
        name: `lung-${lung}`,
        value: opacity,
        checked: opacity === state.opacity[lung],
      });
      input.addEventListener(
        'change',
        change(() => {
          state.opacity = state.opacity.with(lung, opacity);
        }),
      );
      const text = document.createElement('span');
      text.textContent = words;
      label.append(input, text);
      choice.append(label);
    }
    row.append(choice);
    $('lungs').append(row);
  });
}

/** Return the picture as a PNG blob, with its state in words. */
function picturePng() {
  const reference = state.beside ? `${postureWords(gravityOf(state.pinnedQ))} and beside it ` : '';
  const shown = `${reference}${postureWords(gravityOf(state.goal))}, ${$('depth-value').textContent}`;
  const title = `${legendTitle()}, ${KINDS[state.kind].unit}`;
  const range = state.kind === 'plain' ? null : { ...state.range, title };
  const colours = basis.colours[KINDS[state.kind].map];
  return savePicture(canvas, draw, document.title, [shown, 'computed, not for diagnosis'], range, colours);
}

/** Bind saving the picture, and printing. */
function bindSaving() {
  $('save').addEventListener('click', async () => {
    const link = document.createElement('a');
    link.href = URL.createObjectURL(await picturePng());
    link.download = `${document.title.replace(/[^\w.-]+/g, '-')}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  });
  window.addEventListener('beforeprint', () => {
    draw();
    const paper = Object.assign(document.createElement('canvas'), { width: canvas.width, height: canvas.height });
    const context = paper.getContext('2d');
    context.fillStyle = themes.stage.back;
    context.fillRect(0, 0, paper.width, paper.height);
    for (const layer of [canvas, $('notes')]) context.drawImage(layer, 0, 0, paper.width, paper.height);
    $('stage').style.backgroundImage = `url(${paper.toDataURL()})`;
  });
  window.addEventListener('afterprint', () => {
    $('stage').style.backgroundImage = '';
  });
}

/** Set the view from an address, and say what is wrong with it. */
function followLink({ hash }) {
  const wrong = takeLink(hash, state);
  $('link-trouble').hidden = !wrong;
  write('link-trouble', wrong);
}

/** Bind copying the link, and a changed address. */
function bindLink() {
  $('link').addEventListener('click', async () => {
    keepLink();
    try {
      await navigator.clipboard.writeText(location.href);
      write('link', 'Copied');
    } catch {
      write('link', 'See the address bar');
    }
    setTimeout(() => write('link', 'Copy link'), 2000);
  });
  window.addEventListener('hashchange', ({ newURL }) => {
    followLink(new URL(newURL)); // keepLink may have replaced the address already
    table?.press();
    told = null;
    remeasure();
    touch();
  });
}

/** Bind the theme and the full screen. */
function bindTheme() {
  $('theme').addEventListener('click', () => {
    document.documentElement.dataset.theme = isDark() ? 'light' : 'dark';
    showTheme();
    redraw();
  });
  $('full').hidden = !document.fullscreenEnabled;
  $('full').addEventListener('click', () =>
    document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen(),
  );
}

/** Follow the size of the canvas, and the loss of the graphics card. */
function bindCanvas() {
  const resize = () => {
    const pixels = Math.min(2, window.devicePixelRatio || 1);
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * pixels));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * pixels));
    if (state.moment && picture && !inHeadset) draw(); // resizing clears the canvas; redraw before it is shown
    redraw();
  };
  new ResizeObserver(resize).observe(canvas);
  canvas.addEventListener('webglcontextlost', (event) => {
    event.preventDefault(); // lets the browser restore the context
    picture = null;
    tell(
      'The browser has lost its connection to the graphics card. Reload the page if the picture does not come back.',
    );
  });
  canvas.addEventListener('webglcontextrestored', () => {
    picture = pictureOn(canvas, basis);
    touch();
  });
  resize();
}

/** Set the ranges of the sliders. */
function limitSliders() {
  for (const id of Object.keys(SLIDERS)) [$(id).min, $(id).max] = state.limits[id];
  $('tidal').step = state.tidal / 50;
  $('depth').step = state.tidal / 100;
}

/** Return what the lungs' reference is, in words. */
function originWords() {
  if (basis.fields) {
    const volume = basis.order > 0 ? ' and volume' : '';
    return `another simulator\u2019s fields of gravity${volume}, compressed: error ${errorOf(basis)}`;
  }
  return `at ${basis.hasRest ? 'rest, after a quiet expiration' : 'the volume of the scan'}`;
}

/** Write texts that never change. */
function writeOnce() {
  if (!basis.breathes)
    for (const part of document.querySelectorAll('.breath, section[aria-labelledby=breath-title]')) part.hidden = true;
  document.querySelector('[name=kind][value=expansion]').disabled = basis.words === 0;
  write('depth-name', `Above ${restOrScan()}`);
  write('ghost-name', 'Ghost of the reference');
  write('patient-fit', basis.metadata.patient ? `fitted to this patient: ${basis.metadata.patient}` : '');
  write('state', originWords());
  $('credit').hidden = !basis.metadata.attribution;
  write('credit', `Lungs: ${basis.metadata.attribution}`);
  $('inside').disabled = !inside;
  showFacts(basis);
}
