/** The zones that the motion guard keeps, in the base frame: red is kept out of, green lines are kept within. */
import * as THREE from '../../vendor/three/three.module.js';

const OUT = 0xd83a2e;
const WITHIN = 0x2fa14f;
/** Edge of the floor, which has none, as it is drawn, m. */
const FLOOR_EDGE = 4;

/**
 * The answer to the command `zones`: the keys of the driver's workspace, m and rad.
 *
 * @typedef {object} ZoneLists
 * @property {Box[]} [keep_out]
 * @property {Box[]} [keep_in]
 * @property {{foot: number[], height: number, radius: number}[]} [cylinders]
 * @property {number} [floor]
 */

/** @typedef {{centre: number[], size: number[], rpy: number[]}} Box */

export class Zones {
  constructor() {
    this.group = new THREE.Group();
  }

  /** @param {ZoneLists|null} lists In place of what was drawn before; null: none. */
  show(lists) {
    for (const part of [...this.group.children]) {
      part.geometry.dispose();
      part.material.dispose();
      this.group.remove(part);
    }
    for (const box of lists?.keep_out ?? []) this.add(solid(new THREE.BoxGeometry(...box.size)), box.centre, box.rpy);
    for (const box of lists?.keep_in ?? []) this.add(edges(new THREE.BoxGeometry(...box.size)), box.centre, box.rpy);
    for (const { foot, height, radius } of lists?.cylinders ?? []) {
      const geometry = new THREE.CylinderGeometry(radius, radius, height, 32).rotateX(Math.PI / 2);
      this.add(solid(geometry), [foot[0], foot[1], foot[2] + height / 2], [0, 0, 0]);
    }
    if (typeof lists?.floor === 'number') {
      this.add(solid(new THREE.PlaneGeometry(FLOOR_EDGE, FLOOR_EDGE)), [0, 0, lists.floor], [0, 0, 0]);
    }
  }

  /**
   * @param {any} part
   * @param {number[]} place m
   * @param {number[]} rpy About the fixed axes x, y, z, rad.
   */
  add(part, place, rpy) {
    part.position.set(...place);
    part.rotation.set(rpy[0], rpy[1], rpy[2], 'ZYX');
    this.group.add(part);
  }
}

/** @param {any} geometry */
function solid(geometry) {
  return new THREE.Mesh(geometry, new THREE.MeshPhongMaterial({ color: OUT, transparent: true, opacity: 0.35,
    depthWrite: false, side: THREE.DoubleSide }));
}

/** @param {any} geometry */
function edges(geometry) {
  const lines = new THREE.LineSegments(new THREE.EdgesGeometry(geometry), new THREE.LineBasicMaterial({ color: WITHIN }));
  geometry.dispose();
  return lines;
}
