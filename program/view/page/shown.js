// SPDX-License-Identifier: MIT
// What the page shows now, and helpers that several of its parts need. start() in page.js sets the variables.

let basis = null; // the lungs: the result of readBasis
let state = null; // State
let canvas = null; // element of the picture
let picture = null; // Picture or Poster; null while the browser has no graphics card
let notes = null; // Notes over the picture
let inside = null; // structures inside the lungs, or null
let panes = []; // views that the last frame drew
let buttons = []; // cards of the postures
let table = null; // TargetTable, or null
let stale = true; // whether the vertices are out of date
let unseen = true; // whether the picture is out of date: the next frame draws it
let told = null; // {gravity, depth, from, chosen, day}: what the texts describe; null makes them be written again

const CHECKBOXES = [...SHOWN, 'inside']; // ids of checkboxes; each sets the field of State with the same name

/** Draw the picture in the next frame. */
function redraw() {
  unseen = true;
}

/** Compute the vertices and draw the picture in the next frame. */
function touch() {
  stale = true;
  unseen = true;
}

const fromWhere = () => state.from.name.replace(/^the /, 'in the '); // for example "in the scan"

const restOrScan = () => (basis.hasRest ? 'rest' : 'the scan');

const isDark = () => document.documentElement.dataset.theme === 'dark';

const amount = (value) => `${value.toFixed(0)} mL`;

const valueText = (value) =>
  `${value.toFixed(KINDS[state.kind].unit === 'mm' ? 2 : 1)} ${KINDS[state.kind].unit}`.replace('-', '\u2212');

/** Return the state from which displacements are measured. */
const originMoment = () => (state.kind === 'difference' ? state.pinned : state.from);
const originName = () => (state.kind === 'difference' ? postureWords(gravityOf(state.pinnedQ)) : state.from.name);

function choose(part) {
  state.chosen = part;
  state.picked = true;
  table.press();
  told = null;
  redraw();
}
