/**
 * The lateness of messages: how much later than the quickest ones they come, by the server's clock in them. Round trips
 * do not show it alone: a queue on the way here grows while the pings of seconds ago were quick.
 */

/** The quickest message and round trip of so long count: the clocks of two computers part by a millisecond meanwhile. */
const KEPT_S = 30;
/** A page that slept or stood still has forgotten nothing: a longer pause between two messages counts as this, s. */
const PAUSE_S = 1;

/** The least of the values of the last while. */
class Least {
  constructor() {
    /** Values that grow, each the least since the one before it, and when they came, s. @type {[number, number][]} */
    this.kept = [];
  }

  clear() {
    this.kept = [];
  }

  /**
   * @param {number} value
   * @param {number} at s
   * @returns {number} The least value of the last KEPT_S, this one among them.
   */
  take(value, at) {
    while (this.kept.length && this.kept[this.kept.length - 1][0] >= value) this.kept.pop();
    this.kept.push([value, at]);
    while (this.kept[0][1] < at - KEPT_S) this.kept.shift();
    return this.kept[0][0];
  }
}

export class Lateness {
  constructor() {
    /** Half of the quickest of the newest round trips, s. */
    this.way = 0;
    this.ways = new Least();
    this.delays = new Least();
    this.leastWay = 0;
    this.seconds = 0;
    this.takenAt = 0;
  }

  /** Forgets the server, which may be another one. */
  clear() {
    this.ways.clear();
    this.delays.clear();
    this.leastWay = 0;
  }

  /** @returns {number} Time of this page without long pauses, s. */
  time() {
    const at = performance.now() / 1000;
    this.seconds += Math.min(Math.max(at - this.takenAt, 0), PAUSE_S);
    this.takenAt = at;
    return this.seconds;
  }

  /** @param {number} way Half of the quickest of the newest round trips, s. */
  takeWay(way) {
    this.way = way;
    this.leastWay = this.ways.take(way, this.time());
  }

  /**
   * @param {number} now Server's clock in a message that has just come, s.
   * @returns {number} By how much it was on its way for longer than the quickest one, s.
   */
  take(now) {
    const delay = performance.now() / 1000 - now;
    return delay - this.delays.take(delay, this.time());
  }

  /**
   * @param {number} late Of a message, as `take` has returned it.
   * @returns {number} By how much it was on its way for longer than `way`, which the newest round trips have shown, s.
   */
  beyond(late) {
    return Math.max(0, this.leastWay + late - this.way);
  }
}
