import assert from 'node:assert/strict';
import { test } from 'node:test';
import { FROZEN_MS, Hold, PERIOD_MS } from '../../../../tools/jaka_panel/web/js/jog/hold.js';

const MOTION = { arm: '/arm', space: /** @type {'joint'} */ ('joint'), v: [1, 0, 0, 0, 0, 0], step: null };

/** A page whose clock, focus and connection the test moves. */
function makePage() {
  const page = {
    time: 1000, attended: true, waiting: 0, state: /** @type {number|null} */ (5), connected: true,
    sent: /** @type {any[]} */ ([]), ends: /** @type {string[]} */ ([]), timers: /** @type {Set<() => void>} */ (new Set()),
    tick(ms = PERIOD_MS) {
      page.time += ms;
      for (const call of [...page.timers]) call();
    },
  };
  const hold = new Hold({
    send: (message) => page.connected && page.sent.push(message) > 0,
    now: () => page.time, isAttended: () => page.attended, backlog: () => page.waiting, drawn: () => page.state,
    setTimer: (call) => { page.timers.add(call); return call; }, clearTimer: (timer) => page.timers.delete(timer),
    onEnd: (why) => page.ends.push(why),
  });
  return { page, hold, beats: () => page.sent.filter((message) => message.t === 'jog') };
}

test('the first heartbeat goes at once, the others by the timer, with rising numbers and the newest state drawn', () => {
  const { page, hold, beats } = makePage();
  assert.equal(hold.begin(MOTION), true);
  page.tick();
  page.state = 5.1;
  page.tick();
  assert.deepEqual(beats().map(({ seq, echo, hold: number, clock }) => [seq, echo, number, clock]),
    [[1, 5, 1, 1000], [2, 5, 1, 1050], [3, 5.1, 1, 1100]]);
});

test('letting go says so once and then nothing', () => {
  const { page, hold, beats } = makePage();
  hold.begin(MOTION);
  hold.end('released');
  hold.end('released');
  page.tick();
  assert.equal(beats().length, 1);
  assert.deepEqual(page.sent.filter((message) => message.t === 'jog_stop'), [{ t: 'jog_stop', hold: 1 }]);
  assert.equal(page.timers.size, 0);
});

for (const [why, spoil] of /** @type {[string, (page: any) => void][]} */ ([
  ['not seen', (page) => { page.attended = false; }],
  ['no state', (page) => { page.state = null; }],
  ['link', (page) => { page.connected = false; }],
  ['frozen', (page) => { page.time += FROZEN_MS; }],
])) {
  test(`a page that is ${why} sends no more heartbeats, and none when it is well again`, () => {
    const { page, hold, beats } = makePage();
    hold.begin(MOTION);
    page.tick();
    const before = beats().length;
    spoil(page);
    page.tick();
    Object.assign(page, { attended: true, state: 6, connected: true });
    page.tick();
    page.tick();
    assert.equal(beats().length, before);
    assert.deepEqual(page.ends, [why]);
    assert.equal(hold.isHeld, false);
  });
}

test('heartbeats that stay in the browser end it', () => {
  const { page, hold } = makePage();
  hold.begin(MOTION);
  page.waiting = 100;
  for (let n = 0; n < 4; n += 1) page.tick();
  assert.deepEqual(page.ends, ['link']);
});

test('a second button ends the first and holds nothing', () => {
  const { page, hold } = makePage();
  hold.begin(MOTION);
  assert.equal(hold.begin(MOTION), false);
  assert.equal(hold.isHeld, false);
  assert.deepEqual(page.ends, ['two buttons']);
});

test('an end that the server tells counts for the hold that it names', () => {
  const { page, hold } = makePage();
  hold.begin(MOTION);
  hold.endedByServer(7, 'missed');
  assert.equal(hold.isHeld, true);
  hold.endedByServer(1, 'missed');
  assert.deepEqual(page.ends, ['missed']);
  hold.begin(MOTION);
  assert.equal(hold.number, 2);
});

test('a page that nobody looks at does not begin', () => {
  const { page, hold, beats } = makePage();
  page.attended = false;
  assert.equal(hold.begin(MOTION), false);
  assert.equal(beats().length, 0);
});
