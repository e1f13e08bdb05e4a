/** Fields for numbers, with their units, that say what is wrong with what was typed. */
import { h, setAttribute } from './dom.js';
import { fixed, typedNumber } from './format.js';
import { toast } from './toast.js';

let made = 0;

/**
 * @typedef {object} NumberField
 * @property {HTMLElement} element
 * @property {HTMLInputElement} input
 * @property {() => number} value In the unit of the wire; NaN where no number stands there, or one out of range.
 * @property {(value: number) => void} set In the unit of the wire.
 * @property {(value: number) => string} textOf A value of the wire as the field shows it, without its unit.
 * @property {(value: number) => boolean} shows Whether the field stands as it shows this value of the wire.
 * @property {string} label
 * @property {string} unit
 * @property {HTMLElement} note Beside the field, for what is to be said of it.
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
  const note = h('span', { class: 'note', hidden: true });
  const textOf = (/** @type {number} */ one) => fixed(one * scale, decimals);
  const check = () => setAttribute(input, 'aria-invalid', input.value !== '' && Number.isNaN(read()) ? 'true' : null);
  input.addEventListener('input', () => {
    check();
    onChange?.();
  });
  return {
    element: h('div', { class: 'field' }, h('label', isKey ? { for: id, t: label } : { for: id }, isKey ? null : label),
      input, h('span', { class: 'unit' }, unit), note),
    input, label, unit, note, textOf,
    shows: (one) => Math.abs(typedNumber(input.value) - Number(textOf(one))) < 1e-9,
    value: () => read() / scale,
    set(next) {
      input.value = textOf(next);
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

/**
 * Values of fields, or null, with the focus in the first one that holds no number.
 *
 * @param {NumberField[]} fields
 * @returns {number[]|null}
 */
export function readAll(fields) {
  const values = fields.map((field) => field.value());
  const wrong = values.findIndex((value) => Number.isNaN(value));
  if (wrong < 0) return values;
  fields[wrong].input.setAttribute('aria-invalid', 'true');
  fields[wrong].input.focus();
  toast('field.wrong', 'bad');
  return null;
}
