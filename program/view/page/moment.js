// SPDX-License-Identifier: MIT
// Pose the lungs with the run-time library. A moment is the state of the lungs for a direction of gravity and a volume.

const sumOf = (values) => values.reduce((sum, x) => sum + x, 0);

/** Return the state of a moment as supine.js takes it; `depth` is mL above rest, or above the scan without a rest. */
function stateFor(basis, gravity, depth) {
  if (!basis.breathes) return { gravity };
  const sign = depth < 0 ? '-' : '+';
  return { gravity, volume: `${basis.hasRest ? 'rest' : 'scan'}${sign}${Math.abs(depth).toFixed(9)}` };
}

/** Return the lowest and the highest volume of all lungs that another simulator computed for a direction of gravity,
 * relative to that at rest or in the scan, mL. */
const simulatedRange = (basis, gravity) => basis.library.simulatedRange(gravity, basis.hasRest ? 'rest' : 'scan');

/** Pose the library of the surface, or of the structures inside it, at a moment. */
function pose(library, moment) {
  if (library.posed === moment) return library;
  if (moment.state === undefined) library.poseScan();
  else library.pose(moment.state);
  library.posed = moment;
  return library;
}

/** Return the uniforms or frames of supine.glsl, and the volume (gas and tissue) of each lung, mL, in a pose. */
function numbersOf(basis, moment) {
  const { library } = basis;
  library.posed = null;
  pose(library, moment);
  const frames = basis.clusters > 0 ? library.frames : null;
  const within = basis.inside ? pose(basis.inside.library, moment).uniforms : null;
  const held = basis.breathes ? Object.values(library.volumes) : null;
  return { frames, ...(frames ? {} : library.uniforms), within, held };
}

/** Return a moment: {gravity, state, above, weights, gains, frames, within, held, folds, limited}. `state` is what the
 * library takes, `above` the volume above rest, mL, `held` the volume of each lung. The other numbers are for the
 * shaders. `folds` is the library's message if it refuses the state, otherwise null. A volume that was not simulated in
 * this posture is replaced by the nearest that was; `limited` is then the range [low, high], otherwise null. */
function momentFor(basis, gravity, depth) {
  const range = basis.order > 0 ? simulatedRange(basis, gravity) : null;
  const above = range ? Math.max(range[0], Math.min(range[1], depth)) : depth;
  const moment = { gravity, state: stateFor(basis, gravity, above), above, limited: above === depth ? null : range };
  try {
    return Object.assign(moment, numbersOf(basis, moment), { folds: null });
  } catch (error) {
    if (error.status !== 'numerical') throw error;
    return Object.assign(moment, { folds: error.message });
  }
}

/** Return the moments from which displacements can be measured, without those that are the same. */
function takeFroms(basis) {
  const moments = basis.froms.map(({ name, gravity, state }) => {
    const moment = { name, gravity, state: state ?? undefined };
    return Object.assign(moment, numbersOf(basis, moment));
  });
  const key = (moment) => (moment.frames ? ['frames'] : ['weights', 'gains']);
  const same = (a, b) => key(a).every((name) => a[name].every((x, i) => Math.abs(x - b[name][i]) < 1e-6));
  return moments.filter((moment, i) => !moments.slice(0, i).some((other) => same(moment, other)));
}

const placesKept = new WeakMap(); // for each library, the positions at moments, which never change

/** Return the positions of all vertices of a library at a moment, mm. */
function placesIn(library, moment) {
  if (!placesKept.has(library)) placesKept.set(library, new WeakMap());
  const kept = placesKept.get(library);
  if (!kept.has(moment)) kept.set(moment, pose(library, moment).deform().slice());
  return kept.get(moment);
}

/** Return the positions of the vertices of the surface at a moment, mm. */
const placesOf = (basis, moment) => placesIn(basis.library, moment);

/** Return the position of a vertex of the surface at a moment, mm. */
const placeOf = (basis, moment, vertex) => pose(basis.library, moment).at(vertex);

/** Compute the positions of the corners of up to 3000 triangles, mm: enough to choose the range of the colours. */
function samplePlaces(basis, moment) {
  const stride = 3 * Math.max(1, Math.ceil(basis.corners.length / 3 / 3000));
  const all = placesOf(basis, moment);
  const places = [];
  for (let t = 0; t < basis.corners.length; t += stride) {
    for (const corner of basis.corners.subarray(t, t + 3)) places.push([...all.subarray(3 * corner, 3 * corner + 3)]);
  }
  return places;
}
