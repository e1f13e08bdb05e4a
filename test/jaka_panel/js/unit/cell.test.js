import assert from 'node:assert/strict';
import { test } from 'node:test';
import { layoutOf } from '../../../../tools/jaka_panel/web/js/cell/names.js';
import { moved, wordsOf } from '../../../../tools/jaka_panel/web/js/cell/lists.js';
import { Cell, partsOf, withChanges } from '../../../../tools/jaka_panel/web/js/cell/cell.js';
import { translate } from '../../../../tools/jaka_panel/web/js/ui/i18n.js';

const change = (/** @type {string} */ name, /** @type {any} */ entry = { label: name }) => ({ section: 'io', arm: '/a', name, entry });

/** A cell that keeps what it asks for. */
function listeningCell() {
  /** @type {any[]} */
  const written = [];
  /** @type {any[]} */
  const asked = [];
  const cell = new Cell({ write: (message) => written.push(message) > 0, onChange() {},
    ask: async (cmd, args) => {
      asked.push({ cmd, ...args });
      return { ok: true, message: '' };
    } });
  return { cell, written, asked };
}

test('changes are made in a copy, entry by entry', () => {
  const before = withChanges({}, [change('cabinet.di.0'), change('cabinet.di.1')]);
  const after = withChanges(before, [change('cabinet.di.0', null), change('cabinet.di.1', { label: 'x' })]);
  assert.deepEqual(after, { io: { '/a': { 'cabinet.di.1': { label: 'x' } } } });
  assert.equal(Object.keys(before.io['/a']).length, 2);
});

test('the next revision is taken as it comes; anything else is fetched as a whole', () => {
  const { cell, written } = listeningCell();
  cell.take({ t: 'cell', revision: 4, data: {} });
  cell.take({ t: 'cell_changed', revision: 5, by: 'other', changes: [change('a')] });
  assert.deepEqual([cell.revision, cell.by, cell.entry('io', '/a', 'a'), written], [5, 'other', { label: 'a' }, []]);
  assert.deepEqual(cell.entries('io', '/a'), [['a', { label: 'a' }]]);
  assert.equal(cell.entry('io', '/a', 'toString'), undefined);
  cell.take({ t: 'cell_changed', revision: 7, changes: [change('b')] });
  cell.take({ t: 'cell_changed', revision: 6, changes: null });
  assert.deepEqual(written, [{ t: 'cell' }, { t: 'cell' }]);
  assert.equal(cell.revision, 5);
  cell.take({ t: 'cell', revision: 7, data: {} });
  clearTimeout(cell.timer);
});

test('a change names the revision that is shown when its turn comes', async () => {
  const { cell, asked } = listeningCell();
  cell.take({ t: 'cell', revision: 1, data: {} });
  const first = cell.change([change('a')]);
  cell.take({ t: 'cell_changed', revision: 2, changes: [change('a')] });
  await Promise.all([first, cell.change([change('b')])]);
  assert.deepEqual(asked.map(({ revision }) => revision), [2, 2]);
});

test('a file is sent in parts that are its text again, and cuts no character', async () => {
  const text = '🤖'.repeat(7) + 'é'.repeat(3);
  assert.deepEqual(partsOf(text, 4).map((part) => part.length), [8, 7, 2]);
  assert.equal(partsOf(text, 4).join(''), text);
  assert.deepEqual(partsOf('', 4), ['']);
  const { cell, asked } = listeningCell();
  cell.take({ t: 'cell', revision: 3, data: {} });
  assert.equal((await cell.replace('x'.repeat(30000))).ok, true);
  assert.deepEqual(asked.map(({ part, parts, revision }) => [part, parts, revision]), [[1, 3, 3], [2, 3, 3], [3, 3, 3]]);
});

test('steps are told in words and moved one place', () => {
  assert.deepEqual(wordsOf({ kind: 'line', point: 'P1', speed: 0.05, blend: 0.01 }, translate), ['list.step.line', { point: 'P1, ⌒ 10 mm', speed: '50 mm/s' }]);
  assert.deepEqual(wordsOf({ kind: 'output', signal: 'digital', bank: 'tool', index: 1, value: false }, translate),
    ['list.step.output', { where: 'Tool I/O DO 1', value: 'off' }]);
  const [a, b, c] = ['a', 'b', 'c'].map((kind) => ({ kind }));
  assert.deepEqual([moved([a, b, c], 0, 1), moved([a, b, c], 2, -1), moved([a, b, c], 2, 1)], [[b, a, c], [a, c, b], [a, b, c]]);
});

test('the layout is what the browser keeps of the page, and nothing else that it keeps', () => {
  const kept = new Map([['jaka-panel-drawer', '240'], ['jaka-panel-points', '{}'], ['jaka-panel-token', 'secret'], ['jaka-panel-theme', 'dark']]);
  const storage = /** @type {any} */ ({ getItem: (/** @type {string} */ key) => kept.get(key) ?? null });
  assert.deepEqual(layoutOf(storage), { drawer: '240', theme: 'dark' });
  assert.deepEqual(layoutOf(null), {});
});
