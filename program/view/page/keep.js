// SPDX-License-Identifier: MIT
// Write the view (posture, volume, colours, camera, ...) to the URL and read it back. Save the picture as PNG.

/** Fields of State whose names the URL lists under `show` if they are true. */
const SHOWN = ['contours', 'ghost', 'arrows', 'wires', 'beside', 'doubt'];

const round = (x, digits = 3) => String(Number(x.toFixed(digits)));

const numbersIn = (text, separator = ':') => text.split(separator).map((x) => (x.trim() === '' ? NaN : Number(x)));
const isWithin = (x, [low, high]) => x >= low && x <= high;
const rangeWords = (limits) => limits.map((x) => round(x, 1).replace('-', '\u2212')).join(' to ');

/** Return a number within its limits, which are shown with one decimal; NaN for others. */
const limitedTo = ([low, high], x) =>
  isWithin(x, [low - 0.05, high + 0.05]) ? Math.max(low, Math.min(high, x)) : NaN;


/** Return the key of the link for a number that has limits. */
const limited = (name) => ({
  wants: (state) => rangeWords(state.limits[name]),
  write: (state) => round(state[name], 1),
  read(state, text) {
    const x = limitedTo(state.limits[name], Number(text || NaN));
    if (Number.isFinite(x)) state[name] = x;
    return Number.isFinite(x);
  },
});

/** Return the key of the link for one of the words of `list`. `get` returns the index of the one shown, and `set` takes
 * it. */
const worded = (list, get, set, usual) => ({
  wants: (state) => list(state).join(' or '),
  write: (state) => list(state)[get(state)],
  read(state, text) {
    const index = list(state).indexOf(text);
    if (index >= 0) set(state, index);
    return index >= 0;
  },
  usual: usual && ((state) => list(state)[usual(state)]),
});

/** Return the key of the link for a posture. */
const posed = (get, set) => ({
  wants: () => POSTURE_WANTED,
  write: (state) => postureText(gravityOf(get(state))),
  read(state, text) {
    const found = postureFrom(text);
    if (found) set(state, found);
    return Boolean(found);
  },
});

/** Keys of the link. `write` returns the text for the view that is shown, and `read` takes a text, or returns false if
 * it is wrong; `wants` says what is right. The text `usual` is left out of the link; it is what a link without the key
 * means. Without `usual`, such a link changes nothing. A key may depend on those before it. */
const LINK = {
  posture: posed(
    (state) => state.goal,
    (state, { q, tilt }) => state.settle(q, tilt, 0),
  ),
  depth: limited('depth'),
  tidal: limited('tidal'),
  colour: worded(
    ({ basis }) => Object.keys(KINDS).filter((kind) => kind !== 'expansion' || basis.words !== 0),
    ({ kind }) => Object.keys(KINDS).indexOf(kind),
    (state, i) => {
      state.kind = Object.keys(KINDS)[i];
    },
  ),
  reference: posed(
    (state) => state.pinnedQ,
    (state, { q, tilt }) => {
      state.pinnedQ = tilted(q, tilt);
    },
  ),
  room: worded(
    () => ['0', '1'],
    ({ room }) => Number(room),
    (state, i) => Object.assign(state, { room: i === 1, roomBlend: i }),
    () => 1,
  ),
  show: {
    wants: () => `nothing, or some of ${SHOWN.join('.')}`,
    write: (state) => SHOWN.filter((name) => state[name]).join('.') || 'nothing',
    read(state, text) {
      const shown = text === 'nothing' ? [] : text.split('.');
      if (!shown.every((name) => SHOWN.includes(name))) return false;
      for (const name of SHOWN) state[name] = shown.includes(name);
      return true;
    },
    usual: ({ basis }) => (basis.inside ? 'contours' : 'contours.ghost'),
  },
  lungs: {
    wants: ({ opacity }) => `an opacity of 0 to 1 for each lung, such as ${opacity.map(() => FADED).join(':')}`,
    write: ({ opacity }) => opacity.join(':'),
    read(state, text) {
      const opacity = numbersIn(text);
      if (opacity.length !== state.opacity.length || !opacity.every((x) => isWithin(x, [0, 1]))) return false;
      state.opacity = opacity;
      return true;
    },
    usual: (state) => state.opacity.map(() => state.usualOpacity()).join(':'),
  },
  cut: {
    wants: () => 'none, or x, y or z and a position of 0 to 1, such as z:0.5',
    write: ({ cut }) => (cut.axis < 0 ? 'none' : `${'xyz'[cut.axis]}:${round(cut.at)}`),
    read(state, text) {
      const [, axis, at] = /^([xyz]):([^:]+)$/.exec(text) ?? [];
      if (text !== 'none' && !isWithin(Number(at), [0, 1])) return false;
      state.cut = axis ? { axis: 'xyz'.indexOf(axis), at: Number(at) } : { axis: -1, at: 0.5 };
      return true;
    },
    usual: () => 'none',
  },
  range: {
    wants: () => 'automatic, or two numbers of which the second is larger, such as 0:20',
    write: ({ ownRanges, kind }) => (ownRanges[kind] ? `${ownRanges[kind].begin}:${ownRanges[kind].end}` : 'automatic'),
    read(state, text) {
      const [begin, end, ...more] = numbersIn(text);
      if (text !== 'automatic' && (more.length || !(end > begin && Number.isFinite(end - begin)))) return false;
      state.ownRanges[state.kind] = text === 'automatic' ? undefined : { begin, end };
      return true;
    },
    usual: () => 'automatic',
  },
  camera: {
    wants: () =>
      'azimuth, elevation (\u22121.58 to 1.58), zoom (0.3 to 30), shifts x and y, and maybe a pivot x, y, z',
    write: ({ camera: { azimuth, elevation, zoom, pan, pivot } }) =>
      [azimuth, elevation, zoom, ...pan, ...(pivot ?? [])].map((x) => round(x)).join(':'),
    read(state, text) {
      const [azimuth, elevation, zoom, ...places] = numbersIn(text);
      const right = [azimuth, ...places].every(Number.isFinite) && [2, 5].includes(places.length);
      if (!right || !isWithin(elevation, [-1.58, 1.58]) || !isWithin(zoom, [0.3, 30])) return false;
      const pivot = places.length === 5 ? places.slice(2) : null;
      state.camera = { azimuth, elevation, zoom, pan: places.slice(0, 2), pivot };
      return true;
    },
  },
  probes: {
    wants: ({ basis }) => `none, or at most ${PROBES_MOST} vertices of 0 to ${basis.vertices - 1}, such as 3.250`,
    write: ({ probes }) => probes.join('.') || 'none',
    read(state, text) {
      const probes = text === 'none' ? [] : numbersIn(text, '.');
      const right = probes.every((v) => Number.isInteger(v) && isWithin(v, [0, state.basis.vertices - 1]));
      if (right && probes.length <= PROBES_MOST) state.probes = probes;
      return right && probes.length <= PROBES_MOST;
    },
    usual: () => 'none',
  },
  target: {
    wants: ({ basis }) => `first, or a number of 0 to ${(basis.inside?.names.length ?? 1) - 1}`,
    write: ({ picked, chosen }) => (picked ? String(chosen) : 'first'),
    read(state, text) {
      const picked = text !== 'first';
      if (picked && !state.basis.inside?.names[text]) return false;
      Object.assign(state, { picked, chosen: picked ? Number(text) : state.chosen });
      return true;
    },
    usual: () => 'first',
  },
  since: worded(
    ({ basis }) => basis.froms.map((_, i) => String(i)),
    ({ basis, from }) => basis.froms.indexOf(from),
    (state, i) => {
      state.from = state.basis.froms[i];
    },
    () => 0,
  ),
  day: worded(
    () => Object.keys(DAYS),
    ({ day }) => Object.keys(DAYS).indexOf(day),
    (state, i) => {
      state.day = Object.keys(DAYS)[i];
    },
    () => 0,
  ),
  slices: {
    wants: () => 'middle, or x, y and z within the lungs, mm, such as 60:-120:-110',
    write: ({ slices }) => slices?.map((x) => round(x, 1)).join(':') ?? 'middle',
    read(state, text) {
      const slices = text === 'middle' ? null : numbersIn(text);
      if (slices) state.measure(); // the body at the volume that the link has set
      const { low, high } = state.body;
      const right = slices === null || (slices.length === 3 && slices.every((x, i) => isWithin(x, [low[i], high[i]])));
      if (right) state.slices = slices;
      return right;
    },
    usual: () => 'middle',
  },
  inside: worded(
    ({ basis }) => (basis.inside ? ['0', '1'] : ['0']),
    ({ inside }) => Number(inside),
    (state, i) => {
      state.inside = i === 1;
    },
    ({ basis }) => Number(Boolean(basis.inside)),
  ),
};

/** Return the view as the fragment of a URL. */
function linkOf(state) {
  const written = Object.entries(LINK).filter(([, { write, usual }]) => write(state) !== usual?.(state));
  return new URLSearchParams(written.map(([key, { write }]) => [key, write(state)]))
    .toString()
    .replaceAll('%3A', ':')
    .replaceAll('%2B', '%2b');
}

/** Return what is wrong with an input in words: its name, what was given, what is right, and what is shown instead. */
const notTaken = (name, given, wants, shown) =>
  `${name} ${given && `\u201c${shortName(given, 60)}\u201d `}is not taken: give ${wants}. Taken instead: ${shown}.`;

/** Set the view from the fragment of a URL. Return what is wrong with it in words, which is empty if all is right. */
function takeLink(text, state) {
  const link = new URLSearchParams(text.replace(/^#/, '').replaceAll('+', '%2b'));
  const wrong = [];
  for (const [key, { wants, write, read, usual }] of Object.entries(LINK)) {
    const given = link.getAll(key);
    if (usual) read(state, usual(state));
    if (given.length > 1 || (given.length === 1 && !read(state, given[0])))
      wrong.push(notTaken(`Link: ${key}`, given.join(' '), wants(state), write(state)));
  }
  for (const key of new Set(link.keys()))
    if (!LINK[key]) wrong.push(notTaken(`Link: ${key}`, '', `only ${Object.keys(LINK).join(', ')}`, 'nothing'));
  return wrong.join('\n');
}

/** Return the picture with the notes, title, `lines` of text and, unless `range` is null, the colour bar as a PNG blob.
 * `draw` is called first, because the canvas keeps its pixels only until the end of the frame. */
function savePicture(canvas, draw, title, lines, range, colours) {
  draw();
  const ratio = canvas.width / canvas.clientWidth;
  const paper = document.createElement('canvas');
  [paper.width, paper.height] = [canvas.width, canvas.height];
  const context = paper.getContext('2d');
  context.fillStyle = themes.stage.back;
  context.fillRect(0, 0, paper.width, paper.height);
  for (const layer of [canvas, $('notes')]) context.drawImage(layer, 0, 0, paper.width, paper.height);
  context.scale(ratio, ratio);
  const text = (words, x, y, font, align = 'left') => {
    Object.assign(context, { font: `${font} system-ui, sans-serif`, textAlign: align, fillStyle: themes.stage.ink });
    context.fillText(words, x, y);
  };
  text(title, 20, 34, '600 18px');
  lines.forEach((line, i) => text(line, 20, 56 + 18 * i, '13px'));
  const [left, top, width] = [20, canvas.clientHeight - 44, Math.min(320, canvas.clientWidth - 40)];
  for (let i = 0; range && i < width; ++i) {
    const at = 4 * Math.round((255 * i) / (width - 1));
    context.fillStyle = `rgb(${colours[at]} ${colours[at + 1]} ${colours[at + 2]})`;
    context.fillRect(left + i, top, 1.5, 12);
  }
  if (range) text(range.title, left, top - 8, '600 13px');
  for (
    let i = Math.ceil((range?.begin ?? 0) / (range?.step ?? 1) - 1e-9);
    range && i * range.step <= range.end * (1 + 1e-9);
    ++i
  ) {
    text(
      plain(i * range.step),
      left + (width * (i * range.step - range.begin)) / (range.end - range.begin),
      top + 28,
      '12px',
      'center',
    );
  }
  return new Promise((done) => {
    paper.toBlob(done, 'image/png');
  });
}
