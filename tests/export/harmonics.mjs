// SPDX-License-Identifier: GPL-3.0-or-later
// Real spherical harmonics from the closed form of the associated Legendre functions, independent of the
// recurrence used by the program and the page.

/** d^m/dz^m P_l(z), as a sum of powers: coefficients exact up to l = 15 in doubles. */
function legendreDerivative(l, m, z) {
  let sum = 0;
  let term = 1; // (2l)! / (2^l l! l!) built up below
  for (let i = 1; i <= l; ++i) term *= (l + i) / (2 * i);
  for (let k = 0; 2 * k <= l; ++k) {
    const power = l - 2 * k;
    if (power >= m) {
      let falling = term;
      for (let i = 0; i < m; ++i) falling *= power - i;
      sum += falling * z ** (power - m);
    }
    term *= -((l - 2 * k) * (l - 2 * k - 1)) / (2 * (k + 1) * (2 * l - 2 * k - 1));
  }
  return sum;
}

/** Return all Y_lm with l <= band at a unit vector, at index l * l + l + m. */
export function harmonics(band, [x, y, z]) {
  const values = new Float64Array((band + 1) ** 2);
  const phi = Math.atan2(y, x);
  const sine = Math.hypot(x, y);
  for (let l = 0; l <= band; ++l) {
    for (let m = 0; m <= l; ++m) {
      let ratio = (2 * l + 1) / (4 * Math.PI);
      for (let i = l - m + 1; i <= l + m; ++i) ratio /= i;
      const q = Math.sqrt(ratio) * legendreDerivative(l, m, z) * sine ** m;
      if (m === 0) values[l * l + l] = q;
      else {
        values[l * l + l + m] = Math.SQRT2 * q * Math.cos(m * phi);
        values[l * l + l - m] = Math.SQRT2 * q * Math.sin(m * phi);
      }
    }
  }
  return values;
}
