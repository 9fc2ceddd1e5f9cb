// SPDX-License-Identifier: MIT
// Turn, shift and zoom the camera, and turn the patient.

/** Turn the camera about the lungs by angles, radians. */
function orbit(dx, dy) {
  state.camera.azimuth += dx;
  state.camera.elevation = Math.max(-RIGHT_ANGLE, Math.min(RIGHT_ANGLE, state.camera.elevation + dy));
  redraw();
}

const boxSize = () => ({ width: sizeOf(canvas).width / (state.beside ? 2 : 1), height: sizeOf(canvas).height });

/** Shift the picture by distances in CSS pixels. */
function shift(dx, dy) {
  const { width, height } = boxSize();
  const mm = (2 * tangent * distanceNow(width / height)) / height;
  state.camera.pan = [state.camera.pan[0] + dx * mm, state.camera.pan[1] - dy * mm];
  redraw();
}

/** Zoom by a ratio, towards the position `at` on the canvas, CSS pixels. A point that is seen there, as far away as
 * the camera's pivot, does not move on the canvas. */
function zoom(ratioOfSizes, at) {
  const { width, height } = boxSize();
  const aspect = width / height;
  const first = distanceNow(aspect);
  state.camera.zoom = Math.max(0.4, Math.min(20, state.camera.zoom * ratioOfSizes));
  const grown = distanceNow(aspect) - first;
  if (at && panes.length) {
    const { x, y } = paneAt(at);
    state.camera.pan = [state.camera.pan[0] + x * tangent * aspect * grown, state.camera.pan[1] + y * tangent * grown];
  }
  redraw();
}

function lookFrom(letter) {
  // Direction to the viewer, in the room's axes
  const [x, y, z] = rotate(modelTurn(state.goal), ENDS[letter]).map((part) => Math.round(1e9 * part) / 1e9);
  Object.assign(state.camera, {
    azimuth: Math.atan2(0 - x, 0 - y),
    elevation: Math.asin(Math.max(-1, Math.min(1, z))),
    pan: [0, 0],
  });
  redraw();
}

/** Turn the patient (or gravity, if the view is fixed to the patient) by a drag of the silhouette, angles in
 * radians. */
function spin(dx, dy) {
  const sense = state.room ? 1 : -1;
  for (const [axis, angle] of [
    [[0, 1, 0], dx],
    [[1, 0, 0], dy],
  ]) {
    const inBody = rotate(inverse(compose(cameraTurn(), modelTurn())), axis);
    state.roll(rotate(state.q, inBody), sense * angle);
  }
  touch();
}

/** Bind the keys that move the camera. */
function bindCameraKeys() {
  canvas.addEventListener('keydown', (event) => {
    const arrow = ARROWS[event.key];
    if (arrow && event.shiftKey) shift(-arrow[0] * 24, -arrow[1] * 24);
    else if (arrow) orbit(arrow[0] * 0.09, arrow[1] * 0.09);
    if (event.key === '+' || event.key === '=') zoom(1.12);
    if (event.key === '-') zoom(1 / 1.12);
    if (arrow) event.preventDefault();
  });
}

/** Turn the patient by drags and keys on the silhouette. */
function bindSilhouette() {
  onDrag($('patient'), (dx, dy) => spin(dx / 66, dy / 66));
  $('patient').addEventListener('keydown', (event) => {
    const arrow = ARROWS[event.key];
    if (!arrow) return;
    event.preventDefault();
    const step = ((event.shiftKey ? 1 : 5) * Math.PI) / 180;
    spin(arrow[0] * step, arrow[1] * step);
  });
}
