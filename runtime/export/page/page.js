// SPDX-License-Identifier: MIT
// The page: state in, picture out, and the controls between.

const VIEW_ANGLE = 0.5; // radians, of the camera from top to bottom

function bounds(basis) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  basis.rest.forEach((x, i) => {
    low[i % 3] = Math.min(low[i % 3], x);
    high[i % 3] = Math.max(high[i % 3], x);
  });
  const centre = low.map((x, i) => (x + high[i]) / 2);
  let radius = 0;
  for (let i = 0; i < basis.rest.length; i += 3) radius = Math.max(radius, Math.hypot(basis.rest[i] - centre[0], basis.rest[i + 1] - centre[1], basis.rest[i + 2] - centre[2]));
  return { centre, radius: radius || 1 };
}

/** The rotation that takes the arrow's -z to a direction. */
function arrowTurn(direction) {
  const axis = cross([0, 0, -1], direction);
  const w = 1 - direction[2];
  return w < 1e-6 ? turn([1, 0, 0], Math.PI) : unit([...axis, w]);
}

const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);

function start() {
  const basis = readBasis();
  const state = new State(basis);
  const canvas = $('picture');
  const picture = new Picture(canvas, basis);
  const { centre, radius } = bounds(basis);
  let stale = true;     // vertices are not where the state says
  let unseen = true;    // the picture is not what the state says
  let pointer = null;   // where on the canvas, CSS pixels
  let asked = true;     // what is there has been asked, for this picture
  let before = null;    // time of the last frame, when frames follow each other
  let streak = 0;       // frames that have followed each other
  let frameTime = NaN;  // ms, smoothed
  let view = null;

  const modelTurn = () => slerp(IDENTITY, state.q, state.roomBlend * state.roomBlend * (3 - 2 * state.roomBlend));
  const cameraTurn = () => compose(turn([1, 0, 0], state.camera.elevation - RIGHT_ANGLE), turn([0, 0, 1], state.camera.azimuth));
  const isDark = () => document.documentElement.dataset.theme === 'dark';

  /** How far the lungs reach from their centre along gravity, mm. */
  function lowest(gravity) {
    let reach = 0;
    const stride = 3 * Math.ceil(basis.vertices / 4000);
    for (let i = 0; i < basis.rest.length; i += stride) {
      reach = Math.max(reach, dot(gravity, [basis.rest[i] - centre[0], basis.rest[i + 1] - centre[1], basis.rest[i + 2] - centre[2]]));
    }
    return reach;
  }

  function makeView() {
    const aspect = canvas.width / canvas.height;
    const fit = radius * 1.2 * Math.max(1, 0.86 / aspect);
    const distance = fit / Math.sin(VIEW_ANGLE / 2) / state.camera.zoom;
    const q = compose(cameraTurn(), modelTurn());
    const away = rotate(q, centre);
    const gravity = state.gravity;
    const tail = rotate(q, gravity).map((x) => x * (lowest(gravity) + 0.06 * radius));
    const arrow = rigid(compose(q, arrowTurn(gravity)), [tail[0], tail[1], tail[2] - distance]);
    for (let i = 0; i < 12; ++i) arrow[i] *= radius * 0.24;
    return {
      toEye: rigid(q, [-away[0], -away[1], -away[2] - distance]),
      projection: perspective(VIEW_ANGLE, aspect, Math.max(distance - 2.5 * radius, distance * 0.02), distance + 2.5 * radius),
      arrowToEye: arrow, kind: state.kind, range: state.ranges[state.kind], contours: state.contours, dark: isDark(), tint: rgb(css('--gravity')),
    };
  }

  /** Shows what is under the pointer once the graphics card has said it, and asks again where the
   * picture or the pointer has changed since. */
  function point() {
    const found = picture.picked();
    if (!pointer) showPointed(null);
    else if (found !== undefined) showPointed(found);
    if (!asked && pointer && view && !picture.picking) {
      asked = true;
      picture.pick(view, (2 * pointer.x) / canvas.clientWidth - 1, 1 - (2 * pointer.y) / canvas.clientHeight);
    }
  }

  function showPointed(found) {
    const tip = $('pointed');
    tip.hidden = $('needle').hidden = !found;
    if (!found) return;
    tip.firstChild.textContent = `${found.value.toFixed(2)} mm`;
    tip.lastChild.textContent = placeText(found.at);
    const [x, y] = [Math.min(pointer.x + 16, canvas.clientWidth - tip.offsetWidth - 8), Math.max(8, pointer.y - tip.offsetHeight - 10)];
    tip.style.transform = `translate(${x}px, ${y}px)`;
    $('needle').style.left = `${100 * Math.min(1, found.value / view.range.end)}%`;
  }

  const buttons = makePostureButtons((i) => {
    state.settle(POSTURES[i].q, POSTURES[i].tilt, 0.7);
    touch();
  });

  function showState() {
    const gravity = state.gravity;
    const name = postureName(gravityOf(tilted(state.standing.q, state.standing.tilt)));
    if ($('posture-name').textContent !== name) $('posture-name').textContent = name;
    for (const { button, posture } of buttons) button.setAttribute('aria-pressed', String(posture.name === name));
    $('gravity').textContent = `gravity  L ${gravity[0].toFixed(2)}  P ${gravity[1].toFixed(2)}  H ${gravity[2].toFixed(2)}`.replaceAll('-', '−').replaceAll('−0.00', '0.00');
    setSlider($('tilt'), state.standing.tilt, `${state.standing.tilt} degrees`);
    $('tilt-value').textContent = `${state.standing.tilt}°`.replace('-', '−');
    const depth = `${state.depth.toFixed(basis.hasVolume ? 0 : 1)} ${state.unit}`;
    setSlider($('depth'), state.depth, depth);
    $('depth-value').textContent = `+${depth}`;
    setSlider($('tidal'), state.tidal, `${state.tidal} ${state.unit}`);
    $('tidal-value').textContent = `${state.tidal} ${state.unit}`;
    setSlider($('rate'), state.rate, `${state.rate} per minute`);
    $('rate-value').textContent = `${state.rate} /min`;
    $('play').setAttribute('aria-pressed', String(state.playing));
    $('play').setAttribute('aria-label', state.playing ? 'Pause the breath' : 'Play the breath');
    $('gains').textContent = state.moment?.gains ? state.moment.gains.map((gain, i) => `${basis.lungNames[i] ?? `lung ${i}`} +${gain.toFixed(0)} mL`).join('   ').replaceAll('+-', '−') : 'open surface: the largest displacement, supine, instead of a volume';
    drawBall($('ball'), compose(cameraTurn(), modelTurn()), gravity);
  }

  function showLegend() {
    const pinnedName = postureName(state.pinnedGravity);
    drawLegend(state.kind, state.ranges[state.kind], pinnedName);
    $('pinned').textContent = `pinned: ${pinnedName}`;
    for (const input of document.getElementsByName('kind')) input.checked = input.value === state.kind;
    for (const input of document.getElementsByName('frame')) input.checked = (input.value === 'room') === state.room;
  }

  function showTheme() {
    $('theme').textContent = isDark() ? 'Light' : 'Dark';
    for (const { icon, posture } of buttons) drawIcon(icon, tilted(posture.q, posture.tilt));
  }

  /** Vertices move, and the picture with them; `look`: only the picture. */
  const touch = () => { stale = unseen = true; };
  const look = () => { unseen = true; };

  function frame(now) {
    requestAnimationFrame(frame);
    point();
    const seconds = before === null ? 0 : Math.min(0.1, (now - before) / 1000);
    const moving = state.advance(seconds);
    if (moving) stale = unseen = true;
    if (!unseen) {
      before = null;
      streak = 0;
      return;
    }
    streak += 1;
    if (streak > 3) frameTime = streak === 4 ? now - before : 0.9 * frameTime + 0.1 * (now - before);
    before = now;
    if (stale) {
      const good = state.compute();
      $('message').hidden = good;
      if (!good) {
        $('message').className = 'trouble';
        $('message').textContent = `No breath of ${state.depth.toFixed(0)} mL in this posture: the surface would fold.`;
      }
      if (state.moment) picture.deform(state.moment, state.kind === 'difference' ? state.pinned : null);
    }
    view = makeView();
    picture.draw(view);
    asked = false;
    showState();
    stale = unseen = false;
    const gpu = Number.isNaN(picture.gpuTime) ? '' : `, drawing ${picture.gpuTime.toFixed(1)} ms`;
    if (!Number.isNaN(frameTime)) $('frame-time').textContent = `frame ${frameTime.toFixed(1)} ms${gpu}`;
  }

  /* The camera. */
  const orbit = (dx, dy) => {
    state.camera.azimuth += dx;
    state.camera.elevation = Math.max(-1.55, Math.min(1.55, state.camera.elevation + dy));
    look();
  };
  const zoom = (ratio) => {
    state.camera.zoom = Math.max(0.4, Math.min(8, state.camera.zoom * ratio));
    look();
  };
  const dragging = onDrag(canvas, (dx, dy) => orbit(dx * 0.008, dy * 0.008), zoom);
  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    zoom(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0015)));
  }, { passive: false });
  for (const type of ['pointermove', 'pointerdown', 'pointerup']) {
    canvas.addEventListener(type, (event) => {
      pointer = dragging() && event.pointerType === 'mouse' ? null : { x: event.offsetX, y: event.offsetY };
      asked = false;
    });
  }
  canvas.addEventListener('pointerleave', () => { pointer = null; });
  canvas.addEventListener('keydown', (event) => {
    const arrow = ARROWS[event.key];
    if (arrow) orbit(arrow[0] * 0.09, arrow[1] * 0.09);
    if (event.key === '+' || event.key === '=') zoom(1.12);
    if (event.key === '-') zoom(1 / 1.12);
    if (arrow) event.preventDefault();
  });

  /* The ball: what the hand does to the patient, or, with the patient still, to gravity. */
  const spin = (dx, dy) => {
    const sense = state.room ? 1 : -1;
    for (const [axis, angle] of [[[0, 1, 0], dx], [[1, 0, 0], dy]]) {
      const inBody = rotate(inverse(compose(cameraTurn(), modelTurn())), axis);
      state.roll(rotate(state.q, inBody), sense * angle);
    }
    touch();
  };
  onDrag($('ball'), (dx, dy) => spin(dx / 66, dy / 66));
  $('ball').addEventListener('keydown', (event) => {
    const arrow = ARROWS[event.key];
    if (!arrow) return;
    event.preventDefault();
    const step = ((event.shiftKey ? 1 : 5) * Math.PI) / 180;
    spin(arrow[0] * step, arrow[1] * step);
  });

  /* The panel. */
  const slide = (id, act) => $(id).addEventListener('input', () => { act($(id).valueAsNumber); touch(); });
  const remeasure = () => { state.measure(); showLegend(); };
  slide('tilt', (value) => state.settle(state.standing.q, value, 0));
  slide('depth', (value) => { state.playing = false; state.depth = value; remeasure(); });
  slide('tidal', (value) => { state.tidal = value; if (!state.playing) state.depth = value; remeasure(); });
  slide('rate', (value) => { state.rate = value; });
  const play = () => {
    state.playing = !state.playing;
    const part = Math.min(1, state.depth / state.tidal);
    if (state.playing) state.phase = Math.acos(1 - 2 * part) / (2 * Math.PI);
    touch();
  };
  const pin = () => { state.pinnedGravity = state.gravity; showLegend(); touch(); };
  const colourBy = (kind) => { state.kind = kind; showLegend(); touch(); };
  const holdStill = (room) => { state.room = room; showLegend(); touch(); };
  const reset = () => { state.camera = { ...FIRST_CAMERA }; look(); };
  $('play').addEventListener('click', play);
  $('pin').addEventListener('click', pin);
  $('reset').addEventListener('click', reset);
  $('contours').addEventListener('change', () => { state.contours = $('contours').checked; look(); });
  for (const input of document.getElementsByName('kind')) input.addEventListener('change', () => colourBy(input.value));
  for (const input of document.getElementsByName('frame')) input.addEventListener('change', () => holdStill(input.value === 'room'));
  $('theme').addEventListener('click', () => {
    document.documentElement.dataset.theme = isDark() ? 'light' : 'dark';
    showTheme();
    look();
  });
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const posture = POSTURES[Number(event.key) - 1];
    if (posture) buttons[Number(event.key) - 1].button.click();
    else if (event.key === ' ' && !event.target.closest('button, input, summary')) { event.preventDefault(); play(); }
    else if (event.key === 'p') pin();
    else if (event.key === 'd') colourBy(state.kind === 'displacement' ? 'difference' : 'displacement');
    else if (event.key === 'r') holdStill(!state.room);
    else if (event.key === '0') reset();
  });

  for (const id of ['depth', 'tidal']) $(id).max = state.depthMax;
  $('tidal').min = $('tidal').step = state.tidal / 20;
  $('depth').step = state.tidal / 100;
  if (!basis.hasVolume) $('tidal-name').textContent = 'Depth';
  const { metadata } = basis;
  $('about').textContent = [
    `${basis.lungs === 1 ? 'one lung' : `${basis.lungs} lungs`}, ${basis.vertices.toLocaleString('en')} vertices`,
    `${basis.modes} ${metadata.modes === 'harmonics' ? 'harmonics' : 'modes'} of band ${basis.band}`,
    metadata.error_rms_percent ? `error ${Number(metadata.error_rms_percent).toPrecision(2)} % RMS` : '',
    metadata.attribution ?? '',
  ].filter(Boolean).join(' · ');

  const resize = () => {
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    look();
  };
  new ResizeObserver(resize).observe(canvas);
  canvas.addEventListener('webglcontextlost', () => tell('The graphics card was taken away: load the page again.'));
  resize();
  showTheme();
  showLegend();
  requestAnimationFrame(frame);

  /* For tests, benchmarks and the console: gravity in the patient's axes (x left, y back, z head), mL. */
  return {
    picture,
    view: () => view,
    /** Positions as the graphics card computes them: xyz of each vertex, mm LPS. */
    positions: (gravity, volume) => picture.readPositions(momentFor(basis, unit(gravity), volume)),
    /** Weights with the breath scale in them, and the scale. */
    moment: (gravity, volume) => momentFor(basis, unit(gravity), volume),
    state,
  };
}

function tell(text) {
  $('message').hidden = false;
  $('message').className = '';
  $('message').textContent = text;
}

document.documentElement.dataset.theme = matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light';
try {
  window.supine = start();
} catch (error) {
  tell(error.message);
  throw error;
}
