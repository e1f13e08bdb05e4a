/**
 * A button that asks before it acts: the second press within some seconds does it, where that is still what was asked.
 * The second half of a double click is no answer: nobody has read the question by then.
 */
import { h, setText } from '../ui/dom.js';

const ASKED_MS = 6000;

/**
 * @param {string} label Key of its text.
 * @param {string} question Key of the text that asks.
 * @param {() => Promise<any>} act
 * @param {{values?: () => Record<string, string|number>, needs?: string}} [options] `values`: all that says what is done,
 *   the question's among them: where they are others at the second press, it is asked again; `needs`: its name in state/line.js, where it is a command to the arm.
 * @returns {HTMLButtonElement}
 */
export function twiceButton(label, question, act, { values = () => ({}), needs = '' } = {}) {
  /** Values of the question that stands; null: none does. @type {string|null} */
  let asked = null;
  /** @type {any} */
  let timer = null;
  const button = /** @type {HTMLButtonElement} */ (h('button', { type: 'button', t: label,
    class: needs ? 'needs-control' : null, 'data-needs': needs || null,
    on: { click: (/** @type {MouseEvent} */ event) => void press(event) } }));

  function rest() {
    clearTimeout(timer);
    asked = null;
    button.classList.remove('primary');
    setText(button, label);
  }

  /** @param {MouseEvent} event */
  async function press(event) {
    if (asked !== null && event.detail > 1) return;
    const now = values();
    const isSame = asked === JSON.stringify(now);
    rest();
    if (isSame) {
      await act();
      return;
    }
    asked = JSON.stringify(now);
    button.classList.add('primary');
    setText(button, question, now);
    timer = setTimeout(rest, ASKED_MS);
  }

  return button;
}
