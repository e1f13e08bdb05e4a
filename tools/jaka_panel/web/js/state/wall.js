/** The view that is read from across the room: what the arm does, who moves it, how fast, which program, and the last alarm. */
import { h, replaceText, setAttribute, setText } from '../ui/dom.js';
import { sentenceOf } from '../ui/errors.js';
import { fixed } from '../ui/format.js';
import { timeOfDay } from './events.js';
import { readStates } from './status.js';

/** @typedef {import('../app.js').App} App */

const NAMES = ['motion', 'owner', 'speed', 'program', 'alarm'];

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountWall(root, app) {
  const { store } = app;
  const words = Object.fromEntries(NAMES.map((name) => [name, h('dd', { class: 'mark' })]));
  root.append(h('dl', {}, ...NAMES.map((name) => h('div', { 'data-wall': name }, h('dt', { t: `wall.${name}` }), words[name]))));

  /**
   * @param {string} name
   * @param {string} word Key of a text, or a text.
   * @param {string} mark
   */
  function say(name, word, mark = '') {
    const isOld = !store.isFresh() && name !== 'alarm';
    if (isOld && word !== 'state.unknown') setText(words[name], 'state.was', { was: app.isText(word) ? app.say(word) : word });
    else if (app.isText(word)) setText(words[name], word);
    else {
      words[name].removeAttribute('data-t');
      replaceText(words[name], word);
    }
    setAttribute(words[name], 'data-mark', isOld ? 'old' : (mark || null));
  }

  function show() {
    if (root.hidden) return;
    const { state, program, alarms } = store.record();
    const states = readStates(state);
    const [motion, mark] = states.motion;
    say('motion', store.moves() && mark === 'ok' ? 'motion.running' : motion, mark);
    say('owner', states.owner[0] === 'state.nobody' && store.moves() ? 'owner.unknown' : states.owner[0]);
    say('speed', state?.speed === null || state?.speed === undefined ? 'state.unknown' : `${fixed(100 * state.speed, 0)} %`, states.speed[1]);
    const key = `program.state.${program?.state ?? 'unknown'}`;
    say('program', [program?.program, app.isText(key) ? app.say(key) : ''].filter(Boolean).join(': '));
    const last = alarms.filter((one) => one.level !== 'info').at(-1);
    if (!last) say('alarm', 'alarms.none');
    else {
      say('alarm', `${timeOfDay(last.wall).slice(0, 5)} ${last.code ?? ''} ${sentenceOf(last.text)}`,
        last.until === null || last.until === undefined ? (last.level === 'error' ? 'bad' : 'warn') : '');
    }
  }

  app.onFrame(show);
  setInterval(show, 200);
}
