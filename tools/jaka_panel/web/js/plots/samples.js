/** The samples of the last minutes, and how many of them are enough for a picture. */

/** Samples that are kept: two minutes at 125 Hz. */
export const KEPT = 15000;
/** Samples further apart than this, s, have a gap between them, as the age from which on joints are stale. */
export const GAP_S = 0.3;

/** @typedef {{s: number[], last: number[], min: (number|null)[][], max: (number|null)[][]}} History */

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

  /** @returns {number} Time of the newest sample, s. */
  newest() {
    return this.count ? this.timeAt(this.count - 1) : -Infinity;
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
   * Lowest and highest value in each of so many equal pieces of a time span: a peak is never left out, and no piece reaches
   * over a gap.
   *
   * @param {number} from s
   * @param {number} to s
   * @param {number} pieces
   * @returns {(number|null)[][]} Times, then six rows of values; null where a value is missing, and between two samples with
   *   a gap between them.
   */
  picture(from, to, pieces) {
    const begin = Math.max(0, this.indexOf(from) - 1);
    const end = Math.min(this.count, this.indexOf(to) + 1);
    const rows = emptyRows();
    const width = (to - from) / pieces;
    const most = end - begin <= 2 * pieces ? 1 : Infinity;  // of the samples in one piece
    for (let index = begin; index < end;) {
      const low = [NaN, NaN, NaN, NaN, NaN, NaN];
      const high = [NaN, NaN, NaN, NaN, NaN, NaN];
      const started = this.timeAt(index);
      const piece = Math.floor((started - from) / width);
      const first = index;
      let last = started;
      while (index < end && index - first < most && this.timeAt(index) - last <= GAP_S
        && Math.floor((this.timeAt(index) - from) / width) === piece) {
        const place = (this.first + index) % this.capacity;
        last = this.times[place];
        for (let n = 0; n < 6; n += 1) {
          const value = this.values[n][place];
          if (!(value >= low[n])) low[n] = Number.isNaN(value) ? low[n] : value;
          if (!(value <= high[n])) high[n] = Number.isNaN(value) ? high[n] : value;
        }
        index += 1;
      }
      const next = index < end ? this.timeAt(index) : Infinity;
      addPiece(rows, [started, last, next], width, low.map(orNull), high.map(orNull));
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
 * Adds the lowest and highest values of one piece to a picture, and an end of its lines where a gap follows.
 *
 * @param {(number|null)[][]} rows Times, then six rows of values.
 * @param {[number, number, number]} times Of the first and last sample of the piece, and of the first one after it, s.
 * @param {number} width The least that a piece which stands alone is wide, s: without it nothing is seen of it.
 * @param {(number|null)[]} low
 * @param {(number|null)[]} high
 */
function addPiece(rows, [started, last, next], width, low, high) {
  const isEnd = next - last > GAP_S;
  const isOne = started === last && low.every((value, n) => value === high[n]);
  const isAlone = isOne && isEnd && (!rows[0].length || rows[1].at(-1) === null);
  rows[0].push(started);
  low.forEach((value, n) => rows[n + 1].push(value));
  if (!isOne || isAlone) {
    rows[0].push(last > started ? last : Math.min(started + width / 2, (started + next) / 2));
    high.forEach((value, n) => rows[n + 1].push(value));
  }
  if (!isEnd || next === Infinity) return;
  rows[0].push((Math.max(last, Number(rows[0].at(-1))) + next) / 2);
  for (let n = 1; n < rows.length; n += 1) rows[n].push(null);
}

/**
 * The same kind of picture from the server's history, which has lowest and highest values already.
 *
 * @param {History} history
 * @param {number} width The least that a piece which stands alone is wide, s.
 * @param {number} scale
 * @returns {(number|null)[][]}
 */
export function pictureOfHistory(history, width, scale) {
  const rows = emptyRows();
  history.s.forEach((time, index) => {
    addPiece(rows, [time, history.last[index], history.s[index + 1] ?? Infinity], width,
      history.min.map((row) => scaled(row[index], scale)), history.max.map((row) => scaled(row[index], scale)));
  });
  return rows;
}

/**
 * The server's history as samples: the lowest values at the first moment of each piece, the highest at its last one.
 *
 * @param {History} history Its pieces must be shorter than a gap.
 * @param {number} scale
 * @returns {(number|null)[][]} Times, then six rows of values.
 */
export function samplesOfHistory(history, scale) {
  const rows = emptyRows();
  history.s.forEach((time, index) => {
    rows[0].push(time, history.last[index]);
    for (let n = 0; n < 6; n += 1) rows[n + 1].push(scaled(history.min[n][index], scale), scaled(history.max[n][index], scale));
  });
  return rows;
}

/** @returns {(number|null)[][]} */
function emptyRows() {
  return Array.from({ length: 7 }, () => []);
}

/**
 * @param {number|null} value
 * @param {number} scale
 * @returns {number|null}
 */
function scaled(value, scale) {
  return value === null ? null : value * scale;
}
