// SPDX-License-Identifier: MIT
// Show the lungs at life size in a virtual-reality headset, if the browser has WebXR.

const XR_AWAY = 0.7; // distance of the lungs from the viewer's first position, m

/** Return the product of column-major 4 x 4 matrices. */
const product = (a, b) => Float32Array.from({ length: 16 }, (_, i) => {
  let sum = 0;
  for (let k = 0; k < 4; ++k) sum += a[4 * k + (i % 4)] * b[4 * Math.floor(i / 4) + k];
  return sum;
});

/** Return a copy of a pane (a view to draw) for one eye of the headset: in front of the viewer, in metres instead of
 * millimetres. */
function xrPane(pane, view, { x, y, width, height }) {
  const room = Float32Array.from([1e-3, 0, 0, 0, 0, 1e-3, 0, 0, 0, 0, 1e-3, 0, 0, 0, 1e-3 * pane.distance - XR_AWAY, 1]);
  const toEye = product(view.transform.inverse.matrix, room);
  return {
    ...pane, box: [x, y, width, height], toEye: product(toEye, pane.toEye), arrowToEye: product(toEye, pane.arrowToEye), tableToEye: pane.tableToEye && product(toEye, pane.tableToEye),
    projection: view.projectionMatrix, pixel: 0, dark: true,
  };
}

/** If the browser supports a headset, show `button`, which starts and ends a session. getPicture() returns the Picture
 * that draws. frame(time) advances the state and returns the pane (the view) to draw, or null if there is none yet.
 * over() is called after a session. */
async function offerXr(button, getPicture, frame, over) {
  if (!(await navigator.xr?.isSessionSupported('immersive-vr').catch(() => false))) return;
  button.hidden = false;
  let session = null;
  button.addEventListener('click', async () => {
    if (session) {
      session.end();
      return;
    }
    const { gl } = getPicture();
    try {
      session = await navigator.xr.requestSession('immersive-vr');
      await gl.makeXRCompatible();
    } catch { // the user declined, or the graphics card cannot serve the headset
      session?.end();
      session = null;
      return;
    }
    const layer = new XRWebGLLayer(session, gl);
    session.updateRenderState({ baseLayer: layer, depthNear: 0.05, depthFar: 20 });
    const space = await session.requestReferenceSpace('local');
    button.textContent = 'Leave VR';
    session.addEventListener('end', () => {
      session = null;
      button.textContent = 'Enter VR';
      over();
    });
    const draw = (time, seen) => {
      if (!session) return; // the session ended after this frame was requested
      session.requestAnimationFrame(draw);
      const views = seen.getViewerPose(space)?.views ?? [];
      const pane = views.length ? frame(time) : null;
      if (pane) getPicture().draw(views.map((view) => xrPane(pane, view, layer.getViewport(view))), layer.framebuffer);
    };
    session.requestAnimationFrame(draw);
  });
}
