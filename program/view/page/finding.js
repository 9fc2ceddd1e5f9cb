// SPDX-License-Identifier: MIT
// Write in words what each lung gains or loses, and how far the surface moves.

const signed = (value) => `${value < 0 ? '\u2212' : value > 0 ? '+' : ''}${Math.abs(value)}`;

/** Published changes, %, of the volume that each lung has at rest, relative to the supine posture: mean and standard
 * deviation, by posture. */
const PUBLISHED = { left: { source: 'Little 2021, n 10', 'left lung': [0, 44], 'right lung': [25, 11] } };

/** Return the volume (gas plus tissue) of each lung, mL. */
const heldBy = (basis, { weights, gains }) => basis.references.map((ml, lung) => ml + formAt(lungForm(basis, lung, weights), gains.slice(3 * lung, 3 * lung + 3)));

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

/** Return statistics of the displacement from the state `from` to the state `now`, mm, over every `stride`th vertex:
 * the mean over the area, the 95th percentile (rounded up to a multiple of 1/2000 of the largest) and the largest. */
function displacementBetween(basis, now, from, stride) {
  basis.areas ??= areasOf(basis);
  const { modes, coefficients, direction, areas } = basis;
  const far = new Float32Array(Math.ceil(basis.vertices / stride));
  let [sum, area, largest] = [0, 0, 0];
  for (let at = 0, lung = 0; at < far.length; ++at) {
    const v = at * stride;
    while (v >= basis.lungBegin[lung + 1]) ++lung;
    let [a, b] = [0, 0];
    for (let k = 0; k < modes; ++k) {
      a += now.weights[k] * coefficients[v * modes + k];
      b += from.weights[k] * coefficients[v * modes + k];
    }
    let square = 0;
    for (let axis = 0; axis < 3; ++axis) square += ((a * now.gains[3 * lung + axis] - b * from.gains[3 * lung + axis]) * direction[3 * v + axis]) ** 2;
    far[at] = Math.sqrt(square);
    sum += areas[v] * far[at];
    area += areas[v];
    largest = Math.max(largest, far[at]);
  }
  const bins = new Float64Array(2001);
  far.forEach((mm, at) => { bins[Math.ceil((2000 * mm) / (largest || 1))] += areas[at * stride]; });
  let [bin, within] = [0, bins[0]];
  while (within < 0.95 * area && bin < 2000) within += bins[++bin];
  return { mean: sum / area, p95: (bin / 2000) * largest, largest };
}

/** Return the beginning of a sentence on a posture: "On the left side", "Supine, 15 degrees head down,". */
function whereWords(gravity) {
  const text = postureText(gravity);
  const [, name, tilt] = /^([a-z]+)([+-]\d+)?$/.exec(text) ?? [];
  if (!name) return `With gravity along ${text.replaceAll('-', '\u2212')},`;
  if (name === 'left' || name === 'right') return `On the ${name} side`;
  return `${name[0].toUpperCase()}${name.slice(1)},${tilt ? ` ${Math.abs(tilt)} degrees head ${tilt > 0 ? 'down' : 'up'},` : ''}`;
}

/** Return a phrase for each lung, the largest change first: "the right lung gains 122 mL (+18 %)". */
function lungWords(basis, held, before) {
  return held.map((ml, lung) => ({ name: basis.lungNames[lung], ml: Math.round(ml - before[lung]), percent: Math.round((100 * (ml - before[lung])) / before[lung]) }))
    .sort((a, b) => Math.abs(b.ml) - Math.abs(a.ml))
    .map(({ name, ml, percent }) => `the ${name} ${Math.abs(percent) < 2 ? 'keeps its volume' : `${ml < 0 ? 'loses' : 'gains'} ${Math.abs(ml)} mL`} (${signed(percent)} %)`);
}

/** Return two sentences on the state of the lungs: one on volumes, one on displacements of every `stride`th vertex.
 * `volume` is a phrase such as "500 mL above rest", or empty. */
function findingOf(basis, moment, gravity, volume, stride) {
  const { from } = basis;
  const { mean, p95, largest } = displacementBetween(basis, moment, from, stride);
  if (largest < 0.05) return [`This is ${from.name}, from which displacements are measured.`, ''];
  const where = `${whereWords(gravity)}${volume ? `${whereWords(gravity).endsWith(',') ? '' : ','} ${volume},` : ''}`;
  const displacement = `the surface moves ${mean.toFixed(1)} mm on average and ${largest.toFixed(1)} mm at most, 95 % of it within ${p95.toFixed(1)} mm, from ${from.name}.`;
  if (!moment.held) return [`${where} ${displacement}`, ''];
  basis.fromHeld ??= heldBy(basis, from);
  return [`${where} ${lungWords(basis, moment.held, basis.fromHeld).join('; ')}.`, displacement.replace(/^t/, 'T')];
}

/** Return the expected error of the displacement u from the state `from` to the state `now`, mm RMS over the vertices,
 * as the library defines it. The squared error of a vertex is |u| min(expected_error_mm, RMS of u). If the volume at
 * rest is only assumed, add (5 d)^2. Here d is the change of u if the volumes of both states, `now` and `from`, grow by
 * 1 % of the reference volume. `fuller` has both states with these volumes; null if the volume at rest is known. */
function expectedError(basis, now, from, fuller) {
  const [a, b] = [placesOf(basis, now), placesOf(basis, from)];
  const more = fuller?.map((moment) => placesOf(basis, moment));
  let [lengths, squares, slopes] = [0, 0, 0];
  for (let i = 0; i < a.length; i += 3) {
    let [square, slope] = [0, 0];
    for (let k = i; k < i + 3; ++k) {
      const u = a[k] - b[k];
      square += u * u;
      if (more) slope += (more[0][k] - more[1][k] - u) ** 2;
    }
    lengths += Math.sqrt(square);
    squares += square;
    slopes += slope;
  }
  const n = a.length / 3;
  return Math.sqrt((Math.min(Number(basis.metadata.expected_error_mm), Math.sqrt(squares / n)) * lengths + slopes * (0.05 / 0.01) ** 2) / n);
}

/** Return a sentence on the expected error at a volume `depth` mL above rest. It is empty if the basis states no
 * expected error, or if displacements are not measured from supine at rest. */
function errorWords(basis, moment, depth) {
  const { metadata, from } = basis;
  if (!metadata.expected_error_mm || !moment.held || from.name !== 'supine at rest') return '';
  const assumed = basis.hasResting && !metadata.resting_known && metadata.scanned !== 'rest' && !metadata.scan_state?.includes('rest');
  const more = 0.01 * sumOf(basis.references);
  const fuller = assumed ? [[moment.gravity, depth], [[0, 1, 0], 0]].map(([gravity, ml]) => momentFor(basis, gravity, ml + more)) : null;
  return `Expected error ${expectedError(basis, moment, from, fuller).toFixed(1)} mm (RMS), an extrapolation.`;
}

/** Return the changes of volume and the mean displacement for the card of a posture: "L \u22121 %, R +18 %, 6.9 mm".
 * */
function answerOf(basis, moment) {
  const { mean, largest } = displacementBetween(basis, moment, basis.from, 1);
  if (largest < 0.05) return 'reference';
  if (moment.held) basis.fromHeld ??= heldBy(basis, basis.from);
  const lungs = moment.held.map((ml, lung) => `${basis.lungNames[lung].slice(0, 1).toUpperCase()} ${signed(Math.round((100 * ml) / basis.fromHeld[lung] - 100))} %, `);
  return `${lungs.join('')}${mean.toFixed(1)}\u00a0mm`;
}

/** Write a text to an element, with the lungs' changes of volume emphasised. */
function writeFinding(element, text) {
  if (element.written === text) return;
  element.written = text;
  element.replaceChildren(...text.split(/(\S+ \S+ (?:gains|loses) [^;]*?\))/).map((part, i) => {
    if (i % 2 === 0) return part;
    const change = document.createElement('em');
    change.textContent = part;
    return change;
  }));
}

/** Bars that show the lungs' volumes: grey for the earlier volume, then orange for a gain or hatched for a loss. */
class Holds {
  constructor(parent, { lungNames }) {
    this.rows = lungNames.map(() => {
      const row = document.createElement('div');
      row.className = 'hold';
      const parts = Object.fromEntries([['who', 'span'], ['percent', 'strong'], ['amount', 'div'], ['was', 'i'], ['change', 'i'], ['published', 'i'], ['ml', 'span']].map(([name, tag]) => {
        const part = document.createElement(tag);
        part.className = name;
        return [name, part];
      }));
      parts.amount.append(parts.was, parts.change, parts.published, parts.ml);
      row.append(parts.who, parts.percent, parts.amount);
      parent.append(row);
      return parts;
    });
  }

  /** Show the volume of each lung, mL: `held` now, and `before` in the state from which displacements are measured.
   * Bars are scaled to `most`, the largest volume of a lung in any posture. `heights`, mm, tell which lung is
   * uppermost. `measured` has the published changes of volume in this posture; undefined if there are none. */
  show({ lungNames }, held, before, most, heights, measured) {
    const full = 1.06 * Math.max(most, ...held, ...before.map((ml, lung) => ml * (1 + (measured?.[lungNames[lung]] ?? [0, 0]).reduce((sum, x) => sum + x, 0) / 100)));
    const apart = heights.length === 2 && Math.abs(heights[0] - heights[1]) > 30; // one lung is > 30 mm higher
    this.rows.forEach(({ who, percent, was, change, published, ml }, lung) => {
      const [from, to] = [before[lung], held[lung]];
      const place = (part, begin, end) => {
        part.style.left = `${(100 * begin) / full}%`;
        part.style.width = `${(100 * (end - begin)) / full}%`;
      };
      who.textContent = `${lungNames[lung]}${apart ? (heights[lung] > heights[1 - lung] ? ' (uppermost)' : ' (lowermost)') : ''}`;
      percent.textContent = `${signed(Math.round((100 * to) / from - 100))} %`;
      ml.textContent = `${from.toFixed(0)} \u2192 ${to.toFixed(0)}`;
      place(was, 0, Math.min(from, to));
      place(change, Math.min(from, to), Math.max(from, to));
      change.classList.toggle('lost', to < from);
      const [mean, deviation] = measured?.[lungNames[lung]] ?? [];
      published.hidden = mean === undefined;
      if (mean !== undefined) place(published, from * (1 + (mean - deviation) / 100), from * (1 + (mean + deviation) / 100));
    });
  }
}
