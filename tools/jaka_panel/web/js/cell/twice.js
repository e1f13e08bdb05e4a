/** A button that asks before it acts: the second press within some seconds does it. */
import { h, setText } from '../ui/dom.js';

const ASKED_MS = 6000;

/**
 * @param {string} label Key of its text.
 * @param {string} question Key of the text that asks.
 * @param {() => Promise<any>} act
 * @param {{values?: () => Record<string, string|number>, needsControl?: boolean}} [options] `values`: for the question.
 * @returns {HTMLButtonElement}
 */
export function twiceButton(label, question, act, { values = () => ({}), needsControl = false } = {}) {
  let isAsked = false;
  /** @type {any} */
  let timer = null;
  const button = /** @type {HTMLButtonElement} */ (h('button', { type: 'button', t: label,
    class: needsControl ? 'needs-control' : null, on: { click: () => void press() } }));

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
