/** Fields for numbers, with their units, that say what is wrong with what was typed. */
import { h, setAttribute } from './dom.js';
import { fixed, typedNumber } from './format.js';

let made = 0;

/**
 * @typedef {object} NumberField
 * @property {HTMLElement} element
 * @property {HTMLInputElement} input
 * @property {() => number} value In the unit of the wire; NaN where no number stands there, or one out of range.
 * @property {(value: number) => void} set In the unit of the wire.
 */

/**
 * A field for a number. It is a text field, so that a comma is a decimal point, too, and the wheel changes nothing.
 *
 * @param {object} options
 * @param {string} options.label Key, or a text as it is, such as `J1`.
 * @param {string} options.unit As it is shown.
 * @param {number} [options.scale] Shown value per unit of the wire.
 * @param {number} [options.decimals]
 * @param {number} [options.value] Shown at the beginning.
 * @param {number} [options.low] Shown values.
 * @param {number} [options.high]
 * @param {() => void} [options.onChange]
 * @returns {NumberField}
 */
export function numberField({ label, unit, scale = 1, decimals = 2, value, low = -Infinity, high = Infinity, onChange }) {
  made += 1;
  const id = `field-${made}`;
  const isKey = label.includes('.');
  const input = /** @type {HTMLInputElement} */ (h('input', { type: 'text', inputmode: 'decimal', id, autocomplete: 'off',
    spellcheck: 'false', value: value === undefined ? '' : String(value) }));
  /** @returns {number} */
  const read = () => {
    const typed = typedNumber(input.value);
    return typed >= low && typed <= high ? typed : NaN;
  };
  const check = () => setAttribute(input, 'aria-invalid', input.value !== '' && Number.isNaN(read()) ? 'true' : null);
  input.addEventListener('input', () => {
    check();
    onChange?.();
  });
  return {
    element: h('div', { class: 'field' }, h('label', isKey ? { for: id, t: label } : { for: id }, isKey ? null : label),
      input, h('span', { class: 'unit' }, unit)),
    input,
    value: () => read() / scale,
    set(next) {
      input.value = fixed(next * scale, decimals);
      check();
    },
  };
}

/**
 * A button that is busy until what it began has ended.
 *
 * @param {string} label Key of its text.
 * @param {() => Promise<any>} act
 * @param {Record<string, any>} [attributes]
 * @returns {HTMLButtonElement}
 */
export function actionButton(label, act, attributes = {}) {
  const button = /** @type {HTMLButtonElement} */ (h('button', { type: 'button', class: 'needs-control', t: label, ...attributes }));
  button.addEventListener('click', async () => {
    if (button.getAttribute('aria-busy') === 'true') return;
    setAttribute(button, 'aria-busy', 'true');
    try {
      await act();
    } finally {
      setAttribute(button, 'aria-busy', null);
    }
  });
  return button;
}
