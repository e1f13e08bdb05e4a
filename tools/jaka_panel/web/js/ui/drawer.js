/** The drawer at the foot of the page: plots and lists, as high as it was left, or closed to its bar. */
import { byId, h, setAttribute, setText } from './dom.js';
import { keep } from './keep.js';

const KEPT_AS = 'jaka-panel-drawer';
/** Lowest height of an open drawer, px. */
export const LOWEST = 120;
/** Share of the window that it may take. */
const MOST = 0.6;
const STEP = 40;
/** Windows at least so high have it open at first, px, and its height then as a share of them. */
const ROOMY = 960;
const SHARE = 0.27;

/**
 * Height of the drawer to begin with, px; 0: closed.
 *
 * @param {string|null} kept What was kept from the last time.
 * @param {number} room Height of the window, px.
 * @returns {number}
 */
export function firstHeight(kept, room) {
  const read = kept === null || kept.trim() === '' ? NaN : Number(kept);
  return Number.isFinite(read) ? within(read, room) : (room >= ROOMY ? Math.round(SHARE * room) : 0);
}

/**
 * A height that an open drawer can have, px; 0, closed, for what is less than half of the lowest.
 *
 * @param {number} height px
 * @param {number} room Height of the window, px.
 * @returns {number}
 */
export function within(height, room) {
  if (height < LOWEST / 2) return 0;
  return Math.round(Math.max(LOWEST, Math.min(MOST * room, height)));
}

/**
 * @param {Storage|null} storage
 * @param {Element} tabs The row of tabs that is seen in the bar; a press of one opens the drawer.
 * @param {Element} news What the bar shows of the news while the drawer is closed.
 */
export function mountDrawer(storage, tabs, news) {
  const root = byId('drawer');
  const edge = byId('drawer-edge');
  const body = byId('drawer-body');
  let height = 0;
  /** Height to open to, px. */
  let last = Math.max(LOWEST, Math.round(SHARE * window.innerHeight));
  const toggle = h('button', { type: 'button', class: 'plain', 'aria-controls': 'drawer-body', on: { click: () => {
    set(height ? 0 : last);
  } } });
  byId('drawer-bar').append(toggle, tabs, news);
  for (const [name, value] of Object.entries({ role: 'separator', tabindex: '0', 'aria-orientation': 'horizontal',
    'aria-controls': 'drawer-body', 'aria-valuemin': '0', 'aria-valuemax': '100' })) edge.setAttribute(name, value);
  edge.setAttribute('data-t-label', 'drawer.edge');

  /**
   * @param {number} wanted px
   * @param {boolean} [isKept]
   */
  function set(wanted, isKept = true) {
    height = within(wanted, window.innerHeight);
    if (height) last = height;
    root.style.setProperty('--drawer', `${height}px`);
    body.hidden = height === 0;
    /** @type {HTMLElement} */ (news).hidden = height > 0;
    setText(toggle, height ? 'drawer.close' : 'drawer.open');
    setAttribute(toggle, 'aria-expanded', String(height > 0));
    setAttribute(edge, 'aria-valuenow', String(Math.round((100 * height) / window.innerHeight)));
    if (isKept) keep(storage, KEPT_AS, String(height));
  }

  tabs.addEventListener('click', () => {
    if (!height) set(last);
  });
  edge.addEventListener('pointerdown', (event) => {
    if (event.button !== 0) return;
    event.preventDefault();
    edge.focus();
    edge.setPointerCapture(event.pointerId);
    const from = event.clientY + height;
    const drag = (/** @type {PointerEvent} */ move) => set(from - move.clientY);
    edge.addEventListener('pointermove', drag);
    for (const end of ['pointerup', 'pointercancel']) edge.addEventListener(end, () => edge.removeEventListener('pointermove', drag), { once: true });
  });
  edge.addEventListener('keydown', (event) => {
    const wanted = /** @type {Record<string, number>} */ ({ ArrowUp: Math.max(LOWEST, height + STEP), ArrowDown: height - STEP,
      Home: MOST * window.innerHeight, End: 0 })[event.key];
    if (wanted === undefined) return;
    event.preventDefault();
    set(event.key === 'ArrowDown' && height > LOWEST ? Math.max(LOWEST, wanted) : wanted);
  });
  edge.addEventListener('dblclick', () => set(height ? 0 : last));
  window.addEventListener('resize', () => set(height, false));
  let kept = null;
  try {
    kept = storage?.getItem(KEPT_AS) ?? null;
  } catch {
    // as above
  }
  set(firstHeight(kept, window.innerHeight), false);
}
