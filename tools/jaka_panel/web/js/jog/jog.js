/** The jog: which axes, how fast, by steps or as long as it is held. */
import { h, replaceText, setAttribute, setText } from '../ui/dom.js';
import { DEGREES, fixed } from '../ui/format.js';
import { makeChoice } from '../ui/choice.js';
import { sentenceOf } from '../ui/errors.js';
import { toast } from '../ui/toast.js';
import { Hold } from './hold.js';
import { makeHoldButton } from './hold_button.js';

/** @typedef {import('../app.js').App} App */

const AXES = /** @type {Record<string, string[]>} */ ({
  joint: ['J1', 'J2', 'J3', 'J4', 'J5', 'J6'],
  base: ['X', 'Y', 'Z', 'RX', 'RY', 'RZ'],
  tool: ['X', 'Y', 'Z', 'RX', 'RY', 'RZ'],
});
const STEPS = /** @type {Record<string, [number, number]>} */ ({  // m, rad
  hold: [0, 0],
  small: [0.001, 0.1 / DEGREES],
  middle: [0.005, 1 / DEGREES],
  large: [0.02, 5 / DEGREES],
});

/**
 * The tab of the jog.
 *
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountJog(root, app) {
  const { store, connection } = app;
  let space = /** @type {'joint'|'base'|'tool'} */ ('joint');
  let step = 'hold';
  let axis = '';
  /** The reason why the tool stands although it is jogged, in the driver's words. */
  let stands = '';
  const said = h('p', { class: 'said', role: 'status', t: 'jog.idle' });

  const hold = new Hold({
    send: (message) => connection.write(message),
    now: () => performance.now(),
    isAttended: () => document.visibilityState === 'visible' && document.hasFocus(),
    backlog: () => connection.backlog(),
    drawn: () => store.drawn,
    setTimer: (call, period) => setInterval(call, period),
    clearTimer: (timer) => clearInterval(timer),
    onEnd: (why) => {
      for (const button of root.querySelectorAll('.jog-button')) button.dispatchEvent(new Event('holdover'));
      sayEnd(why);
    },
  });
  app.hold = hold;

  /** @param {string} why Of this page or of the server, which may add a text of the driver's. */
  function sayEnd(why) {
    const key = `jog.end.${why.split(':')[0].replaceAll(' ', '_')}`;
    setText(said, app.isText(key) ? key : 'jog.end', { why });
    said.classList.toggle('bad', !['released', 'step done'].includes(why));
  }

  /** Says what the arm does, which is not what it was told. */
  function sayHeld() {
    const moves = store.moves();
    if (stands && !moves) setText(said, 'jog.stands', { why: sentenceOf(stands) });
    else setText(said, moves ? 'jog.moving' : 'jog.held', { axis });
    said.classList.toggle('bad', Boolean(stands) && !moves);
  }

  const rows = [0, 1, 2, 3, 4, 5].map((index) => {
    const name = h('span', { class: 'axis-name' });
    const value = h('output', { class: 'axis-value' });
    /** @param {number} sign */
    const makeButton = (sign) => {
      const button = h('button', { type: 'button', class: 'jog-button needs-control', 'data-needs': 'jog',
        'data-axis': index, 'data-sign': sign }, sign > 0 ? '+' : '−');
      makeHoldButton(button, () => press(index, sign), (why) => hold.end(why));
      return button;
    };
    const buttons = [makeButton(-1), makeButton(1)];
    const axisPart = h('div', { class: 'axis' }, name, value);
    return { name, value, buttons, element: h('div', { class: 'jog-row' }, buttons[0], axisPart, buttons[1]) };
  });

  /**
   * @param {number} index
   * @param {number} sign
   * @returns {boolean}
   */
  function press(index, sign) {
    if (!app.mayDo('jog')) return false;
    const { trip } = store.welcome?.jog ?? {};
    if (connection.isSlower(trip)) {
      toast('jog.slow', 'bad');
      setText(said, 'jog.slow.by', { ms: fixed(1000 * connection.roundTrip(), 0), most: fixed(1000 * trip, 0) });
      said.classList.add('bad');
      return false;
    }
    if (!store.isFresh()) {
      toast('jog.stale', 'bad');
      return false;
    }
    const v = [0, 0, 0, 0, 0, 0];
    v[index] = sign;
    const [metres, radians] = STEPS[step];
    const way = space !== 'joint' && index < 3 ? metres : radians;
    const held = hold.begin({ arm: store.chosen, space, v, step: step === 'hold' ? null : way });
    axis = AXES[space][index] + (sign > 0 ? '+' : '−');
    stands = '';
    if (held) sayHeld();
    return held;
  }

  const spaces = makeChoice('jog.space', ['joint', 'base', 'tool'], 'jog.space', (name) => {
    hold.end('released');
    space = /** @type {any} */ (name);
    nameRows();
    draw();
  });
  const steps = makeChoice('jog.step', Object.keys(STEPS), 'jog.step', (name) => {
    hold.end('released');
    step = name;
  });

  const speed = /** @type {HTMLInputElement} */ (h('input', { type: 'range', min: 1, max: 100, step: 1, id: 'jog-speed',
    class: 'needs-control' }));
  const speedText = h('output', { for: 'jog-speed' });
  /** Share of the jog speed that holds, as it was told last. */
  let fraction = store.jogFraction;
  speed.addEventListener('input', () => {
    hold.end('released');  // nothing becomes faster under a finger that holds it
    replaceText(speedText, `${speed.value} %`);
  });
  speed.addEventListener('change', async () => {
    await app.command('jog_speed', { fraction: Number(speed.value) / 100 }, { arm: null, quiet: true });
    showSpeed();
  });

  function showSpeed() {
    if (store.jogFraction !== fraction) hold.end('released');
    fraction = store.jogFraction;
    speed.max = String(Math.round(100 * (store.welcome?.jog?.max_fraction ?? 1)));
    speed.value = String(Math.round(100 * store.jogFraction));
    replaceText(speedText, `${speed.value} %`);
  }

  function nameRows() {
    rows.forEach((row, index) => {
      replaceText(row.name, AXES[space][index]);
      row.buttons.forEach((button, side) => {
        setAttribute(button, 'aria-label', `${AXES[space][index]} ${side ? '+' : '−'}`);
      });
    });
  }

  function draw() {
    const state = store.record().state;
    rows.forEach((row, index) => replaceText(row.value, axisValue(state, space, index)));
    if (hold.isHeld) sayHeld();
  }

  root.append(
    h('div', { class: 'jog-choices' }, spaces.element, steps.element,
      h('div', { class: 'field wide' }, h('label', { for: 'jog-speed', t: 'jog.speed' }), speed, speedText)),
    h('div', { class: 'jog-rows' }, ...rows.map((row) => row.element)), said,
    h('p', { class: 'hint', t: 'jog.hint' }));
  nameRows();
  showSpeed();
  app.onFrame(draw);
  store.on('jog_speed welcome', showSpeed);
  store.on('chosen', () => hold.end('not seen'));
  store.on('jog', (message) => {
    if (message.state === 'ended') {
      if (hold.isHeld) hold.endedByServer(message.hold, message.why);
      else if (message.hold === hold.number && message.why !== 'released') sayEnd(message.why);
    }
  });
  store.on('motion', (message) => {
    if (message.id !== 'jog' || message.arm !== store.chosen || message.state !== 'stopped' || !hold.isHeld) return;
    stands = message.reason;
    sayHeld();
  });
  /** The reason why there is no jog now, as it is said. */
  let against = '';
  store.on('line', (line) => {
    if (hold.isHeld) return;
    const before = against;
    against = line.may.jog ?? '';
    if (against) setText(said, against);
    else if (before && said.getAttribute('data-t') === before) setText(said, 'jog.idle');
  });
  endWhenUnseen((why) => hold.end(why));
}

/**
 * Calls back when the page can no longer be seen or has not the focus any more, before anything else can happen.
 *
 * @param {(why: string) => void} end
 */
function endWhenUnseen(end) {
  window.addEventListener('blur', () => end('not seen'));
  document.addEventListener('visibilitychange', () => {
    if (document.visibilityState !== 'visible') end('not seen');
  });
  for (const kind of ['pagehide', 'beforeunload']) window.addEventListener(kind, () => end('not seen'));
  document.addEventListener('freeze', () => end('not seen'));
}

/**
 * @param {import('../link/messages.js').ArmState|null} state
 * @param {string} space
 * @param {number} index
 * @returns {string} The value beside an axis of the jog.
 */
function axisValue(state, space, index) {
  if (space === 'joint') return state?.q ? `${fixed(state.q[index] * DEGREES, 2)}°` : '–';
  if (!state?.tool || space === 'tool') return '';
  return index < 3 ? `${fixed(state.tool.p[index] * 1000, 1)} mm` : '';
}
