/** The joints, each as a number and as a bar between its limits. */
import { h, replaceText, setAttribute } from '../ui/dom.js';
import { DEGREES, fixed } from '../ui/format.js';

/** @typedef {import('../app.js').App} App */

/** A joint is near its limit within this distance, rad. */
const NEAR = 5 / DEGREES;

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountJoints(root, app) {
  const rows = [0, 1, 2, 3, 4, 5].map((index) => {
    const needle = h('div', { class: 'needle' });
    const bar = h('div', { class: 'bar', role: 'meter', 'aria-label': `J${index + 1}`, 'aria-valuemin': -360,
      'aria-valuemax': 360, 'aria-valuenow': 0 }, needle);
    const degrees = h('td', { class: 'number' });
    const radians = h('td', { class: 'number second' });
    const speed = h('td', { class: 'number second' });
    const low = h('span', {});
    const high = h('span', {});
    const element = h('tr', {}, h('th', { scope: 'row' }, `J${index + 1}`), degrees,
      h('td', { class: 'bar-cell' }, bar, h('div', { class: 'limits' }, low, high)), radians, speed);
    return { element, needle, bar, degrees, radians, speed, low, high };
  });
  root.append(h('table', { class: 'joints' },
    h('thead', {}, h('tr', {}, h('th', { scope: 'col', t: 'joints.joint' }), h('th', { scope: 'col', class: 'number' }, '°'),
      h('th', { scope: 'col', t: 'joints.range' }), h('th', { scope: 'col', class: 'number second' }, 'rad'),
      h('th', { scope: 'col', class: 'number second' }, '°/s'))),
    h('tbody', {}, ...rows.map((row) => row.element))));

  function showLimits() {
    const joints = app.store.arm()?.joints;
    rows.forEach((row, index) => {
      const joint = joints?.[index];
      replaceText(row.low, joint ? `${fixed(joint.lower * DEGREES, 0)}°` : '');
      replaceText(row.high, joint ? `${fixed(joint.upper * DEGREES, 0)}°` : '');
      if (joint) {
        setAttribute(row.bar, 'aria-valuemin', fixed(joint.lower * DEGREES, 0));
        setAttribute(row.bar, 'aria-valuemax', fixed(joint.upper * DEGREES, 0));
      }
    });
  }

  app.onFrame((state) => {
    const joints = app.store.arm()?.joints;
    rows.forEach((row, index) => {
      const q = state?.q?.[index];
      replaceText(row.degrees, fixed(q === undefined ? null : q * DEGREES, 2));
      replaceText(row.radians, fixed(q, 4));
      const dq = state?.dq?.[index];
      replaceText(row.speed, fixed(dq === undefined ? null : dq * DEGREES, 1));
      const joint = joints?.[index];
      row.needle.hidden = q === undefined || !joint;
      if (q === undefined || !joint) return;
      const share = Math.max(0, Math.min(1, (q - joint.lower) / (joint.upper - joint.lower)));
      row.needle.style.left = `${(100 * share).toFixed(2)}%`;
      row.bar.classList.toggle('near', q - joint.lower < NEAR || joint.upper - q < NEAR);
      setAttribute(row.bar, 'aria-valuenow', fixed(q * DEGREES, 0));
    });
  });
  app.store.on('arms welcome chosen', showLimits);
  showLimits();
}
