import assert from 'node:assert/strict';
import { test } from 'node:test';
import { pictureOfHistory, Samples, samplesOfHistory } from '../../../../tools/jaka_panel/web/js/plots/samples.js';
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

test('few samples are shown as they are, values that are missing as missing', () => {
  const samples = new Samples();
  samples.add(1, row(1));
  samples.add(1.1, [null, 1, 1, 1, 1, 1]);
  assert.deepEqual(samples.picture(0, 3, 100).slice(0, 2), [[1, 1.1], [1, null]]);
});

/**
 * @param {(number|null)[][]} picture
 * @returns {number[][]} Begin and end of each line of the first joint, s.
 */
function linesOf([times, values]) {
  /** @type {number[][]} */
  const lines = [];
  values.forEach((value, index) => {
    if (value === null) return;
    if (index && values[index - 1] !== null) lines[lines.length - 1][1] = Number(times[index]);
    else lines.push([Number(times[index]), Number(times[index])]);
  });
  return lines;
}

for (const [name, span, pieces] of /** @type {[string, number, number][]} */ ([['each sample', 4, 4000], ['pieces', 4, 40], ['pieces longer than the gap', 40, 20]])) {
  test(`no line is drawn over a gap between samples: ${name}`, () => {
    const samples = new Samples();
    for (let n = 0; n < 500; n += 1) if (n < 150 || n > 200) samples.add(n * 0.008, row(n < 150 ? 1 : 2));
    const lines = linesOf(samples.picture(0, span, pieces));
    assert.equal(lines.length, 2, JSON.stringify(lines));
    assert.ok(lines[0][1] <= 149 * 0.008 + 1e-9 && lines[1][0] >= 201 * 0.008 - 1e-9, JSON.stringify(lines));
  });
}

test('a feed that is slow and not silent is one line, and a sample alone between two gaps is seen', () => {
  const samples = new Samples();
  for (let n = 0; n < 30; n += 1) samples.add(n * 0.25, row(n));
  assert.equal(linesOf(samples.picture(0, 10, 300)).length, 1);
  samples.add(9, row(5));
  samples.add(10, row(5));
  const [, alone] = linesOf(samples.picture(0, 12, 300));
  assert.ok(alone[0] === 9 && alone[1] > 9 && alone[1] < 9.1, JSON.stringify(alone));
});

test('the server’s history becomes the same kind of picture, with its gaps', () => {
  const missing = { s: [0, 1], last: [0.99, 1.5], min: Array(6).fill([1, null]), max: Array(6).fill([2, null]) };
  assert.deepEqual(pictureOfHistory(missing, 0.1, 10).slice(0, 2), [[0, 0.99, 1, 1.5], [10, 20, null, null]]);
  const full = { s: [0, 1, 3], last: [0.99, 1.99, 3.5], min: Array(6).fill([1, 1, 1]), max: Array(6).fill([2, 2, 2]) };
  assert.deepEqual(linesOf(pictureOfHistory(full, 0.1, 1)), [[0, 1.99], [3, 3.5]]);
  const short = { s: [0, 0.2, 1], last: [0.19, 0.39, 1.19], min: Array(6).fill([1, 1, 1]), max: Array(6).fill([2, 2, 2]) };
  const samples = new Samples();
  samples.precede(samplesOfHistory(short, 1));
  assert.deepEqual(linesOf(samples.picture(0, 2, 300)), [[0, 0.39], [1, 1.19]], 'in front of the page’s own samples, too');
});

test('what was before the page came stands in front, and nothing twice', () => {
  const samples = new Samples();
  for (const time of [1, 1.1, 1.2]) samples.add(time, row(time));
  const flat = (/** @type {(number|null)[]} */ times) => [times, ...Array.from({ length: 6 }, () => times)];
  samples.precede(flat([0.7, 0.8, 0.9, 1, 1.1]));
  assert.deepEqual(samples.picture(0, 20, 100)[0], [0.7, 0.8, 0.9, 1, 1.1, 1.2]);
  assert.deepEqual(samples.picture(0, 20, 100)[1], [0.7, 0.8, 0.9, 1, 1.1, 1.2]);
  const none = new Samples();
  none.precede(flat([1, 1.2]));
  assert.equal(none.count, 2);
});

test('marks of the time axis are at round distances from the newest moment', () => {
  const ticks = timeTicks(70.3, 100.3, 5, 100.3);
  assert.deepEqual(ticks.map((tick) => Math.round((tick - 100.3) * 1e6) / 1e6), [-30, -25, -20, -15, -10, -5, 0]);
  assert.deepEqual(timeTicks(71, 76, 5, 100.3).map((tick) => Math.round(tick - 100.3)), [-25]);
  assert.deepEqual(timeTicks(5, 5.1, 1, 5.5), []);
});
