// SPDX-License-Identifier: MIT
// Show the doubt: plausible lungs around the computed ones, which the picture shows in their place, one after the
// other. All numbers stay those of the computed lungs.

const SAMPLES = 20;
const SEED = 0;
const SAMPLE_MS = 400; // for which each is shown

/** What is shown: sample `index`, which differs by `shift` from the computed lungs. `kept` has the samples that were
 * drawn of the lungs at `moment` and on `day`. `held` tells whether the user chose the sample. */
const doubt = { index: 0, shift: null, kept: [], moment: null, day: '', since: 0, held: false };

/** Draw a sample of the lungs on the day of the ring. Return how it differs from the computed positions, mm: of the
 * surface's vertices, and of those inside in the order of drawing. Targets are the same as of 'deform --samples'. The
 * surface does not keep its volume, so that it belongs to the targets. */
function drawSample(index) {
  const { moment, day } = state;
  const [session] = pose(basis.library, moment).expectedError();
  const anotherDay = ringOf({ session, place: null }, day).day === DAYS.another;
  const [surface, within] = [basis.library, inside?.library].map((library) => {
    const places = library && placesIn(library, moment);
    return library && pose(library, moment).sample(index, { seed: SEED, anotherDay }).map((x, i) => x - places[i]);
  });
  const inDrawnOrder = (_, i) => within[3 * inside.order[Math.floor(i / 3)] + (i % 3)];
  return { surface, inside: within?.map(inDrawnOrder) };
}

/** Take the next sample of lungs that rest at the time `now`, ms, and return whether it is another one. The sample
 * stays if the user holds it or prefers reduced motion. */
function takeSample(now) {
  if (!state.doubt || !state.moment || now - doubt.since < SAMPLE_MS) return false;
  if (doubt.moment !== state.moment || doubt.day !== state.day)
    Object.assign(doubt, { moment: state.moment, day: state.day, kept: [] });
  const stays = doubt.held || !doubt.shift || matchMedia('(prefers-reduced-motion: reduce)').matches;
  const index = stays ? doubt.index : (doubt.index + 1) % SAMPLES;
  const shift = (doubt.kept[index] ??= drawSample(index));
  const changes = shift !== doubt.shift;
  Object.assign(doubt, { index, shift, since: performance.now() }); // a large surface takes a while to draw
  return changes;
}

/** Return where a target is in the sample that is shown, mm; its computed place if none is. */
function placeInDoubt(part, at) {
  const shift = state.doubt && doubt.shift?.inside;
  if (!shift) return at;
  const members = inside.members[part];
  return at.map((x, k) => x + sumOf(members.map((vertex) => shift[3 * vertex + k])) / members.length);
}

/** Bind the switch of the doubt, to begin anew, and the slider that holds one sample. */
function bindDoubt() {
  $('doubts').hidden = !basis.metadata.expected_error_mm;
  $('sample').max = SAMPLES;
  $('doubt').addEventListener('change', () => {
    Object.assign(doubt, { index: 0, shift: null, since: 0, held: false });
  });
  $('sample').addEventListener('input', () => {
    Object.assign(doubt, { index: $('sample').valueAsNumber - 1, since: 0, held: true });
  });
}

/** Show the number of the sample. */
function showDoubt() {
  $('sampled').hidden = !state.doubt;
  if (!state.doubt) return;
  $('sample').value = doubt.index + 1;
  fill($('sample'));
  const number = String(doubt.index + 1).padStart(2, '\u2007'); // as wide as two digits
  write('sample-text', `${SAMPLES} plausible lungs, seed ${SEED}: number ${number}`);
}
