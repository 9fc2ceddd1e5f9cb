// SPDX-License-Identifier: MIT
// Write the view (posture, volume, colours, camera, ...) to the URL and read it back. Save the picture as PNG.

/** Fields of State whose names the URL lists under `show` if they are true. */
const SHOWN = ['contours', 'ghost', 'arrows', 'wires', 'beside'];

const round = (x, digits = 3) => String(Number(x.toFixed(digits)));

/** Return the view as the fragment of a URL; empty values are omitted. */
function linkOf(state) {
  const { camera } = state;
  const all = {
    posture: postureText(gravityOf(state.goal)),
    depth: round(state.depth, 1),
    tidal: round(state.tidal, 1),
    colour: state.kind,
    reference: postureText(gravityOf(state.pinnedQ)),
    room: state.room ? '' : '0',
    show: SHOWN.filter((name) => state[name]).join('.') || 'nothing',
    lungs: state.opacity.every((x) => x === state.usualOpacity()) ? '' : state.opacity.join(':'),
    cut: state.cut.axis < 0 ? '' : `${'xyz'[state.cut.axis]}:${round(state.cut.at)}`,
    range: state.ownRanges[state.kind] ? `${state.ownRanges[state.kind].begin}:${state.ownRanges[state.kind].end}` : '',
    camera: [camera.azimuth, camera.elevation, camera.zoom, ...camera.pan, ...(camera.pivot ?? [])]
      .map((x) => round(x))
      .join(':'),
    slices: state.slices ? state.slices.map((x) => round(x, 1)).join(':') : '',
    probes: state.probes.join('.'),
    target: state.picked ? String(state.chosen) : '',
    since: state.basis.froms.length > 1 ? String(state.basis.froms.indexOf(state.from)) : '',
    inside: state.basis.inside && !state.inside ? '0' : '',
  };
  return new URLSearchParams(Object.entries(all).filter(([, value]) => value !== ''))
    .toString()
    .replaceAll('%3A', ':')
    .replaceAll('%2B', '%2b');
}

/** Set the view from the fragment of a URL; ignore invalid values. */
function takeLink(text, state) {
  const link = new URLSearchParams(text.replace(/^#/, ''));
  const numbers = (name, separator = ':') =>
    (link.get(name) ?? '')
      .split(separator)
      .filter((x) => x !== '')
      .map(Number);
  const within = (value, low, high, otherwise) =>
    Number.isFinite(value) && value >= low && value <= high ? value : otherwise;
  const posture = postureFrom(link.get('posture') ?? '');
  if (posture) state.settle(posture.q, posture.tilt, 0);
  const reference = postureFrom(link.get('reference') ?? '');
  if (reference) state.pinnedQ = tilted(reference.q, reference.tilt);
  state.tidal = within(numbers('tidal')[0], 1e-3, state.tidalMax, state.tidal);
  state.depth = within(numbers('depth')[0], state.depthMin, state.depthMax, state.depth);
  if (KINDS[link.get('colour')]) state.kind = link.get('colour');
  state.room = link.get('room') !== '0';
  state.roomBlend = state.room ? 1 : 0;
  const shown = (link.get('show') ?? (state.basis.inside ? 'contours' : 'contours.ghost')).split('.');
  for (const name of SHOWN) state[name] = shown.includes(name);
  state.opacity = state.opacity.map(() => state.usualOpacity());
  const opacity = numbers('lungs');
  if (opacity.length === state.opacity.length && opacity.every((x) => x >= 0 && x <= 1)) state.opacity = opacity;
  const [axis, at] = (link.get('cut') ?? '').split(':');
  state.cut = { axis: axis ? 'xyz'.indexOf(axis) : -1, at: within(Number(at), 0, 1, 0.5) };
  const [begin, end] = numbers('range');
  if (end > begin) state.ownRanges[state.kind] = { begin, end };
  const camera = numbers('camera');
  if (camera.length >= 5 && camera.every(Number.isFinite)) {
    state.camera = {
      azimuth: camera[0],
      elevation: within(camera[1], -1.58, 1.58, 0),
      zoom: within(camera[2], 0.3, 30, 1),
      pan: camera.slice(3, 5),
      pivot: camera.length === 8 ? camera.slice(5) : null,
    };
  }
  const slices = numbers('slices');
  if (slices.length === 3 && slices.every((x, axis) => x > state.body.low[axis] && x < state.body.high[axis]))
    state.slices = slices;
  state.inside = Boolean(state.basis.inside) && link.get('inside') !== '0';
  const target = numbers('target')[0];
  state.picked = Number.isInteger(target) && within(target, 0, (state.basis.inside?.names.length ?? 1) - 1, -1) >= 0;
  if (state.picked) state.chosen = target;
  state.from = state.basis.froms[numbers('since')[0] ?? 0] ?? state.basis.froms[0];
  state.probes = numbers('probes', '.')
    .filter((v) => Number.isInteger(v) && v >= 0 && v < state.basis.vertices)
    .slice(0, 8);
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
