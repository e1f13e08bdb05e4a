/** Names of inputs and outputs, where the cell has given them some. */

/** @typedef {import('../app.js').App} App */

/**
 * @param {App} app
 * @param {string} bank
 * @param {string} kind
 * @param {number} index
 * @returns {string} Empty where there is none.
 */
export function nameOf(app, bank, kind, index) {
  const cell = /** @type {any} */ (app).cell;
  return cell?.entry('io', app.store.chosen, `${bank}.${kind}.${index}`)?.label ?? '';
}

/**
 * A terminal as people call it: `Cabinet DO 3`.
 *
 * @param {(key: string) => string} say
 * @param {string} bank
 * @param {string} kind
 * @param {number|string} index
 * @returns {string} In the language that `say` speaks now.
 */
export function terminalWords(say, bank, kind, index) {
  return `${say(`io.bank.${bank}`)} ${kind.toUpperCase()} ${index}`;
}
