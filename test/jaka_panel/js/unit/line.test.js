import assert from 'node:assert/strict';
import { test } from 'node:test';
import { en } from '../../../../tools/jaka_panel/web/i18n/en.js';
import { factsOf } from '../../../../tools/jaka_panel/web/js/control/offers.js';
import { Store } from '../../../../tools/jaka_panel/web/js/link/store.js';
import { BUTTONS, CONDITION_NAMES, lineOf, reasonAgainst } from '../../../../tools/jaka_panel/web/js/state/line.js';

/** @typedef {import('../../../../tools/jaka_panel/web/js/state/line.js').Facts} Facts */

/** @type {Facts} An arm that can move, and a page that has control. */
const READY = { link: 'open', may: 'command', control: 'you', arm: 'alive', isFresh: true, isSlow: false, age: 0.01, isControllerLost: false,
  stopped: false, collided: false, faulted: false, powered: true, enabled: true, guided: false, isPaused: false, moves: false, owner: '',
  program: 'idle', speed: 1, canRecover: true, offer: null };
const OLD = { isFresh: false, age: 2 };
const DRIVES = ['power_on', 'enable', 'jog', 'move', 'run', 'guiding_on', 'program_play', 'program_resume'];
const SIDE = ['take', 'command'];
const PROGRAM = ['program_pause', 'program_resume'];
const IDLE = ['pause', 'resume', ...PROGRAM];
const ALL = Object.keys(BUTTONS).filter((name) => !SIDE.includes(name));

/**
 * Each condition: what makes it, which button stands out, and all buttons that must not be offered.
 *
 * @type {[string, Partial<Facts>, string|null, string[]][]}
 */
const TABLE = [
  ['connecting', { link: 'connecting', ...OLD }, null, [...ALL, ...SIDE]],
  ['cut', { link: 'silent', ...OLD }, null, [...ALL, ...SIDE]],
  ['cut', { link: 'lost', ...OLD }, null, [...ALL, ...SIDE]],
  ['no_arm', { arm: 'none', ...OLD }, null, ALL],
  ['dead', { arm: 'dead', ...OLD }, null, ALL],
  ['no_controller', { isControllerLost: true, ...OLD }, null, ALL],
  ['slow', { isFresh: false, isSlow: true, age: 0.5 }, null, IDLE],
  ['never', { isFresh: false, age: Infinity }, null, ALL.filter((name) => name !== 'guiding_off')],
  ['old', OLD, null, ALL.filter((name) => name !== 'guiding_off')],
  ['stopped', { stopped: true }, null, [...DRIVES, ...IDLE, 'recover', 'clear_err']],
  ['stopped', { stopped: true, powered: false, enabled: false, faulted: true }, null, [...DRIVES, ...IDLE, 'recover', 'clear_err']],
  ['guided', { guided: true }, null, ['recover', 'jog', 'move', 'run', 'sensitivity', 'guiding_on', 'program_play', ...IDLE]],
  ['collided', { collided: true }, 'recover', [...DRIVES, ...IDLE]],
  ['collided', { collided: true, canRecover: false }, 'clear_err', [...DRIVES, ...IDLE]],
  ['faulted', { faulted: true, enabled: false }, 'recover', ['jog', 'move', 'run', 'guiding_on', 'program_play', ...IDLE]],
  ['unpowered', { powered: false, enabled: false }, 'power_on', [...DRIVES.filter((name) => name !== 'power_on'), ...IDLE]],
  ['disabled', { enabled: false }, 'enable', ['jog', 'move', 'run', 'guiding_on', 'program_play', ...IDLE]],
  ['unknown', { enabled: null }, null, IDLE],
  ['paused', { isPaused: true }, 'resume', PROGRAM],
  ['program_paused', { isPaused: true, program: 'paused', owner: 'a program' }, 'program_resume', ['program_pause']],
  ['moving', { moves: true, owner: 'a move' }, null, ['setting', 'guiding_on', 'zero_force', ...PROGRAM]],
  ['moving', { moves: true, owner: 'a program', program: 'running' }, null,
    ['jog', 'move', 'run', 'setting', 'guiding_on', 'zero_force', 'program_load', 'program_play', 'program_resume']],
  ['held', { owner: 'servo mode' }, null, PROGRAM],
  ['no_speed', { speed: 0 }, null, IDLE],
  ['ready', {}, null, IDLE],
  ['ready', { offer: 'move' }, 'move', IDLE],
  ['ready', { offer: 'run' }, 'run', IDLE],
];

test('in each condition the line says so, one button at most stands out, and nothing is offered that will be refused', () => {
  assert.deepEqual([...new Set(TABLE.map(([name]) => name))], CONDITION_NAMES);
  for (const [name, changed, button, refused] of TABLE) {
    const line = lineOf({ ...READY, ...changed });
    const context = `${name} ${JSON.stringify(changed)}`;
    assert.equal(line.name, name, context);
    assert.equal(line.button, button, context);
    assert.deepEqual(Object.keys(line.may).filter((one) => line.may[one]).sort(), [...new Set(refused)].sort(), context);
    for (const reason of Object.values(line.may)) assert.ok(reason === null || en[reason], `${context} ${reason}`);
    assert.ok(en[`line.can.${line.can}`] && (en[`line.why.${name}`] || name === 'ready'), context);
    assert.ok(!line.button || en[line.next], `${context} ${line.next}`);
  }
});

test('what stands out may be pressed, in every state that these facts can make', () => {
  const yes = [true, false, null];
  let count = 0;
  for (const control of /** @type {const} */ (['you', 'other', 'free'])) {
    for (const may of /** @type {const} */ (['command', 'watch', null])) {
      for (const [, changed] of TABLE) {
        for (const stopped of yes) {
          for (const powered of yes) {
            for (const enabled of yes) {
              const facts = { ...READY, stopped, powered, enabled, ...changed, may, control: may === 'command' ? control : 'free' };
              const line = lineOf(/** @type {Facts} */ (facts));
              assert.ok(line.button === null || line.may[line.button] === null, JSON.stringify(facts));
              count += 1;
            }
          }
        }
      }
    }
  }
  assert.ok(count > 5000);
});

test('without control, what stands out is how to get it; without the token nothing is', () => {
  const collided = { ...READY, collided: true };
  assert.deepEqual([lineOf({ ...collided, control: 'free' }).button, lineOf({ ...collided, control: 'free' }).next], ['take', 'line.next.take']);
  assert.equal(lineOf({ ...collided, control: 'other' }).next, 'line.next.ask');
  assert.equal(lineOf({ ...collided, control: 'free', may: 'watch' }).button, null);
  assert.equal(reasonAgainst({ ...READY, may: 'watch', control: 'free' }, 'jog'), 'control.may_not');
  assert.equal(reasonAgainst({ ...READY, control: 'other' }, 'jog'), 'control.ask_first');
  assert.equal(reasonAgainst({ ...READY, arm: 'dead', control: 'free' }, 'enable'), 'control.take_first');
});

test('facts are what a fresh state says; an old part of it is not known', () => {
  const store = new Store();
  const app = /** @type {any} */ ({ store, connection: { state: 'open' }, offer: null });
  assert.deepEqual([factsOf(app).arm, factsOf(app).stopped, factsOf(app).age], ['none', null, Infinity]);
  store.take({ t: 'welcome', may: 'command', arms: [{ id: '/a', alive: true }], control: { holder: { page: 'p1' }, you: false, asked: null } });
  const say = (/** @type {object} */ more) => store.take({ t: 'state', arm: '/a', n: (store.record().state?.n ?? 0) + 1, now: 1, age: 0.01,
    fresh: true, q: [], dq: [0], enabled: true, owner: 'nobody', robot: { motion: 0, power: 1, servo: 0, collision: 0, age: 0.01 },
    status: { e_stopped: false, in_error: false, age: 0.01 }, ...more });
  say({});
  assert.deepEqual([factsOf(app).stopped, factsOf(app).powered, factsOf(app).control], [false, true, 'other']);
  say({ status: null, robot: { motion: 2, power: 0, servo: 0, collision: 1, age: 0.01 } });
  assert.deepEqual([factsOf(app).stopped, factsOf(app).powered, factsOf(app).collided], [true, false, true]);
  say({ robot: { motion: 0, power: 1, servo: 0, collision: 0, age: 3 } });
  assert.deepEqual([factsOf(app).stopped, factsOf(app).powered, factsOf(app).collided], [false, null, null]);
  store.take({ t: 'diag', arm: '/a', status: [{ name: 'controller link', level: 2, message: 'down: [Errno 111]', values: [] }] });
  assert.equal(factsOf(app).isControllerLost, false, 'a state is newer than what is said once a second');
  say({ fresh: false, age: 2 });
  assert.equal(lineOf(factsOf(app)).name, 'no_controller');
});
