import assert from 'node:assert/strict';
import { test } from 'node:test';
import { changes, grouped, marksOf, SHAPES } from '../../../../tools/jaka_panel/web/js/plots/marks.js';

const call = (/** @type {Record<string, any>} */ changed) => (
  { n: 1, wall: 1010, name: 'joint_move', caller: '/node', request: '', answer: '', took: 0.5, ok: true, error: '', ...changed });
const alarm = (/** @type {Record<string, any>} */ changed) => (
  { n: 1, wall: 1005, until: null, level: /** @type {any} */ ('error'), code: '0x1', text: 'stop', source: /** @type {any} */ ('controller'), ...changed });
const move = (/** @type {Record<string, any>} */ changed) => ({ n: 1, s: 8, to: 9, owner: 'move', lost: false, ...changed });
const marks = (/** @type {any} */ record, seen = 20) => (
  marksOf({ alarms: [], calls: [], moves: [], ...record }, 1000, seen, (owner) => `<${owner}>`, (wall) => `at ${wall}`));

test('calls that only ask are no marks', () => {
  for (const name of ['get_fk', 'get_io', 'get_settings']) assert.equal(changes(call({ name })), false, name);
  assert.equal(changes(call({ name: 'set_workspace', request: 'yaml: ""' })), false);
  for (const name of ['joint_move', 'set_io', 'stop_move', 'program/play']) assert.equal(changes(call({ name })), true, name);
  assert.equal(changes(call({ name: 'set_workspace', request: 'yaml: "floor: 0"' })), true);
});

test('all stand on the clock of the samples, in the order of time, and notes are left out', () => {
  const found = marks({ alarms: [alarm({}), alarm({ n: 2, level: 'info' })], calls: [call({}), call({ n: 2, wall: 1001, ok: false })], moves: [move({})] });
  assert.deepEqual(found.map(({ kind, at, to }) => [kind, at, to]), [['failed', 1, null], ['error', 5, null], ['move', 8, 9], ['call', 10, null]]);
  assert.deepEqual(found[1].says, ['mark.error', { time: 'at 1005', text: '0x1 stop' }]);
  assert.deepEqual(found[2].says, ['mark.move', { time: 'at 1008', s: '1.0', owner: '<move>' }]);
});

test('a motion that goes on ends where the arm was last seen, not now', () => {
  const [open] = marks({ moves: [move({ to: null })] }, 8.7);
  assert.equal(open.to, 8.7);
  assert.equal(open.says[0], 'mark.move_on');
  assert.equal(marks({ moves: [move({ to: null })] }, -Infinity)[0].to, 8, 'an arm that was not seen since');
  assert.equal(marks({ moves: [move({ lost: true })] })[0].says[0], 'mark.move_lost');
});

test('marks upon each other are one, the gravest in front, and stay together as time goes on', () => {
  const found = marks({ alarms: [alarm({ wall: 1010.4 })], calls: [call({}), call({ n: 2, wall: 1012 })], moves: [move({ to: 30 })] }, 30);
  const names = (/** @type {number} */ from) => grouped(found, from, from + 20, 1).map((group) => group.map(({ id }) => id).join());
  assert.deepEqual(names(5), ['move 1', 'alarm 1,call 1', 'call 2']);
  assert.deepEqual(names(9.3), ['move 1', 'alarm 1,call 1', 'call 2'], 'a motion that began before');
  assert.deepEqual(names(11), ['move 1', 'call 2']);
  assert.deepEqual(names(31), []);
});

test('each kind has a shape of its own', () => {
  assert.equal(new Set(Object.values(SHAPES)).size, 5);
});
