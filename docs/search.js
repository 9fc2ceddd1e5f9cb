// SPDX-License-Identifier: GPL-3.0-or-later
// The search of the site: list the sections that have all words. site.py writes SECTIONS, an array of [address, title
// of the page, heading, text], before this text, and ROOT, the way to the site's folder, into each page.

const FOUND_MOST = 12;
const AROUND = 60; // letters shown before and after the first word that is found

/** Return how well a section matches words: more where they stand in its heading; 0 if one is missing. */
function matchOf([, title, heading, text], words) {
  const [head, all] = [`${title} ${heading}`, `${title} ${heading} ${text}`].map((part) => part.toLowerCase());
  if (!words.every((word) => all.includes(word))) return 0;
  return 1 + words.filter((word) => head.includes(word)).length;
}

/** Return an item of the list of what is found. */
function itemOf([address, title, heading, text], word) {
  const [item, link, words] = ['li', 'a', 'small'].map((tag) => document.createElement(tag));
  link.href = ROOT + address;
  link.textContent = heading === title ? title : `${title}: ${heading}`;
  const near = text.toLowerCase().indexOf(word) - AROUND;
  const at = near <= 0 ? 0 : text.indexOf(' ', near) + 1;
  words.textContent = `${text.slice(at, at + 2 * AROUND)} \u2026`;
  item.append(link, words);
  return item;
}

/** List the sections that have all words of the field. */
function search() {
  const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
  const found = words.length
    ? SECTIONS.map((section) => [matchOf(section, words), section]).filter(([match]) => match > 0)
    : [];
  found.sort(([a], [b]) => b - a);
  const items = found.slice(0, FOUND_MOST).map(([, section]) => itemOf(section, words[0]));
  if (words.length && !found.length) items.push('Nothing has all these words.');
  document.getElementById('found').replaceChildren(...items);
}

const field = document.getElementById('search');
field.hidden = false;
field.addEventListener('input', search);
if (matchMedia('(max-width: 820px)').matches) document.querySelector('nav details').open = false;
