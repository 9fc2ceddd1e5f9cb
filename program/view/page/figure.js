// SPDX-License-Identifier: MIT
// Draw the patient as a silhouette of ellipsoids on 2-D canvases.

// Centres and half axes of the ellipsoids that form the figure, in the patient's axes (x left, y back, z head).
const BODY = [
  [
    [0, 0, 0.3],
    [0.27, 0.14, 0.16],
  ],
  [
    [0, 0, 0.1],
    [0.2, 0.14, 0.4],
  ],
  [
    [0, 0.01, -0.18],
    [0.2, 0.14, 0.17],
  ],
  [
    [0, 0.01, 0.66],
    [0.125, 0.125, 0.16],
  ],
  [
    [0, -0.13, 0.65],
    [0.025, 0.04, 0.03],
  ],
  [
    [0, 0.02, 0.5],
    [0.06, 0.06, 0.1],
  ],
  [
    [0.09, 0, -0.55],
    [0.085, 0.095, 0.36],
  ],
  [
    [-0.09, 0, -0.55],
    [0.085, 0.095, 0.36],
  ],
  [
    [0.09, -0.07, -0.88],
    [0.055, 0.1, 0.04],
  ],
  [
    [-0.09, -0.07, -0.88],
    [0.055, 0.1, 0.04],
  ],
  [
    [0.27, 0.03, 0.12],
    [0.055, 0.06, 0.32],
  ],
  [
    [-0.27, 0.03, 0.12],
    [0.055, 0.06, 0.32],
  ],
  [
    [0.26, 0.02, -0.2],
    [0.045, 0.05, 0.2],
  ],
  [
    [-0.26, 0.02, -0.2],
    [0.045, 0.05, 0.2],
  ],
];

const AXES = [
  [1, 0, 0],
  [0, 1, 0],
  [0, 0, 1],
];

/** Direction of each end of the patient's axes. */
const ENDS = { L: [1, 0, 0], R: [-1, 0, 0], A: [0, -1, 0], P: [0, 1, 0], H: [0, 0, 1], F: [0, 0, -1] };

/** Draw the figure at (x, y) in one colour, with `scale` CSS pixels for each unit of BODY. The quaternion `q` rotates
 * the patient's axes to the eye's axes (x right, y up, z to the viewer). */
function drawFigure(context, q, x, y, scale) {
  const axes = AXES.map((axis) => rotate(q, axis));
  context.save();
  const { a: ratio } = context.getTransform(); // device pixels per CSS pixel, from freshContext
  for (const [at, size] of BODY) {
    const [px, py] = rotate(q, at);
    const sum = (i, j) => axes.reduce((total, axis, k) => total + size[k] ** 2 * axis[i] * axis[j], 0);
    const [xx, xy, yy] = [sum(0, 0), sum(0, 1), sum(1, 1)];
    // Map a circle of radius 1 to the outline of the ellipsoid, an ellipse, by the square root of the ellipse's matrix.
    const det = Math.sqrt(Math.max(xx * yy - xy * xy, 0));
    const by = (ratio * scale) / Math.sqrt(xx + yy + 2 * det);
    context.setTransform(
      by * (xx + det),
      -by * xy,
      -by * xy,
      by * (yy + det),
      ratio * (x + scale * px),
      ratio * (y - scale * py),
    );
    context.beginPath();
    context.arc(0, 0, 1, 0, 2 * Math.PI);
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

/** Colours of the page in the current theme, and of the picture, which has a ground of its own. readTheme sets them. */
const themes = { page: {}, stage: {} };
let theme = themes.page; // colours that css() returns
function readTheme() {
  for (const [name, element] of [
    ['page', document.documentElement],
    ['stage', $('stage')],
  ]) {
    const style = getComputedStyle(element);
    for (const colour of [
      'ink',
      'soft',
      'line',
      'edge',
      'gravity',
      'back',
      'paper-solid',
      'accent',
      'table',
      'change',
      'field',
      'figure',
    ])
      themes[name][colour] = style.getPropertyValue(`--${colour}`).trim();
  }
}
const css = (name) => theme[name.slice(2)];

/** Call `draw` while css() returns the colours of the picture. */
function onStage(draw) {
  theme = themes.stage;
  try {
    return draw();
  } finally {
    theme = themes.page;
  }
}

/** Draw the silhouette of the patient on a table, seen as the picture shows the patient. The quaternion `toEye` rotates
 * the patient's axes to the eye's axes. */
function drawSilhouette(canvas, toEye) {
  const context = freshContext(canvas);
  const { width, height } = sizeOf(canvas);
  const along = rotate(toEye, [0, 0, 0.86]);
  const scale = Math.min(width / 2 / (Math.abs(along[0]) + 0.14), height / 2 / (Math.abs(along[1]) + 0.2));
  const up = rotate(inverse(toEye), [0, 1, 0]);
  const lowest = Math.min(...BODY.map(([at, size]) => dot(up, at) - Math.hypot(...size.map((s, i) => s * up[i]))));
  const middle = height / 2 - 1;
  context.fillStyle = css('--figure');
  drawFigure(context, toEye, width / 2, middle, scale);
  if (Math.abs(along[1]) < 0.05 || Math.abs(along[1]) > 0.8)
    context.fillRect(width * 0.04, Math.min(height - 1.5, middle - scale * lowest + 1), width * 0.92, 1.5);
}
