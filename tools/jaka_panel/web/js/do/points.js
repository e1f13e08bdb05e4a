/** Points that are stored in this browser, for each arm. */

const KEPT_AS = 'jaka-panel-points';
const MOST = 200;
const LONGEST = 60;

/**
 * @typedef {object} Point
 * @property {string} name
 * @property {number[]} q rad
 */

/** The stored points of all arms; what cannot be read counts as none. */
export class Points {
  /** @param {Storage|null} storage */
  constructor(storage) {
    this.storage = storage;
    /** @type {Record<string, Point[]>} */
    this.byArm = {};
    try {
      const read = JSON.parse(storage?.getItem(KEPT_AS) ?? '{}');
      for (const [arm, points] of Object.entries(read)) {
        this.byArm[arm] = /** @type {any[]} */ (points).filter(isPoint).slice(0, MOST);
      }
    } catch {
      this.byArm = {};
    }
  }

  /**
   * @param {string} arm Id.
   * @returns {Point[]} In the order in which they were stored.
   */
  list(arm) {
    return this.byArm[arm] ?? [];
  }

  /**
   * Stores a point; one of the same name is replaced.
   *
   * @param {string} arm
   * @param {string} name An empty one gets the next free number.
   * @param {number[]} q rad
   * @returns {Point}
   */
  add(arm, name, q) {
    const list = this.list(arm);
    let free = list.length + 1;
    while (list.some((point) => point.name === `P${free}`)) free += 1;
    const point = { name: (name.trim() || `P${free}`).slice(0, LONGEST), q: [...q] };
    const place = list.findIndex((one) => one.name === point.name);
    if (place < 0) this.byArm[arm] = [...list, point].slice(-MOST);
    else this.byArm[arm] = list.map((one, index) => (index === place ? point : one));
    this.keep();
    return point;
  }

  /**
   * @param {string} arm
   * @param {string} name
   */
  remove(arm, name) {
    this.byArm[arm] = this.list(arm).filter((point) => point.name !== name);
    this.keep();
  }

  keep() {
    try {
      this.storage?.setItem(KEPT_AS, JSON.stringify(this.byArm));
    } catch {
      // a browser that stores nothing: the points hold until the page is closed
    }
  }
}

/**
 * @param {any} point
 * @returns {boolean}
 */
function isPoint(point) {
  return typeof point?.name === 'string' && Array.isArray(point.q) && point.q.length === 6
    && point.q.every((/** @type {any} */ value) => typeof value === 'number' && Number.isFinite(value));
}

/**
 * Times at which a path through points is where: joint by joint no faster than a speed, with a smooth start and end.
 *
 * @param {number[][]} joints rad, the first is where the arm is.
 * @param {number} speed rad/s, of the fastest joint on the average of each leg.
 * @param {number} [least] Shortest time of a leg, s.
 * @returns {{t: number, q: number[]}[]}
 */
export function timedPoints(joints, speed, least = 0.5) {
  let time = 0;
  return joints.map((q, index) => {
    if (index > 0) {
      const way = Math.max(...q.map((value, n) => Math.abs(value - joints[index - 1][n])));
      time += Math.max(least, way / speed);
    }
    return { t: time, q };
  });
}
