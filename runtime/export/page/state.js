// SPDX-License-Identifier: MIT
// What is shown: the patient's posture, the breath, the colours, the camera. A posture is a rotation
// of the patient into a room whose z points up; gravity in the patient follows from it.

const RIGHT_ANGLE = Math.PI / 2;
const LYING = compose(turn([0, 0, 1], RIGHT_ANGLE), turn([1, 0, 0], -RIGHT_ANGLE)); // on the back
const rolled = (degrees) => compose(LYING, turn([0, 0, 1], (degrees * Math.PI) / 180));
const tilted = (q, degrees) => compose(q, turn([1, 0, 0], (-degrees * Math.PI) / 180));

const POSTURES = [
  { name: 'supine', label: 'Supine', q: rolled(0), tilt: 0 },
  { name: 'prone', label: 'Prone', q: rolled(180), tilt: 0 },
  { name: 'left', label: 'Left side', q: rolled(90), tilt: 0 },
  { name: 'right', label: 'Right side', q: rolled(-90), tilt: 0 },
  { name: 'upright', label: 'Upright', q: IDENTITY, tilt: 0 },
  { name: 'Trendelenburg', label: 'Head down', q: rolled(0), tilt: 15 },
];

const gravityOf = (q) => rotate(inverse(q), [0, 0, -1]);

/** The name of a direction of gravity. */
function postureName(gravity) {
  const near = POSTURES.find((p) => dot(gravityOf(tilted(p.q, p.tilt)), gravity) > Math.cos(0.008));
  if (near) return near.name;
  const close = POSTURES.slice(0, 5)
    .map((p) => ({ p, angle: (Math.acos(Math.min(1, dot(gravityOf(p.q), gravity))) * 180) / Math.PI }))
    .sort((a, b) => a.angle - b.angle)[0];
  return `${close.p.name} + ${Math.round(close.angle)}°`;
}

const FIRST_CAMERA = { azimuth: -0.62, elevation: -0.1, zoom: 1 };

class State {
  constructor(basis) {
    this.basis = basis;
    this.standing = { q: POSTURES[0].q, tilt: 0 }; // the posture, and the tilt on top of it
    this.q = POSTURES[0].q;                        // as shown, on its way there
    this.turning = null;
    this.unit = basis.hasVolume ? 'mL' : 'mm';
    this.tidal = basis.hasVolume ? basis.breathVolume : basis.breathLargest;
    this.depth = this.tidal;
    this.depthMax = 2 * this.tidal;
    this.rate = 12;
    this.phase = 0.5;
    this.playing = false;
    this.kind = 'displacement';
    this.pinnedGravity = gravityOf(POSTURES[0].q);
    this.contours = false;
    this.room = false;
    this.roomBlend = 0; // 0: the patient stands still; 1: the room does
    this.camera = { ...FIRST_CAMERA };
    this.moment = null;
    this.measure();
  }

  get gravity() {
    return gravityOf(this.q);
  }

  /** Takes up a posture, over a moment unless motion is unwanted. */
  settle(q, tilt, seconds) {
    this.standing = { q, tilt };
    const goal = tilted(q, tilt);
    const still = seconds === 0 || matchMedia('(prefers-reduced-motion: reduce)').matches;
    this.turning = still ? null : { from: this.q, to: goal, time: 0, seconds };
    if (still) this.q = goal;
  }

  /** Turns the patient about an axis of the room. */
  roll(axis, angle) {
    this.settle(compose(turn(axis, angle), this.q), 0, 0);
  }

  /** Moves on by `seconds`; true when something is still moving. */
  advance(seconds) {
    if (this.turning) {
      this.turning.time += seconds / this.turning.seconds;
      const t = Math.min(1, this.turning.time);
      this.q = slerp(this.turning.from, this.turning.to, t * t * (3 - 2 * t));
      if (t === 1) this.turning = null;
    }
    const goal = this.room ? 1 : 0;
    if (this.roomBlend !== goal) {
      const step = matchMedia('(prefers-reduced-motion: reduce)').matches ? 1 : 2 * seconds;
      this.roomBlend += Math.max(-step, Math.min(step, goal - this.roomBlend));
    }
    if (this.playing) {
      this.phase = (this.phase + (seconds * this.rate) / 60) % 1;
      this.depth = (this.tidal * (1 - Math.cos(2 * Math.PI * this.phase))) / 2;
    }
    return this.playing || this.turning !== null || this.roomBlend !== goal;
  }

  /** Weights for now; false, and the old ones stay, where the surface would fold. */
  compute() {
    const moment = momentFor(this.basis, this.gravity, this.depth);
    if (!Number.isFinite(moment.scale)) return false;
    this.moment = moment;
    const pinned = momentFor(this.basis, this.pinnedGravity, this.depth);
    this.pinned = Number.isFinite(pinned.scale) ? pinned : moment;
    return true;
  }

  /** Ranges of the colours: the most that six postures show at the deepest breath in use. */
  measure() {
    const deepest = Math.max(this.tidal, this.playing ? 0 : this.depth);
    if (deepest === this.measured) return;
    this.measured = deepest;
    const fields = POSTURES.map((p) => momentFor(this.basis, gravityOf(tilted(p.q, p.tilt)), deepest))
      .filter((m) => Number.isFinite(m.scale)).map((m) => sampleField(this.basis, m));
    const most = (a, b) => {
      let largest = 0;
      for (let i = 0; i < a.length; i += 3) {
        const square = b ? (a[i] - b[i]) ** 2 + (a[i + 1] - b[i + 1]) ** 2 + (a[i + 2] - b[i + 2]) ** 2 : a[i] ** 2 + a[i + 1] ** 2 + a[i + 2] ** 2;
        if (square > largest) largest = square;
      }
      return Math.sqrt(largest);
    };
    let displacement = 1e-3;
    let difference = 1e-3;
    fields.forEach((a, i) => {
      displacement = Math.max(displacement, most(a));
      for (const b of fields.slice(i + 1)) difference = Math.max(difference, most(a, b));
    });
    this.ranges = { displacement: roundRange(displacement), difference: roundRange(difference) };
  }
}
