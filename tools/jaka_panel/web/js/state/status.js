/** The strip of states, each by a word and a mark, and how old they are. */
import { byId, h, replaceText, setAttribute, setText } from '../ui/dom.js';
import { fixed } from '../ui/format.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {import('../link/messages.js').ArmState} ArmState */

const MOTIONS = ['stop', 'pause', 'emergency', 'running', 'error'];

/**
 * Word and mark of each state: `ok`, `warn`, `bad`, or nothing for what is neither.
 *
 * @param {ArmState|null} state
 * @returns {Record<string, [string, string]>} Keys of texts, or texts as they are.
 */
export function readStates(state) {
  const unknown = /** @type {[string, string]} */ (['state.unknown', '']);
  const robot = state?.robot;
  const status = state?.status;
  /**
   * @param {boolean|null|undefined} value
   * @param {[string, string]} yes
   * @param {[string, string]} no
   * @returns {[string, string]}
   */
  const pick = (value, yes, no) => (value === null || value === undefined ? unknown : (value ? yes : no));
  /** @type {[string, string]} */
  let motion = unknown;
  if (robot) {
    const name = MOTIONS[robot.motion] ?? 'unknown';
    motion = [`motion.${name}`, ['emergency', 'error'].includes(name) ? 'bad' : (name === 'pause' ? 'warn' : 'ok')];
  }
  return {
    power: pick(robot ? robot.power === 1 : null, ['state.on', 'ok'], ['state.off', 'warn']),
    enabled: pick(state?.enabled, ['state.yes', 'ok'], ['state.no', 'warn']),
    motion,
    emergency: pick(status?.e_stopped, ['state.pressed', 'bad'], ['state.released', 'ok']),
    collision: pick(robot ? robot.collision === 1 : null, ['state.collision', 'bad'], ['state.none', 'ok']),
    servo: pick(robot ? robot.servo === 1 : null, ['state.on', 'ok'], ['state.off', '']),
    guiding: pick(state?.hand_guiding, ['state.on', 'warn'], ['state.off', '']),
    owner: [state?.owner && state.owner !== 'nobody' ? state.owner : 'state.nobody', ''],
    speed: state?.speed === null || state?.speed === undefined ? unknown : [`${fixed(100 * state.speed, 0)} %`,
      state.speed < 0.005 ? 'warn' : ''],
  };
}

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountStatus(root, app) {
  const names = Object.keys(readStates(null));
  const marks = Object.fromEntries(names.map((name) => [name, h('dd', { class: 'mark' })]));
  root.append(h('dl', { class: 'states' }, ...names.map((name) => (
    h('div', { class: 'state', 'data-state': name }, h('dt', { t: `state.name.${name}` }), marks[name])))));
  const age = byId('age');

  app.onFrame((state) => {
    for (const [name, [word, mark]] of Object.entries(readStates(state))) {
      if (app.isText(word)) setText(marks[name], word);
      else {
        marks[name].removeAttribute('data-t');
        replaceText(marks[name], word);
      }
      setAttribute(marks[name], 'data-mark', mark || null);
    }
  });

  /** Ages go on between the samples, and past the last one. */
  function showAge() {
    const seconds = app.store.age();
    const isFresh = app.store.isFresh();
    document.body.classList.toggle('stale', !isFresh);
    if (isFresh) setText(age, 'age.fresh', { ms: Math.max(1, Math.round(seconds * 1000)) });
    else if (!app.store.arm()) setText(age, 'age.no_arm');
    else if (seconds === Infinity) setText(age, 'age.never');
    else if (app.store.isSlow()) setText(age, 'age.slow', { s: fixed(seconds, 1) });
    else setText(age, 'age.stale', { s: fixed(seconds, 1) });
  }

  setInterval(showAge, 200);
  app.store.on('chosen state', showAge);
  showAge();
}
