// SPDX-License-Identifier: MIT
// Perceptually uniform colours: paths through OKLab (B. Ottosson 2020), in equal steps of its
// distance, lightness rising all the way, so that they also read in grey and for the colour-blind.

function fromOklab(lightness, a, b) {
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.291485548 * b) ** 3;
  return [
    4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
    -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
    -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s,
  ];
}

const encode = (x) => {
  const c = Math.min(1, Math.max(0, x));
  return c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055;
};

// Lightness, chroma and hue (degrees) along the path.
const PATHS = {
  displacement: [[0.42, 0.14, 288], [0.51, 0.125, 258], [0.61, 0.098, 218], [0.72, 0.115, 170], [0.84, 0.16, 130], [0.95, 0.15, 106]],
  difference: [[0.4, 0.08, 265], [0.47, 0.14, 305], [0.57, 0.175, 350], [0.68, 0.155, 390], [0.81, 0.13, 425], [0.95, 0.07, 455]],
};

/** 256 colours, RGBA bytes. */
function colourMap(name) {
  const knots = PATHS[name];
  const fine = 4096;
  const points = [];
  const lengths = [0];
  for (let i = 0; i <= fine; ++i) {
    const t = (i / fine) * (knots.length - 1);
    const k = Math.min(Math.floor(t), knots.length - 2);
    const mix = (j) => { // Catmull-Rom
      const at = (n) => knots[Math.min(Math.max(n, 0), knots.length - 1)][j];
      const [p, q, r, s, u] = [at(k - 1), at(k), at(k + 1), at(k + 2), t - k];
      return 0.5 * (2 * q + (r - p) * u + (2 * p - 5 * q + 4 * r - s) * u * u + (3 * q - p - 3 * r + s) * u ** 3);
    };
    const hue = (mix(2) * Math.PI) / 180;
    points.push([mix(0), mix(1) * Math.cos(hue), mix(1) * Math.sin(hue)]);
    if (i > 0) lengths.push(lengths[i - 1] + Math.hypot(...points[i].map((x, j) => x - points[i - 1][j])));
  }
  const bytes = new Uint8ClampedArray(4 * 256);
  for (let i = 0, at = 0; i < 256; ++i) {
    while (at < fine && lengths[at] < (i / 255) * lengths[fine]) ++at;
    bytes.set([...fromOklab(...points[at]).map((x) => 255 * encode(x)), 255], 4 * i);
  }
  return bytes;
}

/** The next round number at or above x, and a step that divides it into 4 to 6. */
function roundRange(x) {
  const power = 10 ** Math.floor(Math.log10(x));
  const steps = [[1, 0.2], [1.2, 0.2], [1.5, 0.25], [2, 0.5], [2.5, 0.5], [3, 0.5], [4, 1], [5, 1], [6, 1], [8, 2], [10, 2]];
  const [end, step] = steps.find(([mantissa]) => mantissa * power >= x * 0.999) ?? [10, 2];
  return { end: end * power, step: step * power };
}
