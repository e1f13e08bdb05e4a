/** The right to command: what this page may do, who holds control, and the question when another page asks for it. */
import { byId, h, replaceText, setText } from '../ui/dom.js';
import { toast } from '../ui/toast.js';

/** @typedef {import('../app.js').App} App */

/** @param {App} app */
export function mountControl(app) {
  const { store, connection } = app;
  const said = byId('control-said');
  const button = byId('control-button');
  const question = byId('take-over');
  const questionText = h('p', { id: 'take-over-text' });
  const give = h('button', { type: 'button', t: 'control.give',
    on: { click: () => connection.write({ t: 'answer_control', give: true }) } });
  const keep = h('button', { type: 'button', t: 'control.keep',
    on: { click: () => connection.write({ t: 'answer_control', give: false }) } });
  question.append(questionText, h('div', { class: 'buttons' }, give, keep));
  let isAsking = false;

  button.addEventListener('click', async () => {
    if (store.welcome?.may !== 'command') {
      toast(`may.${store.welcome?.why || 'no token'}`.replaceAll(' ', '_').replaceAll('-', '_'), 'bad');
      return;
    }
    if (store.control.you) {
      connection.write({ t: 'release_control' });
      return;
    }
    const answer = await connection.request({ t: 'take_control' }, 5);
    if (answer.pending) isAsking = true;
    else if (!answer.ok) toast(answer.message, 'bad', 'control.label');
    show();
  });

  function show() {
    const { holder, you, asked } = store.control;
    const may = store.welcome?.may === 'command';
    const why = (store.welcome?.why || 'no token').replaceAll(' ', '_').replaceAll('-', '_');
    document.body.dataset.may = store.hasControl() ? 'control' : (may ? 'take' : 'watch');
    if (!store.welcome) setText(said, 'control.connecting');
    else if (!may) setText(said, `may.${why}`);
    else if (you) setText(said, 'control.yours');
    else if (holder) setText(said, 'control.other', { name: holder.name });
    else setText(said, 'control.nobody');
    setText(button, you ? 'control.release' : (holder ? 'control.ask' : 'control.take'));
    button.hidden = !may;
    if (you || !asked) isAsking = isAsking && Boolean(asked);
    showQuestion(you, asked);
  }

  /**
   * @param {boolean} you
   * @param {{page: string, name: string, until: number}|null} asked
   */
  function showQuestion(you, asked) {
    const isMine = Boolean(asked && asked.page === store.welcome?.page);
    const isShown = Boolean(asked);
    const wasHidden = question.hidden;
    question.hidden = !isShown;
    give.hidden = keep.hidden = !you;
    if (!asked) return;
    const rest = Math.max(0, Math.ceil(asked.until - connection.serverNow));
    const key = you ? 'control.question' : (isMine || isAsking ? 'control.waiting' : 'control.others_ask');
    setText(questionText, key, { name: asked.name, rest });
    if (wasHidden && you) {
      app.hold?.end('control asked');
      keep.focus();
    }
  }

  store.on('welcome control arms', show);
  store.on('pong', () => {
    if (store.control.asked) show();
  });
  store.on('error', (message) => {
    if (message.code === 'control_refused') toast('control.refused', 'bad');
    else toast(message.message ?? message.code, 'bad');
  });
  show();
  app.afterMount(show);
}

/**
 * Keeps what may not be pressed now from acting, and says why; and Enter that is held from pressing a button more than
 * once: browsers click it with each repetition, which would give a command again, and answer what it asks.
 *
 * @param {App} app
 */
export function guardControls(app) {
  /** @param {Event} event */
  const guard = (event) => {
    const target = event.target instanceof Element ? event.target.closest('.needs-control') : null;
    const button = target?.getAttribute('data-needs') ?? 'command';
    if (!target || !app.offers.against(button)) return;
    event.preventDefault();
    event.stopPropagation();
    app.mayDo(button);
  };
  for (const kind of ['click', 'change', 'input', 'submit']) window.addEventListener(kind, guard, { capture: true });
  window.addEventListener('keydown', (event) => {
    if (event.key !== 'Enter' || !event.repeat || !(event.target instanceof Element)) return;
    if (event.target.closest('button:not(#stop)')) event.preventDefault();
  }, { capture: true });
}

/**
 * The chosen arm, and those there are.
 *
 * @param {App} app
 */
export function mountArmChoice(app) {
  const { store } = app;
  const select = /** @type {HTMLSelectElement} */ (byId('arm'));
  const simulated = byId('simulated');
  const alone = byId('arm-name');

  function show() {
    const ids = store.arms.map((arm) => arm.id);
    if ([...select.options].map((option) => option.value).join('\n') !== ids.join('\n')) {
      select.replaceChildren(...store.arms.map((arm) => h('option', { value: arm.id }, arm.label || arm.id)));
    }
    select.value = store.chosen;
    const arm = store.arm();
    select.hidden = ids.length < 2;
    alone.hidden = ids.length >= 2;
    if (arm) replaceText(alone, [arm.label || arm.id, arm.model].filter(Boolean).join(' · '));
    else setText(alone, 'arm.none');
    simulated.hidden = typeof arm?.simulated !== 'boolean';
    if (!simulated.hidden) setText(simulated, arm?.simulated ? 'arm.simulated' : 'arm.real');
    simulated.classList.toggle('real', arm?.simulated === false);
  }

  select.addEventListener('change', () => store.choose(select.value));
  store.on('welcome arms chosen', show);
  show();
}
