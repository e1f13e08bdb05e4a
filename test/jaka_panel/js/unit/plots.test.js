import assert from 'node:assert/strict';
import { test } from 'node:test';
import { pictureOfHistory, Samples } from '../../../../tools/jaka_panel/web/js/plots/samples.js';
import { timeTicks } from '../../../../tools/jaka_panel/web/js/plots/ticks.js';

const row = (/** @type {number} */ value) => [value, 0, 0, 0, 0, 0];

test('samples rise in time, and the oldest go first', () => {
  const samples = new Samples(4);
  for (const time of [1, 2, 2, 1.5, 3, 4, 5]) samples.add(time, row(time));
  assert.equal(samples.count, 4);
  assert.deepEqual([0, 1, 2, 3].map((index) => samples.timeAt(index)), [2, 3, 4, 5]);
  assert.equal(samples.indexOf(3.5), 2);
});

test('no peak is lost in a picture of few pieces', () => {
  const samples = new Samples();
  for (let n = 0; n < 10000; n += 1) samples.add(n * 0.008, row(n === 7777 ? 9 : (n === 1234 ? -8 : Math.sin(n))));
  const [times, values] = samples.picture(0, 80, 100);
  assert.ok(times.length < 500);
  assert.equal(Math.max(.../** @type {number[]} */ (values)), 9);
  assert.equal(Math.min(.../** @type {number[]} */ (values)), -8);
  assert.ok(times.every((time, index) => index === 0 || Number(time) >= Number(times[index - 1])));
});

test('few samples are shown as they are, gaps as gaps', () => {
  const samples = new Samples();
  samples.add(1, row(1));
  samples.add(2, [null, 1, 1, 1, 1, 1]);
  assert.deepEqual(samples.picture(0, 3, 100).slice(0, 2), [[1, 2], [1, null]]);
});

test('the server’s history becomes the same kind of picture', () => {
  const rows = pictureOfHistory({ s: [0, 1], min: [[1, null]], max: [[2, null]] }, 10);
  assert.deepEqual(rows[0], [0, 0.5, 1, 1.5]);
  assert.deepEqual(rows[1], [10, 20, null, null]);
});

test('what was before the page came stands in front, and nothing twice', () => {
  const samples = new Samples();
  for (const time of [10, 11, 12]) samples.add(time, row(time));
  const flat = (/** @type {(number|null)[]} */ times) => [times, ...Array.from({ length: 6 }, () => times)];
  samples.precede(flat([7, 8, 9, 10, 11]));
  assert.deepEqual(samples.picture(0, 20, 100)[0], [7, 8, 9, 10, 11, 12]);
  assert.deepEqual(samples.picture(0, 20, 100)[1], [7, 8, 9, 10, 11, 12]);
  const none = new Samples();
  none.precede(flat([1, 2]));
  assert.equal(none.count, 2);
});

test('marks of the time axis are at round distances from the newest moment', () => {
  const ticks = timeTicks(70.3, 100.3, 5, 100.3);
  assert.deepEqual(ticks.map((tick) => Math.round((tick - 100.3) * 1e6) / 1e6), [-30, -25, -20, -15, -10, -5, 0]);
  assert.deepEqual(timeTicks(71, 76, 5, 100.3).map((tick) => Math.round(tick - 100.3)), [-25]);
  assert.deepEqual(timeTicks(5, 5.1, 1, 5.5), []);
});
