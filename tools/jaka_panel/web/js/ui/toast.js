/** Short answers in a corner of the page: what was done, or why not. */
import { byId, h } from './dom.js';
import { sentenceOf } from './errors.js';
import { isKnown, translate } from './i18n.js';

const GOOD_MS = 4000;
const BAD_MS = 12000;
const MOST = 4;

/**
 * Shows a text for some seconds; a click takes it away.
 *
 * @param {string} text Key of a text of ours, or a foreign text.
 * @param {'good'|'bad'} kind
 * @param {string} [about] Key or text in front of it.
 */
export function toast(text, kind, about = '') {
  const say = (/** @type {string} */ part) => (isKnown(part) ? translate(part) : sentenceOf(part));
  const place = byId('toasts');
  const element = h('div', { class: `toast ${kind}`, role: kind === 'bad' ? 'alert' : 'status' },
    h('span', { class: 'toast-mark', 'aria-hidden': 'true' }, kind === 'bad' ? '!' : '✓'),
    about ? h('b', {}, say(about)) : null, h('span', {}, say(text)),
    h('button', { type: 'button', class: 'plain', tLabel: 'toast.close', on: { click: () => element.remove() } }, '×'));
  place.append(element);
  while (place.children.length > MOST) place.firstElementChild?.remove();
  setTimeout(() => element.remove(), kind === 'bad' ? BAD_MS : GOOD_MS);
}
