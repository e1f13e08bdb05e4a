/** The page's language: all texts stand in i18n/en.js and i18n/zh.js, by the same keys. */
import { en } from '../../i18n/en.js';
import { zh } from '../../i18n/zh.js';
import { keep } from './keep.js';

/** @type {Record<string, Record<string, string>>} */
const LANGUAGES = { en, zh };
const KEPT_AS = 'jaka-panel-language';

let language = 'en';

/** The languages that there are, by code. */
export const languages = Object.keys(LANGUAGES);

/** @returns {string} The code of the language that holds. */
export function currentLanguage() {
  return language;
}

/**
 * The language to begin with: the one chosen last in this browser, else the browser's own, else English.
 *
 * @param {Storage|null} storage
 * @param {readonly string[]} wanted Codes such as `zh-CN`, best first.
 * @returns {string}
 */
export function firstLanguage(storage, wanted) {
  const kept = storage?.getItem(KEPT_AS);
  const codes = [kept ?? '', ...wanted.map((code) => code.split('-')[0])];
  return codes.find((code) => languages.includes(code)) ?? 'en';
}

/**
 * Chooses the language of what is said from now on.
 *
 * @param {string} code
 * @param {Storage|null} [storage] Where the choice is kept.
 */
export function chooseLanguage(code, storage) {
  language = languages.includes(code) ? code : 'en';
  keep(storage, KEPT_AS, language);
}

/**
 * A text in the page's language; a key without one shows itself.
 *
 * @param {string} key
 * @param {Record<string, string|number>} [values] For places such as `{name}`.
 * @returns {string}
 */
export function translate(key, values = {}) {
  const text = LANGUAGES[language][key] ?? en[key] ?? key;
  return text.replace(/\{(\w+)\}/g, (place, name) => (name in values ? String(values[name]) : place));
}

/**
 * Return whether the languages have a text for a key.
 *
 * @param {string} key
 * @returns {boolean}
 */
export function isKnown(key) {
  return key in en;
}
