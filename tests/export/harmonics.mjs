// SPDX-License-Identifier: GPL-3.0-or-later
// Real spherical harmonics by the closed form of the associated Legendre functions. The program and the page use
// a recurrence instead.

/** Return the m-th derivative of P_l at z, as a sum of powers whose coefficients are exact in
 * double up to l = 15. */
function legendreDerivative(l, m, z) {
  let sum = 0;
  let term = 1; // becomes (2l)! / (2^l l! l!)
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
