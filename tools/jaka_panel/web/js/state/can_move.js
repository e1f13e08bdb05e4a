/** Shows the line at the top of the page, and how old what is shown is where that matters. */
import { byId, clearText, h, replaceText, setAttribute, setText } from '../ui/dom.js';
import { fixed } from '../ui/format.js';
import { sentenceOf } from '../ui/errors.js';
import { ownerKey } from './status.js';

/** @typedef {import('../app.js').App} App */

/** Conditions whose reason is an alarm of the controller's. */
const ALARMED = ['collided', 'faulted'];

/**
 * The newest alarm of the controller that stands; null: none.
 *
 * @param {import('../link/messages.js').Alarm[]} alarms
 */
export function standingAlarm(alarms) {
  return [...alarms].reverse().find((alarm) => alarm.level === 'error' && alarm.source === 'controller'
    && (alarm.until === null || alarm.until === undefined)) ?? null;
}

/** @param {App} app */
export function mountLine(app) {
  const { store } = app;
  const root = byId('line');
  const can = h('strong', { class: 'line-can', id: 'line-can' });
  const why = h('span', { class: 'line-why' });
  const alarm = h('span', { class: 'line-alarm' });
  const next = h('span', { class: 'line-next' });
  byId('line-said').append(can, ' ', why, alarm, ' ', next);

  function show() {
    const { line } = app.offers;
    if (!line) return;
    setAttribute(root, 'data-mark', line.mark);
    setAttribute(root, 'data-line', line.name);
    const state = store.record().state;
    const seconds = store.age();
    const values = { s: Number.isFinite(seconds) ? fixed(seconds, 1) : '–', owner: ownerText(app, state?.owner) };
    setText(can, `line.can.${line.can}`);
    const isUntold = line.name === 'moving' && (!state?.owner || state.owner === 'nobody');  // told once a second
    const reason = isUntold ? 'line.why.moving_unknown' : `line.why.${line.name}`;
    for (const [part, key] of /** @type {[Element, string][]} */ ([[why, reason], [next, line.next]])) {
      if (app.isText(key)) {
        setText(part, key, values);
      } else {
        clearText(part);
      }
    }
    const last = ALARMED.includes(line.name) ? standingAlarm(store.record().alarms) : null;
    replaceText(alarm, last ? ` ${last.code ? `${last.code} ` : ''}${sentenceOf(last.text)}` : '');
  }

  store.on('line alarm alarms chosen-language', show);
  setInterval(() => {
    if (app.offers.line?.mark === 'old') show();
  }, 200);
  app.onFrame(() => {
    if (app.offers.line?.name === 'moving' || app.offers.line?.name === 'held') show();
  });
  show();
}

/**
 * Return who has the arm's motion, in the page's language where the driver's words are known.
 *
 * @param {App} app
 * @param {string|null|undefined} owner
 * @returns {string}
 */
export function ownerText(app, owner) {
  if (!owner || owner === 'nobody') return app.say('state.nobody');
  const key = ownerKey(owner);
  return app.isText(key) ? app.say(key) : owner;
}
