/** The samples of the last minutes, and how many of them are enough for a picture. */

/** Samples that are kept: two minutes at 125 Hz. */
export const KEPT = 15000;

/** Six values at each moment, the oldest forgotten first. */
export class Samples {
  /** @param {number} [capacity] */
  constructor(capacity = KEPT) {
    this.capacity = capacity;
    this.times = new Float64Array(capacity);
    this.values = Array.from({ length: 6 }, () => new Float64Array(capacity));
    this.first = 0;
    this.count = 0;
  }

  /**
   * @param {number} time s, later than the one before; others are left out.
   * @param {(number|null|undefined)[]} values
   */
  add(time, values) {
    if (this.count && time <= this.timeAt(this.count - 1)) return;
    const place = (this.first + this.count) % this.capacity;
    this.times[place] = time;
    for (let n = 0; n < 6; n += 1) this.values[n][place] = values[n] ?? NaN;
    if (this.count < this.capacity) this.count += 1;
    else this.first = (this.first + 1) % this.capacity;
  }

  /**
   * @param {number} index From the oldest on.
   * @returns {number} s
   */
  timeAt(index) {
    return this.times[(this.first + index) % this.capacity];
  }

  clear() {
    this.first = 0;
    this.count = 0;
  }

  /**
   * Puts what was before the first sample in front of it, as from the server's history.
   *
   * @param {(number|null)[][]} rows Times, s, which rise, then six rows of values.
   */
  precede([times, ...values]) {
    const end = this.count ? this.timeAt(0) : Infinity;
    const own = Array.from({ length: this.count }, (_, index) => {
      const place = (this.first + index) % this.capacity;
      return { time: this.times[place], values: this.values.map((row) => row[place]) };
    });
    this.clear();
    times.forEach((time, index) => {
      if (time !== null && time < end) this.add(time, values.map((row) => row[index]));
    });
    for (const sample of own) this.add(sample.time, sample.values);
  }

  /**
   * Index of the first sample that is not before a time.
   *
   * @param {number} time s
   * @returns {number}
   */
  indexOf(time) {
    let low = 0;
    let high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.timeAt(middle) < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /**
   * Lowest and highest value in each of so many equal pieces of a time span: a peak is never left out.
   *
   * @param {number} from s
   * @param {number} to s
   * @param {number} pieces
   * @returns {(number|null)[][]} Times, then six rows of values; null where a value is missing.
   */
  picture(from, to, pieces) {
    const begin = Math.max(0, this.indexOf(from) - 1);
    const end = Math.min(this.count, this.indexOf(to) + 1);
    /** @type {(number|null)[][]} */
    const rows = Array.from({ length: 7 }, () => []);
    if (end - begin <= 2 * pieces) {
      for (let index = begin; index < end; index += 1) {
        const place = (this.first + index) % this.capacity;
        rows[0].push(this.times[place]);
        for (let n = 0; n < 6; n += 1) rows[n + 1].push(orNull(this.values[n][place]));
      }
      return rows;
    }
    const width = (to - from) / pieces;
    for (let index = begin; index < end;) {
      const piece = Math.floor((this.timeAt(index) - from) / width);
      const low = [NaN, NaN, NaN, NaN, NaN, NaN];
      const high = [NaN, NaN, NaN, NaN, NaN, NaN];
      const started = this.timeAt(index);
      let last = started;
      while (index < end && Math.floor((this.timeAt(index) - from) / width) === piece) {
        const place = (this.first + index) % this.capacity;
        last = this.times[place];
        for (let n = 0; n < 6; n += 1) {
          const value = this.values[n][place];
          if (!(value >= low[n])) low[n] = Number.isNaN(value) ? low[n] : value;
          if (!(value <= high[n])) high[n] = Number.isNaN(value) ? high[n] : value;
        }
        index += 1;
      }
      rows[0].push(started, last > started ? last : started + width / 2);
      for (let n = 0; n < 6; n += 1) rows[n + 1].push(orNull(low[n]), orNull(high[n]));
    }
    return rows;
  }
}

/**
 * @param {number} value
 * @returns {number|null}
 */
function orNull(value) {
  return Number.isNaN(value) ? null : value;
}

/**
 * The same kind of picture from the server's history, which has lowest and highest values already.
 *
 * @param {{s: number[], min: (number|null)[][], max: (number|null)[][]}} history
 * @param {number} scale
 * @returns {(number|null)[][]}
 */
export function pictureOfHistory(history, scale) {
  /** @type {(number|null)[][]} */
  const rows = Array.from({ length: 7 }, () => []);
  const width = history.s.length > 1 ? history.s[1] - history.s[0] : 0;
  const scaled = (/** @type {number|null|undefined} */ value) => (value === null || value === undefined ? null : value * scale);
  history.s.forEach((time, index) => {
    rows[0].push(time, time + width / 2);
    for (let n = 0; n < 6; n += 1) rows[n + 1].push(scaled(history.min[n]?.[index]), scaled(history.max[n]?.[index]));
  });
  return rows;
}
