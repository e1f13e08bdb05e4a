/**
 * The STOP button, from the page's first moment on: this module imports nothing, so that no file that is late or
 * missing takes STOP with it. Until the page takes it over a press goes by POST, and is said to be not confirmed.
 */

/** @typedef {import('../link/messages.js').Answer} Answer */

const GIVE_UP_S = 5;
/** The text of `stop.unconfirmed`, which stands in files that may not be there yet. */
export const UNCONFIRMED = /** @type {Record<string, string>} */ ({
  en: 'NOT CONFIRMED: use the emergency stop button', zh: '停止未确认：请按急停按钮' });

/** @type {Promise<Answer>|null} */
let answered = null;
let press = stopByPost;

/**
 * Return whether the space bar belongs to the element: fields for words. Numbers have no spaces.
 *
 * @param {EventTarget|null} target
 * @returns {boolean}
 */
export function takesSpaces(target) {
  if (!(target instanceof HTMLElement)) return false;
  if (target.isContentEditable || target.tagName === 'TEXTAREA') return true;
  return target instanceof HTMLInputElement && ['text', 'search', 'url', 'email', 'password'].includes(target.type)
    && target.inputMode !== 'decimal' && target.inputMode !== 'numeric';
}

/**
 * Stops all arms by HTTP.
 *
 * @param {string|null} token
 * @returns {Promise<Answer>}
 */
export async function postStop(token) {
  const limit = new AbortController();
  const timer = setTimeout(() => limit.abort(), GIVE_UP_S * 1000);
  try {
    const response = await fetch('/api/stop', { method: 'POST', signal: limit.signal,
      headers: { Authorization: `Bearer ${token ?? ''}` } });
    const text = await response.text();
    return response.ok ? JSON.parse(text) : { ok: false, message: text };
  } catch {
    return { ok: false, message: 'stop.unreachable' };
  } finally {
    clearTimeout(timer);
  }
}

/**
 * Gives the presses from now on to the page.
 *
 * @param {() => void} handler
 * @returns {Promise<Answer>|null} Of the newest press that came before; null: there was none.
 */
export function takeOver(handler) {
  press = handler;
  return answered;
}

/**
 * @param {'localStorage'|'sessionStorage'} storage
 * @param {string} key
 * @returns {string|null}
 */
function kept(storage, key) {
  try {
    return window[storage].getItem(key);
  } catch {
    return null;
  }
}

/** @returns {string} In the language that the page will have. */
function unconfirmed() {
  const codes = [kept('localStorage', 'jaka-panel-language') ?? '', ...navigator.languages.map((code) => code.split('-')[0])];
  return UNCONFIRMED[codes.find((code) => code in UNCONFIRMED) ?? 'en'];
}

function stopByPost() {
  answered = postStop(token);
  const said = document.getElementById('stop-said');
  said?.setAttribute('data-t', 'stop.unconfirmed');
  said?.replaceChildren(unconfirmed());
  said?.classList.add('bad');
}

// read before the page takes it out of the address
const token = new URLSearchParams(location.hash.replace(/^#/, '')).get('token') ?? kept('sessionStorage', 'jaka-panel-token');
const button = document.getElementById('stop');
button?.addEventListener('pointerdown', (event) => {
  if (event.button === 0) press();
});
button?.addEventListener('click', (event) => {
  if (event.detail === 0) press();  // by keyboard or screen reader; a pointer has stopped at its pressing
});
window.addEventListener('keydown', (event) => {
  const isTyping = takesSpaces(event.target);
  if (!(isTyping ? event.key === 'Escape' : event.code === 'Space')) return;
  event.preventDefault();
  event.stopPropagation();
  if (!event.repeat) press();
}, { capture: true });
window.addEventListener('keyup', (event) => {  // browsers click a button when the space bar goes up
  if (event.code === 'Space' && !takesSpaces(event.target)) {
    event.preventDefault();
    event.stopPropagation();
  }
}, { capture: true });
// from here on it does what it looks like
button?.classList.remove('unable');
button?.removeAttribute('aria-disabled');
