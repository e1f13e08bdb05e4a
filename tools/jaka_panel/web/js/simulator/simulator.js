/** The actions of a person at a simulated arm, and faults of its wire. Not there with a real controller. */
import { h, replaceText, setText } from '../ui/dom.js';
import { actionButton, numberField, readAll } from '../ui/field.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {import('../ui/field.js').NumberField} NumberField */

/** Each with its parameters, as docs/simulation.md has them. @type {[string, string, Record<string, any>][]} */
const FAULTS = [
  ['stall', 'stall', { port: 'status', duration_ms: 1000 }],
  ['close', 'close', { port: 'all' }],
  ['slow_feed', 'slow_feed', { rate: 10 }],
  ['delay', 'fault', { kind: 'delay', port: 'command', delay_ms: 200, count: 20 }],
  ['drop', 'fault', { kind: 'drop', port: 'command', count: 1 }],
  ['garbage', 'fault', { kind: 'garbage', port: 'status', count: 1 }],
  ['reboot', 'reboot', { down: 5 }],
];

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountSimulator(root, app) {
  const said = h('p', { class: 'said', role: 'status' });

  /**
   * @param {string} action
   * @param {Record<string, any>} [fields]
   */
  async function act(action, fields = {}) {
    const answer = await app.command('sim', { action, ...fields }, { quiet: true });
    const data = answer.data && Object.keys(answer.data).length ? JSON.stringify(answer.data) : '';
    if (answer.ok) setText(said, 'sim.done', { action, data });
  }

  /**
   * @param {string} title
   * @param {NumberField[]} fields
   * @param {string} hint
   * @param {...HTMLElement} buttons
   */
  const card = (title, fields, hint, ...buttons) => h('section', { class: 'card' }, h('h3', { t: title }),
    h('p', { class: 'hint', t: hint }), h('div', { class: 'fields' }, ...fields.map((field) => field.element)),
    h('div', { class: 'buttons' }, ...buttons));

  const force = numberField({ label: 'sim.force', unit: 'N', value: 150, low: 0, high: 1000, decimals: 0 });
  const joint = numberField({ label: 'sim.joint', unit: '1–6', value: 1, low: 1, high: 6, decimals: 0 });
  const velocity = numberField({ label: 'sim.velocity', unit: '°/s', value: 10, low: -60, high: 60, decimals: 0 });
  const index = numberField({ label: 'sim.index', unit: '0–', value: 0, low: 0, high: 127, decimals: 0 });
  /**
   * @param {NumberField[]} fields
   * @param {(values: number[]) => Promise<void>} use
   * @returns {() => Promise<void>}
   */
  const withValues = (fields, use) => async () => {
    const values = readAll(fields);
    if (values) await use(values);
  };
  root.append(
    h('p', { class: 'hint', t: 'sim.hint' }),
    card('sim.emergency', [], 'sim.emergency.hint',
      actionButton('sim.press', () => act('press_emergency_stop'), { class: 'needs-control danger' }),
      actionButton('sim.release', () => act('release_emergency_stop'))),
    card('sim.hit', [force], 'sim.hit.hint', actionButton('sim.do_hit', withValues([force], ([value]) => act('hit', { force: value })))),
    card('sim.push', [joint, velocity], 'sim.push.hint',
      actionButton('sim.do_push', withValues([joint, velocity], ([n, value]) => act('push', { joint: Math.round(n), velocity: value, duration: 1 })))),
    card('sim.input', [index], 'sim.input.hint',
      actionButton('io.on', withValues([index], ([n]) => act('set_input', { index: Math.round(n), value: 1, bank: 'cabinet', signal: 'digital' }))),
      actionButton('io.off', withValues([index], ([n]) => act('set_input', { index: Math.round(n), value: 0, bank: 'cabinet', signal: 'digital' })))),
    card('sim.faults', [], 'sim.faults.hint', ...FAULTS.map(([name, action, fields]) => actionButton(`sim.fault.${name}`, () => act(action, fields))),
      actionButton('sim.clear', () => act('clear_faults'))),
    said);
  app.store.on('chosen', () => {
    said.removeAttribute('data-t');
    replaceText(said, '');
  });
}
