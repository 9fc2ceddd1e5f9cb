// SPDX-License-Identifier: MIT
// Start the page: read the lungs, make the picture and the controls, and connect them.

const KIND_TEXT = {
  displacement: 'Distance of each point from its position FROM.',
  difference: 'Distance of each point from its position in the other posture at the same breath.',
  expansion: 'Growth of the surface area around each point, relative to its area FROM.',
  plain: '',
};

/** Compute the bounding box and sphere of positions. */
function boundsOf(places) {
  const [low, high] = [
    [Infinity, Infinity, Infinity],
    [-Infinity, -Infinity, -Infinity],
  ];
  for (const place of places) {
    for (let i = 0; i < 3; ++i) [low[i], high[i]] = [Math.min(low[i], place[i]), Math.max(high[i], place[i])];
  }
  const centre = low.map((x, i) => (x + high[i]) / 2);
  const radius = places.reduce(
    (most, [x, y, z]) => Math.max(most, Math.hypot(x - centre[0], y - centre[1], z - centre[2])),
    0,
  );
  return { centre, low, high, half: low.map((x, i) => (high[i] - x) / 2), radius: radius || 1 };
}

const colourReader = document.createElement('canvas').getContext('2d');
/** Return red, green and blue, 0 to 1, of a CSS colour, which may be a system colour. */
const rgb = (name) => {
  colourReader.fillStyle = name;
  return [1, 3, 5].map((i) => parseInt(colourReader.fillStyle.slice(i, i + 2), 16) / 255);
};

/** Read the lungs, and set what the page shows at first. */
async function prepare() {
  basis = await readBasis();
  ({ inside } = basis);
  state = new State(basis);
  followLink(location);
  state.measure(); // the URL may have set a larger volume, which changes the ranges of the colour bar
  canvas = $('picture');
  picture = pictureOn(canvas, basis);
  notes = new Notes($('notes'));
  radii = inside?.members.map(radiusOf);
  table = inside && new TargetTable(inside, state, choose);
  buttons = makePostureButtons((i) => {
    state.settle(POSTURES[i].q, POSTURES[i].tilt, 0.7);
    touch();
  });
  holds = new Holds($('holds'), basis);
  outlines = new Outlines($('outlines'), basis, state, () => {
    told = null;
    redraw();
  });
}

/** Return the RMS distance of a target's vertices from their mean, mm. */
function radiusOf(members) {
  if (members.length === 1) return BALL_RADIUS;
  const places = members.map((v) => [...inside.reference.subarray(4 * v, 4 * v + 3)]);
  const { centre } = boundsOf(places);
  const squares = places.map((p) => p.reduce((sum, x, i) => sum + (x - centre[i]) ** 2, 0));
  return Math.sqrt(sumOf(squares) / members.length);
}

/** Start the page; return forTests. */
async function start() {
  await prepare();
  for (const build of [buildFroms, buildViews, buildLungs, limitSliders, writeOnce]) build();
  for (const bind of [
    bindHeadset,
    bindDrags,
    bindDoubleClick,
    bindCameraKeys,
    bindSilhouette,
    bindSliders,
    bindPosture,
    bindButtons,
    bindDoubt,
  ])
    bind();
  for (const bind of [bindTheme, bindSaving, bindLink, bindKeys, bindCanvas]) bind();
  showTheme();
  showLegend();
  requestAnimationFrame(frame);
  return forTests;
}

/* Interface for tests, benchmarks and the console. Gravity is a vector in the patient's axes (x left, y back,
 * z head); volumes are mL above rest. */
const forTests = {
  get picture() {
    return picture;
  },
  panes: () => panes,
  /** Return the positions of the vertices, computed by the graphics card, mm LPS. */
  positions: (gravity, volume) => picture.read(momentFor(basis, unit(gravity), volume))[0],
  /** Return the unit normals of the vertices, computed by the graphics card. */
  normals: (gravity, volume) => picture.read(momentFor(basis, unit(gravity), volume))[1],
  /** Return the positions of the vertices of structures inside the lungs, computed by the graphics card, mm LPS. They
   * are in the order of basis.inside: points first, then meshes. `shift` is that of `doubt`, or undefined. */
  insidePositions: (gravity, volume, shift) =>
    picture.readInside(momentFor(basis, unit(gravity), volume), shift?.inside),
  moment: (gravity, volume) => momentFor(basis, unit(gravity), volume),
  /** Do the CPU part of the work of one frame. */
  frameScript: () => {
    state.compute();
    panes = makePanes();
    onStage(drawNotes);
    showState();
  },
  sentenceOf,
  movedBetween,
  armsOf,
  downOf,
  torsoRings,
  planesFor,
  linesAcross,
  placesOf,
  rangeEnd,
  tickStep,
  postureText,
  postureWords,
  postureFrom,
  gravityOf,
  picturePng,
  touch,
  doubt,
  get basis() {
    return basis;
  },
  get state() {
    return state;
  },
};

/** Return a Picture, or a Poster if the browser has no WebGL 2, that draws on a canvas. */
function pictureOn(canvas, basis) {
  try {
    return new Picture(canvas, basis);
  } catch (error) {
    if (canvas.getContext('2d') === null) throw error;
    return new Poster(canvas, basis);
  }
}

/** Return the error of the displacement by the modes, in words; undefined if it is unknown. */
function errorOf({ metadata, fields, order }) {
  if (!metadata.error_rms_percent) return undefined;
  const rms = `${Number(metadata.error_rms_percent).toPrecision(2)} % RMS`;
  if (!fields) return `${rms} from the full solve, on held-out directions`;
  const most = Number(metadata.error_max_mm).toPrecision(2);
  return `${rms}, ${most} mm at most, each direction${order > 0 ? ' and volume' : ''} from the others`;
}

/** Write the facts about the lungs. */
function showFacts(basis) {
  const { metadata } = basis;
  const counted = (count) => count.toLocaleString('en');
  const whole = basis.wholeVertices > basis.vertices ? ` of ${counted(basis.wholeVertices)}` : '';
  const facts = [
    ['surface', `${basis.lungNames.join(' and ')}, ${counted(basis.vertices)} vertices${whole}`],
    ['field', `${basis.modes} ${metadata.modes === 'harmonics' ? 'harmonics' : 'modes'} of band ${basis.band}`],
    ['error', errorOf(basis)],
    ...basis.library.facts.map(({ name, line }) => [name, line]),
    ['force', metadata.force],
    ['made by', metadata.made_by],
    ['credit', metadata.attribution],
  ];
  $('facts').replaceChildren(
    ...facts
      .filter(([, value]) => value)
      .flatMap(([name, value]) => {
        const [term, text] = [document.createElement('dt'), document.createElement('dd')];
        term.textContent = name;
        text.textContent = value;
        return [term, text];
      }),
  );
}

function tell(text) {
  $('message').hidden = false;
  $('message').className = '';
  $('message').textContent = text;
}

/** Say why there is no picture, above the still picture if the page has one. */
function tellWhy(text) {
  tell(text);
  if (!$('still')) return;
  $('still').firstElementChild.textContent = text;
  document.body.classList.add('still');
}

document.documentElement.dataset.theme = matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light';
document.body.classList.remove('still');
if (MeshoptDecoder.supported) {
  try {
    await MeshoptDecoder.ready;
    window.supine = await start();
  } catch (error) {
    tellWhy(error.message);
    throw error;
  }
} else tellWhy('This browser has no WebAssembly, which reads the lungs. Open the page in another browser.');
