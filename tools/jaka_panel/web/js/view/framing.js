/** The place of a camera from which what is to be seen fills its picture and nothing of it is cut off. */
import * as THREE from '../../vendor/three/three.module.js';

/** Share of the picture that is left free. */
const MARGIN = 0.08;

/**
 * Corners of the boxes around the parts of an object that can be seen, in the world.
 *
 * @param {any} object
 * @returns {any[]} Vector3, m; none where nothing is seen.
 */
export function cornersOf(object) {
  /** @type {any[]} */
  const corners = [];
  object.updateMatrixWorld(true);
  object.traverseVisible((/** @type {any} */ part) => {
    if (!part.isMesh) return;
    if (!part.geometry.boundingBox) part.geometry.computeBoundingBox();
    const { min, max } = part.geometry.boundingBox;
    for (const x of [min.x, max.x]) {
      for (const y of [min.y, max.y]) {
        for (const z of [min.z, max.z]) corners.push(new THREE.Vector3(x, y, z).applyMatrix4(part.matrixWorld));
      }
    }
  });
  return corners;
}

/**
 * Return the place that a camera looks at, and its distance, so that points just fit into its picture.
 *
 * @param {any[]} points Vector3, m; at least one.
 * @param {any} direction Vector3 of length 1, from what is looked at to the camera.
 * @param {any} up Vector3: what is above in the picture; not along the direction.
 * @param {number} high Tangent of half the angle that is seen from below to above.
 * @param {number} wide Tangent of half the angle that is seen from left to right.
 * @returns {{target: any, distance: number, above: any}} Vector3 and length, m; the direction that is above in the picture.
 */
export function fit(points, direction, up, high, wide) {
  const right = new THREE.Vector3().crossVectors(up, direction).normalize();
  const above = new THREE.Vector3().crossVectors(direction, right);
  const middle = (/** @type {any} */ axis) => {
    const along = points.map((point) => point.dot(axis));
    return (Math.min(...along) + Math.max(...along)) / 2;
  };
  const target = new THREE.Vector3().addScaledVector(right, middle(right)).addScaledVector(above, middle(above))
    .addScaledVector(direction, middle(direction));
  const distance = Math.max(...points.map((point) => {
    const from = point.clone().sub(target);
    return from.dot(direction) + Math.max(Math.abs(from.dot(right)) / wide, Math.abs(from.dot(above)) / high) / (1 - MARGIN);
  }));
  return { target, distance, above };
}
