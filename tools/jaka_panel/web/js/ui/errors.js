/** Errors of the operating system, as sentences: nobody beside an arm knows their numbers. */
import { translate } from './i18n.js';

/** Keys of the sentences by the numbers that Linux gives. @type {Record<string, string>} */
const SENTENCES = {
  2: 'error.no_file', 13: 'error.not_allowed', 28: 'error.disk_full', 32: 'error.closed', 98: 'error.in_use', 101: 'error.no_way',
  104: 'error.closed', 110: 'error.no_answer', 111: 'error.refused', 112: 'error.no_way', 113: 'error.no_way',
};
const PATTERN = /\[Errno (-?\d+)\] ?(?:Connect call failed \('([^']+)', (\d+)\)|[A-Z][\w'’ -]*)?/g;

/**
 * A foreign text with each `[Errno 111] ...` in it as a sentence.
 *
 * @param {string} text
 * @returns {string}
 */
export function sentenceOf(text) {
  return text.replace(PATTERN, (whole, number, host, port) => {
    const key = SENTENCES[number];
    const place = host ? ` (${host}:${port})` : '';
    return key ? translate(key) + place : whole.replace(/^\[Errno -?\d+\] ?/, '');
  });
}
