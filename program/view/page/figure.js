// SPDX-License-Identifier: MIT
// Draw the patient as a figure of ellipsoids on 2-D canvases: in the ball with which the user turns the patient, and
// on the icons of the postures.

// Centres, half axes and tones of the ellipsoids that form the figure, in the patient's axes (x left, y back, z head).
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

const AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
for (const part of BODY) part.squares = part.size.map((x) => x * x);

/** Direction of each end of the patient's axes. */
const ENDS = { L: [1, 0, 0], R: [-1, 0, 0], A: [0, -1, 0], P: [0, 1, 0], H: [0, 0, 1], F: [0, 0, -1] };

const lights = new WeakMap(); // for each context of a canvas, the last result of lightsOf
/** Return the gradients that shade a ball of radius 1, one for each tone. They are made once for each canvas and
 * colour theme. */
function lightsOf(context, tones) {
  const made = lights.get(context);
  if (made?.tones === tones) return made;
  const fresh = { tones };
  for (const [name, [bright, dim]] of Object.entries(tones)) {
    fresh[name] = context.createRadialGradient(-0.3, -0.5, 0, 0, 0, 1.05);
    fresh[name].addColorStop(0, bright);
    fresh[name].addColorStop(1, dim);
  }
  lights.set(context, fresh);
  return fresh;
}

/** Draw the figure at (x, y), with `scale` CSS pixels for each unit of BODY. The quaternion `q` rotates the
 * patient's axes to the eye's axes (x right, y up, z to the viewer). */
function drawFigure(context, q, x, y, scale, tones) {
  const [ex, ey, ez] = AXES.map((axis) => rotate(q, axis));
  const light = lightsOf(context, tones);
  const parts = BODY.map(({ at, squares: [a, b, c], tone }) => ({
    tone,
    x: at[0] * ex[0] + at[1] * ey[0] + at[2] * ez[0],
    y: at[0] * ex[1] + at[1] * ey[1] + at[2] * ez[1],
    xx: a * ex[0] * ex[0] + b * ey[0] * ey[0] + c * ez[0] * ez[0],
    xy: a * ex[0] * ex[1] + b * ey[0] * ey[1] + c * ez[0] * ez[1],
    yy: a * ex[1] * ex[1] + b * ey[1] * ey[1] + c * ez[1] * ez[1],
    // depth by which ellipsoids are sorted: that of the centre plus half of the extent towards the viewer
    front: at[0] * ex[2] + at[1] * ey[2] + at[2] * ez[2] + 0.5 * Math.sqrt(a * ex[2] * ex[2] + b * ey[2] * ey[2] + c * ez[2] * ez[2]),
  })).sort((a, b) => a.front - b.front);
  context.save();
  const { a: ratio } = context.getTransform(); // device pixels per CSS pixel, from freshContext
  for (const part of parts) {
    // Draw a shaded circle of radius 1, mapped to the outline of the ellipsoid, an ellipse. The map is the symmetric
    // square root of the ellipse's matrix, because this does not rotate the shading.
    const det = Math.sqrt(Math.max(part.xx * part.yy - part.xy * part.xy, 0));
    const by = (ratio * scale) / Math.sqrt(part.xx + part.yy + 2 * det);
    context.setTransform(by * (part.xx + det), -by * part.xy, -by * part.xy, by * (part.yy + det), ratio * (x + scale * part.x), ratio * (y - scale * part.y));
    context.beginPath();
    context.arc(0, 0, 1, 0, 2 * Math.PI);
    context.fillStyle = light[part.tone];
    context.fill();
  }
  context.restore();
}

const sizes = new WeakMap();
const measured = new ResizeObserver((entries) => entries.forEach(({ target }) => sizes.delete(target)));
/** Return the size of a canvas, CSS pixels. It is measured only after a change, because measuring forces a layout. */
function sizeOf(canvas) {
  if (!sizes.has(canvas)) {
    sizes.set(canvas, { width: canvas.clientWidth, height: canvas.clientHeight });
    measured.observe(canvas);
  }
  return sizes.get(canvas);
}

/** Fit a canvas to the screen's pixels, clear it, and return its context, scaled to CSS pixels. */
function freshContext(canvas) {
  const ratio = Math.min(3, window.devicePixelRatio || 1);
  const { width, height } = sizeOf(canvas);
  if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
  if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
  const context = canvas.getContext('2d');
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return context;
}

/** Colours of the current theme, set by readTheme. */
const theme = {};
function readTheme() {
  const style = getComputedStyle(document.documentElement);
  const get = (name) => style.getPropertyValue(`--${name}`).trim();
  for (const name of ['ink', 'soft', 'line', 'gravity', 'paper-solid', 'accent', 'table', 'back-inner', 'back-outer', 'ball-light', 'ball-dark']) theme[name] = get(name);
  theme.tones = {
    body: [get('figure-light'), get('figure-dark')], lung: [get('figure-lung'), get('figure-lung-dark')],
    hair: [get('figure-hair'), get('figure-hair')], face: [get('figure-face'), get('figure-light')],
  };
}
const css = (name) => theme[name.slice(2)];

const GLYPH = 18; // side of a letter's box, CSS pixels

let glyphsMade = null;
/** Return a canvas with the letters on the gravity ball: one row for letters in front, and one row for letters behind.
 * The letters are drawn once for each colour theme, because drawing text is slow. */
function glyphsOf() {
  const ratio = Math.min(3, window.devicePixelRatio || 1);
  if (glyphsMade?.tones === theme.tones && glyphsMade.ratio === ratio) return glyphsMade;
  const glyphs = document.createElement('canvas');
  const letters = Object.keys(ENDS);
  [glyphs.width, glyphs.height] = [letters.length * GLYPH * ratio, 2 * GLYPH * ratio];
  const context = glyphs.getContext('2d');
  context.scale(ratio, ratio);
  context.font = '650 12px system-ui, sans-serif';
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  ['--ink', '--soft'].forEach((colour, row) => {
    context.fillStyle = css(colour);
    letters.forEach((letter, i) => context.fillText(letter, (i + 0.5) * GLYPH, (row + 0.5) * GLYPH));
  });
  glyphsMade = { glyphs, ratio, tones: theme.tones };
  return glyphsMade;
}

let drawn = [];   // size, theme, rotation and gravity with which the gravity ball was last drawn
let glass = null; // gradient that shades the gravity ball, made once for each size and theme
/** Draw the gravity ball: a sphere with the patient inside and gravity as an arrow. The quaternion `toEye` rotates the
 * patient's axes to the eye's axes. */
function drawBall(canvas, toEye, gravity) {
  const { width: size } = sizeOf(canvas);
  const now = [size, window.devicePixelRatio, theme.tones, ...toEye, ...gravity];
  if (now.every((x, i) => x === drawn[i])) return;
  const context = freshContext(canvas);
  const centre = size / 2;
  const radius = size / 2 - 9;
  if (glass === null || now[0] !== drawn[0] || now[2] !== drawn[2]) {
    glass = context.createRadialGradient(centre - radius * 0.35, centre - radius * 0.45, radius * 0.1, centre, centre, radius);
    glass.addColorStop(0, css('--ball-light'));
    glass.addColorStop(1, css('--ball-dark'));
  }
  drawn = now;
  context.beginPath();
  context.arc(centre, centre, radius, 0, 2 * Math.PI);
  context.fillStyle = glass;
  context.fill();
  context.strokeStyle = css('--line');
  context.lineWidth = 1;
  context.stroke();
  const down = rotate(toEye, gravity);
  const ends = Object.values(ENDS).map((end) => rotate(toEye, end));
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
    context.beginPath(); // draw all three great circles by one stroke
    for (const n of [ends[0], ends[3], ends[4]]) { // L, P and H
      // Draw the near or the far half of the great circle normal to n. Its projection is an ellipse. If n points to the
      // viewer, the near half of the circle projects to the half of the ellipse opposite to the projection of n.
      const begin = n[2] > 0 === front ? -radius : radius;
      const angle = Math.atan2(-n[0], -n[1]);
      context.moveTo(centre + begin * Math.cos(angle), centre + begin * Math.sin(angle));
      context.ellipse(centre, centre, radius, radius * Math.abs(n[2]), angle, begin < 0 ? Math.PI : 0, begin < 0 ? 2 * Math.PI : Math.PI);
    }
    context.stroke();
    context.globalAlpha = 1;
  };
  const { glyphs, ratio } = glyphsOf();
  const box = GLYPH * ratio;
  const letters = (front) => {
    ends.forEach((at, i) => {
      if (at[2] >= 0 !== front) return;
      const [x, y] = [centre + (radius - 9) * at[0], centre - (radius - 9) * at[1]];
      context.drawImage(glyphs, i * box, front ? 0 : box, box, box, x - GLYPH / 2, y - GLYPH / 2, GLYPH, GLYPH);
    });
  };
  graticule(false);
  letters(false);
  if (down[2] < 0) arrow();
  drawFigure(context, toEye, centre, centre, radius * 0.92, theme.tones);
  graticule(true);
  letters(true);
  if (down[2] >= 0) arrow();
  if (down[2] < 0) { // show the arrow through the patient, who hides it
    context.save();
    context.globalAlpha = 0.6;
    arrow();
    context.restore();
  }
}

/** Return the height of the lowest point of the patient's figure rotated by the quaternion `q`. */
function lowestPart(q) {
  const up = rotate(inverse(q), [0, 1, 0]);
  return Math.min(...BODY.map((part) => dot(up, part.at) - Math.hypot(...part.size.map((s, i) => s * up[i]))));
}

/** Draw the icon of a posture: the patient's figure on a table, seen from the side of the table. */
function drawIcon(canvas, bodyToRoom) {
  const context = freshContext(canvas);
  const { width, height } = sizeOf(canvas);
  const camera = compose(turn([1, 0, 0], -1.45), turn([0, 0, 1], 0.35)); // rotation from the room's to the eye's axes
  const q = compose(camera, bodyToRoom);
  const along = rotate(q, [0, 0, 0.86]);
  const scale = Math.min(width / 2 / (Math.abs(along[0]) + 0.12), height / 2 / (Math.abs(along[1]) + 0.2));
  const middle = height / 2 + 0.05 * scale * along[1] - 2;
  drawFigure(context, q, width / 2, middle, scale, theme.tones);
  context.fillStyle = css('--soft');
  const slope = bodyToRoom === IDENTITY ? 0 : Math.abs(rotate(bodyToRoom, [0, 0, 1])[2]);
  if (slope < 0.05 || slope > 0.95 || slope === 0) context.fillRect(width * 0.08, Math.min(height - 2, middle - scale * lowestPart(q)), width * 0.84, 2);
}
