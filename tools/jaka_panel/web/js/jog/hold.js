/**
 * The dead-man's switch of the page: while a button is held, heartbeats go out 20 times a second from the page's own
 * thread, each only if the page is seen at that moment. A page that stands still, is hidden or cannot send says nothing,
 * and what was held is over for good: the button must be pressed anew.
 */

/**
 * Time between two heartbeats, ms.
 * @type {number}
 */
export const PERIOD_MS = 50;
/** A heartbeat that comes so late shows that the page stood still, ms. */
export const FROZEN_MS = 150;
/** Most heartbeats in a row that may find bytes of the ones before still in the browser. */
const BACKLOG_BEATS = 2;

/**
 * @typedef {object} Surroundings
 * @property {(message: any) => boolean} send False where there is no connection.
 * @property {() => number} now ms
 * @property {() => boolean} isAttended The tab is visible and has the focus.
 * @property {() => number} backlog Bytes that wait in the browser.
 * @property {() => number|null} drawn Server's clock in the newest state on the screen, s.
 * @property {(call: () => void, period: number) => any} setTimer
 * @property {(timer: any) => void} clearTimer
 * @property {(why: string) => void} onEnd
 */

/**
 * @typedef {object} Motion
 * @property {string} arm
 * @property {'joint'|'base'|'tool'} space
 * @property {number[]} v Share of the jog speed for each axis, -1 to 1.
 * @property {number|null} step m or rad; null: as long as it is held.
 */

export class Hold {
  /** @param {Surroundings} surroundings */
  constructor(surroundings) {
    this.page = surroundings;
    this.number = 0;
    this.seq = 0;
    /** @type {Motion|null} */
    this.motion = null;
    /** @type {any} */
    this.timer = null;
    this.beatAt = 0;
    this.behind = 0;
  }

  /** @returns {boolean} */
  get isHeld() {
    return this.motion !== null;
  }

  /**
   * A button was pressed. A second one while the first is held ends both.
   *
   * @param {Motion} motion
   * @returns {boolean} Whether it is held now.
   */
  begin(motion) {
    if (this.motion) {
      this.end('two buttons');
      return false;
    }
    this.number += 1;
    this.motion = motion;
    this.behind = 0;
    this.beatAt = this.page.now();
    this.beat();
    if (!this.motion) return false;
    this.timer = this.page.setTimer(() => this.beat(), PERIOD_MS);
    return true;
  }

  beat() {
    if (!this.motion) return;
    const now = this.page.now();
    const late = now - this.beatAt > FROZEN_MS;
    this.beatAt = now;
    this.behind = this.page.backlog() > 0 ? this.behind + 1 : 0;
    if (late) {
      this.end('frozen');
    } else if (!this.page.isAttended()) {
      this.end('not seen');
    } else if (this.behind > BACKLOG_BEATS) {
      this.end('link');
    } else if (this.page.drawn() === null) {
      this.end('no state');
    } else {
      this.seq += 1;
      const sent = this.page.send({ t: 'jog', ...this.motion, hold: this.number, seq: this.seq, clock: now,
        echo: this.page.drawn() });
      if (!sent) this.end('link');
    }
  }

  /**
   * The button was let go, or something else ends it.
   *
   * @param {string} why
   */
  end(why) {
    if (!this.motion) return;
    this.motion = null;
    this.page.clearTimer(this.timer);
    this.timer = null;
    this.page.send({ t: 'jog_stop', hold: this.number });
    this.page.onEnd(why);
  }

  /**
   * The server has ended a hold.
   *
   * @param {number} number
   * @param {string} why
   */
  endedByServer(number, why) {
    if (this.motion && number === this.number) this.end(why);
  }
}
