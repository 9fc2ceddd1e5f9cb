// SPDX-License-Identifier: MIT
// Compute how far targets and the surface move, with the expected error, and write it in words.

/** Published changes, %, of the volume that each lung has at rest, relative to the supine posture: mean (standard
 * deviation), by posture. */
const PUBLISHED = { left: 'left 0 % (SD 44), right +25 % (SD 11); Little 2021, n\u00a010' };

/** Return the volume (gas plus tissue) of each lung, mL. */
const heldBy = (basis, moment) => basis.references.map((ml, lung) => ml + formAt(lungForm(basis, lung, weightsOf(basis, moment, lung)), moment.gains.slice(3 * lung, 3 * lung + 3)));

/** Return a weight for each vertex, proportional to the area of the triangles around it. */
function areasOf({ surface, corners, vertices }) {
  const areas = new Float32Array(vertices);
  for (let t = 0; t < corners.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map((i) => surface.subarray(3 * corners[t + i], 3 * corners[t + i] + 3));
    const piece = Math.hypot(...cross([0, 1, 2].map((i) => b[i] - a[i]), [0, 1, 2].map((i) => c[i] - a[i])));
    for (let i = 0; i < 3; ++i) areas[corners[t + i]] += piece;
  }
  return areas;
}

/** Return statistics of the distance of the surface's vertices between positions `after` and `before`, mm: the mean over
 * the area, the 95th percentile (rounded up to a multiple of 1/2000 of the largest), the largest, and the vertex where
 * it is. */
function distancesOf(basis, after, before) {
  basis.areas ??= areasOf(basis);
  const { areas } = basis;
  const far = new Float32Array(basis.vertices);
  let [sum, area, at] = [0, 0, 0];
  for (let v = 0; v < far.length; ++v) {
    far[v] = Math.hypot(after[3 * v] - before[3 * v], after[3 * v + 1] - before[3 * v + 1], after[3 * v + 2] - before[3 * v + 2]);
    sum += areas[v] * far[v];
    area += areas[v];
    if (far[v] > far[at]) at = v;
  }
  const bins = new Float64Array(2001);
  far.forEach((mm, v) => { bins[Math.ceil((2000 * mm) / (far[at] || 1))] += areas[v]; });
  let [bin, within] = [0, bins[0]];
  while (within < 0.95 * area && bin < 2000) within += bins[++bin];
  return { mean: sum / area, p95: (bin / 2000) * far[at], largest: far[at], at };
}

/** Return, for each lung and axis, the sums over its vertices of the products of their displacements by two modes at
 * weight and gain 1, divided by the number of all vertices: matrices [lungs, 3, modes, modes], mm^2. The page of a
 * simplified surface has those of the whole one. */
function squaresOf(basis) {
  const { modes, vertices } = basis;
  const sums = new Float64Array(basis.lungs * 3 * modes * modes);
  const by = Array.from({ length: modes }, () => [0, 0, 0]);
  for (let v = 0, lung = 0; v < vertices; ++v) {
    while (v >= basis.lungBegin[lung + 1]) ++lung;
    by.forEach((displacement, k) => modeOf(basis, v, k, displacement));
    for (let axis = 0, at = 3 * lung * modes * modes; axis < 3; ++axis) {
      for (let k = 0; k < modes; ++k) for (let l = 0; l < modes; ++l, ++at) sums[at] += (by[k][axis] * by[l][axis]) / vertices;
    }
  }
  return sums;
}

/** Return the RMS over the vertices of the surface of their distance between two states of the lungs, mm, without a pass
 * over the vertices. */
function rmsBetween(basis, now, from) {
  basis.squares ??= basis.wholeVertices > basis.vertices ? takeTensor('squares', Float64Array) : squaresOf(basis);
  const { modes, squares } = basis;
  let sum = 0;
  for (let row = 0, at = 0; row < 3 * basis.lungs; ++row) {
    const [to, past] = [now, from].map((moment) => weightsOf(basis, moment, Math.floor(row / 3)));
    const by = Float64Array.from({ length: modes }, (_, k) => now.gains[row] * to[k] - from.gains[row] * past[k]);
    for (let k = 0; k < modes; ++k) for (let l = 0; l < modes; ++l, ++at) sum += by[k] * by[l] * squares[at];
  }
  return Math.sqrt(Math.max(0, sum));
}

/** Return the RMS over points of the expected error of their displacement u, mm. The squared error of a point is the
 * sum of the terms of supine/locate.h: of u itself; of u minus its part `level`, without a turn; of a volume at rest that
 * is only assumed, by the change of u if the volumes of the states that count from rest grow by 1 % of the reference
 * volume; beside the heart; and sideways. `places(moment)` returns the points in a state of the lungs, `reference` has
 * their reference positions, and `terms` is the result of termsBetween. */
function expectedError({ now, from, law, turn: turning, level, perStep, fuller, heart, sliding }, places, reference) {
  const [a, b] = [places(now), places(from)];
  const [more, flat] = [fuller?.map(places), level?.map(places)];
  let sum = 0;
  for (let i = 0; i < a.length; i += 3) {
    let [square, slope, turned] = [0, 0, 0];
    for (let k = i; k < i + 3; ++k) {
      const u = a[k] - b[k];
      square += u * u;
      if (more) slope += (more[0][k] - more[1][k] - u) ** 2;
      if (flat) turned += (u - flat[0][k] + flat[1][k]) ** 2;
    }
    sum += law * Math.sqrt(square) + turning * Math.sqrt(turned) + perStep ** 2 * slope + heart(reference.subarray(i, i + 3)) ** 2 + sliding ** 2;
  }
  return Math.sqrt(sum / (a.length / 3));
}

/** Return a function that computes, from a reference position, the error beside the heart, mm, for a change of gravity
 * by `across` across the body. */
function heartError({ metadata, expected, torso: { low, high } }, across) {
  const middle = Number(metadata.midline_mm);
  return ([x, y, z]) => {
    const width = x > middle ? high[0] - middle : middle - low[0];
    const share = (v, axis) => (high[axis] > low[axis] ? (high[axis] - v) / (high[axis] - low[axis]) : 0.5);
    const [out, back, down] = [width > 0 ? Math.abs(x - middle) / width : 0, share(y, 1), share(z, 2)];
    return expected.heart * across * Math.max(0, 1 - out / 0.7) * Math.max(0, 4 * back * (1 - back)) * Math.max(0, 1 - Math.abs(down - 0.65) / 0.35);
  };
}

/** Return what expectedError needs for the displacement from the state `from` to the state `now`. `known`: whether the
 * error is known. The cost does not depend on the number of vertices, so that every frame can have its own terms. */
function termsBetween(basis, now, from) {
  const { metadata, expected } = basis;
  const rms = rmsBetween(basis, now, from);
  const number = (key, usual) => (Number(metadata[key]) > 0 ? Number(metadata[key]) : usual);
  const full = Math.min(1, rms / expected.fullBreath);
  const law = number('expected_error_mm', expected.constant) * Math.min(1, rms / number('expected_error_from_mm', expected.fullBreath));
  const turning = metadata.turn_fitted ? 0 : Math.max(0, expected.constant * full - law);
  const scan = (metadata.scan_gravity ?? '0,1,0').split(',').map(Number);
  const volume = sumOf(basis.references);
  const assumed = basis.hasResting && !metadata.resting_known && metadata.scanned !== 'rest' && !metadata.scan_state?.includes('rest');
  const at = (gravity, more) => [momentFor(basis, gravity ?? now.gravity, now.above + more), from.above === null ? from : momentFor(basis, gravity ?? from.gravity, from.above + more)];
  const change = unit(now.gravity).map((x, i) => x - unit(from.gravity)[i]);
  return {
    now, from, law, turn: turning, level: turning > 0 ? at(scan, 0) : null, fuller: assumed ? at(null, 0.01 * volume) : null,
    perStep: assumed ? (number('resting_spread', expected.spread) * (volume + restFor(basis, scan))) / volume / 0.01 : 0, heart: heartError(basis, Math.hypot(change[0], change[1])), sliding: expected.sliding * Math.abs(change[0]),
    known: Boolean(metadata.expected_error_mm && now.held),
  };
}

/** Return how the lungs move from the state `from` to the state `now`: the statistics of distancesOf, and the result of
 * termsBetween. `error` is that of the surface, mm; null if it is unknown. */
function movedBetween(basis, now, from) {
  const places = (moment) => placesOf(basis, moment);
  const terms = termsBetween(basis, now, from);
  return { ...distancesOf(basis, places(now), places(from)), ...terms, error: terms.known ? expectedError(terms, places, basis.surface) : null };
}

/** Return how a structure inside the lungs moves: the mean position of its vertices `at` and before, `was`, its
 * displacement and distance, mm, and the expected error, null if it is unknown. */
function targetOf(inside, part, moved) {
  const mean = (places) => [0, 1, 2].map((axis) => places.reduce((sum, p) => sum + p[axis], 0) / places.length);
  const [at, was] = [moved.now, moved.from].map((moment) => mean(insidePlaces(inside, moment, part)));
  const move = at.map((x, i) => x - was[i]);
  return { name: inside.names[part] || '(no name)', at, was, move, mm: Math.hypot(...move), error: moved.known ? expectedError(moved, (moment) => insidePlaces(inside, moment, part).flat(), Float32Array.from(inside.members[part].flatMap((v) => [...inside.reference.subarray(4 * v, 4 * v + 3)]))) : null };
}

/** Return whether a displacement exceeds its expected error. */
const isTold = ({ mm, error }) => error === null || mm > error;
/** Return what stands beside a distance that is within its expected error, mm. */
const withinWords = (error) => `within its error of ${error.toFixed(1)}`;

/** Return the index of the target to tell of first: that with the largest displacement, in multiples of its expected
 * error. Targets come before anatomy. */
function firstTarget(inside, moved) {
  const ratios = inside.names.map((_, part) => {
    const { mm, error } = inside.members[part].length ? targetOf(inside, part, moved) : { mm: 0, error: 1 };
    return [inside.anatomy.includes(part) ? 0 : 1, mm / (error ?? 1)];
  });
  return ratios.reduce((best, [kind, ratio], part) => (kind > ratios[best][0] || (kind === ratios[best][0] && ratio > ratios[best][1]) ? part : best), 0);
}

/** Return a displacement in words, with at most `most` directions and the largest first: "12 to the feet, 7 to the
 * front". With gravity, a direction along it is marked "(up)" or "(down)". */
function wayWords(move, most, gravity) {
  const ways = [['left', 'right'], ['back', 'front'], ['head', 'feet']];
  const parts = move.map((x, axis) => ({ mm: Math.round(Math.abs(x)), way: ways[axis][x > 0 ? 0 : 1], down: gravity ? Math.sign(x) * gravity[axis] : 0 }));
  const words = parts.filter(({ mm }) => mm > 0).sort((a, b) => b.mm - a.mm).slice(0, most)
    .map(({ mm, way, down }) => `${mm} to the ${way}${Math.abs(down) > 0.9 ? ` (${down > 0 ? 'down' : 'up'})` : ''}`);
  return words.join(', ') || 'less than 1 in any direction';
}

/** Return the beginning of a sentence on a posture: "Lying on the left side", "Supine, 15 degrees head down". */
function whereWords(gravity) {
  const text = postureText(gravity);
  const [, name, roll, tilt] = /^([a-z]+)(?:@(-?\d+))?([+-]\d+)?$/.exec(text) ?? [];
  if (!name) return `With gravity along ${text.replaceAll('-', '\u2212')}`;
  const lying = name === 'left' || name === 'right' ? `Lying on the ${name} side` : `${name[0].toUpperCase()}${name.slice(1)}`;
  const rolled = roll ? `, rolled ${Math.abs(roll)} degrees to the ${roll > 0 ? 'left' : 'right'}` : '';
  return `${lying}${rolled}${tilt ? `, ${Math.abs(tilt)} degrees head ${tilt > 0 ? 'down' : 'up'}` : ''}`;
}

/** Return where a vertex is on its lung: "at the base of the right lung". */
function spotWords(basis, vertex) {
  const lung = lungOf(basis, vertex);
  const { centre, half } = basis.lungBoxes[lung];
  const [x, y, z] = centre.map((c, i) => (basis.surface[3 * vertex + i] - c) / half[i]);
  const outwards = centre[0] < basis.lungBoxes.reduce((sum, box) => sum + box.centre[0] / basis.lungs, 0) ? -x : x;
  const spots = [[outwards, 'on the outer side'], [-outwards, 'on the inner side'], [y, 'at the back'], [-y, 'at the front'], [z, 'at the apex'], [-z, 'at the base']];
  return `${spots.reduce((most, spot) => (spot[0] > most[0] ? spot : most))[1]} of the ${basis.lungNames[lung]}`;
}

/** Return the sentence on a state of the lungs as {before, told, after, error, meaning}; `told`, which the page
 * emphasises, is empty if the change is within its expected error. `target` is the result of targetOf, or null if the
 * sentence is about the surface, and `above` a phrase such as "500 mL above rest", or empty. */
function sentenceOf(basis, moved, target, gravity, above) {
  const { name } = moved.from;
  const where = `${whereWords(gravity)}${above && `, ${above}`}, `;
  const who = target ? target.name : 'the surface';
  const { mm, error } = target ?? { mm: moved.mean, error: moved.error };
  if (moved.largest < 0.05) return { before: `This is ${name}, from which displacements are measured.`, told: '', after: '', error: '', meaning: '' };
  const stated = error === null ? '' : `expected error ${errorText(error)}`;
  const half = error === null ? '' : `Half of all points lie within ${(0.9 * error).toFixed(0)} mm of the computed place, 95 % within ${(1.8 * error).toFixed(0)} mm${near(gravity, moved.from.gravity) ? '' : '; for a change of posture the error is an extrapolation'}.`;
  if (!isTold({ mm, error })) return { before: `${where}${who} moves ${mm.toFixed(1)} mm from ${name}, ${withinWords(error)}: no change that the model can tell.`, told: '', after: '', error: '', meaning: half };
  const [told, after] = target ? [`moves ${mm.toFixed(1)} mm`, `: ${wayWords(target.move, 2)}`] : [`moves ${mm.toFixed(1)} mm on average`, `, ${moved.largest.toFixed(1)} mm at most, ${spotWords(basis, moved.at)}`];
  return { before: where, told: `${who} ${told}`, after: ` from ${name}${after}${stated && '; '}`, error: stated && `${stated}.`, meaning: half };
}

const errorText = (mm) => `${mm < 3 ? mm.toFixed(1) : mm.toFixed(0)} mm`;

/** Write a sentence of sentenceOf to an element, with its parts emphasised or toned down. */
function writeSentence(element, sentence) {
  const text = ['before', 'told', 'after', 'error'].map((key) => sentence[key]).join('');
  if (element.written === text) return;
  element.written = text;
  element.replaceChildren(sentence.before, ...[['em', sentence.told], ['', sentence.after], ['small', sentence.error]].map(([tag, words]) => {
    if (!tag) return words;
    const part = document.createElement(tag);
    part.textContent = words;
    return part;
  }));
}

/** Return the second line of a posture's card: "13.9 mm, 12 to the feet", or "3.1 mm, error 5.4". */
function answerOf(moved, target) {
  const told = target ?? { mm: moved.mean, error: moved.error };
  if (moved.largest < 0.05) return 'reference';
  if (!isTold(told)) return `${told.mm.toFixed(1)} mm, error ${told.error.toFixed(1)}`;
  return `${told.mm.toFixed(1)} mm${!target ? ' on average' : told.mm < 1 ? '' : `, ${wayWords(target.move, 1)}`}`;
}

/** Bars with the lungs' volumes: a tick for the earlier volume, a dot for that now, and a band for its range. */
class Holds {
  constructor(parent, { lungNames }) {
    this.rows = lungNames.map(() => {
      const row = document.createElement('div');
      row.className = 'hold';
      const parts = Object.fromEntries(['who', 'bar', 'band', 'was', 'now', 'ml'].map((name) => {
        const part = document.createElement(['who', 'ml'].includes(name) ? 'span' : 'i');
        part.className = name;
        return [name, part];
      }));
      parts.bar.append(parts.band, parts.was, parts.now);
      row.append(parts.who, parts.bar, parts.ml);
      parent.append(row);
      return parts;
    });
  }

  /** Show the volume of each lung, mL: `held` now, `depth` above rest in all lungs, and `before` in the state from which
   * displacements are measured. `heights`, mm, tell which lung is uppermost. The logarithm of an assumed volume at rest
   * has a normal distribution; the range is one standard deviation to either side. */
  show({ lungNames, references, simulated, metadata }, held, depth, before, heights) {
    const apart = heights.length === 2 && Math.abs(heights[0] - heights[1]) > 30; // one lung is > 30 mm higher
    this.rows.forEach(({ who, band, was, now, ml }, lung) => {
      const [from, to] = [before[lung], held[lung]];
      const above = (depth * to) / sumOf(held);
      const ends = [-1, 1].map((sign) => above + (to - above) * Math.exp(sign * Number(metadata.resting_spread)));
      const known = !metadata.resting_spread;
      const most = references[lung] + Math.max(0, simulated?.range[2 * lung + 1] ?? 0);
      const at = (volume) => `${Math.max(0, Math.min(100, (100 * volume) / most))}%`;
      who.textContent = `${lungNames[lung]}${apart ? ` (${heights[lung] > heights[1 - lung] ? 'up' : 'down'})` : ''}`;
      ml.textContent = `${Math.abs(to - from) < 0.5 ? '' : `${from.toFixed(0)} \u2192 `}${to.toFixed(0)} mL${known ? '' : `, range ${ends[0].toFixed(0)} to ${ends[1].toFixed(0)}`}`;
      was.style.left = at(from);
      now.style.left = at(to);
      band.hidden = known;
      [band.style.left, band.style.right] = [at(ends[0]), `calc(100% - ${at(ends[1])})`];
    });
  }
}
