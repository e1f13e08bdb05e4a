import assert from 'node:assert/strict';
import { test } from 'node:test';
import { changesInWords, valuesToWrite } from '../../../../tools/jaka_panel/web/js/do/held.js';
import { isShown } from '../../../../tools/jaka_panel/web/js/do/io.js';
import { fixed } from '../../../../tools/jaka_panel/web/js/ui/format.js';

/** @param {string} label @param {string} unit @param {number} scale @param {string} typed A field, as far as it is needed. */
const field = (label, unit, scale, typed) => /** @type {any} */ ({ label, unit, textOf: (/** @type {number} */ value) => fixed(value * scale, 2),
  shows: (/** @type {number} */ value) => typed === fixed(value * scale, 2) });

test('what nobody changed is written as it is held, to the last digit', () => {
  const held = [1.5, 0.0412345, -0.02];
  const fields = [field('setup.mass', 'kg', 1, '0.00'), field('X', 'mm', 1000, '41.23'), field('Y', 'mm', 1000, '-20.00')];
  assert.deepEqual(valuesToWrite(fields, [0, 0.04123, -0.02], held), [0, 0.0412345, -0.02]);
  assert.deepEqual(changesInWords(fields, [0, 0.04123, -0.02], held, () => 'Mass'), ['Mass: 1.50 → 0.00 kg']);
  assert.deepEqual(changesInWords(fields, [1.5, 0.0412345, -0.02], null, () => 'Mass')[1], 'X: ? → 41.23 mm', 'what is held is not known');
});

test('of inputs and outputs the usual ones are seen, and those that are used or have a name', () => {
  const terminal = { kind: /** @type {const} */ ('di'), index: 100, isUsed: false, isNamed: false, isOn: false, text: 'DI 100' };
  const shown = (/** @type {object} */ more, /** @type {any} */ extent = 'usual', filter = '') => isShown({ ...terminal, ...more }, extent, filter);
  assert.deepEqual([shown({}), shown({ index: 15 }), shown({ index: 16 }), shown({ kind: 'ai', index: 15 })], [false, true, false, false]);
  assert.deepEqual([shown({ isUsed: true }), shown({ isNamed: true }), shown({ kind: 'r' })], [true, true, true]);
  assert.deepEqual([shown({}, 'all'), shown({}, 'on'), shown({ isOn: true }, 'on')], [true, false, true]);
  assert.deepEqual([shown({}, 'usual', ' di 1'), shown({ index: 3, text: 'DI 3 Door' }, 'usual', 'door'), shown({}, 'all', 'door')], [true, true, false]);
});
