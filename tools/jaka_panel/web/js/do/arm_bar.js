/** The buttons that bring the arm to life and to rest: power, enable, recover, clear, pause and resume, and its speed. */
import { h, replaceText, setAttribute, setText } from '../ui/dom.js';
import { actionButton } from '../ui/field.js';

/** @typedef {import('../app.js').App} App */

/**
 * A button that may lead on: then it stands out.
 *
 * @param {string} label Key of its text.
 * @param {string} needs Its name in state/line.js.
 * @param {() => Promise<any>} act
 */
function leading(label, needs, act) {
  return actionButton(label, act, { 'data-needs': needs, 'data-leads': '' });
}

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountArmBar(root, app) {
  const { store } = app;
  const isPowered = () => store.record().state?.robot?.power === 1;
  const isEnabled = () => store.record().state?.enabled === true;
  const power = leading('do.power_on', 'power_on', () => app.command('power', { on: !isPowered() }));
  const enable = leading('do.enable', 'enable', () => app.command('enable', { on: !isEnabled() }));
  const recover = leading('do.recover', 'recover', () => app.command('recover'));
  const clear = leading('do.clear_err', 'clear_err', () => app.command('clear_err'));
  const pause = leading('do.pause', 'pause', () => app.command('pause'));
  const resume = leading('do.resume', 'resume', () => app.command('resume'));
  const slider = /** @type {HTMLInputElement} */ (h('input', { type: 'range', min: 1, max: 100, step: 1, value: 100,
    id: 'speed-slider', class: 'needs-control', 'data-needs': 'speed' }));
  const speed = h('output', { for: 'speed-slider' }, '–');
  let isSliding = false;

  slider.addEventListener('input', () => {
    isSliding = true;
    replaceText(speed, `${slider.value} %`);
  });
  slider.addEventListener('change', async () => {
    await app.command('speed', { fraction: Number(slider.value) / 100 });
    isSliding = false;
  });
  slider.addEventListener('blur', () => {
    isSliding = false;
  });
  const speedField = h('div', { class: 'field wide' }, h('label', { for: 'speed-slider', t: 'do.speed' }), slider, speed);
  root.append(h('div', { class: 'buttons' }, power, enable, recover, clear, pause, resume), speedField);

  /**
   * A button of two states, which does the other one.
   *
   * @param {HTMLElement} button
   * @param {string} label Key of its text.
   */
  function turn(button, label) {
    setText(button, label);
    const name = label.slice(3);
    if (button.getAttribute('data-needs') === name) return;
    button.setAttribute('data-needs', name);
    app.offers.lock(button);
  }

  app.onFrame((state) => {
    turn(power, isPowered() ? 'do.power_off' : 'do.power_on');
    turn(enable, isEnabled() ? 'do.disable' : 'do.enable');
    speedField.hidden = store.arm()?.has?.speed === false;
    recover.hidden = store.arm()?.has?.recover === false;
    if (!isSliding && state && state.speed !== null && state.speed !== undefined) {
      const percent = String(Math.round(state.speed * 100));
      if (slider.value !== percent) slider.value = percent;
      replaceText(speed, `${percent} %`);
    }
    setAttribute(slider, 'aria-valuetext', speed.textContent);
  });
}
