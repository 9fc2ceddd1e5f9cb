// SPDX-License-Identifier: MIT
// Compute and draw a frame, on the page or in a headset.

let before = null; // time of the last frame, ms; null if the last frame was not drawn
let streak = 0; // number of frames drawn without a pause
let frameTime = NaN; // smoothed time between frames, ms
let idle = null; // timer that writes the view to the URL

let kept = null; // the Picture or Poster that stores the lungs in the state `from`

let inHeadset = false;

function frame(now) {
  requestAnimationFrame(frame);
  if (!picture || inHeadset) return;
  point();
  const moving = state.advance(before === null ? 0 : (now - before) / 1000);
  if (moving) stale = unseen = true;
  const sampled = !stale && takeSample(now); // the sample stays while the lungs move
  if (sampled) unseen = true;
  if (!unseen) {
    if (state.moment) tellSettled(now);
    before = null;
    streak = 0;
    return;
  }
  streak += 1;
  if (streak > 3) frameTime = streak === 4 ? now - before : 0.9 * frameTime + 0.1 * (now - before);
  before = now;
  if (stale) {
    const good = state.compute();
    const { limited } = state.moment ?? {};
    $('message').hidden = good && !limited;
    if (good && limited) {
      $('message').className = 'plate';
      $('message').textContent = `In this posture ${limitWords(limited)} was simulated: the nearest volume is shown.`;
    }
    if (!good) {
      $('message').className = 'trouble plate';
      $('message').textContent = `No breath of ${amount(state.depth)} in this posture: ${state.trouble}.`;
    }
  }
  if (stale || sampled) deform();
  if (state.moment) draw();
  if (state.moment && (state.playing || state.live)) tellSettled(now);
  asked = false;
  showState();
  stale = unseen = false;
  const gpu = Number.isNaN(picture.gpuTime) ? '' : `, drawing ${picture.gpuTime.toFixed(1)} ms`;
  if (!Number.isNaN(frameTime)) {
    $('frame-time').hidden = false;
    write('frame-time', `frame ${frameTime.toFixed(1)} ms${gpu}`);
  }
  clearTimeout(idle);
  idle = setTimeout(keepLink, 400);
}

function deform() {
  if (!state.moment) return;
  if (kept !== picture) {
    picture.deform('from', state.from);
    kept = picture;
  }
  picture.deform('now', state.moment, state.doubt ? doubt.shift : null);
  if (state.kind === 'difference' || state.beside) picture.deform('pinned', state.pinned);
}

function draw() {
  panes = makePanes();
  picture.draw(panes);
  onStage(drawNotes);
  if (state.probes.length || $('probes').children.length || !$('probes-text').textContent) showProbes();
}

/** Advance the state to the time `now`, ms, and return the view of the lungs (pane) for a headset; null before the
 * first state is computed. */
function headsetFrame(now) {
  if (
    state.advance(inHeadset && before !== null ? (now - before) / 1000 : 0) ||
    stale ||
    !inHeadset ||
    dot(state.gravity, state.moment.gravity) < 1 - 1e-9
  ) {
    state.compute();
    deform();
    showState();
  }
  if (state.moment) tellSettled(now);
  inHeadset = true;
  before = now;
  stale = false;
  return state.moment && picture ? makePane('now', state.moment, state.q, [0, 0, 1, 1]) : null;
}

/** Offer headsets, if the browser supports them. */
function bindHeadset() {
  const headset = {
    getPicture: () => picture,
    frame: headsetFrame,
    sentence: () => $('finding').textContent,
    over: () => {
      inHeadset = false;
      before = null;
      touch();
    },
  };
  offerXr('immersive-vr', $('vr'), state, headset);
  offerXr('immersive-ar', $('ar'), state, headset);
}

function keepLink() {
  const link = linkOf(state);
  try {
    history.replaceState(null, '', `#${link}`);
  } catch {
    // Some browsers refuse to change the URL of a page that was opened from a file.
  }
}
