import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Cell } from '../../../../tools/jaka_panel/web/js/cell/cell.js';
import { Points, timedPoints } from '../../../../tools/jaka_panel/web/js/do/points.js';

const Q = [0, 1, 2, 3, 4, 5];

/** @param {string|null} text What it holds. */
function storageWith(text) {
  const kept = new Map(text === null ? [] : [['jaka-panel-points', text]]);
  return /** @type {any} */ ({ kept, getItem: (/** @type {string} */ key) => kept.get(key) ?? null,
    setItem: (/** @type {string} */ key, /** @type {string} */ value) => kept.set(key, value), removeItem: (/** @type {string} */ key) => kept.delete(key) });
}

/** A cell whose server takes every change. */
function cellThatTakes() {
  const cell = new Cell({ write: () => true, onChange() {}, ask: async (_, args) => {
    const { changes } = /** @type {any} */ (args);
    cell.take({ t: 'cell_changed', revision: cell.revision + 1, changes });
    return { ok: true, message: '' };
  } });
  cell.take({ t: 'cell', revision: 0, data: {} });
  return cell;
}

test('points are stored by arm with what is known of them, replaced by name, and removed', async () => {
  const points = new Points(cellThatTakes(), null, (arm) => ({ model: arm }), assert.fail);
  await points.add('/a', '', Q);
  await points.add('/a', ' home ', Q);
  await points.add('/a', 'home', [...Q].reverse());
  await points.add('/b', '', Q);
  assert.deepEqual(points.list('/a').map(({ name }) => name), ['P1', 'home']);
  await points.remove('/a', 'P1');
  assert.deepEqual(points.list('/a'), [{ name: 'home', q: [...Q].reverse(), model: '/a' }]);
  assert.equal(points.list('/b')[0].name, 'P1');
});

test('a change that the server refuses is told and not shown', async () => {
  const cell = new Cell({ write: () => true, onChange() {}, ask: async () => ({ ok: false, message: 'of the server', data: { stale: true } }) });
  cell.take({ t: 'cell', revision: 0, data: {} });
  /** @type {string[]} */
  const told = [];
  const points = new Points(cell, null, () => ({}), (answer) => told.push(answer.message));
  await points.add('/a', 'x', Q);
  assert.deepEqual([points.list('/a'), told], [[], ['cell.stale']]);
});

test('the points that this browser kept are offered until they are taken or declined, and replace none', async () => {
  const storage = storageWith(JSON.stringify({ '/a': [{ name: 'home', q: Q }, { name: 'x', q: [1] }, { name: 5, q: Q }] }));
  const cell = cellThatTakes();
  const points = new Points(cell, storage, () => ({}), assert.fail);
  assert.deepEqual(points.kept(), [{ section: 'points', arm: '/a', name: 'home', entry: { q: Q } }]);
  await points.add('/a', 'home', [0, 0, 0, 0, 0, 0]);
  assert.equal(points.kept()[0].name, 'home 2');
  points.decline();
  assert.deepEqual(points.kept(), []);
  assert.ok(storage.kept.get('jaka-panel-points-declined').includes('home'));
});

test('a storage without space keeps the points where they are', () => {
  const text = JSON.stringify({ '/a': [{ name: 'home', q: Q }] });
  const storage = storageWith(text);
  const put = storage.setItem;
  storage.setItem = (/** @type {string} */ key, /** @type {string} */ value) => {
    if (key !== 'jaka-panel-points') throw new Error('it is full');
    put(key, value);
  };
  new Points(cellThatTakes(), storage, () => ({}), assert.fail).decline();
  assert.deepEqual([...storage.kept], [['jaka-panel-points', text]]);
});

test('what is no point is left out', () => {
  for (const text of ['{', '[]', 'null', '{"a": 5}', '{"a": [{"name": "x", "q": [1]}, null]}']) {
    assert.deepEqual(new Points(cellThatTakes(), storageWith(text), () => ({}), assert.fail).kept(), [], text);
  }
});

test('the fastest joint sets the time of each leg', () => {
  const timed = timedPoints([[0, 0, 0, 0, 0, 0], [1, -2, 0, 0, 0, 0], [1, -2, 0, 0, 0, 0.01]], 0.5);
  assert.deepEqual(timed.map(({ t }) => t), [0, 4, 4.5]);
});
