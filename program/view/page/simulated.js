// SPDX-License-Identifier: MIT
// Pose another simulator's fields over gravity and volume, like runtime/simulated.c. The weights of a lung are functions
// of gravity and of a parameter t, to which its simulated volumes were mapped: -1 to 1. The surface holds nearly the
// volume that t stands for; the t at which it holds exactly the volume that is asked is solved for. Volumes are mL above
// those of the reference surface.

const CLOSE_ENOUGH = 1e-6; // difference between the volumes asked and held that ends the search, mL
const BEYOND = 0.1;        // how far outside the simulated range of t the search may go

/** Read the ranges and shares of the lungs' volumes from the page. `offsets` are added to the shares of the lungs, so that
 * each has its own volume in the scan in its posture, if this is known. */
function takeSimulated({ metadata, lungs }) {
  const [range, limits, shares] = ['range', 'limits', 'shares'].map((name) => takeTensor(`simulated_${name}`, Float64Array));
  const simulated = { range, limits, shares, total: metadata.simulated_total_ml.split(',').map(Number) };
  const scan = metadata.scan_gravity?.split(',').map(Number);
  const fitted = scan ? fittedShares({ simulated, lungs }, scan, 0) : new Array(lungs).fill(0);
  return { ...simulated, offsets: fitted.map((ml) => -ml) };
}

/** Return the lowest and the highest simulated volume of each lung, [[low, high], ...], for a direction of gravity. */
function simulatedLimits({ simulated: { limits }, lungs }, gravity) {
  const y = harmonics(2, gravity);
  const row = (at) => y.reduce((sum, x, i) => sum + x * limits[at * y.length + i], 0);
  return Array.from({ length: lungs }, (_, lung) => [row(2 * lung), row(2 * lung + 1)]);
}

/** Return the volume of each lung at rest, or in the scan if rest is unknown. */
const simulatedOrigin = (basis, gravity) => (basis.resting ? volumesFor(basis, gravity).rest : basis.references.map(() => 0));

/** Return the lowest and the highest volume of all lungs, relative to that at rest or in the scan, for a direction of
 * gravity. */
function simulatedRange(basis, gravity) {
  const limits = simulatedLimits(basis, gravity);
  const origin = sumOf(simulatedOrigin(basis, gravity));
  return [0, 1].map((end) => sumOf(limits.map((limit) => limit[end])) - origin);
}

const toUnit = (value, low, high) => (2 * (value - low)) / (high - low) - 1;

/** Return the Chebyshev polynomials T_0 to T_order at t. */
function chebyshev(order, t) {
  const values = [1, t];
  for (let n = 2; n <= order; ++n) values.push(2 * t * values[n - 1] - values[n - 2]);
  return values.slice(0, order + 1);
}

/** Return what the fit of the simulated volumes gives each lung of a total. */
function fittedShares({ simulated: { shares, total: range }, lungs }, gravity, total) {
  const y = harmonics(2, gravity);
  const orders = shares.length / lungs / y.length;
  const polynomials = chebyshev(orders - 1, Math.max(-1, Math.min(1, toUnit(total, ...range))));
  return Array.from({ length: lungs }, (_, lung) => {
    let sum = 0;
    for (let i = 0; i < y.length * orders; ++i) sum += shares[lung * y.length * orders + i] * y[Math.floor(i / orders)] * polynomials[i % orders];
    return sum;
  });
}

/** Divide a total volume among the lungs as the simulator did. Then move each share into the lung's limits, and give what
 * is left to lungs that have room. */
function simulatedShares(basis, gravity, limits, total) {
  const fitted = fittedShares(basis, gravity, total);
  const volumes = limits.map(([low, high], lung) => Math.max(low, Math.min(high, fitted[lung] + basis.simulated.offsets[lung])));
  let left = total - sumOf(volumes);
  limits.forEach(([low, high], lung) => {
    const room = (left > 0 ? high : low) - volumes[lung];
    const moved = Math.abs(left) < Math.abs(room) ? left : room;
    volumes[lung] += moved;
    left -= moved;
  });
  return volumes;
}

/** Return the weights of the modes for a direction of gravity as polynomials of t: coefficients [modes, order + 1]. */
function pathOf({ mixes, modes, band, order }, gravity) {
  const y = harmonics(band, gravity);
  const orders = order + 1;
  const path = new Float64Array(modes * orders);
  for (let k = 0; k < modes; ++k) for (let i = 0; i < y.length * orders; ++i) path[k * orders + (i % orders)] += mixes[k * y.length * orders + i] * y[Math.floor(i / orders)];
  return path;
}

/** Return the weights [modes] of a lung at t, and its volume there. */
function follow(basis, path, lung, t) {
  const polynomials = chebyshev(basis.order, t);
  const weights = Float64Array.from({ length: basis.modes }, (_, k) => polynomials.reduce((sum, p, n) => sum + p * path[k * polynomials.length + n], 0));
  return { weights, volume: formAt(lungForm(basis, lung, weights), [1, 1, 1]) };
}

/** Return the weights [modes] at which a lung holds `volume`, found by the rule of false position with the Illinois
 * correction between `low` and `high`; null if there are none. */
function solveLung(basis, path, lung, volume, low, high) {
  let [below, above] = [low, high].map((t) => follow(basis, path, lung, t).volume - volume);
  let side = 0;
  if (!(below <= CLOSE_ENOUGH && above >= -CLOSE_ENOUGH)) return null;
  for (let step = 0; step < 100; ++step) {
    const t = above > below ? (low * above - high * below) / (above - below) : low;
    const found = follow(basis, path, lung, t);
    const residual = found.volume - volume;
    if (Math.abs(residual) <= CLOSE_ENOUGH || high - low < 1e-14) return found.weights;
    if (residual > 0) {
      [high, above] = [t, residual];
      if (side > 0) below /= 2;
      side = 1;
    } else {
      [low, below] = [t, residual];
      if (side < 0) above /= 2;
      side = -1;
    }
  }
  return null;
}

/** Return the moment (momentFor) of another simulator's fields for a direction of gravity and a volume `depth` above rest,
 * or above the scan if rest is unknown. A volume that was not simulated in this posture is replaced by the nearest that
 * was; `limited` is then the range [low, high] of `depth`, otherwise null. The weights are [lungs, modes]. */
function simulatedMoment(basis, gravity, depth) {
  const limits = simulatedLimits(basis, gravity);
  const origin = simulatedOrigin(basis, gravity);
  const range = simulatedRange(basis, gravity);
  const above = Math.max(range[0], Math.min(range[1], depth));
  const volumes = simulatedShares(basis, gravity, limits, sumOf(origin) + above);
  const path = pathOf(basis, gravity);
  const found = volumes.map((ml, lung) => {
    const [low, high] = limits[lung].map((limit) => toUnit(limit, ...basis.simulated.range.subarray(2 * lung, 2 * lung + 2)));
    return solveLung(basis, path, lung, ml, low - BEYOND, high + BEYOND);
  });
  const folds = found.includes(null);
  return {
    gravity, weights: folds ? new Float64Array(basis.lungs * basis.modes).fill(NaN) : Float64Array.from(found.flatMap((w) => [...w])), gains: new Float64Array(3 * basis.lungs).fill(1),
    held: volumes.map((ml, lung) => basis.references[lung] + ml), above, folds, limited: above === depth ? null : range,
  };
}
