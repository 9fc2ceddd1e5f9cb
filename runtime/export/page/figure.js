// SPDX-License-Identifier: MIT
// The patient as a small figure of ellipsoids on a 2-D canvas: on the ball, and as the postures' icons.

// Centre and half axes, patient's axes (x left, y back, z head), and a tone. Face, lungs and toes are
// in front, hair behind.
const BODY = [
  { at: [0, 0, 0.2], size: [0.25, 0.145, 0.3], tone: 'body' },
  { at: [0, 0.01, -0.14], size: [0.2, 0.14, 0.17], tone: 'body' },
  { at: [0.1, -0.09, 0.24], size: [0.085, 0.07, 0.17], tone: 'lung' },
  { at: [-0.1, -0.09, 0.24], size: [0.085, 0.07, 0.17], tone: 'lung' },
  { at: [0, 0.03, 0.66], size: [0.125, 0.125, 0.15], tone: 'hair' },
  { at: [0, -0.045, 0.62], size: [0.1, 0.1, 0.13], tone: 'face' },
  { at: [0, -0.16, 0.62], size: [0.025, 0.04, 0.035], tone: 'face' },
  { at: [0.31, 0, 0.13], size: [0.06, 0.065, 0.33], tone: 'body' },
  { at: [-0.31, 0, 0.13], size: [0.06, 0.065, 0.33], tone: 'body' },
  { at: [0.105, 0, -0.52], size: [0.085, 0.095, 0.38], tone: 'body' },
  { at: [-0.105, 0, -0.52], size: [0.085, 0.095, 0.38], tone: 'body' },
  { at: [0.105, -0.09, -0.87], size: [0.055, 0.12, 0.04], tone: 'body' },
  { at: [-0.105, -0.09, -0.87], size: [0.055, 0.12, 0.04], tone: 'body' },
];

/** The ends of the patient's axes. */
const ENDS = { L: [1, 0, 0], R: [-1, 0, 0], A: [0, -1, 0], P: [0, 1, 0], H: [0, 0, 1], F: [0, 0, -1] };

/** Draws the figure, turned by q into the eye's axes (x right, y up, z to the viewer). */
function drawFigure(context, q, x, y, scale, tones) {
  const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => rotate(q, axis));
  const parts = BODY.map((part) => ({ ...part, eye: rotate(q, part.at) }));
  // The half axis that points most to the viewer decides what hides what.
  const front = (part) => part.eye[2] + 0.5 * Math.hypot(...part.size.map((s, i) => s * axes[i][2]));
  parts.sort((a, b) => front(a) - front(b));
  for (const part of parts) {
    let xx = 0;
    let xy = 0;
    let yy = 0;
    part.size.forEach((s, i) => {
      xx += (s * axes[i][0]) ** 2;
      xy += s * axes[i][0] * s * axes[i][1];
      yy += (s * axes[i][1]) ** 2;
    });
    const mean = (xx + yy) / 2;
    const spread = Math.hypot((xx - yy) / 2, xy);
    const angle = Math.atan2(2 * xy, xx - yy) / 2;
    const cx = x + scale * part.eye[0];
    const cy = y - scale * part.eye[1];
    const long = scale * Math.sqrt(mean + spread);
    const short = scale * Math.sqrt(Math.max(mean - spread, 0));
    const light = context.createRadialGradient(cx - 0.3 * short, cy - 0.5 * short, 0, cx, cy, long * 1.05);
    light.addColorStop(0, tones[part.tone][0]);
    light.addColorStop(1, tones[part.tone][1]);
    context.beginPath();
    context.ellipse(cx, cy, long, short, -angle, 0, 2 * Math.PI);
    context.fillStyle = light;
    context.fill();
  }
}

/** Sizes a canvas for the screen's pixels and returns its context, in CSS pixels, cleared. */
function freshContext(canvas) {
  const ratio = Math.min(3, window.devicePixelRatio || 1);
  const { clientWidth, clientHeight } = canvas;
  if (canvas.width !== Math.round(clientWidth * ratio)) canvas.width = Math.round(clientWidth * ratio);
  if (canvas.height !== Math.round(clientHeight * ratio)) canvas.height = Math.round(clientHeight * ratio);
  const context = canvas.getContext('2d');
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, clientWidth, clientHeight);
  return context;
}

/** The theme's colours, read once a theme. */
const theme = {};
function readTheme() {
  const style = getComputedStyle(document.documentElement);
  const get = (name) => style.getPropertyValue(`--${name}`).trim();
  for (const name of ['ink', 'soft', 'line', 'gravity', 'paper-solid', 'back-inner', 'back-outer', 'ball-light', 'ball-dark']) theme[name] = get(name);
  theme.tones = {
    body: [get('figure-light'), get('figure-dark')], lung: [get('figure-lung'), get('figure-lung-dark')],
    hair: [get('figure-hair'), get('figure-hair')], face: [get('figure-face'), get('figure-light')],
  };
}
const css = (name) => theme[name.slice(2)];

/** The ball: the patient inside, gravity as an arrow. `toEye` turns the patient's axes to the eye's. */
function drawBall(canvas, toEye, gravity) {
  const context = freshContext(canvas);
  const size = canvas.clientWidth;
  const centre = size / 2;
  const radius = size / 2 - 9;
  const glass = context.createRadialGradient(centre - radius * 0.35, centre - radius * 0.45, radius * 0.1, centre, centre, radius);
  glass.addColorStop(0, css('--ball-light'));
  glass.addColorStop(1, css('--ball-dark'));
  context.beginPath();
  context.arc(centre, centre, radius, 0, 2 * Math.PI);
  context.fillStyle = glass;
  context.fill();
  context.strokeStyle = css('--line');
  context.lineWidth = 1;
  context.stroke();
  const down = rotate(toEye, gravity);
  const tip = [centre + radius * 0.97 * down[0], centre - radius * 0.97 * down[1]];
  const arrow = () => {
    const start = [centre + radius * 0.5 * down[0], centre - radius * 0.5 * down[1]];
    context.strokeStyle = context.fillStyle = css('--gravity');
    context.globalAlpha = down[2] < -0.02 ? 0.55 : 1;
    context.lineWidth = 3.5;
    context.lineCap = 'round';
    context.beginPath();
    context.moveTo(...start);
    context.lineTo(...tip);
    context.stroke();
    context.beginPath();
    context.arc(...tip, 6.5 + 1.5 * down[2], 0, 2 * Math.PI);
    context.fill();
    context.globalAlpha = 1;
  };
  const graticule = (front) => {
    context.lineWidth = 1;
    context.strokeStyle = css('--line');
    context.globalAlpha = front ? 1 : 0.4;
    for (const [p, q] of [[[1, 0, 0], [0, 1, 0]], [[0, 1, 0], [0, 0, 1]], [[0, 0, 1], [1, 0, 0]]]) {
      const [a, b] = [rotate(toEye, p), rotate(toEye, q)];
      context.beginPath();
      for (let i = 0, pen = false; i <= 90; ++i) {
        const t = (i / 90) * 2 * Math.PI;
        const at = a.map((v, j) => v * Math.cos(t) + b[j] * Math.sin(t));
        const here = at[2] >= 0 === front;
        if (here) context[pen ? 'lineTo' : 'moveTo'](centre + radius * at[0], centre - radius * at[1]);
        pen = here;
      }
      context.stroke();
    }
    context.globalAlpha = 1;
  };
  const letters = (front) => {
    context.font = '650 12px system-ui, sans-serif';
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    for (const [letter, end] of Object.entries(ENDS)) {
      const at = rotate(toEye, end);
      if (at[2] >= 0 !== front) continue;
      context.fillStyle = front ? css('--ink') : css('--soft');
      context.fillText(letter, centre + (radius - 9) * at[0], centre - (radius - 9) * at[1]);
    }
  };
  graticule(false);
  letters(false);
  if (down[2] < 0) arrow();
  drawFigure(context, toEye, centre, centre, radius * 0.92, theme.tones);
  graticule(true);
  letters(true);
  if (down[2] >= 0) arrow();
  if (down[2] < 0) { // seen through the patient
    context.save();
    context.globalAlpha = 0.6;
    arrow();
    context.restore();
  }
}

/** How far down the figure reaches, turned by q: a table's height. */
function lowestPart(q) {
  const up = rotate(inverse(q), [0, 1, 0]);
  return Math.min(...BODY.map((part) => dot(up, part.at) - Math.hypot(...part.size.map((s, i) => s * up[i]))));
}

/** The icon of a posture: the figure as it lies in the room on a table, seen from its side. */
function drawIcon(canvas, bodyToRoom) {
  const context = freshContext(canvas);
  const { clientWidth: width, clientHeight: height } = canvas;
  const camera = compose(turn([1, 0, 0], -1.45), turn([0, 0, 1], 0.35)); // room -> eye
  const q = compose(camera, bodyToRoom);
  const along = rotate(q, [0, 0, 0.86]);
  const scale = Math.min(width / 2 / (Math.abs(along[0]) + 0.12), height / 2 / (Math.abs(along[1]) + 0.2));
  const middle = height / 2 + 0.05 * scale * along[1] - 2;
  drawFigure(context, q, width / 2, middle, scale, theme.tones);
  context.fillStyle = css('--soft');
  const slope = bodyToRoom === IDENTITY ? 0 : Math.abs(rotate(bodyToRoom, [0, 0, 1])[2]);
  if (slope < 0.05 || slope > 0.95 || slope === 0) context.fillRect(width * 0.08, Math.min(height - 2, middle - scale * lowestPart(q)), width * 0.84, 2);
}
