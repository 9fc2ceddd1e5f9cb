// SPDX-License-Identifier: MIT
// Show the lungs at life size in a headset, if the browser has WebXR: before the viewer in virtual reality, or at the
// patient's place in see-through (augmented) reality, turned by a controller that lies on the breastbone.

const XR_AWAY = 0.7; // distance of the lungs from the viewer's first position in virtual reality, m

/** Return the product of column-major 4 x 4 matrices. */
const product = (a, b) =>
  Float32Array.from({ length: 16 }, (_, i) => {
    let sum = 0;
    for (let k = 0; k < 4; ++k) sum += a[4 * k + (i % 4)] * b[4 * Math.floor(i / 4) + k];
    return sum;
  });

/** Return a copy of a pane (a view to draw) for one eye of the headset. `room` maps millimetres in the patient's axes,
 * turned by pane.turn if `turned` is true, to metres in the room. */
function xrPane(pane, view, { x, y, width, height }, room, turned) {
  const toEye = product(view.transform.inverse.matrix, room);
  return {
    ...pane,
    box: [x, y, width, height],
    toEye: turned ? product(toEye, pane.toEye) : toEye,
    tableToEye: turned && pane.tableToEye && product(toEye, pane.tableToEye),
    fade: turned ? pane.fade : null,
    projection: view.projectionMatrix,
    pixel: 0,
    dark: true,
  };
}

/** The controller on the patient's breastbone: its forward direction points to the head, and its upper side to the
 * front. In the room of WebXR, y points up. */
class Tracker {
  constructor(state) {
    Object.assign(this, { state, known: gravityOf(state.goal), off: IDENTITY, place: null });
  }

  /** Take the pose of the controller: turn the patient, and keep where the breastbone is. If `pressed`, correct the
   * tracker so that the patient is in the posture that was chosen before the session. */
  take({ transform: { position, orientation: o } }, pressed) {
    const { state } = this;
    const untrimmed = compose([o.x, o.y, o.z, o.w], turn([1, 0, 0], Math.PI)); // from the patient's axes to the room's
    if (pressed) {
      const [known, seen] = [this.known, rotate(inverse(untrimmed), [0, -1, 0])];
      const axis = cross(known, seen);
      const size = Math.hypot(...axis);
      this.off =
        size < 1e-6
          ? IDENTITY
          : turn(
              axis.map((x) => x / size),
              Math.atan2(size, dot(known, seen)),
            );
    }
    this.q = compose(untrimmed, this.off);
    this.place = [position.x, position.y, position.z];
    const q = compose(turn([1, 0, 0], RIGHT_ANGLE), this.q);
    if (1 - Math.abs(q.reduce((sum, x, i) => sum + x * state.q[i], 0)) > 1e-7) state.settle(q, 0, 0);
  }

  /** Return the matrix from the patient's axes, mm, to the room, m; `breastbone` is the controller's place in the
   * patient's axes. */
  room(breastbone) {
    const metres = rigid(this.q, [0, 0, 0]).map((x, i) => (i < 15 ? 1e-3 * x : x));
    const away = rotate(this.q, breastbone);
    this.place.forEach((x, i) => {
      metres[12 + i] = x - 1e-3 * away[i];
    });
    return metres;
  }
}

/** Return a function that draws a frame of a session for each eye, and returns whether it has used `pressed`. */
function xrFrames({ tracker, space, layer, torso, getPicture, frame, sentence }) {
  const breastbone = [torso.centre[0], torso.centre[1] - 1.2 * torso.half[1], torso.centre[2] + 0.3 * torso.half[2]];
  const away = (distance) =>
    Float32Array.from([1e-3, 0, 0, 0, 0, 1e-3, 0, 0, 0, 0, 1e-3, 0, 0, 0, 1e-3 * distance - XR_AWAY, 1]);
  const overHead = (room) => (i) =>
    room[12 + i] + torso.centre.reduce((sum, x, k) => sum + room[4 * k + i] * x, i === 1 ? 0.35 : 0);
  return (time, seen, session, pressed) => {
    const controller =
      tracker && [...session.inputSources].find(({ targetRayMode }) => targetRayMode === 'tracked-pointer');
    const held = controller && seen.getPose(controller.targetRaySpace, space);
    if (held) tracker.take(held, pressed);
    const views = seen.getViewerPose(space)?.views ?? [];
    const pane = views.length && (!tracker || tracker.place) ? frame(time) : null;
    if (!pane) return Boolean(held);
    const room = tracker ? tracker.room(breastbone) : away(pane.distance);
    const above = tracker ? [0, 1, 2].map(overHead(room)) : [0, 0.35, -XR_AWAY];
    const note = (view) => ({ text: sentence(), toEye: view.transform.inverse.matrix, at: above });
    const eyes = views.map((view) => ({
      ...xrPane(pane, view, layer.getViewport(view), room, !tracker),
      note: note(view),
    }));
    getPicture().draw(eyes, layer.framebuffer);
    return Boolean(held);
  };
}

/** If the browser supports a headset, show `button`, which starts and ends a session of `kind`: immersive-vr or
 * immersive-ar. getPicture() returns the Picture that draws. frame(time) advances the state and returns the pane (the
 * view) to draw, or null if there is none yet. sentence() returns the text of the panel, and over() is called after a
 * session. */
async function offerXr(kind, button, state, { getPicture, frame, sentence, over }) {
  if (!(await navigator.xr?.isSessionSupported(kind).catch(() => false))) return;
  const enter = button.textContent;
  button.hidden = false;
  let session = null;
  button.addEventListener('click', async () => {
    if (session) {
      session.end();
      return;
    }
    const {
      gl,
      basis: { torso },
    } = getPicture();
    try {
      session = await navigator.xr.requestSession(kind);
      await gl.makeXRCompatible();
    } catch {
      // the user declined, or the graphics card cannot serve the headset
      session?.end();
      session = null;
      return;
    }
    const layer = new XRWebGLLayer(session, gl);
    session.updateRenderState({ baseLayer: layer, depthNear: 0.05, depthFar: 20 });
    const space = await session.requestReferenceSpace('local');
    const tracker = kind === 'immersive-ar' ? new Tracker(state) : null;
    let pressed = false;
    session.addEventListener('select', () => {
      pressed = true;
    });
    button.textContent = enter.replace('Enter', 'Leave');
    session.addEventListener('end', () => {
      session = null;
      button.textContent = enter;
      over();
    });
    const show = xrFrames({ tracker, space, layer, torso, getPicture, frame, sentence });
    const draw = (time, seen) => {
      if (!session) return; // the session ended after this frame was requested
      session.requestAnimationFrame(draw);
      if (show(time, seen, session, pressed)) pressed = false;
    };
    session.requestAnimationFrame(draw);
  });
}
