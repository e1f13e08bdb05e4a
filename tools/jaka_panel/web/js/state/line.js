/**
 * The line at the top of the page: can the arm move, why not, what is next. It is reckoned from facts alone. One table has
 * the arm's conditions, another what each button needs; a button whose need is not met says why, and the line alone says
 * which one stands out.
 */

/**
 * Facts of one moment; null: not known.
 *
 * @typedef {object} Facts
 * @property {'connecting'|'open'|'silent'|'lost'} link
 * @property {'command'|'watch'|null} may
 * @property {'you'|'other'|'free'} control
 * @property {'none'|'dead'|'alive'} arm
 * @property {boolean} isFresh The newest state is the present.
 * @property {boolean} isSlow States come as they should, and only the way of the link makes them old.
 * @property {number} age Of the newest joint sample, s; Infinity: none has come.
 * @property {boolean} isControllerLost The driver has lost the controller.
 * @property {boolean|null} stopped The emergency stop is pressed.
 * @property {boolean|null} collided A collision or protective stop stands.
 * @property {boolean|null} faulted
 * @property {boolean|null} powered
 * @property {boolean|null} enabled
 * @property {boolean|null} guided Hand guiding is on.
 * @property {boolean} isPaused
 * @property {boolean} moves
 * @property {string} owner Who has the arm's motion, in the driver's words; empty: nobody, or not known.
 * @property {'running'|'paused'|'idle'|'unknown'} program
 * @property {number|null} speed 0 to 1
 * @property {boolean} canRecover The driver offers to recover.
 * @property {'move'|'run'|null} offer What is drawn and waits for its button.
 */

/**
 * @typedef {object} Line
 * @property {string} name Of the condition; its reason is the text `line.why.NAME`.
 * @property {string} can The text `line.can.WORD` with which the line begins.
 * @property {'ok'|'warn'|'bad'|'old'} mark
 * @property {string} next Key of the text that says what to do; where there is none of this key, nothing is to be done.
 * @property {string|null} button Name of the one button that stands out.
 * @property {Record<string, string|null>} may By the name of a button: key of the reason against it; null: it may.
 */

/** @typedef {(facts: Facts) => boolean} Test */
/** @typedef {'ok'|'warn'|'bad'|'old'} Mark */

/**
 * Conditions of the arm; the first that holds is said. The last two entries are how `line.can.WORD`
 * begins to say it, and the button that leads on.
 *
 * @type {[string, Test, Mark, string, ((facts: Facts) => string|null)?][]}
 */
const CONDITIONS = [
  ['connecting', ({ link }) => link === 'connecting', 'old', 'unknown'],
  ['cut', ({ link }) => link !== 'open', 'old', 'unknown'],
  ['no_arm', ({ arm }) => arm === 'none', 'old', 'unknown'],
  ['dead', ({ arm }) => arm === 'dead', 'bad', 'unknown'],
  ['no_controller', ({ isControllerLost }) => isControllerLost, 'bad', 'unknown'],
  ['slow', ({ isFresh, isSlow }) => !isFresh && isSlow, 'old', 'late'],
  ['never', ({ age }) => age === Infinity, 'old', 'unknown'],
  ['old', ({ isFresh }) => !isFresh, 'old', 'unknown'],
  ['stopped', ({ stopped }) => stopped === true, 'bad', 'cannot'],
  ['guided', ({ guided }) => guided === true, 'warn', 'by_hand'],
  ['collided', ({ collided }) => collided === true, 'bad', 'cannot', clearing],
  ['faulted', ({ faulted }) => faulted === true, 'bad', 'cannot', clearing],
  ['unpowered', ({ powered }) => powered === false, 'warn', 'cannot', () => 'power_on'],
  ['disabled', ({ enabled }) => enabled === false, 'warn', 'cannot', () => 'enable'],
  ['unknown', ({ stopped, powered, enabled }) => stopped === null || powered === null || enabled === null, 'old', 'unknown'],
  ['paused', ({ isPaused, program }) => isPaused && program !== 'paused', 'warn', 'paused', () => 'resume'],
  ['program_paused', ({ program }) => program === 'paused', 'warn', 'paused', () => 'program_resume'],
  ['moving', ({ moves }) => moves, 'ok', 'moving'],
  ['held', ({ owner }) => owner !== '', 'ok', 'rest'],
  ['no_speed', ({ speed }) => speed !== null && speed < 0.005, 'warn', 'still'],
  ['ready', () => true, 'ok', 'can', ({ offer }) => offer],
];

/** @param {Facts} facts */
function clearing(facts) {
  return facts.canRecover ? 'recover' : 'clear_err';
}

/** Names of the conditions, in the order in which they are looked at. */
export const CONDITION_NAMES = CONDITIONS.map(([name]) => name);

/**
 * Conditions that a button may need, each with the key of the reason where it does not hold.
 *
 * @type {Record<string, [Test, string | ((facts: Facts) => string)]>}
 */
const NEEDS = {
  link: [({ link }) => link === 'open', 'why.link'],
  token: [({ may }) => may === 'command', 'control.may_not'],
  control: [({ control }) => control === 'you', ({ control }) => (control === 'other' ? 'control.ask_first' : 'control.take_first')],
  driver: [({ arm }) => arm === 'alive', ({ arm }) => (arm === 'none' ? 'why.no_arm' : 'why.driver')],
  controller: [({ isControllerLost }) => !isControllerLost, 'why.controller'],
  live: [({ isFresh, isSlow }) => isFresh || isSlow, 'why.old'],
  released: [({ stopped }) => stopped !== true, 'why.stopped'],
  uncollided: [({ collided }) => collided !== true, 'why.collided'],
  power: [({ powered }) => powered !== false, 'why.unpowered'],
  enabled: [({ enabled }) => enabled !== false, 'why.disabled'],
  unguided: [({ guided }) => guided !== true, 'why.guided'],
  motion: [({ moves, owner, isPaused }) => moves || owner !== '' || isPaused, 'why.no_motion'],
  rest: [({ moves }) => !moves, 'why.moving'],
  no_program: [({ program }) => program !== 'running', 'why.program'],
  program_runs: [({ program }) => program === 'running' || program === 'unknown', 'why.no_program'],
  program_paused: [({ program }) => program === 'paused' || program === 'unknown', 'why.no_program_paused'],
};

const COMMAND = ['link', 'token', 'control'];
const LIVE = [...COMMAND, 'driver', 'controller', 'live'];
const MOTION = [...LIVE, 'released', 'uncollided', 'power', 'enabled', 'unguided'];

/** The conditions of each button, in the order in which a reason is looked for. @type {Record<string, string[]>} */
export const BUTTONS = {
  take: ['link', 'token'],
  command: COMMAND,
  power_on: [...LIVE, 'released', 'uncollided'],
  power_off: LIVE,
  enable: [...LIVE, 'released', 'uncollided', 'power'],
  disable: LIVE,
  recover: [...LIVE, 'released', 'unguided'],
  clear_err: [...LIVE, 'released'],
  pause: [...LIVE, 'motion'],
  resume: [...LIVE, 'released', 'uncollided', 'power', 'enabled', 'motion'],
  speed: LIVE,
  jog: [...MOTION, 'no_program'],
  move: [...MOTION, 'no_program'],
  run: [...MOTION, 'no_program'],
  plan: LIVE,
  output: LIVE,
  setting: [...LIVE, 'rest'],
  sensitivity: [...LIVE, 'unguided'],
  guiding_on: [...MOTION, 'rest'],
  guiding_off: [...COMMAND, 'driver', 'controller'],
  zero_force: [...LIVE, 'rest'],
  program_load: [...LIVE, 'no_program'],
  program_play: [...MOTION, 'no_program'],
  program_pause: [...LIVE, 'program_runs'],
  program_resume: [...MOTION, 'program_paused'],
  program_stop: LIVE,
};

/**
 * Return the reason why a button may not be pressed.
 *
 * @param {Facts} facts
 * @param {string} button One of BUTTONS; any other counts as `command`.
 * @returns {string|null} Key of the reason; null: it may.
 */
export function reasonAgainst(facts, button) {
  for (const name of BUTTONS[button] ?? BUTTONS.command) {
    const [isMet, reason] = NEEDS[name];
    if (!isMet(facts)) return typeof reason === 'string' ? reason : reason(facts);
  }
  return null;
}

/**
 * The line for a moment's facts.
 *
 * @param {Facts} facts
 * @returns {Line}
 */
export function lineOf(facts) {
  const [name, , mark, can, leads] = /** @type {typeof CONDITIONS[0]} */ (CONDITIONS.find(([, holds]) => holds(facts)));
  const may = Object.fromEntries(Object.keys(BUTTONS).map((button) => [button, reasonAgainst(facts, button)]));
  let button = leads?.(facts) ?? null;
  let next = button ? `line.next.${button}` : `line.next.${name}`;
  if (leads && facts.control !== 'you') {
    button = facts.may === 'command' ? 'take' : null;
    if (button) next = facts.control === 'other' ? 'line.next.ask' : 'line.next.take';
  }
  if (button && may[button]) button = null;
  return { name, can, mark, next, button, may };
}
