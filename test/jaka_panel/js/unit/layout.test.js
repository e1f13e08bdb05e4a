import assert from 'node:assert/strict';
import { test } from 'node:test';
import { firstHeight, LOWEST, within } from '../../../../tools/jaka_panel/web/js/ui/drawer.js';
import { firstView } from '../../../../tools/jaka_panel/web/js/ui/size.js';

test('the drawer is as high as it was left, within its window, and at first open where there is room', () => {
  assert.deepEqual([firstHeight(null, 768), firstHeight(null, 1080)], [0, 292]);
  assert.deepEqual([firstHeight('300', 768), firstHeight('300', 400), firstHeight('0', 1080)], [300, 240, 0]);
  assert.deepEqual([firstHeight('x', 768), firstHeight('', 768), firstHeight('-5', 1080)], [0, 0, 0]);
  assert.deepEqual([within(59, 768), within(61, 768), within(9999, 1000)], [0, LOWEST, 600]);
});

test('the view is the one that the address names, else the one chosen last, else by the pointer', () => {
  assert.equal(firstView('?view=wall', 'desk', true), 'wall');
  assert.equal(firstView('?view=none', 'tablet', false), 'tablet');
  assert.deepEqual([firstView('', null, true), firstView('', null, false), firstView('', 'x', false)], ['tablet', 'desk', 'desk']);
});
