// SPDX-License-Identifier: MIT
// Store the state of the page: posture, breath, colours, camera. A posture is a rotation from the patient's axes to
// the axes of a room whose z axis points up. It determines the direction of gravity in the patient's axes.

const RIGHT_ANGLE = Math.PI / 2;
const LYING = compose(turn([0, 0, 1], RIGHT_ANGLE), turn([1, 0, 0], -RIGHT_ANGLE)); // supine
const rolled = (degrees) => compose(LYING, turn([0, 0, 1], (degrees * Math.PI) / 180));
/** Tilt a posture so that positive degrees lower the head of a lying body, and lean an upright one back. */
const tilted = (q, degrees) => {
  const [x, y] = gravityOf(q);
  const level = Math.hypot(x, y);
  const axis = level > 1e-6 ? [y / level, -x / level, 0] : [1, 0, 0];
  return compose(q, turn(axis, (-degrees * Math.PI) / 180));
};

const POSTURES = [
  { name: 'supine', label: 'Supine', q: rolled(0), tilt: 0 },
  { name: 'prone', label: 'Prone', q: rolled(180), tilt: 0 },
  { name: 'left', label: 'Left side', q: rolled(90), tilt: 0 },
  { name: 'right', label: 'Right side', q: rolled(-90), tilt: 0 },
  { name: 'upright', label: 'Upright', q: IDENTITY, tilt: 0 },
  { name: 'supine+15', label: 'Head down', q: rolled(0), tilt: 15 },
];
const INVERTED = { name: 'inverted', q: compose(turn([1, 0, 0], Math.PI), IDENTITY), tilt: 0 };
const DICOM = { S: 0, P: 1, DL: 2, DR: 3 }; // posture by the last letters of a patient position

const gravityOf = (q) => rotate(inverse(q), [0, 0, -1]);
const near = (a, b) => dot(a, b) > Math.cos(0.004);
const same = (a, b) => Math.hypot(...cross(a, b)) < 0.0005 && dot(a, b) > 0; // other directions are written as numbers
const NAMED = [...POSTURES.slice(0, 5), INVERTED].map((p) => ({ name: p.name, gravity: gravityOf(p.q) }));

/** Return a direction of gravity as text, in the notation of --posture: a name, a name with a tilt or supine with a
 * roll in degrees, or three numbers. */
function postureText(gravity) {
  const named = NAMED.find((p) => near(p.gravity, gravity));
  if (named) return named.name;
  const [x, y, z] = gravity;
  const tilt = Math.round((Math.atan2(z, Math.hypot(x, y)) * 180) / Math.PI);
  const lying = POSTURES.slice(0, 4).find((p, i) => (i < 2 ? near : same)(gravityOf(tilted(p.q, tilt)), gravity));
  if (lying) return `${lying.name}${tilt < 0 ? '' : '+'}${tilt}`;
  const roll = Math.round((Math.atan2(x, y) * 180) / Math.PI);
  if (same(gravityOf(rolled(roll)), gravity)) return `supine@${roll}`;
  return gravity.map((v) => v.toFixed(2).replace('-0.00', '0.00')).join(':');
}

/** Return a direction of gravity in words: "left side", "supine, rolled 55 degrees to the left, head 10 degrees down",
 * or "upright, leaning 20 degrees back". */
function postureWords([x, y, z]) {
  const degrees = (opposite, adjacent) => Math.round((Math.atan2(opposite, adjacent) * 180) / Math.PI);
  const level = Math.hypot(x, y);
  const tilt = degrees(z, level);
  if (Math.abs(tilt) > 60) {
    const lean = 90 - Math.abs(tilt);
    const ways = [
      [Math.abs(y), y > 0 ? 'back' : 'forward'],
      [Math.abs(x), x > 0 ? 'to the left' : 'to the right'],
    ].filter(([share]) => share > 0.38 * level); // 0.38: sine of a quarter of a right angle
    const way = ways.map(([, word]) => word).join(' and ');
    return `${z < 0 ? 'upright' : 'inverted'}${lean ? `, leaning ${lean} degrees ${way}` : ''}`;
  }
  const roll = degrees(Math.abs(x), y); // 0 supine, 180 prone
  const side = x > 0 ? 'left' : 'right';
  const rolled = Math.min(roll, 180 - roll);
  const nearest = roll < 90 ? 'supine' : 'prone';
  const lying = rolled === 90 ? `${side} side` : nearest;
  const turned = rolled % 90 ? `, rolled ${rolled} degrees to the ${side}` : '';
  return `${lying}${turned}${tilt ? `, head ${Math.abs(tilt)} degrees ${tilt > 0 ? 'down' : 'up'}` : ''}`;
}

/** What a text of a posture may be, in words. */
const POSTURE_WANTED =
  'supine, prone, left, right, upright, inverted, a tilt such as supine+15, a roll such as supine@30, ' +
  'or gravity such as 0.6:0:-0.8';

/** Return a posture from a text in the notation of --posture, or null if the text is not valid. {q, tilt} are the
 * quaternion of the posture without its tilt, and the tilt, degrees. */
function postureFrom(text) {
  const word = text.trim().replaceAll('\u2212', '-');
  const numbers = word.split(/[:,]/).map((part) => (part.trim() === '' ? NaN : Number(part)));
  if (numbers.length === 3 && numbers.every(Number.isFinite) && Math.hypot(...numbers) > 0) {
    const now = rotate(LYING, unit(numbers)); // gravity, rotated to the room's axes for a supine patient
    const axis = cross(now, [0, 0, -1]);
    const size = Math.hypot(...axis);
    const swing =
      size < 1e-9 ? (now[2] < 0 ? IDENTITY : turn([1, 0, 0], Math.PI)) : turn(unit(axis), Math.atan2(size, -now[2]));
    return { q: compose(swing, LYING), tilt: 0 };
  }
  const [, name, roll = '0', tilt = '0'] = /^([a-z]+)(?:[@>]([+-]?[\d.]+))?([+-][\d.]+)?$/i.exec(word) ?? [];
  const [, last] = /^(?:HF|FF|LF|RF|AF|PF)(S|P|DL|DR)$/.exec(name?.toUpperCase() ?? '') ?? [];
  const found = [...POSTURES, INVERTED].find((p) => p.name === name?.toLowerCase()) ?? POSTURES[DICOM[last]];
  if (!found || !(Math.abs(roll) <= 180 && Math.abs(tilt) <= 90)) return null;
  return { q: compose(found.q, turn([0, 0, 1], (roll * Math.PI) / 180)), tilt: Number(tilt) };
}

const FADED = 0.35; // opacity of translucent lungs

const FIRST_CAMERA = { azimuth: 0, elevation: 0.05, zoom: 1, pan: [0, 0], pivot: null };

/** Names of the views. The key is the direction of the body that faces the viewer, such as A for anterior. */
const VIEWS = {
  A: 'From the front',
  P: 'From the back',
  L: 'From the left',
  R: 'From the right',
  H: 'From the head',
  F: 'From the feet',
};

class State {
  constructor(basis) {
    this.basis = basis;
    this.standing = { q: POSTURES[2].q, tilt: 0 }; // chosen posture; tilt in degrees
    this.q = POSTURES[2].q; // rotation shown now; while `turning`, on the way to the chosen posture
    this.turning = null;
    this.takeVolumes();
    this.rate = 12;
    this.phase = 0.5;
    this.playing = false;
    this.kind = 'plain';
    this.pinnedQ = POSTURES[0].q;
    this.contours = true;
    this.ghost = !basis.inside;
    this.arrows = false;
    this.wires = false;
    this.doubt = false; // whether plausible lungs are shown in place of the computed ones
    this.beside = false; // whether the other posture is shown beside the chosen one
    this.inside = Boolean(basis.inside); // whether structures inside the lungs are shown
    this.chosen = 0; // structure inside the lungs that the sentence is about
    this.picked = false; // whether the user chose it; otherwise it is the one that firstTarget returns
    this.day = 'automatic'; // key of DAYS
    this.opacity = Array(basis.lungs).fill(FADED);
    // Cutting plane: axis, or -1 for no cut; position as a fraction of the lungs' extent
    this.cut = { axis: -1, at: 0.5 };
    this.ownRanges = {}; // for each of KINDS, the range {begin, end} of the colour bar if the user typed one
    this.probes = []; // marked vertices
    this.room = true;
    this.roomBlend = 1; // 0: the view is fixed to the patient; 1: to the room; in between during the change
    this.camera = { ...FIRST_CAMERA };
    this.moment = null;
    [this.from] = basis.froms; // state of the lungs from which displacements are measured
    this.live = false; // whether a tracker moves the patient
    this.measure();
    // X, y, z of the sagittal, coronal and axial plane, mm; null for those through the chosen structure
    this.slices = null;
  }

  /** Set the tidal volume, and the range of volumes above rest, or above the scan if rest is unknown, mL. Those of
   * another simulator's fields are the volumes that were simulated in some of POSTURES. A breath stays in the range of
   * all. */
  takeVolumes() {
    const { basis } = this;
    this.tidal = basis.breathVolume;
    this.tidalMin = this.tidal / 50;
    this.depthMin = 0;
    const held = basis.breathes ? (momentFor(basis, gravityOf(POSTURES[0].q), 0).held ?? basis.references) : [];
    // Full inflation, if it was scanned
    this.depthMax = Math.max(2 * this.tidal, sumOf(basis.references) - sumOf(held));
    this.tidalMax = this.depthMax;
    this.shared = [0, Infinity]; // volumes that are within reach in each of POSTURES
    if (basis.order > 0) {
      const ranges = POSTURES.map((p) => simulatedRange(basis, gravityOf(tilted(p.q, p.tilt))));
      const [lows, highs] = [0, 1].map((end) => ranges.map((range) => range[end]));
      [this.depthMin, this.depthMax] = [Math.min(...lows), Math.max(...highs)];
      this.shared = [Math.max(...lows), Math.max(Math.max(...lows) + 1, Math.min(...highs))];
      this.tidalMax = this.shared[1] - this.shared[0];
      this.tidal = Math.min(this.tidal, this.tidalMax);
    }
    this.depth = this.expired;
  }

  /** Least and largest value of each number that can be typed: degrees, mL, and breaths per minute. */
  get limits() {
    return {
      tilt: [-90, 90],
      depth: [this.depthMin, this.depthMax],
      tidal: [this.tidalMin, this.tidalMax],
      rate: [4, 40],
    };
  }

  /** Volume at the end of an expiration: 0 if a breath from there stays within reach. */
  get expired() {
    return Math.max(this.shared[0], Math.min(0, this.shared[1] - this.tidal));
  }

  /** Return the opacity that the lungs have unless it was chosen: a shell, and lungs with something inside, are seen
   * through, and colours need whole lungs. */
  usualOpacity() {
    return this.basis.inside || this.kind === 'plain' ? FADED : 1;
  }

  colourBy(kind) {
    const usual = this.usualOpacity();
    this.kind = kind;
    this.opacity = this.opacity.map((opacity) => (opacity === usual ? this.usualOpacity() : opacity));
  }

  get gravity() {
    return gravityOf(this.q);
  }

  get goal() {
    return tilted(this.standing.q, this.standing.tilt);
  }

  /** Turn to a posture in `seconds`; at once if the user prefers reduced motion. */
  settle(q, tilt, seconds) {
    this.standing = { q, tilt };
    const still = seconds === 0 || matchMedia('(prefers-reduced-motion: reduce)').matches;
    this.turning = still ? null : { from: this.q, to: this.goal, time: 0, seconds };
    if (still) this.q = this.goal;
  }

  /** Turn the patient about an axis of the room by an angle, radians. */
  roll(axis, angle) {
    this.settle(compose(turn(axis, angle), this.q), 0, 0);
  }

  /** Advance by `seconds`; return whether something has moved. */
  advance(seconds) {
    const goal = this.room ? 1 : 0;
    const moves = this.playing || this.turning !== null || this.roomBlend !== goal;
    if (this.turning) {
      this.turning.time += seconds / this.turning.seconds;
      const t = Math.min(1, this.turning.time);
      this.q = slerp(this.turning.from, this.turning.to, t * t * (3 - 2 * t));
      if (t === 1) this.turning = null;
    }
    if (this.roomBlend !== goal) {
      const step = matchMedia('(prefers-reduced-motion: reduce)').matches ? 1 : 2 * seconds;
      this.roomBlend += Math.max(-step, Math.min(step, goal - this.roomBlend));
    }
    if (this.playing) {
      this.phase = (this.phase + (seconds * this.rate) / 60) % 1;
      this.depth = this.expired + (this.tidal * (1 - Math.cos(2 * Math.PI * this.phase))) / 2;
    }
    return moves;
  }

  get needsPinned() {
    return this.kind === 'difference' || this.beside;
  }

  /** Compute the lungs' state for the current gravity and volume. If the surface would fold, keep the previous state
   * and return false. */
  compute() {
    if (!this.basis.breathes) this.depth = 0;
    const moment = momentFor(this.basis, this.gravity, this.depth);
    this.trouble = moment.folds;
    if (moment.folds) return false;
    this.moment = moment;
    if (this.needsPinned) {
      const pinned = momentFor(this.basis, gravityOf(this.pinnedQ), this.depth);
      this.pinned = pinned.folds ? moment : pinned;
    }
    return true;
  }

  /** Range of values of the colour bar: the range that the user typed, or one that contains the surface in each of
   * POSTURES at the largest volume in use. */
  get range() {
    const own = this.ownRanges[this.kind];
    if (!own) return this.ranges[this.kind];
    return { ...own, step: tickStep(own.end - own.begin), beyond: this.ranges[this.kind].most > own.end };
  }

  measure() {
    const deepest =
      this.playing || this.depth > this.expired ? Math.max(this.expired + this.tidal, this.depth) : this.expired;
    if (deepest === this.measured && this.from === this.measuredFrom) return;
    [this.measured, this.measuredFrom] = [deepest, this.from];
    const before = samplePlaces(this.basis, this.from);
    const areas = (places) =>
      Float64Array.from({ length: places.length / 3 }, (_, i) => {
        const [a, b, c] = places.slice(3 * i, 3 * i + 3);
        return Math.hypot(
          ...cross(
            b.map((x, j) => x - a[j]),
            c.map((x, j) => x - a[j]),
          ),
        );
      });
    const far = (a, b) => a.map((p, i) => Math.hypot(p[0] - b[i][0], p[1] - b[i][1], p[2] - b[i][2]));
    const most = { plain: 1, displacement: 0, difference: 0, expansion: 0 };
    const take = (kind, values) => {
      for (const value of values) most[kind] = Math.max(most[kind], value);
    };
    const areasBefore = areas(before);
    const all = [before];
    const states = POSTURES.map((p) => momentFor(this.basis, gravityOf(tilted(p.q, p.tilt)), deepest))
      .filter((m) => !m.folds)
      .map((m) => samplePlaces(this.basis, m));
    states.forEach((places, i) => {
      take('displacement', far(places, before));
      all.push(places);
      const growth = areas(places)
        .map((area, j) => Math.abs(100 * (area / areasBefore[j] - 1)))
        .sort();
      take('expansion', growth.slice(0, Math.ceil(0.95 * growth.length))); // without the narrowest triangles
      for (const other of states.slice(i + 1)) take('difference', far(places, other));
    });
    this.ranges = Object.fromEntries(
      Object.keys(most).map((kind) => {
        const end = rangeEnd(most[kind] > 1e-3 ? most[kind] : 0);
        const begin = kind === 'expansion' ? -end : 0; // -end: shrinkage of the area has the same range as growth
        return [kind, { begin, end, step: tickStep(end - begin), beyond: kind === 'expansion', most: most[kind] }];
      }),
    );
    this.body = boundsOf(all.flat());
  }
}
