/** Lines in the room: the way that the tool has come, and the way that it is going to take. */
import * as THREE from '../../vendor/three/three.module.js';

/** Places that the trace keeps, and how far apart they are, m. */
const PLACES = 1500;
const APART = 0.002;

export class Trace {
  /** @param {number} colour */
  constructor(colour) {
    this.places = new Float32Array(PLACES * 3);
    this.count = 0;
    this.geometry = new THREE.BufferGeometry();
    this.attribute = new THREE.BufferAttribute(this.places, 3);
    this.attribute.setUsage(THREE.DynamicDrawUsage);
    this.geometry.setAttribute('position', this.attribute);
    this.geometry.setDrawRange(0, 0);
    this.line = new THREE.Line(this.geometry, new THREE.LineBasicMaterial({ color: colour }));
    this.line.frustumCulled = false;
  }

  /**
   * One place more, where it is far enough from the last; the oldest half goes when there is no room.
   *
   * @param {{x: number, y: number, z: number}} place m
   * @returns {boolean} Whether the line has changed.
   */
  add(place) {
    const last = 3 * (this.count - 1);
    if (this.count && Math.hypot(place.x - this.places[last], place.y - this.places[last + 1],
      place.z - this.places[last + 2]) < APART) return false;
    if (this.count === PLACES) {
      this.places.copyWithin(0, (PLACES / 2) * 3);
      this.count = PLACES / 2;
    }
    this.places.set([place.x, place.y, place.z], 3 * this.count);
    this.count += 1;
    this.geometry.setDrawRange(0, this.count);
    this.attribute.needsUpdate = true;
    return true;
  }

  clear() {
    this.count = 0;
    this.geometry.setDrawRange(0, 0);
  }
}

export class PathLine {
  /** @param {number} colour */
  constructor(colour) {
    this.line = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: colour }));
    this.line.frustumCulled = false;
    this.line.visible = false;
  }

  /** @param {any[]|null} places Vector3, m; null: no path. */
  show(places) {
    this.line.geometry.dispose();
    this.line.geometry = new THREE.BufferGeometry().setFromPoints(places ?? []);
    this.line.visible = Boolean(places?.length);
  }
}
