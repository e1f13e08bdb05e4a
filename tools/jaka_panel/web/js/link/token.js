/** The token of the page's address: `#token=...`. It leaves the address at once, so that no screenshot shows it. */
import { keep } from '../ui/keep.js';

const KEPT_AS = 'jaka-panel-token';

/**
 * The token of the address, else the one that this tab had before it was loaded again.
 *
 * @param {{hash: string, pathname: string, search: string}} location
 * @param {{replaceState: (data: any, unused: string, url: string) => void}} history
 * @param {Storage|null} storage Of this tab alone.
 * @returns {string|null}
 */
export function takeToken(location, history, storage) {
  const given = new URLSearchParams(location.hash.replace(/^#/, '')).get('token');
  if (given) {
    keep(storage, KEPT_AS, given);
    history.replaceState(null, '', location.pathname + location.search);
    return given;
  }
  return storage?.getItem(KEPT_AS) ?? null;
}
