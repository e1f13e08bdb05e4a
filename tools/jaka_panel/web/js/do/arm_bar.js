/** What brings the arm to life and to rest: power, enable, recover, clear, pause and resume, and its speed. */
import { h, replaceText, setAttribute, setText } from '../ui/dom.js';
import { actionButton } from '../ui/field.js';

/** @typedef {import('../app.js').App} App */

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountArmBar(root, app) {
  const { store } = app;
  const isPowered = () => store.record().state?.robot?.power === 1;
  const isEnabled = () => store.record().state?.enabled === true;
  const power = actionButton('do.power_on', () => app.command('power', { on: !isPowered() }));
  const enable = actionButton('do.enable', () => app.command('enable', { on: !isEnabled() }));
  const recover = actionButton('do.recover', () => app.command('recover'), { class: 'needs-control', 'data-t-title': 'do.recover.hint' });
  const clear = actionButton('do.clear_err', () => app.command('clear_err'));
  const pause = actionButton('do.pause', () => app.command('pause'));
  const resume = actionButton('do.resume', () => app.command('resume'));
  const slider = /** @type {HTMLInputElement} */ (h('input', { type: 'range', min: 1, max: 100, step: 1, value: 100,
    id: 'speed-slider', class: 'needs-control' }));
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

  app.onFrame((state) => {
    setText(power, isPowered() ? 'do.power_off' : 'do.power_on');
    setText(enable, isEnabled() ? 'do.disable' : 'do.enable');
    enable.classList.toggle('primary', isPowered() && !isEnabled());
    power.classList.toggle('primary', state?.robot?.power === 0);
    const { in_error: inError, e_stopped: isStopped } = state?.status ?? {};
    recover.classList.toggle('primary', Boolean(inError) && !isStopped);
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
