/** Names of inputs and outputs, and the layout of the page, as the cell keeps them for all pages. */
import { h, setText } from '../ui/dom.js';
import { numberField, readAll } from '../ui/field.js';
import { keep as keepIn } from '../ui/keep.js';
import { toast } from '../ui/toast.js';
import { terminalWords } from '../do/io_names.js';
import { twiceButton } from './twice.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {import('../link/messages.js').Answer} Answer */

const LONGEST = 60;
const KINDS = ['di', 'do', 'ai', 'ao'];
const RELAYS = 'relays';
const LAYOUT = 'page';
/** The begin of the names under which a browser keeps values; some of them belong to the layout. */
const KEPT = 'jaka-panel-';
const LAYOUT_KEYS = ['drawer', 'view', 'theme'];

/**
 * @param {Answer} answer
 * @param {string} about Key.
 */
function say(answer, about) {
  toast(answer.ok ? 'cmd.done' : (answer.message || 'cmd.failed'), answer.ok ? 'good' : 'bad', about);
}

/**
 * @param {App} app
 * @returns {HTMLElement}
 */
export function makeNames(app) {
  const { store, cell } = app;
  const list = h('ul', { class: 'points' });
  const bank = /** @type {HTMLSelectElement} */ (h('select', { id: 'name-bank' }));
  const kind = /** @type {HTMLSelectElement} */ (h('select', { id: 'name-kind', tLabel: 'cell.terminal_kind' }, ...KINDS.map((one) => h('option', { value: one }, one.toUpperCase()))));
  const index = numberField({ label: 'list.index', unit: '', decimals: 0, value: 0, low: 0, high: 9999 });
  const label = /** @type {HTMLInputElement} */ (h('input', { type: 'text', id: 'name-label', maxlength: LONGEST, autocomplete: 'off' }));
  const keep = h('button', { type: 'button', t: 'teach.keep', on: { click: () => void storeName() } });

  async function storeName() {
    const [number] = readAll([index]) ?? [];
    if (number === undefined || !bank.value) return;
    if (!label.value.trim()) {
      toast('teach.name_first', 'bad', 'teach.keep');
      label.focus();
      return;
    }
    const word = bank.value === RELAYS ? 'r' : kind.value;
    const answer = await cell.change([{ section: 'io', arm: store.chosen, name: `${bank.value}.${word}.${Math.round(number)}`,
      entry: { label: label.value.trim() } }]);
    say(answer, 'teach.keep');
    if (answer.ok) label.value = '';
  }

  function draw() {
    const arm = store.chosen;
    list.replaceChildren(...cell.entries('io', arm).map(([name, entry]) => h('li', {}, h('span', { class: 'point-name' }, entry.label),
      h('span', { class: 'second' }, terminalWords(app.say, .../** @type {[string, string, string]} */ (name.split('.')))),
      twiceButton('points.remove', 'cell.remove_sure', async () => {
        const answer = await cell.change([{ section: 'io', arm, name, entry: null }]);
        if (!answer.ok) say(answer, 'points.remove');
      }, { values: () => ({ name: entry.label }) }))));
  }

  let banks = '';
  store.on('io chosen', () => {
    const { io } = store.record();
    const there = [...Object.keys(io?.banks ?? {}), ...(io?.relays?.length ? [RELAYS] : [])];
    if (there.join() === banks) return;
    banks = there.join();
    bank.replaceChildren(...there.map((one) => h('option', { value: one, t: `io.bank.${one}` })));
  });
  store.on('cell-data chosen chosen-language', draw);
  return h('section', { class: 'card', id: 'cell-names' }, h('h3', { t: 'cell.names' }), list,
    h('div', { class: 'buttons' }, h('label', { for: bank.id, t: 'cell.terminal' }), bank, kind, index.element,
      h('label', { for: label.id, t: 'points.name' }), label, keep));
}

/**
 * The layout that a browser keeps.
 *
 * @param {Storage|null} storage
 * @returns {Record<string, string>} By key.
 */
export function layoutOf(storage) {
  return Object.fromEntries(LAYOUT_KEYS.flatMap((key) => {
    const value = storage?.getItem(KEPT + key);
    return value ? [[key, value.slice(0, LONGEST)]] : [];
  }));
}

/**
 * @param {App} app
 * @returns {HTMLElement}
 */
export function makeLayout(app) {
  const { cell, local } = app;
  const said = h('p', {});
  const keep = twiceButton('cell.layout_keep', 'cell.layout_keep_sure', async () => {
    say(await cell.change([{ section: 'layout', arm: '', name: LAYOUT, entry: { values: layoutOf(local) } }]), 'cell.layout');
  });
  const use = twiceButton('cell.layout_use', 'cell.layout_use_sure', async () => {
    const values = cell.entry('layout', '', LAYOUT)?.values ?? {};
    for (const key of LAYOUT_KEYS) {
      if (Object.hasOwn(values, key)) keepIn(local, KEPT + key, String(values[key]));
    }
    location.reload();
  });
  app.store.on('cell-data', () => {
    const isThere = cell.entry('layout', '', LAYOUT) !== undefined;
    use.hidden = !isThere;
    setText(said, isThere ? 'cell.layout_there' : 'cell.layout_none');
  });
  return h('section', { class: 'card', id: 'cell-layout' }, h('h3', { t: 'cell.layout' }), said, h('div', { class: 'buttons' }, keep, use));
}
