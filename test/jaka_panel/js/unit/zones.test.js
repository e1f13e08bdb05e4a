import assert from 'node:assert/strict';
import { test } from 'node:test';
import * as THREE from '../../../../tools/jaka_panel/web/vendor/three/three.module.js';
import { Zones } from '../../../../tools/jaka_panel/web/js/view/zones.js';

const BOX = { name: 'press', centre: [0.6, 0.1, 0.2], size: [0.2, 0.4, 0.6], rpy: [0.3, -0.4, 0.5] };
const CELL = { keep_out: [BOX], keep_in: [{ ...BOX, name: 'cell' }], floor: -0.1, tool: [],
  cylinders: [{ name: 'post', foot: [0, -0.8, 0.1], height: 1.5, radius: 0.06 }] };

function extent(part) {
  part.updateMatrixWorld(true);
  const box = new THREE.Box3().setFromObject(part, true);
  return [...box.min.toArray(), ...box.max.toArray()].map((value) => Math.round(value * 1e6) / 1e6);
}

test('zones stand where they are, turned about the fixed axes, and the newest replace all', () => {
  const zones = new Zones();
  zones.show(CELL);
  const [press, cell, post, floor] = zones.group.children;
  assert.equal(zones.group.children.length, 4);
  const [roll, pitch, yaw] = BOX.rpy;
  const turn = new THREE.Matrix4().makeRotationZ(yaw).multiply(new THREE.Matrix4().makeRotationY(pitch))
    .multiply(new THREE.Matrix4().makeRotationX(roll));
  const corner = new THREE.Vector3(0.1, 0.2, 0.3).applyMatrix4(turn).add(new THREE.Vector3(...BOX.centre));
  for (const part of [press, cell]) {
    part.updateMatrixWorld(true);
    assert.ok(part.localToWorld(new THREE.Vector3(0.1, 0.2, 0.3)).distanceTo(corner) < 1e-9);
  }
  assert.deepEqual(extent(post), [-0.06, -0.86, 0.1, 0.06, -0.74, 1.6]);
  assert.deepEqual(extent(floor), [-2, -2, -0.1, 2, 2, -0.1]);
  zones.show({ floor: 0 });
  assert.equal(zones.group.children.length, 1);
  zones.show(null);
  assert.equal(zones.group.children.length, 0);
});
