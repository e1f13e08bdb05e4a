/**
 * STOP: the button that is always there, and the space bar wherever the focus is. In a text field the space bar types,
 * and Escape stops. It needs no control, waits for nothing, and goes by HTTP where the WebSocket does not answer.
 */
import { byId, setText } from '../ui/dom.js';
import { toast } from '../ui/toast.js';

/** @typedef {import('../app.js').App} App */

const ANSWER_S = 0.3;

/**
 * Whether the space bar belongs to the element: fields for words. Numbers have no spaces.
 *
 * @param {EventTarget|null} target
 * @returns {boolean}
 */
export function takesSpaces(target) {
  if (!(target instanceof HTMLElement)) return false;
  if (target.isContentEditable || target.tagName === 'TEXTAREA') return true;
  return target instanceof HTMLInputElement && ['text', 'search', 'url', 'email', 'password'].includes(target.type)
    && target.inputMode !== 'decimal' && target.inputMode !== 'numeric';
}

/** @param {App} app */
export function mountStop(app) {
  const button = byId('stop');
  const said = byId('stop-said');
  let presses = 0;

  async function stop() {
    const press = ++presses;
    app.hold?.end('stopped');
    button.classList.add('pressed');
    setText(said, 'stop.sent');
    const byHttp = async () => {
      const response = await fetch('/api/stop', { method: 'POST',
        headers: { Authorization: `Bearer ${app.connection.token ?? ''}` } });
      const text = await response.text();
      let answer = { ok: response.ok, message: text };
      try {
        answer = JSON.parse(text);
      } catch {
        // what is no JSON is shown as it is
      }
      return { ok: response.ok && answer.ok !== false, message: answer.message || text };
    };
    let answer = await app.connection.request({ t: 'stop', arm: null }, ANSWER_S);
    if (!answer.ok && ['link.gone', 'link.no_answer'].includes(answer.message)) {
      answer = await byHttp().catch(() => ({ ok: false, message: 'stop.unreachable' }));
    }
    if (press !== presses) return;
    button.classList.remove('pressed');
    setText(said, answer.ok ? 'stop.done' : 'stop.failed');
    said.classList.toggle('bad', !answer.ok);
    if (!answer.ok) toast(answer.message || 'stop.failed', 'bad', 'stop.label');
  }

  button.addEventListener('pointerdown', (event) => {
    if (event.button === 0) void stop();
  });
  button.addEventListener('click', (event) => {
    if (event.detail === 0) void stop();  // by keyboard or screen reader; a pointer has stopped at its pressing
  });
  window.addEventListener('keydown', (event) => {
    const isTyping = takesSpaces(event.target);
    if (!(isTyping ? event.key === 'Escape' : event.code === 'Space')) return;
    event.preventDefault();
    event.stopPropagation();
    if (!event.repeat) void stop();
  }, { capture: true });
  window.addEventListener('keyup', (event) => {  // browsers click a button when the space bar goes up
    if (event.code === 'Space' && !takesSpaces(event.target)) {
      event.preventDefault();
      event.stopPropagation();
    }
  }, { capture: true });
}
