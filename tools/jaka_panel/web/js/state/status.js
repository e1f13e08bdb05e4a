/** The strip of states, each by a word and a mark, and how old they are. */
import { byId, h, replaceText, setAttribute, setText } from '../ui/dom.js';
import { fixed } from '../ui/format.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {import('../link/messages.js').ArmState} ArmState */

/** The names that a driver has for those who move the arm, without its article, with the keys of their texts. */
const OWNERS = /** @type {Record<string, string>} */ ({
  move: 'owner.move', jog: 'owner.jog', 'servo mode': 'owner.servo_mode', trajectory: 'owner.trajectory',
  'velocity jog': 'owner.velocity_jog', path: 'owner.path', program: 'owner.program',
  'what a dead driver left moving': 'owner.left', 'change of frames, payload or hand guiding': 'owner.setting',
  'the zeroing of the force sensor': 'owner.sensor', 'change of the zones': 'owner.zones',
  'the loading of a program': 'owner.loading', "the motion guard's look at a move": 'owner.look',
  'the audit of a path': 'owner.audit',
});
const MOTIONS = ['stop', 'pause', 'emergency', 'running', 'error'];

/**
 * The key of the text for who has the arm's motion; what is not known stays as the driver says it.
 *
 * @param {string} owner In the driver's words.
 * @returns {string}
 */
export function ownerKey(owner) {
  return OWNERS[owner.replace(/^an? /, '')] ?? owner;
}

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
    owner: !state?.owner ? unknown : [state.owner === 'nobody' ? 'state.nobody' : ownerKey(state.owner), ''],
    speed: state?.speed === null || state?.speed === undefined ? unknown : [`${fixed(100 * state.speed, 0)} %`,
      state.speed < 0.005 ? 'warn' : ''],
  };
}

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountStatus(root, app) {
  const { store } = app;
  const names = Object.keys(readStates(null));
  const marks = Object.fromEntries(names.map((name) => [name, h('dd', { class: 'mark' })]));
  root.append(h('dl', { class: 'states' }, ...names.map((name) => (
    h('div', { class: 'state', 'data-state': name }, h('dt', { t: `state.name.${name}` }), marks[name])))));
  const age = byId('age');

  let isOld = true;

  /** Draw the line; what is old keeps its words, as what was, and loses its marks. */
  function draw() {
    const states = readStates(store.record().state);
    if (states.owner[0] === 'state.nobody' && store.moves()) states.owner = ['owner.unknown', ''];  // told once a second
    for (const [name, [word, mark]] of Object.entries(states)) {
      const isWord = app.isText(word);
      if (isOld && word !== 'state.unknown') setText(marks[name], 'state.was', { was: isWord ? app.say(word) : word });
      else if (isWord) setText(marks[name], word);
      else {
        marks[name].removeAttribute('data-t');
        replaceText(marks[name], word);
      }
      setAttribute(marks[name], 'data-mark', isOld ? 'old' : (mark || null));
    }
  }

  app.onFrame(draw);

  /** Ages go on between the samples, and past the last one. */
  function showAge() {
    const seconds = store.age();
    const isFresh = store.isFresh();
    document.body.classList.toggle('stale', !isFresh);
    if (isOld === isFresh) {
      isOld = !isFresh;
      draw();
    }
    if (isFresh) setText(age, 'age.fresh', { ms: Math.max(1, Math.round(seconds * 1000)) });
    else if (!store.arm()) setText(age, 'age.no_arm');
    else if (seconds === Infinity) setText(age, 'age.never');
    else if (store.isSlow()) setText(age, 'age.slow', { s: fixed(seconds, 1) });
    else setText(age, 'age.stale', { s: fixed(seconds, 1) });
  }

  setInterval(showAge, 200);
  store.on('chosen state', showAge);
  showAge();
}
