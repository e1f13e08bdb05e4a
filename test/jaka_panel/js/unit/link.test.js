import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Connection } from '../../../../tools/jaka_panel/web/js/link/connection.js';
import { takeToken } from '../../../../tools/jaka_panel/web/js/link/token.js';

/** The storage that a browser keeps for a page. */
function makeStorage() {
  const kept = new Map();
  return /** @type {any} */ ({ getItem: (/** @type {string} */ key) => kept.get(key) ?? null,
    setItem: (/** @type {string} */ key, /** @type {string} */ value) => kept.set(key, value) });
}

test('the token leaves the address, and stays with the tab', () => {
  const storage = makeStorage();
  const addresses = /** @type {string[]} */ ([]);
  const history = { replaceState: (/** @type {any} */ _, /** @type {string} */ __, /** @type {string} */ url) => addresses.push(url) };
  assert.equal(takeToken({ hash: '#token=abc', pathname: '/', search: '' }, history, storage), 'abc');
  assert.deepEqual(addresses, ['/']);
  assert.equal(takeToken({ hash: '', pathname: '/', search: '' }, history, storage), 'abc');
  assert.equal(takeToken({ hash: '', pathname: '/', search: '' }, history, null), null);
});

/** A connection on a socket of the test's own. */
function makeConnection() {
  const sockets = /** @type {any[]} */ ([]);
  const states = /** @type {string[]} */ ([]);
  const connection = new Connection({ url: 'ws://x', token: 'abc', name: 'test', onMessage: () => {}, onState: (state) => states.push(state),
    open: (_, protocols) => {
      const socket = { protocols, readyState: 1, bufferedAmount: 0, sent: /** @type {any[]} */ ([]), send: (/** @type {string} */ text) => socket.sent.push(JSON.parse(text)),
        close: () => {}, onopen: () => {}, onmessage: (/** @type {any} */ _) => {}, onclose: (/** @type {any} */ _) => {} };
      sockets.push(socket);
      return /** @type {any} */ (socket);
    } });
  connection.connect();
  sockets[0].onopen();
  const say = (/** @type {any} */ message) => sockets[sockets.length - 1].onmessage({ data: typeof message === 'string' ? message : JSON.stringify(message) });
  return { connection, sockets, states, say };
}

test('the first word is hello with the token, an answer finds its request', async () => {
  const { connection, sockets, states, say } = makeConnection();
  assert.deepEqual(sockets[0].protocols, ['jaka-panel.v1', 'token.abc']);
  assert.deepEqual(sockets[0].sent[0], { t: 'hello', v: 1, token: 'abc', name: 'test', resume: null });
  say({ t: 'welcome', now: 1 });
  assert.deepEqual(states, ['open']);
  const asked = connection.request({ t: 'cmd', cmd: 'power' });
  say({ t: 'answer', id: 99, ok: false });
  say({ t: 'answer', id: 1, ok: true, message: 'on' });
  assert.deepEqual(await asked, { t: 'answer', id: 1, ok: true, message: 'on' });
});

test('what is no message changes nothing', () => {
  const { connection, say } = makeConnection();
  for (const text of ['', '{', 'null', '7', '[]', '{"t":5}']) say(text);
  assert.equal(connection.state, 'connecting');
});

test('requests end with the connection, and are not sent again', async () => {
  const { connection, sockets, states, say } = makeConnection();
  say({ t: 'welcome', now: 1 });
  const asked = connection.request({ t: 'cmd', cmd: 'joint_move' });
  connection.ended = true;
  sockets[0].onclose({ code: 1006 });
  assert.deepEqual(await asked, { ok: false, message: 'link.gone' });
  assert.deepEqual(await connection.request({ t: 'cmd', cmd: 'joint_move' }), { ok: false, message: 'link.gone' });
  assert.deepEqual(states, ['open', 'lost']);
  assert.equal(sockets.length, 1);
});

test('silence is noticed, and words end it', () => {
  const { connection, states, say } = makeConnection();
  say({ t: 'welcome', now: 1 });
  connection.heardAt -= 1300;
  connection.tick();
  say({ t: 'pong', now: 2, clock: performance.now() });
  assert.deepEqual(states, ['open', 'silent', 'open']);
});

test('a connection that is slow to come has ten seconds, one that falls silent six', () => {
  const { connection, sockets, states, say } = makeConnection();
  connection.ended = true;
  connection.triedAt -= 9000;
  connection.tick();
  assert.deepEqual([connection.socket === sockets[0], states], [true, []]);
  say({ t: 'welcome', now: 1 });
  connection.heardAt -= 5500;
  connection.tick();
  assert.deepEqual([connection.socket === sockets[0], states], [true, ['open', 'silent']]);
  connection.heardAt -= 1000;
  connection.tick();
  assert.deepEqual([connection.socket, states], [null, ['open', 'silent', 'lost']]);
});

test('a connection that never comes is given up', () => {
  const { connection, states } = makeConnection();
  connection.ended = true;
  connection.triedAt -= 10100;
  connection.tick();
  assert.deepEqual([connection.socket, states], [null, ['lost']]);
});

test('pauses grow until a connection has lived for a while', (context) => {
  context.mock.timers.enable({ apis: ['setTimeout'] });
  const { connection, sockets, say } = makeConnection();
  const pauses = [];
  for (let loss = 0; loss < 7; loss += 1) {
    const count = sockets.length;
    if (loss === 5) connection.welcomedAt -= 6000;
    sockets[count - 1].onclose({ code: 1006 });
    let pause = 0;
    while (sockets.length === count) {
      context.mock.timers.tick(100);
      pause += 100;
    }
    pauses.push(pause);
    say({ t: 'welcome', now: 1 });
  }
  assert.deepEqual(pauses, [300, 600, 1200, 2400, 4800, 300, 600]);
});

test('the quickest of the newest round trips counts', () => {
  const { connection, say } = makeConnection();
  assert.equal(connection.roundTrip(), 0);
  const slow = [500, 200, 400].map((trip) => {
    say({ t: 'pong', now: 1, clock: performance.now() - trip });
    return connection.isSlower(0.15);
  });
  assert.ok(Math.abs(connection.roundTrip() - 0.2) < 0.05);
  assert.deepEqual(slow, [false, false, true], 'one that took long while the page began is no slow link');
});
