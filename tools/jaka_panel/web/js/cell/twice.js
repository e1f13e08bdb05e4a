/** A button that asks before it acts: the second press within some seconds does it. */
import { h, setText } from '../ui/dom.js';

const ASKED_MS = 6000;

/**
 * @param {string} label Key of its text.
 * @param {string} question Key of the text that asks.
 * @param {() => Promise<any>} act
 * @param {{values?: () => Record<string, string|number>, needs?: string}} [options] `values`: for the question;
 *   `needs`: its name in state/line.js, where it is a command to the arm.
 * @returns {HTMLButtonElement}
 */
export function twiceButton(label, question, act, { values = () => ({}), needs = '' } = {}) {
  let isAsked = false;
  /** @type {any} */
  let timer = null;
  const button = /** @type {HTMLButtonElement} */ (h('button', { type: 'button', t: label,
    class: needs ? 'needs-control' : null, 'data-needs': needs || null, on: { click: () => void press() } }));

  function rest() {
    clearTimeout(timer);
    isAsked = false;
    button.classList.remove('primary');
    setText(button, label);
  }

  async function press() {
    if (isAsked) {
      rest();
      await act();
      return;
    }
    isAsked = true;
    button.classList.add('primary');
    setText(button, question, values());
    timer = setTimeout(rest, ASKED_MS);
  }

  return button;
}
