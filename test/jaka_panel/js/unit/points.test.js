import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Points, timedPoints } from '../../../../tools/jaka_panel/web/js/do/points.js';

const Q = [0, 1, 2, 3, 4, 5];

/** @param {string|null} text What it holds. */
function storageWith(text) {
  const storage = { text, getItem: () => storage.text, setItem: (/** @type {string} */ _, /** @type {string} */ value) => { storage.text = value; } };
  return /** @type {any} */ (storage);
}

test('points are stored by arm, replaced by name, removed, and found again', () => {
  const storage = storageWith(null);
  const points = new Points(storage);
  assert.equal(points.add('/a', '', Q).name, 'P1');
  points.add('/a', 'home', Q);
  points.add('/a', 'home', [...Q].reverse());
  points.add('/b', 'home', Q);
  points.remove('/a', 'P1');
  const again = new Points(storage);
  assert.deepEqual(again.list('/a'), [{ name: 'home', q: [...Q].reverse() }]);
  assert.equal(again.list('/b').length, 1);
});

test('what is no point is left out', () => {
  for (const text of ['{', '[]', 'null', '{"a": 5}', '{"a": [{"name": "x", "q": [1]}, {"name": 5, "q": [0,0,0,0,0,0]}]}']) {
    assert.deepEqual(new Points(storageWith(text)).list('a'), [], text);
  }
});

test('the fastest joint sets the time of each leg', () => {
  const timed = timedPoints([[0, 0, 0, 0, 0, 0], [1, -2, 0, 0, 0, 0], [1, -2, 0, 0, 0, 0.01]], 0.5);
  assert.deepEqual(timed.map(({ t }) => t), [0, 4, 4.5]);
});
