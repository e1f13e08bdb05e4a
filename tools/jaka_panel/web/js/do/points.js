/** Points of the arms, in the data of the cell; those that this browser kept before are offered for import. */

/** @typedef {import('../link/messages.js').Answer} Answer */
/** @typedef {import('../cell/cell.js').Cell} Cell */

const KEPT_AS = 'jaka-panel-points';
const DECLINED_AS = 'jaka-panel-points-declined';
const LONGEST = 60;

/**
 * @typedef {object} Point
 * @property {string} name
 * @property {number[]} q rad
 * @property {string} [model] With which it was taken.
 */

export class Points {
  /**
   * @param {Cell} cell
   * @param {Storage|null} storage Of this browser.
   * @param {(arm: string) => object} about What is kept with a point: the frames and the model with which it is taken.
   * @param {(answer: Answer) => void} refused Called where the server did not take a change.
   */
  constructor(cell, storage, about, refused) {
    this.cell = cell;
    this.storage = storage;
    this.about = about;
    this.refused = refused;
  }

  /**
   * @param {string} arm Id.
   * @returns {Point[]} In the order in which they were stored.
   */
  list(arm) {
    return this.cell.entries('points', arm).map(([name, entry]) => ({ name, ...entry }));
  }

  /**
   * Stores a point; one of the same name is replaced.
   *
   * @param {string} arm
   * @param {string} name An empty one gets the next free number.
   * @param {number[]} q rad
   * @returns {Promise<Answer>}
   */
  add(arm, name, q) {
    const list = this.list(arm);
    let free = list.length + 1;
    while (list.some((point) => point.name === `P${free}`)) free += 1;
    return this.change([{ section: 'points', arm, name: (name.trim() || `P${free}`).slice(0, LONGEST).trim(),
      entry: { q: [...q], ...this.about(arm) } }]);
  }

  /**
   * @param {string} arm
   * @param {string} name
   * @returns {Promise<Answer>}
   */
  remove(arm, name) {
    return this.change([{ section: 'points', arm, name, entry: null }]);
  }

  /**
   * @param {import('../cell/cell.js').Change[]} changes
   * @returns {Promise<Answer>}
   */
  async change(changes) {
    const answer = await this.cell.change(changes);
    if (!answer.ok) this.refused(answer);
    return answer;
  }

  /**
   * The points that this browser kept before the server kept any; what cannot be read counts as none.
   *
   * @returns {import('../cell/cell.js').Change[]} As changes that store them; no point of the cell is replaced.
   */
  kept() {
    try {
      const read = JSON.parse(this.storage?.getItem(KEPT_AS) ?? '{}');
      return Object.entries(read).flatMap(([arm, points]) => /** @type {any[]} */ (points).filter(isPoint).map((point) => ({
        section: 'points', arm, name: this.freeName(arm, point.name.trim() || 'P', point.q), entry: { q: point.q } })));
    } catch {
      return [];
    }
  }

  /**
   * @param {string} arm
   * @param {string} name
   * @param {number[]} q rad
   * @returns {string} The name, with a number behind it where the cell has another point of that name.
   */
  freeName(arm, name, q) {
    /** @type {(one: string) => boolean} */
    const isTaken = (one) => {
      const there = this.cell.entry('points', arm, one);
      return there !== undefined && there.q.some((/** @type {number} */ value, /** @type {number} */ n) => value !== q[n]);
    };
    if (!isTaken(name)) return name;
    let number = 2;
    while (isTaken(`${name.slice(0, LONGEST - 4)} ${number}`)) number += 1;
    return `${name.slice(0, LONGEST - 4)} ${number}`;
  }

  /** Offers the browser's own points no more; they stay in it under another name, unless it has no space left. */
  decline() {
    const text = this.storage?.getItem(KEPT_AS);
    if (!text) return;
    this.storage?.removeItem(KEPT_AS);
    try {
      this.storage?.setItem(DECLINED_AS, text);
    } catch {
      this.storage?.setItem(KEPT_AS, text);
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
