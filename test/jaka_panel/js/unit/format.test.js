import assert from 'node:assert/strict';
import { test } from 'node:test';
import { fixed, rotationVectorFromRpy, rpyFromRotationVector, typedNumber } from '../../../../tools/jaka_panel/web/js/ui/format.js';

test('numbers have their decimals, what is none is a dash, and there is no -0', () => {
  assert.equal(fixed(1.005, 1), '1.0');
  assert.equal(fixed(-0.001, 2), '0.00');
  assert.equal(fixed(null, 2), '–');
  assert.equal(fixed(NaN, 2), '–');
  assert.equal(fixed(undefined, 0), '–');
});

test('typed numbers may have a comma; all else is none', () => {
  assert.equal(typedNumber(' 1,5 '), 1.5);
  assert.equal(typedNumber('−2'), -2);
  assert.equal(typedNumber('.5'), 0.5);
  for (const text of ['', '1 2', '0x10', 'Infinity', '1.2.3', '--1', '<b>']) assert.ok(Number.isNaN(typedNumber(text)), text);
});

test('roll, pitch, yaw and rotation vectors are the same rotations', () => {
  const close = (/** @type {number[]} */ one, /** @type {number[]} */ other) => (
    one.forEach((value, n) => assert.ok(Math.abs(value - other[n]) < 1e-9, `${one} ${other}`)));
  close(rotationVectorFromRpy([0, 0, 0]), [0, 0, 0]);
  close(rotationVectorFromRpy([0, 0, Math.PI / 2]), [0, 0, Math.PI / 2]);
  close(rotationVectorFromRpy([Math.PI, 0, 0]), [Math.PI, 0, 0]);
  for (const rpy of [[0.3, -0.7, 1.9], [-3, 0.2, -2.5], [1, 1.2, -0.4]]) close(rpyFromRotationVector(rotationVectorFromRpy(rpy)), rpy);
});

test('straight up a rotation has many triples; the one that is shown gives it back', () => {
  const vector = rotationVectorFromRpy([0.4, Math.PI / 2, 0.1]);
  const again = rotationVectorFromRpy(rpyFromRotationVector(vector));
  vector.forEach((value, n) => assert.ok(Math.abs(value - again[n]) < 1e-6));
});
