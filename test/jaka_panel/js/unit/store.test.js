import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Store, withItem } from '../../../../tools/jaka_panel/web/js/link/store.js';
import { readStates } from '../../../../tools/jaka_panel/web/js/state/status.js';

const ARM = { id: '/a', label: 'a', alive: true };
const state = (/** @type {object} */ more) => ({ t: 'state', arm: '/a', n: 1, now: 3, age: 0.01, fresh: true, q: [0, 0, 0, 0, 0, 0], ...more });

test('the first arm that lives is chosen, and kept while it is there', () => {
  const store = new Store();
  store.take({ t: 'arms', arms: [{ ...ARM, id: '/dead', alive: false }, ARM] });
  assert.equal(store.chosen, '/a');
  store.take({ t: 'arms', arms: [{ ...ARM, id: '/b' }, ARM] });
  assert.equal(store.chosen, '/a');
  store.take({ t: 'arms', arms: [{ ...ARM, id: '/b' }] });
  assert.equal(store.chosen, '/b');
});

test('an older state never takes the place of a newer one', () => {
  const store = new Store();
  store.take({ t: 'arms', arms: [ARM] });
  store.take(state({ n: 5, now: 9 }));
  store.take(state({ n: 4, now: 8 }));
  assert.equal(store.record().state?.now, 9);
});

test('a state is fresh by the word of the server and by its age here', () => {
  const store = new Store();
  store.take({ t: 'arms', arms: [ARM] });
  assert.equal(store.isFresh(), false);
  store.take(state({}));
  assert.equal(store.isFresh(), true);
  store.record().stateAt -= 400;
  assert.equal(store.isFresh(), false);
  assert.ok(store.age() > 0.4);
  store.take(state({ n: 2, fresh: false }));
  assert.equal(store.isFresh(), false);
  store.take(state({ n: 3, age: null }));
  assert.equal(store.isFresh(), false);
});

test('a new greeting forgets what was known before', () => {
  const store = new Store();
  store.take({ t: 'arms', arms: [ARM] });
  store.take(state({ n: 500 }));
  store.drawn = 3;
  store.take({ t: 'welcome', may: 'command', jog: { fraction: 0.1 }, control: { holder: null, you: false, asked: null }, arms: [ARM] });
  assert.equal(store.record().state, null);
  assert.equal(store.drawn, null);
  store.take(state({ n: 1 }));
  assert.equal(store.record().state?.n, 1);
});

test('control is had with the server’s leave alone', () => {
  const store = new Store();
  store.take({ t: 'welcome', may: 'watch', control: { holder: null, you: true, asked: null }, arms: [] });
  assert.equal(store.hasControl(), false);
});

test('lists keep their order, change in place, and do not grow for ever', () => {
  const list = [{ n: 1, a: 1 }, { n: 2, a: 1 }];
  assert.deepEqual(withItem(list, { n: 1, a: 2 }, 5), [{ n: 1, a: 2 }, { n: 2, a: 1 }]);
  assert.deepEqual(withItem(list, { n: 3, a: 1 }, 2).map(({ n }) => n), [2, 3]);
});

test('what is not known is said to be unknown, never off', () => {
  for (const [name, [word, mark]] of Object.entries(readStates(null))) {
    assert.equal(word, 'state.unknown', name);
    assert.equal(mark, '');
  }
  const states = readStates(/** @type {any} */ ({ robot: { motion: 2, power: 1, servo: 0, collision: 1 }, enabled: false, speed: 0.5,
    status: { e_stopped: true }, owner: 'a jog' }));
  assert.deepEqual(states.motion, ['motion.emergency', 'bad']);
  assert.deepEqual(states.power, ['state.on', 'ok']);
  assert.deepEqual(states.collision, ['state.collision', 'bad']);
  assert.deepEqual(states.emergency, ['state.pressed', 'bad']);
  assert.deepEqual(states.owner, ['owner.jog', '']);
  assert.deepEqual(states.speed, ['50 %', '']);
});

test('an age has the way of the link in it, and a slow link is told from states that do not come', () => {
  const store = new Store();
  store.take({ t: 'arms', arms: [ARM] });
  store.take(state({}));
  store.takeWay(0.4);
  assert.ok(store.age() > 0.4);
  assert.deepEqual([store.isFresh(), store.isSlow()], [false, true]);
  store.record().stateAt -= 400;
  assert.deepEqual([store.isFresh(), store.isSlow()], [false, false]);
});

test('rest and motion are what fresh states show', () => {
  const store = new Store();
  store.take({ t: 'arms', arms: [ARM] });
  const still = [0, 0, 0, 0, 0, 0];
  const moving = [0, 0, 0, 0, -0.1, 0];
  let n = 0;
  for (const [more, rests, moves] of /** @type {[object, boolean, boolean][]} */ ([
    [{ dq: still }, true, false], [{ dq: moving }, false, true], [{ dq: null }, false, false],
    [{ dq: still, status: { in_motion: true } }, false, true], [{ dq: still, status: { in_motion: null } }, true, false],
    [{ dq: moving, status: { in_motion: false } }, false, true], [{ dq: still, fresh: false }, false, false],
  ])) {
    n += 1;
    store.take(state({ n, ...more }));
    assert.deepEqual([store.rests(), store.moves()], [rests, moves], JSON.stringify(more));
  }
  store.take(state({ n: 50, dq: still }));
  store.record().stateAt -= 400;
  assert.equal(store.rests(), false);
});

/**
 * A store on a link whose way from the server takes ever so long, for states and pongs, by a clock of the test's own.
 *
 * @param {(sent: number) => number} way Of what the server sends at that time, s.
 * @param {(sent: number) => number} there The way of the ping that it answers then, s.
 * @param {number} seconds
 * @param {(store: Store, true_age: number, at: number) => void} look After each state.
 */
function overLink(way, there, seconds, look) {
  const { now } = performance;
  let at = 0;
  performance.now = () => 1000 * at;
  try {
    const store = new Store();
    store.take({ t: 'welcome', arms: [ARM], now: 500 });
    /** Arrivals: [when, sent, whether it is a pong]. @type {[number, number, boolean][]} */
    const arrivals = [];
    for (let sent = 0; sent < seconds; sent += 0.04) arrivals.push([sent + way(sent), sent, false]);
    for (let sent = 0; sent < seconds; sent += 0.5) arrivals.push([sent + way(sent), sent, true]);
    arrivals.sort(([one], [other]) => one - other);
    let trips = /** @type {number[]} */ ([]);
    let n = 0;
    for (const [when, sent, isPong] of arrivals) {
      at = when;
      if (isPong) {
        trips = [...trips, there(sent) + way(sent)].slice(-8);
        store.takeWay(Math.min(...trips) / 2);
      } else {
        n += 1;
        store.take(state({ n, now: 500 + sent, dq: [0, 0, 0, 0, 0, 0] }));
        look(store, at - sent + 0.01, at);
      }
    }
  } finally {
    performance.now = now;
  }
}

test('what a growing queue on the link holds back is not fresh', () => {
  let seen = 0;
  overLink((sent) => 0.02 + 0.25 * Math.max(0, sent - 2), () => 0.02, 12, (store, age) => {
    assert.ok(store.age() > age - 0.05 && store.age() < age + 0.05, `${store.age()} of ${age}`);
    if (age < 0.35) return;
    seen += 1;
    assert.deepEqual([store.isFresh(), store.rests()], [false, false], String(age));
  });
  assert.ok(seen > 100);
});

test('a link that has become slow is slow, not silent, once its round trips show it', () => {
  let seen = 0;
  const way = (/** @type {number} */ sent) => (sent < 5 ? 0.02 : 0.8);
  overLink(way, way, 30, (store, age, at) => {
    assert.equal(store.isFresh(), age < 0.3, String(age));
    if (at < 12) return;
    seen += 1;
    assert.deepEqual([store.isSlow(), store.rests()], [true, true]);
    assert.ok(store.age() > 0.7 && store.age() < 0.9, 'nothing counts twice');
  });
  assert.ok(seen > 100);
});

test('a quick link stays fresh for hours, with clocks that part and a page that slept', () => {
  const drift = 1 + 1e-4;
  overLink((sent) => 0.02 + (drift - 1) * sent, () => 0.02, 600, (store) => assert.ok(store.isFresh()));
  const store = new Store();
  const { now } = performance;
  try {
    let at = 100;
    performance.now = () => 1000 * at;
    store.take({ t: 'welcome', arms: [ARM], now: 7 });
    store.take(state({ n: 1, now: 7 }));
    at = 200;  // the browser was held for 100 s, and hears what has waited for it
    store.take(state({ n: 2, now: 7.1 }));
    assert.equal(store.isFresh(), false);
    store.take(state({ n: 3, now: 107 }));
    assert.equal(store.isFresh(), true);
    at = 201;  // the computer slept for an hour, in which its clock of the page stood
    store.take(state({ n: 4, now: 3708 }));
    assert.equal(store.isFresh(), true);
  } finally {
    performance.now = now;
  }
});

test('a new greeting begins anew with what is quick', () => {
  const store = new Store();
  store.take({ t: 'welcome', arms: [ARM], now: 7000 });
  store.take(state({ n: 1, now: 7000 }));
  store.take({ t: 'welcome', arms: [ARM], now: 5 });
  store.take(state({ n: 1, now: 5 }));
  assert.equal(store.isFresh(), true);
});
