/**
 * Elements of the page. Every text, ours or foreign, becomes a text node: nothing here parses markup, so a name such as
 * `<script>` is shown as it is written.
 */
import { translate } from './i18n.js';

/** @typedef {Record<string, any>} Attributes */

/**
 * An element with attributes, listeners and children.
 *
 * @param {string} tag
 * @param {Attributes} [attributes] `class`, `id`, `aria-..`; `on` holds listeners; `t` is the key of its text and
 *   `tLabel` that of its accessible name, both kept in the page's language; `false` and `null` leave an attribute out.
 * @param {...(Node|string|number|null|undefined)} children
 * @returns {HTMLElement}
 */
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === false || value === null || value === undefined) continue;
    if (name === 'on') {
      for (const [kind, listener] of Object.entries(value)) element.addEventListener(kind, listener);
    } else if (name === 't') {
      setText(element, value);
    } else if (name === 'tLabel') {
      setLabel(element, value);
    } else {
      element.setAttribute(name, value === true ? '' : String(value));
    }
  }
  element.append(...children.filter((child) => child !== null && child !== undefined).map((child) => (
    child instanceof Node ? child : document.createTextNode(String(child)))));
  return element;
}

/**
 * Shows a text of the page's language, now and after a change of the language.
 *
 * @param {Element} element
 * @param {string} key
 * @param {Record<string, string|number>} [values] For the text's places in braces.
 */
export function setText(element, key, values) {
  element.setAttribute('data-t', key);
  if (values) element.setAttribute('data-t-values', JSON.stringify(values));
  else element.removeAttribute('data-t-values');
  replaceText(element, translate(key, values));
}

/**
 * Names an element for screen readers, in the page's language; a pointer that rests on it shows the name, too.
 *
 * @param {Element} element
 * @param {string} key
 */
export function setLabel(element, key) {
  element.setAttribute('data-t-label', key);
  const text = translate(key);
  element.setAttribute('aria-label', text);
  if (element.tagName === 'BUTTON') element.setAttribute('title', text);
}

/**
 * Shows a text as it is, of whatever language or origin; touches the page only where it differs.
 *
 * @param {Element} element
 * @param {string} text
 */
export function replaceText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/**
 * Shows nothing, now and after a change of the language.
 *
 * @param {Element} element
 */
export function clearText(element) {
  element.removeAttribute('data-t');
  replaceText(element, '');
}

/** Says every text of the page again, in the language that now holds. */
export function retranslate() {
  for (const element of document.querySelectorAll('[data-t]')) {
    const values = element.getAttribute('data-t-values');
    replaceText(element, translate(element.getAttribute('data-t') ?? '', values ? JSON.parse(values) : undefined));
  }
  for (const element of document.querySelectorAll('[data-t-label]')) {
    setLabel(element, element.getAttribute('data-t-label') ?? '');
  }
}

/**
 * The element with an id, which the page has.
 *
 * @param {string} id
 * @returns {HTMLElement}
 */
export function byId(id) {
  const element = document.getElementById(id);
  if (!element) throw new Error(`the page has no element ${id}`);
  return element;
}

/**
 * Sets or takes away a class, an attribute's value, or whether a control can be used, without needless changes.
 *
 * @param {Element} element
 * @param {string} name
 * @param {string|null} value null takes the attribute away.
 */
export function setAttribute(element, name, value) {
  if (value === null) {
    if (element.hasAttribute(name)) element.removeAttribute(name);
  } else if (element.getAttribute(name) !== value) {
    element.setAttribute(name, value);
  }
}
