/** The list of events, newest first: alarms and notes, service calls, and the diagnostics as they are. All of it is foreign text. */
import { h, replaceText, setText } from '../ui/dom.js';
import { sentenceOf } from '../ui/errors.js';
import { fixed } from '../ui/format.js';
import { standingAlarm } from './can_move.js';

/** @typedef {import('../app.js').App} App */

const SHOWN = 100;
const LEVELS = ['ok', 'warning', 'error', 'stale'];

/**
 * Time of day with milliseconds, as the clock of this computer has it.
 *
 * @param {number} wall Unix time, s.
 * @returns {string}
 */
export function timeOfDay(wall) {
  const moment = new Date(wall * 1000);
  const two = (/** @type {number} */ value) => String(value).padStart(2, '0');
  return `${two(moment.getHours())}:${two(moment.getMinutes())}:${two(moment.getSeconds())}.${
    String(moment.getMilliseconds()).padStart(3, '0')}`;
}

/**
 * Keeps a list of rows as the items say, newest first; a row is made again only when its item is another one.
 *
 * @template {{n: number}} T
 * @param {HTMLElement} list
 * @param {(item: T) => HTMLElement} makeRow
 * @returns {(items: T[]) => void} Takes the items, oldest first.
 */
function keepList(list, makeRow) {
  /** @type {Map<number, {item: T, row: HTMLElement}>} */
  let rows = new Map();
  return (items) => {
    const next = new Map();
    const shown = items.slice(-SHOWN).reverse();
    for (const item of shown) {
      const kept = rows.get(item.n);
      next.set(item.n, kept && kept.item === item ? kept : { item, row: makeRow(item) });
    }
    const elements = shown.map((item) => next.get(item.n).row);
    const isSame = elements.length === list.children.length && elements.every((row, index) => list.children[index] === row);
    if (!isSame) list.replaceChildren(...elements);
    rows = next;
  };
}

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountAlarms(root, app) {
  const { store } = app;
  const list = h('ol', { class: 'events', tabindex: 0, tLabel: 'alarms.title' });
  const empty = h('p', { class: 'empty', t: 'alarms.none' });
  root.append(list, empty);
  const keep = keepList(list, (/** @type {import('../link/messages.js').Alarm} */ alarm) => {
    const isOver = alarm.until !== null && alarm.until !== undefined;
    return h('li', { class: `event ${alarm.level}${isOver ? ' over' : ''}` },
      h('time', {}, timeOfDay(alarm.wall)), h('span', { class: 'level', t: `level.${alarm.level}` }),
      alarm.code ? h('code', {}, alarm.code) : null, h('span', { class: 'event-text' }, sentenceOf(alarm.text)),
      h('span', { class: 'source', t: `source.${alarm.source}` }));
  });
  const standing = document.getElementById('standing');

  function show() {
    const { alarms } = store.record();
    keep(alarms);
    list.hidden = alarms.length === 0;
    empty.hidden = alarms.length > 0;
    const last = standingAlarm(alarms);
    if (!standing) return;
    standing.hidden = !last;
    replaceText(standing, last ? `${last.code ? `${last.code} ` : ''}${sentenceOf(last.text)}` : '');
  }

  store.on('alarms alarm chosen welcome', show);
  show();
}

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountCalls(root, app) {
  const { store } = app;
  const list = h('ol', { class: 'events', tabindex: 0, tLabel: 'calls.title' });
  const empty = h('p', { class: 'empty', t: 'calls.none' });
  root.append(list, empty);
  const keep = keepList(list, (/** @type {import('../link/messages.js').Call} */ call) => (
    h('li', { class: `event call ${call.ok ? 'ok' : 'error'}` },
      h('details', {}, h('summary', {}, h('time', {}, timeOfDay(call.wall)), h('b', {}, call.name),
        h('span', { class: 'level', t: call.ok ? 'calls.ok' : 'calls.failed' }),
        h('span', { class: 'source' }, `${fixed(call.took * 1000, call.took < 0.1 ? 1 : 0)} ms · ${call.caller}`)),
      h('dl', {}, h('dt', { t: 'calls.request' }), h('dd', {}, h('pre', {}, call.request)),
        h('dt', { t: 'calls.answer' }), h('dd', {}, h('pre', {}, call.answer || call.error)))))));

  function show() {
    const { calls } = store.record();
    keep(calls);
    list.hidden = calls.length === 0;
    empty.hidden = calls.length > 0;
  }

  store.on('calls call chosen welcome', show);
  show();
}

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountDiagnostics(root, app) {
  const { store } = app;
  const list = h('ul', { class: 'events', tabindex: 0, tLabel: 'diagnostics.title' });
  const empty = h('p', { class: 'empty', t: 'diagnostics.none' });
  root.append(list, empty);
  /** @type {Map<string, {element: HTMLDetailsElement, level: HTMLElement, message: HTMLElement, values: HTMLElement}>} */
  const rows = new Map();

  /** @param {string} name */
  function makeRow(name) {
    const level = h('span', { class: 'level' });
    const message = h('span', { class: 'event-text' });
    const values = h('dl', {});
    const element = /** @type {HTMLDetailsElement} */ (h('details', {},
      h('summary', {}, level, h('b', {}, name), message), values));
    list.append(h('li', { class: 'event' }, element));
    return { element, level, message, values };
  }

  function show() {
    const { diagnostics } = store.record();
    empty.hidden = diagnostics.length > 0;
    list.hidden = diagnostics.length === 0;
    for (const status of diagnostics) {
      const row = rows.get(status.name) ?? makeRow(status.name);
      rows.set(status.name, row);
      const name = LEVELS[status.level] ?? 'stale';
      setText(row.level, `diagnostics.${name}`);
      row.element.parentElement?.setAttribute('class', `event ${name}`);
      replaceText(row.message, sentenceOf(status.message));
      const text = JSON.stringify(status.values);
      if (row.values.getAttribute('data-shown') !== text) {
        row.values.setAttribute('data-shown', text);
        row.values.replaceChildren(...status.values.flatMap((/** @type {[string, string]} */ [key, value]) => (
          [h('dt', {}, key), h('dd', {}, value)])));
      }
    }
  }

  store.on('chosen welcome', () => {
    rows.clear();
    list.replaceChildren();
    show();
  });
  store.on('diag', show);
  show();
}

/**
 * The newest alarm or note as one line, for where the list is not seen.
 *
 * @param {App} app
 * @returns {HTMLElement}
 */
export function makeNews(app) {
  const { store } = app;
  const element = h('p', { class: 'news' });

  function show() {
    const last = store.record().alarms.at(-1);
    element.className = `news ${last?.level ?? ''}`;
    replaceText(element, last ? `${timeOfDay(last.wall).slice(0, 8)} ${last.code ? `${last.code} ` : ''}${sentenceOf(last.text)}` : '');
  }

  store.on('alarms alarm chosen welcome', show);
  show();
  return element;
}
