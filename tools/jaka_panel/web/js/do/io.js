/** Inputs as lamps, outputs as switches. A switch shows what the controller reports, never what was asked for. */
import { h, replaceText, setAttribute, setText } from '../ui/dom.js';
import { fixed } from '../ui/format.js';
import { actionButton, numberField } from '../ui/field.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {import('../link/messages.js').IoBank} IoBank */

/** Banks whose outputs can be set; the others are shown. */
const SETTABLE = ['cabinet', 'tool', 'extension'];

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountIo(root, app) {
  const { store } = app;
  const place = h('div', { class: 'banks' });
  const empty = h('p', { class: 'empty', t: 'io.none' });
  root.append(empty, place);
  /** @type {((banks: Record<string, IoBank>, relays: boolean[]) => void)[]} */
  let updates = [];
  let shape = '';

  /**
   * @param {string} bank
   * @param {number} index
   * @returns {HTMLElement}
   */
  function makeOutput(bank, index) {
    const button = actionButton('io.off', async () => {
      const on = button.getAttribute('aria-checked') !== 'true';
      setText(button, 'io.waiting');
      await app.command('set_output', { signal: 'digital', bank, index, value: on }, { about: `DO ${index}`, quiet: true });
      setText(button, button.getAttribute('aria-checked') === 'true' ? 'io.on' : 'io.off');
    }, { role: 'switch', 'aria-checked': 'false', class: 'needs-control switch' });
    button.setAttribute('aria-label', `${bank} DO ${index}`);
    updates.push((banks) => {
      const on = Boolean(banks[bank]?.do?.[index]);
      setAttribute(button, 'aria-checked', String(on));
      if (button.getAttribute('aria-busy') !== 'true') setText(button, on ? 'io.on' : 'io.off');
    });
    return h('div', { class: 'terminal' }, h('span', {}, `DO ${index}`), button);
  }

  /**
   * @param {string} bank
   * @param {number} index
   * @returns {HTMLElement}
   */
  function makeAnalogOutput(bank, index) {
    const field = numberField({ label: `AO ${index}`, unit: '', decimals: 3 });
    const value = h('output', { class: 'number' });
    const set = actionButton('io.set', async () => {
      if (Number.isNaN(field.value())) {
        field.input.focus();
        return;
      }
      await app.command('set_output', { signal: 'analog', bank, index, value: field.value() }, { about: `AO ${index}` });
    });
    updates.push((banks) => replaceText(value, fixed(banks[bank]?.ao?.[index], 3)));
    return h('div', { class: 'terminal analog' }, field.element, set, value);
  }

  /**
   * @param {string} label
   * @param {(banks: Record<string, IoBank>, relays: boolean[]) => boolean} read
   * @returns {HTMLElement}
   */
  function makeLamp(label, read) {
    const lamp = h('span', { class: 'lamp', role: 'img' });
    updates.push((banks, relays) => {
      const on = read(banks, relays);
      lamp.classList.toggle('on', on);
      setAttribute(lamp, 'data-t-label', on ? 'io.on' : 'io.off');
      setAttribute(lamp, 'aria-label', app.say(on ? 'io.on' : 'io.off'));
    });
    return h('div', { class: 'terminal' }, h('span', {}, label), lamp);
  }

  /**
   * @param {string} label
   * @param {(banks: Record<string, IoBank>) => number|undefined} read
   * @returns {HTMLElement}
   */
  function makeReading(label, read) {
    const value = h('output', { class: 'number' });
    updates.push((banks) => replaceText(value, fixed(read(banks), 3)));
    return h('div', { class: 'terminal' }, h('span', {}, label), value);
  }

  /**
   * @param {string} name
   * @param {IoBank} bank
   * @returns {HTMLElement}
   */
  function makeBank(name, bank) {
    const isSettable = SETTABLE.includes(name);
    return h('section', { class: 'bank' }, h('h3', { t: `io.bank.${name}` }),
      h('div', { class: 'terminals' },
        ...(bank.di ?? []).map((_, index) => makeLamp(`DI ${index}`, (banks) => Boolean(banks[name]?.di?.[index])))),
      h('div', { class: 'terminals' },
        ...(bank.do ?? []).map((_, index) => (isSettable ? makeOutput(name, index)
          : makeLamp(`DO ${index}`, (banks) => Boolean(banks[name]?.do?.[index]))))),
      h('div', { class: 'terminals wide' },
        ...(bank.ai ?? []).map((_, index) => makeReading(`AI ${index}`, (banks) => banks[name]?.ai?.[index])),
        ...(bank.ao ?? []).map((_, index) => (isSettable ? makeAnalogOutput(name, index)
          : makeReading(`AO ${index}`, (banks) => banks[name]?.ao?.[index])))));
  }

  function show() {
    const io = store.record().io;
    const banks = /** @type {[string, IoBank][]} */ (Object.entries(io?.banks ?? {})
      .filter(([, bank]) => [bank.di, bank.do, bank.ai, bank.ao].some((row) => row?.length)));
    const relays = io?.relays ?? [];
    empty.hidden = banks.length > 0 || relays.length > 0;
    const wanted = JSON.stringify([store.chosen, relays.length, banks.map(([name, bank]) => (
      [name, bank.di?.length, bank.do?.length, bank.ai?.length, bank.ao?.length]))]);
    if (wanted !== shape) {
      shape = wanted;
      updates = [];
      place.replaceChildren(...banks.map(([name, bank]) => makeBank(name, bank)));
      if (relays.length) {
        place.append(h('section', { class: 'bank' }, h('h3', { t: 'io.bank.relays' }), h('div', { class: 'terminals' },
          ...relays.map((/** @type {boolean} */ _, /** @type {number} */ index) => makeLamp(`R ${index}`, (__, all) => Boolean(all[index]))))));
      }
      app.lockControls();
    }
    for (const update of updates) update(io?.banks ?? {}, relays);
  }

  store.on('io chosen welcome', show);
  show();
}
