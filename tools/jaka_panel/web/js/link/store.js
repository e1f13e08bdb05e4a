/** The store of what the page knows, by arm; parts of the page listen for the kinds that they show. */
import { Lateness } from './lateness.js';

/** @typedef {import('./messages.js').ArmInfo} ArmInfo */
/** @typedef {import('./messages.js').ArmState} ArmState */
/** @typedef {import('./messages.js').ControlState} ControlState */

const ALARMS = 200;
const CALLS = 200;
const MOVES = 200;
const STALE_S = 0.3;
/** Speed of a joint up to which no motion is seen, rad/s: a fifth of the slowest jog. */
const REST_RAD_S = 0.001;

/**
 * @typedef {object} ArmRecord
 * @property {ArmState|null} state
 * @property {number} stateAt When it came, ms of performance.now().
 * @property {number} late By how much it was on its way for longer than the quickest one, s.
 * @property {any} io
 * @property {any[]} diagnostics
 * @property {import('./messages.js').Alarm[]} alarms
 * @property {import('./messages.js').Call[]} calls
 * @property {import('./messages.js').Move[]} moves
 * @property {{bank: string, signal: string, index: number, value: boolean|number, wall: number, by: string}[]} byHand Outputs that pages have set.
 * @property {any} program
 */

/** @returns {ArmRecord} */
function emptyRecord() {
  return { state: null, stateAt: 0, late: 0, io: null, diagnostics: [], alarms: [], calls: [], moves: [], byHand: [], program: null };
}

export class Store {
  constructor() {
    /** @type {ArmInfo[]} */
    this.arms = [];
    /** Id of the arm that is shown and commanded. */
    this.chosen = '';
    /** @type {Map<string, ArmRecord>} */
    this.records = new Map();
    /** @type {any} The server's greeting. */
    this.welcome = null;
    /** @type {ControlState} */
    this.control = { holder: null, you: false, asked: null };
    /** Share of the jog speed, 0 to 1. */
    this.jogFraction = 0.1;
    /** Server's clock in the newest state that the page has drawn, s; null: none yet. @type {number|null} */
    this.drawn = null;
    this.lateness = new Lateness();
    /** @type {Map<string, Set<(message: any) => void>>} */
    this.listeners = new Map();
  }

  /**
   * @param {string} kinds Names, apart by spaces: those of the messages, `chosen` and `link`.
   * @param {(message: any) => void} listener
   */
  on(kinds, listener) {
    for (const kind of kinds.split(' ')) {
      const listeners = this.listeners.get(kind) ?? new Set();
      this.listeners.set(kind, listeners.add(listener));
    }
  }

  /**
   * @param {string} kind
   * @param {any} [message]
   */
  tell(kind, message) {
    for (const listener of this.listeners.get(kind) ?? []) listener(message);
  }

  /**
   * @param {string} [id] Of an arm; the chosen one where none is named.
   * @returns {ArmRecord}
   */
  record(id = this.chosen) {
    let record = this.records.get(id);
    if (!record) {
      record = emptyRecord();
      this.records.set(id, record);
    }
    return record;
  }

  /** @returns {ArmInfo|null} The chosen arm. */
  arm() {
    return this.arms.find((arm) => arm.id === this.chosen) ?? null;
  }

  /** @returns {boolean} Whether this page may command arms now. */
  hasControl() {
    return this.control.you && this.welcome?.may === 'command';
  }

  /**
   * Age of the newest joint sample as of now, s: what the server said, its way here, and the time since then.
   *
   * @param {string} [id]
   * @returns {number} Infinity: none has come.
   */
  age(id) {
    const { state, stateAt, late } = this.record(id);
    if (!state || state.age === null || state.age === undefined) return Infinity;
    return state.age + this.lateness.way + this.lateness.beyond(late) + (performance.now() - stateAt) / 1000;
  }

  /** @param {number} way Of a message from the server to here, s: half of the quickest of the newest round trips. */
  takeWay(way) {
    this.lateness.takeWay(way);
  }

  /**
   * @param {string} [id]
   * @returns {number} The age without what the round trips of the link explain, s.
   */
  ageButWay(id) {
    return this.age(id) - this.lateness.way;
  }

  /**
   * @param {string} [id]
   * @returns {Record<string, any>} What is kept with a point: model, tool and frames as they are now, and the time.
   */
  frames(id = this.chosen) {
    const { state } = this.record(id);
    const about = { model: this.arms.find((arm) => arm.id === id)?.model, tool: state?.tool?.base && { p: state.tool.base.p, r: state.tool.base.r },
      tool_number: state?.tool_id, user_number: state?.user_id, taken: Date.now() / 1000 };
    return Object.fromEntries(Object.entries(about).filter(([, value]) => value !== null && value !== undefined));
  }

  /**
   * @param {string} [id]
   * @returns {boolean} Whether what is shown is the present.
   */
  isFresh(id) {
    return this.record(id).state?.fresh === true && this.age(id) <= STALE_S;
  }

  /**
   * @param {string} [id]
   * @returns {boolean} Whether states come as they should, and only the way of the link makes them old.
   */
  isSlow(id) {
    return this.record(id).state?.fresh === true && !this.isFresh(id) && this.ageButWay(id) <= STALE_S;
  }

  /**
   * @param {string} [id]
   * @returns {boolean} Whether the newest state, which comes as it should, shows that the arm moves.
   */
  moves(id) {
    const { state } = this.record(id);
    if (state?.fresh !== true) return false;
    return state.status?.in_motion === true || (state.dq?.some((speed) => Math.abs(speed) > REST_RAD_S) ?? false);
  }

  /**
   * @param {string} [id]
   * @returns {boolean} Whether the newest state shows that the arm rests, however long ago it came.
   */
  showsRest(id) {
    const { state } = this.record(id);
    return state?.fresh === true && Boolean(state.dq) && !this.moves(id);
  }

  /**
   * @param {string} [id]
   * @returns {boolean} Whether the newest state, which comes as it should, shows that the arm rests.
   */
  rests(id) {
    return this.showsRest(id) && this.ageButWay(id) <= STALE_S;
  }

  /** @param {string} id */
  choose(id) {
    if (id === this.chosen) return;
    this.chosen = id;
    this.drawn = null;
    this.tell('chosen', id);
  }

  /** @param {any} message */
  take(message) {
    const record = message.arm ? this.record(message.arm) : null;
    switch (message.t) {
      case 'welcome':
        this.welcome = message;
        this.records.clear();
        this.lateness.clear();
        this.drawn = null;
        this.jogFraction = message.jog?.fraction ?? 0.1;
        this.control = message.control ?? this.control;
        this.takeArms(message.arms ?? []);
        break;
      case 'arms': this.takeArms(message.arms); break;
      case 'control': this.control = message; break;
      case 'jog_speed': this.jogFraction = message.fraction; break;
      case 'state':
        if (record && !(record.state && record.state.n >= message.n)) {
          record.state = message;
          record.stateAt = performance.now();
          record.late = this.lateness.take(message.now);
        }
        break;
      case 'io': if (record) record.io = message; break;
      case 'diag': if (record) record.diagnostics = message.status; break;
      case 'alarms': if (record) record.alarms = message.alarms; break;
      case 'alarm': if (record) record.alarms = withItem(record.alarms, message.alarm, ALARMS); break;
      case 'calls': if (record) record.calls = message.calls; break;
      case 'call': if (record) record.calls = withItem(record.calls, message.call, CALLS); break;
      case 'moves': if (record) record.moves = message.moves; break;
      case 'move': if (record) record.moves = withItem(record.moves, message.move, MOVES); break;
      case 'by_hand': if (record) record.byHand = message.outputs; break;
      case 'program': if (record) record.program = message; break;
      default:
    }
    this.tell(message.t, message);
  }

  /** @param {ArmInfo[]} arms */
  takeArms(arms) {
    this.arms = arms;
    if (!arms.some((arm) => arm.id === this.chosen)) {
      const next = arms.find((arm) => arm.alive) ?? arms[0];
      if (next) this.choose(next.id);
    }
  }
}

/**
 * A list with one item more, or with that item in the place of the one of the same number.
 *
 * @template {{n: number}} T
 * @param {T[]} list Oldest first.
 * @param {T} item
 * @param {number} longest
 * @returns {T[]}
 */
export function withItem(list, item, longest) {
  const place = list.findIndex((one) => one.n === item.n);
  const next = place < 0 ? [...list, item] : list.map((one, index) => (index === place ? item : one));
  return next.slice(-longest);
}
