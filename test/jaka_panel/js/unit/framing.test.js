import assert from 'node:assert/strict';
import { test } from 'node:test';
import * as THREE from '../../../../tools/jaka_panel/web/vendor/three/three.module.js';
import { cornersOf, fit } from '../../../../tools/jaka_panel/web/js/view/framing.js';

const UP = new THREE.Vector3(0, 0, 1);
const FOV = 38;

test('what is to be seen fills the picture as far as it can, and nothing of it is cut off', () => {
  const points = [[-0.2, -0.5, 0], [0.7, 0.1, 1.3], [0.7, -0.5, 0.4], [0, 0, 1.1]].map((place) => new THREE.Vector3(...place));
  for (const aspect of [0.6, 1, 2.4]) {
    for (const place of [[0.82, -0.92, 0.38], [1, 0.001, 0.06], [0.001, -0.001, 1]]) {
      const direction = new THREE.Vector3(...place).normalize();
      const camera = new THREE.PerspectiveCamera(FOV, aspect, 0.01, 50);
      camera.up.copy(UP);
      const high = Math.tan((FOV * Math.PI) / 360);
      const { target, distance } = fit(points, direction, UP, high, high * aspect);
      camera.position.copy(target).addScaledVector(direction, distance);
      camera.lookAt(target);
      camera.updateMatrixWorld(true);
      const seen = points.map((point) => point.clone().project(camera));
      const most = Math.max(...seen.flatMap((point) => [Math.abs(point.x), Math.abs(point.y)]));
      assert.ok(most <= 0.921 && most > 0.9, `${aspect} ${place}: ${most}`);
    }
  }
});

test('corners are those of what is seen, where it stands now', () => {
  const group = new THREE.Group();
  const seen = new THREE.Mesh(new THREE.BoxGeometry(0.2, 0.2, 0.2));
  const unseen = new THREE.Mesh(new THREE.BoxGeometry(9, 9, 9));
  unseen.visible = false;
  group.add(seen, unseen);
  group.position.x = 1;
  const corners = cornersOf(group).map((corner) => corner.toArray().map((/** @type {number} */ value) => Math.round(value * 10) / 10));
  assert.deepEqual([corners.length, corners[0], corners[7]], [8, [0.9, -0.1, -0.1], [1.1, 0.1, 0.1]]);
  seen.visible = false;
  assert.equal(cornersOf(group).length, 0);
});
