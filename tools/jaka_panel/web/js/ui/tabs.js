/** A row of tabs as the ARIA practices describe it: arrows change the tab, Tab goes into its panel. */
import { h, setAttribute } from './dom.js';

/**
 * @typedef {object} Tab
 * @property {string} name
 * @property {HTMLElement} button
 * @property {HTMLElement} panel
 */

/**
 * Shows one of several panels.
 *
 * @param {HTMLElement} root
 * @param {string[]} names Keys `tab.NAME` of the texts.
 * @param {string} label Key of the row's accessible name.
 * @param {(name: string) => void} [onChange]
 * @returns {{row: HTMLElement, panels: Record<string, HTMLElement>, choose: (name: string) => void, hide: (name: string, hidden: boolean)
 *   => void, chosen: () => string}}
 */
export function makeTabs(root, names, label, onChange) {
  /** @type {Tab[]} */
  const tabs = names.map((name) => ({
    name,
    button: h('button', { type: 'button', role: 'tab', id: `tab-${name}`, 'aria-controls': `panel-${name}`,
      t: `tab.${name}` }),
    panel: h('div', { role: 'tabpanel', id: `panel-${name}`, 'aria-labelledby': `tab-${name}`, class: 'tab-panel' }),
  }));
  const row = h('div', { role: 'tablist', class: 'tabs', tLabel: label }, ...tabs.map((tab) => tab.button));
  let current = '';

  /** @param {string} name */
  function choose(name) {
    if (name === current) return;
    current = name;
    for (const tab of tabs) {
      const chosen = tab.name === name;
      setAttribute(tab.button, 'aria-selected', String(chosen));
      tab.button.tabIndex = chosen ? 0 : -1;
      tab.panel.hidden = !chosen;
    }
    onChange?.(name);
  }

  for (const tab of tabs) tab.button.addEventListener('click', () => choose(tab.name));
  row.addEventListener('keydown', (event) => {
    const shown = tabs.filter((tab) => !tab.button.hidden);
    const place = shown.findIndex((tab) => tab.name === current);
    const steps = /** @type {Record<string, number>} */ ({ ArrowRight: place + 1, ArrowLeft: place - 1, Home: 0, End: -1 });
    if (!(event.key in steps)) return;
    event.preventDefault();
    const next = shown[(steps[event.key] + shown.length) % shown.length];
    choose(next.name);
    next.button.focus();
  });
  root.append(row, ...tabs.map((tab) => tab.panel));
  choose(names[0]);
  return {
    row,
    panels: Object.fromEntries(tabs.map((tab) => [tab.name, tab.panel])),
    choose,
    chosen: () => current,
    hide(name, hidden) {
      const tab = tabs.find((one) => one.name === name);
      if (!tab || tab.button.hidden === hidden) return;
      tab.button.hidden = hidden;
      if (hidden && current === name) choose(names[0]);
    },
  };
}
