/** The values that the browser keeps for the next time. It may keep nothing, full or by its settings: nothing else may fail by that. */

/**
 * Keeps a value, or does nothing where the browser keeps none.
 *
 * @param {Storage|null|undefined} storage
 * @param {string} key
 * @param {string} value
 */
export function keep(storage, key, value) {
  try {
    storage?.setItem(key, value);
  } catch {
    // it holds until the page is closed
  }
}
