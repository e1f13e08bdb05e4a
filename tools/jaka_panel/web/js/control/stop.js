/**
 * STOP: the button that is always there, and the space bar wherever the focus is. In a text field the space bar types,
 * and Escape stops. It needs no control, and goes by HTTP, too, where the WebSocket does not answer. The page says that
 * the arm rests when the arm's own states show it, and after a second without that to use the emergency stop button.
 */
import { byId, setAttribute, setText } from '../ui/dom.js';
import { toast } from '../ui/toast.js';
import { postStop, takeOver } from './first_stop.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {import('../link/messages.js').Answer} Answer */

const ANSWER_S = 0.2;
const CONFIRM_S = 1;
const GIVE_UP_S = 5;

/** @param {App} app */
export function mountStop(app) {
  const button = byId('stop');
  const said = byId('stop-said');
  let presses = 0;
  /** Server's clock when the newest stop was served, s. */
  let servedAt = Infinity;
  let isConfirmed = false;
  /** "Confirmed at rest" is what is said now. */
  let isRestSaid = false;

  /** @returns {Promise<Answer>} Of the first way that succeeds, else why none did; within GIVE_UP_S and a little. */
  function served() {
    const bySocket = app.connection.request({ t: 'stop', arm: null }, GIVE_UP_S);
    const late = new Promise((resolve) => setTimeout(resolve, ANSWER_S * 1000));
    const byHttp = Promise.race([bySocket, late]).then((answer) => (answer?.ok ? answer : postStop(app.connection.token)));
    return new Promise((resolve) => {
      for (const way of [bySocket, byHttp]) {
        void way.then((answer) => {
          if (answer.ok) resolve(answer);
        });
      }
      void Promise.all([bySocket, byHttp]).then(([, answer]) => resolve(answer));
    });
  }

  /** @returns {boolean} Whether the server refuses stops of this page, which has no token that counts. */
  function isRefused() {
    const { welcome } = app.store;
    return welcome?.may === 'watch' && welcome.why !== 'read-only';
  }

  /** STOP looks like what it is: on a page without the token, a button that stops nothing. */
  function showAbility() {
    const isWithout = isRefused();
    button.classList.toggle('unable', isWithout);
    setAttribute(button, 'aria-disabled', isWithout ? 'true' : null);
    if (presses === 0) sayHint();
  }

  function sayHint() {
    say(isRefused() ? 'stop.unable' : 'stop.hint', false);
  }

  /** Take back what was said of the arm, as soon as it is not true any more. */
  function takeBack() {
    if (isRestSaid) sayHint();
  }

  /** @param {string} key @param {boolean} isBad */
  function say(key, isBad) {
    isRestSaid = false;
    setText(said, key);
    said.classList.toggle('bad', isBad);
  }

  async function stop() {
    const press = ++presses;
    servedAt = Infinity;
    isConfirmed = false;
    app.hold?.end('stopped');
    button.classList.add('pressed');
    say(isRefused() ? 'stop.no_token' : 'stop.sent', isRefused());  // and tried all the same
    setTimeout(() => {
      if (press !== presses || isConfirmed) return;
      button.classList.remove('pressed');
      say(isRefused() ? 'stop.no_token' : 'stop.unconfirmed', true);
    }, CONFIRM_S * 1000);
    const answer = await served();
    if (press !== presses) return;
    button.classList.remove('pressed');
    if (answer.ok) {
      // by a POST it is served while the socket may stand still, whose newest message is old by then
      servedAt = answer.now ?? app.connection.serverNow + app.connection.silence();
      return;
    }
    say(isRefused() ? 'stop.no_token' : 'stop.unconfirmed', true);
    toast(answer.message || 'stop.failed', 'bad', 'stop.label');
  }

  app.store.on('welcome', showAbility);
  app.store.on('state', (state) => {
    if (state.arm !== app.store.chosen) return;
    if (!app.store.showsRest()) takeBack();
    if (!app.store.rests()) return;
    if (!(state.now - state.age > servedAt)) return;  // a sample of before the stop says nothing
    servedAt = Infinity;
    isConfirmed = true;
    say(app.store.arms.length > 1 ? 'stop.done_one' : 'stop.done', false);
    isRestSaid = true;
  });
  app.store.on('chosen', takeBack);
  app.store.on('link', () => {
    if (app.connection.state !== 'open') takeBack();
  });

  const first = takeOver(() => void stop());
  if (first) {  // pressed before the page was there: the arm's states say how it ended
    presses = 1;
    say('stop.unconfirmed', true);
    void first.then((answer) => {
      if (presses === 1 && answer.ok) servedAt = answer.now ?? Infinity;
    });
  }
}
