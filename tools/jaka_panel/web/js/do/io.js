/**
 * Inputs as lamps, outputs as switches, each one element with its name. A switch shows what the controller reports, never
 * what was asked for. A status frame has rows longer than any cabinet: of each, those that are usual are shown, and those
 * that are on, have a name or were seen to change; the others on request.
 */
import { h, replaceText, setAttribute, setText } from '../ui/dom.js';
import { fixed } from '../ui/format.js';
import { actionButton, numberField } from '../ui/field.js';
import { makeChoice } from '../ui/choice.js';
import { timeOfDay } from '../state/events.js';
import { nameOf } from './io_names.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {import('../link/messages.js').IoBank} IoBank */
/** @typedef {'di'|'do'|'ai'|'ao'} Kind */

/** Banks whose outputs can be set; the others are shown. */
const SETTABLE = ['cabinet', 'tool', 'extension'];
/** Digital terminals of the largest usual cabinet, and analog ones. */
const USUAL = { di: 16, do: 16, ai: 4, ao: 4 };

/**
 * @typedef {object} Terminal
 * @property {HTMLElement} element
 * @property {string} bank
 * @property {Kind|'r'} kind
 * @property {number} index
 * @property {string} text What a filter looks into.
 * @property {boolean} isUsed It was on, or has changed.
 * @property {() => void} update
 */

/**
 * Return whether a terminal is to be shown.
 *
 * @param {{kind: Kind|'r', index: number, isUsed: boolean, text: string, isNamed: boolean, isOn: boolean}} terminal
 * @param {'usual'|'on'|'all'} extent
 * @param {string} filter
 * @returns {boolean}
 */
export function isShown(terminal, extent, filter) {
  const words = filter.trim().toLowerCase();
  if (words) return terminal.text.toLowerCase().includes(words);
  if (extent === 'all' || terminal.kind === 'r') return true;
  if (extent === 'on') return terminal.isOn;
  return terminal.index < USUAL[terminal.kind] || terminal.isUsed || terminal.isNamed;
}

/**
 * A moment as people say it: the time of day, with its date where that is another day.
 *
 * @param {number} wall Unix time, s.
 * @param {Date} [today]
 * @returns {string}
 */
export function momentOf(wall, today = new Date()) {
  const moment = new Date(wall * 1000);
  const time = timeOfDay(wall).slice(0, 5);
  return moment.toDateString() === today.toDateString() ? time : `${moment.getMonth() + 1}-${moment.getDate()} ${time}`;
}

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountIo(root, app) {
  const { store } = app;
  const place = h('div', { class: 'banks' });
  const empty = h('p', { class: 'empty', t: 'io.none' });
  const filter = /** @type {HTMLInputElement} */ (h('input', { type: 'search', id: 'io-filter', autocomplete: 'off', on: { input: () => sift() } }));
  const extent = makeChoice('io.extent', ['usual', 'on', 'all'], 'io.extent', () => sift());
  const count = h('span', { class: 'hint' });
  const bar = h('div', { class: 'buttons io-bar' }, h('label', { for: 'io-filter', t: 'io.filter' }), filter, extent.element, count);
  root.append(empty, bar, place);
  /** @type {Terminal[]} */
  let terminals = [];
  let shape = '';

  /** @param {string} bank @param {Kind|'r'} kind @param {number} index */
  const valueOf = (bank, kind, index) => (kind === 'r' ? store.record().io?.relays?.[index] : store.record().io?.banks?.[bank]?.[kind]?.[index]);

  /**
   * @param {string} bank
   * @param {Kind|'r'} kind
   * @param {number} index
   * @returns {Terminal}
   */
  function make(bank, kind, index) {
    const label = kind === 'r' ? `R ${index}` : `${kind.toUpperCase()} ${index}`;
    const name = nameOf(app, bank, kind, index);
    const hand = h('span', { class: 'by-hand', hidden: true });
    const words = h('span', { class: 'terminal-name' }, label, name ? h('b', {}, ` ${name}`) : null, hand);
    const isAnalog = kind === 'ai' || kind === 'ao';
    const canSet = SETTABLE.includes(bank) && (kind === 'do' || kind === 'ao');
    const [part, update] = isAnalog ? (canSet ? makeAnalogOutput(bank, index, label) : makeReading(bank, kind, index))
      : (canSet ? makeOutput(bank, index, label) : makeLamp(bank, kind, index));
    const element = isAnalog && canSet ? h('div', { class: 'terminal analog' }, words, part) : h('div', { class: 'terminal' }, ...(isAnalog ? [words, part] : [part, words]));
    return { element, bank, kind, index, text: `${label} ${name}`, isUsed: false, update: () => {
      update();
      mark(hand, bank, kind, index);
    } };
  }

  /**
   * Says of an output that a page has set when that was, and who did it, until something else sets it.
   *
   * @param {HTMLElement} element
   * @param {string} bank
   * @param {Kind|'r'} kind
   * @param {number} index
   */
  function mark(element, bank, kind, index) {
    const signal = { do: 'digital', ao: 'analog' }[/** @type {string} */ (kind)];
    const found = store.record().byHand.find((one) => one.bank === bank && one.signal === signal && one.index === index);
    element.hidden = !found;
    if (found) setText(element, 'io.by_hand', { time: momentOf(found.wall), by: found.by });
  }

  /**
   * @param {string} bank
   * @param {number} index
   * @param {string} label
   * @returns {[HTMLElement, () => void]}
   */
  function makeOutput(bank, index, label) {
    const button = actionButton('io.off', async () => {
      const on = button.getAttribute('aria-checked') !== 'true';
      setText(button, 'io.waiting');
      await app.command('set_output', { signal: 'digital', bank, index, value: on }, { about: label, quiet: true });
      setText(button, button.getAttribute('aria-checked') === 'true' ? 'io.on' : 'io.off');
    }, { role: 'switch', 'aria-checked': 'false', class: 'needs-control switch', 'data-needs': 'output', 'aria-label': `${bank} ${label}` });
    return [button, () => {
      const on = Boolean(valueOf(bank, 'do', index));
      setAttribute(button, 'aria-checked', String(on));
      if (button.getAttribute('aria-busy') !== 'true') setText(button, on ? 'io.on' : 'io.off');
    }];
  }

  /**
   * @param {string} bank
   * @param {number} index
   * @param {string} label
   * @returns {[HTMLElement, () => void]}
   */
  function makeAnalogOutput(bank, index, label) {
    const field = numberField({ label, unit: '', decimals: 3 });
    const value = h('output', { class: 'number' });
    const set = actionButton('io.set', async () => {
      if (Number.isNaN(field.value())) {
        field.input.focus();
        return;
      }
      await app.command('set_output', { signal: 'analog', bank, index, value: field.value() }, { about: label });
    }, { 'data-needs': 'output' });
    field.element.querySelector('label')?.classList.add('unseen');
    return [h('span', { class: 'analog-output' }, value, field.element, set), () => replaceText(value, fixed(valueOf(bank, 'ao', index), 3))];
  }

  /**
   * @param {string} bank
   * @param {Kind|'r'} kind
   * @param {number} index
   * @returns {[HTMLElement, () => void]}
   */
  function makeLamp(bank, kind, index) {
    const lamp = h('span', { class: 'lamp', role: 'img' });
    return [lamp, () => {
      const on = Boolean(valueOf(bank, kind, index));
      lamp.classList.toggle('on', on);
      setAttribute(lamp, 'data-t-label', on ? 'io.on' : 'io.off');
      setAttribute(lamp, 'aria-label', app.say(on ? 'io.on' : 'io.off'));
    }];
  }

  /**
   * @param {string} bank
   * @param {Kind|'r'} kind
   * @param {number} index
   * @returns {[HTMLElement, () => void]}
   */
  function makeReading(bank, kind, index) {
    const value = h('output', { class: 'number' });
    return [value, () => replaceText(value, fixed(valueOf(bank, kind, index), 3))];
  }

  /**
   * @param {string} name
   * @param {[Kind|'r', number][]} rows Kinds and how many terminals they have.
   * @returns {HTMLElement}
   */
  function makeBank(name, rows) {
    return h('section', { class: 'bank' }, h('h3', { t: `io.bank.${name}` }), ...rows.map(([kind, length]) => {
      const row = Array.from({ length }, (_, index) => make(name, kind, index));
      terminals.push(...row);
      return h('div', { class: kind === 'ao' ? 'terminals wide' : 'terminals' }, ...row.map(({ element }) => element));
    }));
  }

  function sift() {
    let shown = 0;
    for (const terminal of terminals) {
      const isOn = Boolean(valueOf(terminal.bank, terminal.kind, terminal.index));
      const isNamed = nameOf(app, terminal.bank, terminal.kind, terminal.index) !== '';
      const shows = isShown({ ...terminal, isOn, isNamed }, /** @type {any} */ (extent.chosen()), filter.value);
      terminal.element.hidden = !shows;
      if (shows) shown += 1;
    }
    for (const bank of place.children) {
      /** @type {HTMLElement} */ (bank).hidden = !bank.querySelector('.terminal:not([hidden])');
    }
    setText(count, 'io.count', { shown, all: terminals.length });
  }

  function show() {
    const io = store.record().io;
    const banks = /** @type {[string, IoBank][]} */ (Object.entries(io?.banks ?? {})
      .filter(([, bank]) => [bank.di, bank.do, bank.ai, bank.ao].some((row) => row?.length)));
    const relays = io?.relays ?? [];
    empty.hidden = banks.length > 0 || relays.length > 0;
    bar.hidden = !empty.hidden;
    const kinds = /** @type {Kind[]} */ (['di', 'do', 'ai', 'ao']);
    const wanted = JSON.stringify([store.chosen, relays.length, banks.map(([name, bank]) => [name, kinds.map((kind) => bank[kind]?.length)])]);
    const isOther = wanted !== shape;
    if (isOther) {
      shape = wanted;
      terminals = [];
      place.replaceChildren(...banks.map(([name, bank]) => makeBank(name, kinds.map((kind) => [kind, bank[kind]?.length ?? 0]))),
        ...(relays.length ? [makeBank('relays', [['r', relays.length]])] : []));
      app.lockControls();
    }
    let isSifted = !isOther && extent.chosen() !== 'on';
    for (const terminal of terminals) {
      terminal.update();
      const isMarked = !terminal.element.querySelector('.by-hand')?.hasAttribute('hidden');
      if (terminal.isUsed || !(isMarked || valueOf(terminal.bank, terminal.kind, terminal.index))) continue;
      terminal.isUsed = true;
      isSifted = false;
    }
    if (!isSifted) sift();
  }

  store.on('io by_hand chosen welcome', show);
  store.on('cell-data', () => {
    shape = '';
    show();
  });
  show();
}
