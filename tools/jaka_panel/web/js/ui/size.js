/** The three ways in which the page is laid out: for a desk, for fingers on a tablet, for a wall that is read at 2 m. */
import { byId, h } from './dom.js';
import { keep } from './keep.js';

const KEPT_AS = 'jaka-panel-view';
const VIEWS = ['desk', 'tablet', 'wall'];

/**
 * The view to begin with: the one that the address names (`?view=wall`), else the one chosen last, else by the pointer.
 *
 * @param {string} search Of the address.
 * @param {string|null|undefined} kept
 * @param {boolean} isCoarse The pointer is a finger.
 * @returns {string}
 */
export function firstView(search, kept, isCoarse) {
  const named = new URLSearchParams(search).get('view') ?? '';
  return [named, kept ?? ''].find((view) => VIEWS.includes(view)) ?? (isCoarse ? 'tablet' : 'desk');
}

/** @param {Storage|null} storage */
export function mountView(storage) {
  const select = /** @type {HTMLSelectElement} */ (byId('view-choice'));
  select.append(...VIEWS.map((view) => h('option', { value: view, t: `size.${view}` })));

  /** @param {string} view */
  function show(view) {
    select.value = view;
    document.documentElement.dataset.view = view;
    byId('wall').hidden = view !== 'wall';
  }

  select.addEventListener('change', () => {
    show(select.value);
    keep(storage, KEPT_AS, select.value);
  });
  show(firstView(location.search, storage?.getItem(KEPT_AS), matchMedia('(pointer: coarse)').matches));
}
