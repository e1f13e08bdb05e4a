/** Light and dark: as the system has it, or as somebody chose. */
import { keep } from './keep.js';

const KEPT_AS = 'jaka-panel-theme';
const ORDER = ['auto', 'light', 'dark'];

/**
 * Applies a theme and keeps it.
 *
 * @param {string} theme `auto`, `light` or `dark`.
 * @param {Storage|null} storage
 */
export function chooseTheme(theme, storage) {
  if (theme === 'auto') document.documentElement.removeAttribute('data-theme');
  else document.documentElement.setAttribute('data-theme', theme);
  keep(storage, KEPT_AS, theme);
  window.dispatchEvent(new Event('themechange'));
}

/**
 * @param {Storage|null} storage
 * @returns {string} The theme that was chosen last.
 */
export function keptTheme(storage) {
  const kept = storage?.getItem(KEPT_AS) ?? '';
  return ORDER.includes(kept) ? kept : 'auto';
}

/**
 * A colour of the style sheets, such as `--text`, as it is now.
 *
 * @param {string} name
 * @returns {string}
 */
export function themeColour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** @returns {boolean} Whether the page is dark now. */
export function isDark() {
  const chosen = document.documentElement.getAttribute('data-theme');
  return chosen ? chosen === 'dark' : matchMedia('(prefers-color-scheme: dark)').matches;
}

/**
 * Calls back when the colours change, by the switch or by the system.
 *
 * @param {() => void} listener
 */
export function onThemeChange(listener) {
  window.addEventListener('themechange', listener);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', listener);
}
