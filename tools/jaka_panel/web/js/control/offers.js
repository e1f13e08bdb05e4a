/** Shows what may be pressed now, why not, and which button stands out: as the line at the top has it, and nothing else. */
import { setAttribute } from '../ui/dom.js';
import { lineOf, reasonAgainst } from '../state/line.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {import('../state/line.js').Facts} Facts */
/** @typedef {import('../state/line.js').Line} Line */

const LOOK_MS = 200;
/** A part of the state that is older than this is not known, s. */
const OLD_S = 1;
const PAUSED = 1;
const EMERGENCY = 2;
const ERROR = 4;

/**
 * @param {App} app
 * @returns {Facts}
 */
export function factsOf(app) {
  const { store, connection } = app;
  const { state, diagnostics, program } = store.record();
  const arm = store.arm();
  const robot = known(state?.robot);
  const status = known(state?.status);
  const link = diagnostics.find((one) => one.name === 'controller link');
  const owner = state?.owner && state.owner !== 'nobody' ? state.owner : '';
  return {
    link: connection.state, may: store.welcome?.may ?? null,
    control: store.hasControl() ? 'you' : (store.control.holder ? 'other' : 'free'),
    arm: arm ? (arm.alive ? 'alive' : 'dead') : 'none',
    isFresh: store.isFresh(), isSlow: store.isSlow(), age: store.age(),
    isControllerLost: link?.level === 2 && !store.isFresh(),
    stopped: either(status?.e_stopped, robot ? robot.motion === EMERGENCY : null),
    collided: robot ? robot.collision === 1 : null,
    faulted: either(status?.in_error, robot ? robot.motion === ERROR : null),
    powered: robot ? robot.power === 1 : (status?.drives_powered ?? null),
    enabled: state?.enabled ?? null, guided: state?.hand_guiding ?? null,
    isPaused: robot?.motion === PAUSED, moves: store.moves(), owner,
    program: program?.state === 'loading' ? 'running' : (program?.state ?? 'unknown'), speed: state?.speed ?? null,
    canRecover: arm?.has?.recover !== false, offer: app.offer,
  };
}

/**
 * @template {{age?: number|null}} T
 * @param {T|null|undefined} part
 * @returns {T|null}
 */
function known(part) {
  return part && (part.age ?? 0) <= OLD_S ? part : null;
}

/**
 * @param {boolean|null|undefined} one
 * @param {boolean|null} other
 * @returns {boolean|null} True where one of both says so; null where neither is known.
 */
function either(one, other) {
  return one || other ? true : (one ?? other);
}

export class Offers {
  /** @param {App} app */
  constructor(app) {
    this.app = app;
    /** @type {Line|null} */
    this.line = null;
    this.shown = '';
  }

  start() {
    setInterval(() => this.look(), LOOK_MS);
    this.app.store.on('welcome control arms diag program chosen link', () => this.look());
    this.app.store.on('chosen-language', () => this.lockAll());
    this.app.onFrame(() => this.look());
  }

  /** Reckons the line anew, and shows it where it is another one. */
  look() {
    const line = lineOf(factsOf(this.app));
    const text = JSON.stringify(line);
    if (text === this.shown) return;
    this.shown = text;
    this.line = line;
    this.lockAll();
    this.app.store.tell('line', line);
  }

  lockAll() {
    for (const element of document.querySelectorAll('.needs-control')) this.lock(element);
  }

  /**
   * Shows whether an element may be pressed, with the reason as its title, and whether it is the one that stands out.
   *
   * @param {Element} element
   */
  lock(element) {
    const name = element.getAttribute('data-needs') ?? 'command';
    const reason = this.line ? (name in this.line.may ? this.line.may[name] : this.line.may.command) : 'why.link';
    setAttribute(element, 'aria-disabled', reason ? 'true' : null);
    const title = reason ? this.app.say(reason) : (element.hasAttribute('data-t-label') ? element.getAttribute('aria-label') : null);
    setAttribute(element, 'title', title);
    element.classList.toggle('primary', this.line?.button === name && !reason && element.hasAttribute('data-leads'));
  }

  /**
   * Return the reason why a button may not be pressed at this moment.
   *
   * @param {string} name
   * @returns {string|null} Key of a text.
   */
  against(name) {
    return reasonAgainst(factsOf(this.app), name);
  }
}
