// SPDX-License-Identifier: MIT
// Compute colours, and ranges and ticks of colour bars, by the same rules as 'supine render' and 'supine compare'.

/** Colours of anatomy, large structures such as lobes and airways, in turn: those of pictures, which readBasis finds in
 * the page. */
const ANATOMY_COLOURS = [];

/** Return the interval between the ticks of a scale that ends at `value`: a round number, 1/10 to 1/4 of `value`. */
function tickStep(value) {
  if (!(value > 0)) return 0.2;
  const power = 10 ** Math.floor(Math.log10(value / 4));
  const steps = value / 4 / power;
  return power * ([5, 2].find((round) => steps >= round) ?? 1);
}

/** Return the upper end of a range of colours: `value` rounded up to a tick. */
function rangeEnd(value) {
  const step = tickStep(value);
  return value > 0 ? step * Math.ceil(value / step - 1e-9) : 5 * step;
}

/** Quantities that colours can show. `measure` is the value of the shaders' uniform `kind`; `map` is a colour map. */
const KINDS = {
  plain: { measure: 0, map: 'plain', unit: 'mm' },
  displacement: { measure: 0, map: 'displacement', unit: 'mm' },
  difference: { measure: 0, map: 'difference', unit: 'mm' },
  expansion: { measure: 1, map: 'expansion', unit: '%' },
};

/** Return the RGBA bytes of a diverging colour map: blue below its middle, orange above. */
function divergingMap() {
  const stops = [
    [19, 66, 138],
    [113, 161, 214],
    [243, 242, 238],
    [230, 147, 92],
    [140, 45, 4],
  ];
  return Uint8Array.from({ length: 1024 }, (_, i) => {
    const at = (Math.floor(i / 4) / 255) * 4;
    const below = Math.min(3, Math.floor(at));
    return i % 4 === 3
      ? 255
      : Math.round(stops[below][i % 4] + (at - below) * (stops[below + 1][i % 4] - stops[below][i % 4]));
  });
}

/** Return a CSS gradient of a colour map, which is given as RGBA bytes. */
function gradient(bytes) {
  const stops = Array.from({ length: 33 }, (_, i) => {
    const at = 4 * Math.round((i * 255) / 32);
    return `rgb(${bytes[at]} ${bytes[at + 1]} ${bytes[at + 2]})`;
  });
  return `linear-gradient(to right, ${stops.join(', ')})`;
}

const plain = (value) => String(Number(value.toPrecision(4))).replace('-', '\u2212');
