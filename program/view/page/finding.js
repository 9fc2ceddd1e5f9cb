// SPDX-License-Identifier: MIT
// Compute how far targets and the surface move, with the expected error, and write it in words.

/** Published changes, %, of the volume that each lung has at rest, relative to the supine posture: mean (standard
 * deviation), by posture. */
const PUBLISHED = { left: 'left 0 % (SD 44), right +25 % (SD 11); Little 2021, n\u00a010' };

/** Return a weight for each vertex, proportional to the area of the triangles around it. */
function areasOf({ surface, corners, vertices }) {
  const areas = new Float32Array(vertices);
  for (let t = 0; t < corners.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map((i) => surface.subarray(3 * corners[t + i], 3 * corners[t + i] + 3));
    const piece = Math.hypot(
      ...cross(
        [0, 1, 2].map((i) => b[i] - a[i]),
        [0, 1, 2].map((i) => c[i] - a[i]),
      ),
    );
    for (let i = 0; i < 3; ++i) areas[corners[t + i]] += piece;
  }
  return areas;
}

/** Return statistics of the distance of the surface's vertices between positions `after` and `before`, mm: the mean
 * over the area, the 95th percentile (rounded up to a multiple of 1/2000 of the largest), the largest, and the vertex
 * where it is. */
function distancesOf(basis, after, before) {
  basis.areas ??= areasOf(basis);
  const { areas } = basis;
  const far = new Float32Array(basis.vertices);
  let [sum, area, at] = [0, 0, 0];
  for (let v = 0; v < far.length; ++v) {
    far[v] = Math.hypot(
      after[3 * v] - before[3 * v],
      after[3 * v + 1] - before[3 * v + 1],
      after[3 * v + 2] - before[3 * v + 2],
    );
    sum += areas[v] * far[v];
    area += areas[v];
    if (far[v] > far[at]) at = v;
  }
  const bins = new Float64Array(2001);
  far.forEach((mm, v) => {
    bins[Math.ceil((2000 * mm) / (far[at] || 1))] += areas[v];
  });
  let [bin, within] = [0, bins[0]];
  while (within < 0.95 * area && bin < 2000) within += bins[++bin];
  return { mean: sum / area, p95: (bin / 2000) * far[at], largest: far[at], at };
}

/** Return RMS expected errors over the surface, mm, as targetsBetween; null if they are unknown. In another simulator's
 * fields, `error` is that of the fit to the simulator. */
function surfaceErrors({ library, metadata, fitErrors }, now, from) {
  if (!metadata.expected_error_mm && !fitErrors) return { error: null, session: null, place: null };
  const rms = (sigma) => Math.sqrt(sigma.reduce((sum, x) => sum + x * x, 0) / sigma.length);
  const error = rms(pose(library, now).expectedError(from.state));
  if (fitErrors) return { error, session: null, place: null };
  const session = rms(library.expectedError());
  return { error, session, place: library.anotherDay(session) };
}

/** Return how the lungs move from the state `from` to the state `now`: the statistics of distancesOf, expected errors
 * of the surface, mm, or null, and the result of targetsBetween. */
function movedBetween(basis, now, from) {
  const distances = distancesOf(basis, placesOf(basis, now), placesOf(basis, from));
  const targets = basis.inside ? targetsBetween(basis.inside, now, from) : [];
  return { ...distances, now, from, targets, ...surfaceErrors(basis, now, from) };
}

/** Return how each structure inside the lungs moves: the mean position of its vertices `at` and before, `was`, its
 * displacement `move` and distance `mm`, and expected errors, null if they are unknown: `error` of the displacement,
 * `session` of the position in the session of the scan, and `place` of the position on another day. */
function targetsBetween(inside, now, from) {
  const found = pose(inside.library, now).targets(from.state);
  const still = { at: [0, 0, 0], was: [0, 0, 0], move: [0, 0, 0], mm: 0 };
  const none = { name: '', anatomy: false, ...still, error: 1, session: 1, place: 1 };
  return inside.members.map((members) => {
    if (!members.length) return none;
    const { name, anatomy, at, move, mm, expectedError, anotherDayError, movedError } = found.shift();
    const errors = [movedError, expectedError, anotherDayError];
    const [error, session, place] = errors.map((x) => (Number.isNaN(x) ? null : x));
    const was = at.map((x, i) => x - move[i]);
    return { name: name || '(no name)', anatomy, at, was, move, mm, error, session, place };
  });
}

/** Choices of the error of a target's place: its name, or which is taken by default. */
const DAYS = { automatic: '', another: 'another day', session: 'same session' };

/** Return the expected error of a target's place, mm, and the name of its day. By default it is the error on another
 * day, unless the lungs are as in the scan, where its session has none. */
function ringOf({ session, place }, day) {
  const chosen = day === 'automatic' && session < 0.05 ? 'session' : day;
  return chosen === 'session' ? { error: session, day: DAYS.session } : { error: place, day: DAYS.another };
}

/** Return the verb of a sentence about a target. Structures may have plural names, such as airways or bronchi. */
const verbOf = ({ anatomy, name }) => (anatomy && /([^sui]s|chi|chia)$/i.test(name) ? 'move' : 'moves');

/** Return whether a displacement exceeds its expected error. */
const isTold = ({ mm, error }) => error === null || mm > error;
/** Return what stands beside a distance that is within its expected error, mm. */
const withinWords = (error) => `within its error of ${error.toFixed(1)}`;

/** Return the index of the target to tell of first: that with the largest displacement, in multiples of its expected
 * error. Targets come before anatomy. */
function firstTarget(inside, moved) {
  const ratios = moved.targets.map(({ mm, error }, part) => [inside.anatomy.includes(part) ? 0 : 1, mm / (error ?? 1)]);
  return ratios.reduce(
    (best, [kind, ratio], part) =>
      kind > ratios[best][0] || (kind === ratios[best][0] && ratio > ratios[best][1]) ? part : best,
    0,
  );
}

/** Return a displacement in words, with at most `most` directions and the largest first: "12 to the feet, 7 to the
 * front". With gravity, a direction along it is marked "(up)" or "(down)". */
function wayWords(move, most, gravity) {
  const ways = [
    ['left', 'right'],
    ['back', 'front'],
    ['head', 'feet'],
  ];
  const parts = move.map((x, axis) => ({
    mm: Math.round(Math.abs(x)),
    way: ways[axis][x > 0 ? 0 : 1],
    down: gravity ? Math.sign(x) * gravity[axis] : 0,
  }));
  const words = parts
    .filter(({ mm }) => mm > 0)
    .sort((a, b) => b.mm - a.mm)
    .slice(0, most)
    .map(({ mm, way, down }) => `${mm} to the ${way}${Math.abs(down) > 0.9 ? ` (${down > 0 ? 'down' : 'up'})` : ''}`);
  return words.join(', ') || 'less than 1 in any direction';
}

/** Return the beginning of a sentence on a posture: "Lying on the left side", or, with gravity behind it where it is no
 * round angle, "Supine, rolled 55 degrees to the left (0.82:0.57:0.00)". */
function whereWords(gravity) {
  const words = postureWords(gravity);
  const text = postureText(gravity);
  const numbers = text.includes(':') ? ` (${text.replaceAll('-', '\u2212')})` : '';
  const lying = / side/.test(words) ? `lying on the ${words}` : words;
  return `${lying[0].toUpperCase()}${lying.slice(1)}${numbers}`;
}

/** Return where a vertex is on its lung: "at the base of the right lung". */
function spotWords(basis, vertex) {
  const lung = lungOf(basis, vertex);
  const { centre, half } = basis.lungBoxes[lung];
  const [x, y, z] = centre.map((c, i) => (basis.surface[3 * vertex + i] - c) / half[i]);
  const outwards = centre[0] < basis.lungBoxes.reduce((sum, box) => sum + box.centre[0] / basis.lungs, 0) ? -x : x;
  const spots = [
    [outwards, 'on the outer side'],
    [-outwards, 'on the inner side'],
    [y, 'at the back'],
    [-y, 'at the front'],
    [z, 'at the apex'],
    [-z, 'at the base'],
  ];
  return `${spots.reduce((most, spot) => (spot[0] > most[0] ? spot : most))[1]} of the ${basis.lungNames[lung]}`;
}

/** Return how far points lie from their computed place, for the expected errors of positions in the session of the scan
 * and on another day, mm. */
function spreadWords(session, place, samePosture) {
  const times = (factor) => [session, place].map((error) => (factor * error).toFixed(0));
  const [half, halfOther] = times(0.9);
  const [most, mostOther] = times(1.8);
  const extrapolated = samePosture ? '' : '; for a change of posture the error is an extrapolation';
  return (
    `Half of all points lie within ${half} mm of the computed place in the session of the scan, and within ` +
    `${halfOther} mm on another day; 95 % within ${most} and ${mostOther} mm${extrapolated}.`
  );
}

/** Return the sentence on a state of the lungs as {before, told, after, error, meaning}; `told`, which the page
 * emphasises, is empty if the change is within its expected error. `target` is the one of targetsBetween, or null if
 * the sentence is about the surface, and `above` a phrase such as "500 mL above rest", or empty. */
function sentenceOf(basis, moved, target, gravity, above) {
  const { name } = moved.from;
  const where = `${whereWords(gravity)}${above && `, ${above}`}, `;
  const who = `${target ? target.name : 'the surface'} ${verbOf(target ?? {})}`;
  const { mm, error, session, place } = target ?? { ...moved, mm: moved.mean };
  if (moved.largest < 0.05)
    return {
      before: `This is ${name}, from which displacements are measured.`,
      told: '',
      after: '',
      error: '',
      meaning: '',
    };
  const stated = error === null ? '' : `${errorName(basis)} ${errorText(error)}`;
  const half = session === null ? '' : spreadWords(session, place, near(gravity, moved.from.gravity));
  if (!isTold({ mm, error }))
    return {
      before:
        `${where}${who} ${mm.toFixed(1)} mm from ${name}, ${withinWords(error)}: ` +
        'no change that the model can tell.',
      told: '',
      after: '',
      error: '',
      meaning: half,
    };
  const [told, after] = target
    ? [`${mm.toFixed(1)} mm`, `: ${wayWords(target.move, 2)}`]
    : [
        `${mm.toFixed(1)} mm on average`,
        `, ${moved.largest.toFixed(1)} mm at most, ${spotWords(basis, moved.at)}`,
      ];
  return {
    before: where,
    told: `${who} ${told}`,
    after: ` from ${name}${after}${stated && '; '}`,
    error: stated && `${stated}.`,
    meaning: half,
  };
}

/** Return what the errors of the surface are of. */
const errorName = ({ fitErrors }) => (fitErrors ? 'error of the fit to the simulator' : 'expected error');
const errorText = (mm) => (mm < 0.05 ? 'below 0.05 mm' : `${mm < 3 ? mm.toFixed(1) : mm.toFixed(0)} mm`);

/** Return a text as parts in which no number is broken from its unit. */
const unbroken = (text) =>
  text.split(/(\d[\d.]* (?:mm|mL))/).map((words, i) => {
    if (i % 2 === 0) return words;
    return Object.assign(document.createElement('span'), { className: 'whole', textContent: words });
  });

/** Write a sentence of sentenceOf to an element, with its parts emphasised or toned down. */
function writeSentence(element, sentence) {
  const text = ['before', 'told', 'after', 'error'].map((key) => sentence[key]).join('');
  if (element.written === text) return;
  element.written = text;
  element.replaceChildren(
    ...unbroken(sentence.before),
    ...[
      ['em', sentence.told],
      ['span', sentence.after],
      ['small', sentence.error],
    ].map(([tag, words]) => {
      const part = document.createElement(tag);
      part.append(...unbroken(words));
      return part;
    }),
  );
}

/** Return the second line of a posture's card: "13.9 mm, 12 to the feet", or "3.1 mm, error 5.4". */
function answerOf(moved, target) {
  const told = target ?? { mm: moved.mean, error: moved.error };
  if (moved.largest < 0.05) return 'reference';
  if (!isTold(told)) return `${told.mm.toFixed(1)} mm, error ${told.error.toFixed(1)}`;
  const length = `${told.mm.toFixed(1)} mm`;
  if (!target) return `${length} on average`;
  return told.mm < 1 ? length : `${length}, ${wayWords(target.move, 1)}`;
}

/** Bars with the lungs' volumes: a tick for the earlier volume, a dot for that now, and a band for its range. */
class Holds {
  constructor(parent, { lungNames }) {
    this.rows = lungNames.map(() => {
      const row = document.createElement('div');
      row.className = 'hold';
      const parts = Object.fromEntries(
        ['who', 'bar', 'band', 'was', 'now', 'ml'].map((name) => {
          const part = document.createElement(['who', 'ml'].includes(name) ? 'span' : 'i');
          part.className = name;
          return [name, part];
        }),
      );
      parts.bar.append(parts.band, parts.was, parts.now);
      row.append(parts.who, parts.bar, parts.ml);
      parent.append(row);
      return parts;
    });
  }

  /** Show the volume of each lung, mL: `held` now, `depth` above rest in all lungs, and `before` in the state from
   * which displacements are measured. `heights`, mm, tell which lung is uppermost. The logarithm of an assumed volume
   * at rest has a normal distribution; the range is one standard deviation to either side. */
  show({ library, lungNames, references, metadata }, held, depth, before, heights) {
    const simulated = library.tensor('simulated_range')?.data;
    const apart = heights.length === 2 && Math.abs(heights[0] - heights[1]) > 30; // one lung is > 30 mm higher
    this.rows.forEach(({ who, band, was, now, ml }, lung) => {
      const [from, to] = [before[lung], held[lung]];
      const above = (depth * to) / sumOf(held);
      const ends = [-1, 1].map((sign) => above + (to - above) * Math.exp(sign * Number(metadata.resting_spread)));
      const known = !metadata.resting_spread;
      const most = references[lung] + Math.max(0, simulated?.[2 * lung + 1] ?? 0);
      const at = (volume) => `${Math.max(0, Math.min(100, (100 * volume) / most))}%`;
      who.textContent = `${lungNames[lung]}${apart ? ` (${heights[lung] > heights[1 - lung] ? 'up' : 'down'})` : ''}`;
      const earlier = Math.abs(to - from) < 0.5 ? '' : `${from.toFixed(0)} \u2192 `;
      const range = known ? '' : `, range ${ends[0].toFixed(0)} to ${ends[1].toFixed(0)}`;
      ml.textContent = `${earlier}${to.toFixed(0)} mL${range}`;
      was.style.left = at(from);
      now.style.left = at(to);
      band.hidden = known;
      [band.style.left, band.style.right] = [at(ends[0]), `calc(100% - ${at(ends[1])})`];
    });
  }
}
