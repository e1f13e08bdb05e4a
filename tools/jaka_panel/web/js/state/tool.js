/** The pose of the tool: mm and degrees, and m and rad as ROS has them. */
import { h, replaceText, setText } from '../ui/dom.js';
import { DEGREES, fixed, rpyFromRotationVector } from '../ui/format.js';

/** @typedef {import('../app.js').App} App */

const AXES = ['X', 'Y', 'Z'];

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountTool(root, app) {
  const cells = [0, 1, 2].map(() => [0, 1, 2, 3].map((column) => h('td', { class: column % 2 ? 'number second' : 'number' })));
  const frame = h('span', {});
  const wrench = h('p', { class: 'wrench', hidden: true });
  root.append(h('table', { class: 'tool' },
    h('caption', {}, frame),
    h('thead', {}, h('tr', {}, h('td', {}), h('th', { scope: 'col', class: 'number' }, 'mm'), h('th', { scope: 'col', class: 'number second' }, 'm'),
      h('td', {}), h('th', { scope: 'col', class: 'number', t: 'tool.rpy' }), h('th', { scope: 'col', class: 'number second', t: 'tool.vector' }))),
    h('tbody', {}, ...cells.map((row, index) => h('tr', {}, h('th', { scope: 'row' }, AXES[index]), row[0], row[1],
      h('th', { scope: 'row' }, `R${AXES[index].toLowerCase()}`), row[2], row[3])))), wrench);

  app.onFrame((state) => {
    const tool = state?.tool;
    const rpy = tool ? rpyFromRotationVector(tool.r) : null;
    cells.forEach((row, index) => {
      replaceText(row[0], fixed(tool ? tool.p[index] * 1000 : null, 2));
      replaceText(row[1], fixed(tool?.p[index], 5));
      replaceText(row[2], fixed(rpy ? rpy[index] * DEGREES : null, 2));
      replaceText(row[3], fixed(tool?.r[index], 4));
    });
    setText(frame, 'tool.frame', { frame: tool?.frame ?? '–', tool: state?.tool_id ?? '–', user: state?.user_id ?? '–' });
    wrench.hidden = !state?.wrench;
    if (state?.wrench) {
      const { f, t } = state.wrench;
      replaceText(wrench, `F ${f.map((value) => fixed(value, 1)).join(' ')} N   M ${t.map((value) => fixed(value, 2)).join(' ')} N m`);
    }
  });
}
