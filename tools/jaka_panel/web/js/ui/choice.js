/** One of a few: a row of buttons, of which one is pressed. */
import { h, setAttribute } from './dom.js';

/**
 * @param {string} label Key of the group's name.
 * @param {string[]} names The first is chosen at the beginning.
 * @param {string} keys Texts are `KEYS.NAME`.
 * @param {(name: string) => void} onChange Also when it is chosen by `choose`.
 * @returns {{element: HTMLElement, choose: (name: string) => void, chosen: () => string}}
 */
export function makeChoice(label, names, keys, onChange) {
  let current = names[0];
  const buttons = names.map((name) => h('button', { type: 'button', 'data-name': name, t: `${keys}.${name}`,
    on: { click: () => choose(name) } }));

  function show() {
    for (const button of buttons) {
      setAttribute(button, 'aria-pressed', String(button.getAttribute('data-name') === current));
    }
  }

  /** @param {string} name */
  function choose(name) {
    if (name === current) return;
    current = name;
    show();
    onChange(name);
  }

  show();
  const element = h('div', { class: 'choice', role: 'group', tLabel: label }, ...buttons);
  return { element, choose, chosen: () => current };
}
