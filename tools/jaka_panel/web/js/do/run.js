/** Runs of more than one motion: through stored points, again what a log holds, and programs of the controller. */
import { h, replaceText, setText } from '../ui/dom.js';
import { DEGREES, fixed } from '../ui/format.js';
import { actionButton, numberField, readAll } from '../ui/field.js';
import { sentenceOf } from '../ui/errors.js';
import { toast } from '../ui/toast.js';
import { timedPoints } from './points.js';
import { makeListRun } from '../cell/lists.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {import('../link/messages.js').Plan} Plan */

/** The speed at which the arm goes to the place where a plan begins, rad/s. */
const TO_START = 20 / DEGREES;

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountRun(root, app) {
  const runner = makeRunner(app);
  root.append(makePointRun(app, runner.plan), makeListRun(app, runner), makeLogRun(app, runner.plan), runner.element, makePrograms(app));
}

/**
 * @typedef {object} Runner
 * @property {(cmd: string, args: Record<string, any>) => Promise<void>} plan Has the arm that is shown plan something, and takes it.
 * @property {() => void} drop Takes the plan away.
 * @property {HTMLElement} element
 */

/**
 * Make the runner of a plan: its way is drawn, and it is run by its name, so that what was drawn is what is run. It
 * goes with the arm for which it was made and with the server's greeting, and an answer that comes after that is of
 * something else.
 *
 * @param {App} app
 * @returns {Runner}
 */
function makeRunner(app) {
  /** @type {Plan|null} */
  let plan = null;
  let asked = 0;
  const said = h('p', { class: 'said', role: 'status', t: 'run.none' });
  const warnings = h('ul', { class: 'warnings' });
  const toStart = actionButton('run.to_start', async () => {
    if (!plan) {
      toast('run.none', 'bad');
      return;
    }
    const sent = plan;
    app.preview.ghost(sent.start);
    await app.command('joint_move', { q: sent.start, speed: TO_START });
    if (plan === sent) app.preview.ghost(null);
  }, { 'data-needs': 'move' });
  const run = actionButton('run.run', async () => {
    if (!plan) {
      toast('run.none', 'bad');
      return;
    }
    const sent = plan;
    setText(said, 'run.under_way');
    const answer = await app.command('plan_run', { plan: sent.plan });
    if (plan === sent) setText(said, answer.ok ? 'run.done' : 'run.ended', { why: sentenceOf(answer.message) });
  }, { class: 'needs-control go', 'data-needs': 'run', 'data-leads': '' });
  const drop = h('button', { type: 'button', t: 'move.drop', on: { click: () => take(null) } });

  /** @param {Plan|null} next */
  function take(next) {
    asked += 1;
    plan = next;
    app.preview.path(plan ? plan.path : null);
    app.preview.ghost(plan ? plan.end : null);
    warnings.replaceChildren(...(plan?.warnings ?? []).map((text) => h('li', {}, text)));
    if (plan) setText(said, 'run.planned', { s: fixed(plan.duration, 1) });
    else setText(said, 'run.none');
    app.offer = plan ? 'run' : (app.offer === 'run' ? null : app.offer);
    app.offers.look();
  }

  app.store.on('chosen', () => take(null));
  app.store.on('welcome', () => {  // the server may be another one, which knows nothing of it
    asked += 1;
    if (plan) take(null);
  });
  return { drop: () => take(null), async plan(cmd, args) {
    const number = ++asked;
    const answer = await app.command(cmd, args, { quiet: true });
    if (number === asked) take(answer.ok ? answer.data : null);
  }, element: h('section', { class: 'card' }, h('h3', { t: 'run.plan' }), said, warnings,
    h('div', { class: 'buttons' }, toStart, run, drop)) };
}

/**
 * @param {App} app
 * @param {Runner['plan']} plan
 */
function makePointRun(app, plan) {
  const { store, points } = app;
  const speed = numberField({ label: 'move.speed', unit: '°/s', scale: DEGREES, value: 20, low: 1, high: 90, decimals: 0 });
  /** Names, in the order in which they are passed. @type {string[]} */
  let way = [];
  const order = h('p', { class: 'way' });
  const choices = h('div', { class: 'buttons' });
  const empty = h('p', { class: 'empty', t: 'points.none' });

  function draw() {
    const all = points.list(store.chosen);
    way = way.filter((name) => all.some((point) => point.name === name));
    empty.hidden = all.length > 0;
    choices.replaceChildren(...all.map((point) => h('button', { type: 'button', on: { click: () => {
      way.push(point.name);
      draw();
    } } }, `+ ${point.name}`)));
    if (way.length) {
      order.removeAttribute('data-t');
      replaceText(order, way.join(' → '));
    } else {
      setText(order, 'run.no_way');
    }
  }

  const planButton = actionButton('run.make_plan', async () => {
    const from = store.record().state?.q;
    const [value] = readAll([speed]) ?? [];
    if (value === undefined) return;
    if (!from || way.length === 0) {
      toast('run.no_way', 'bad');
      return;
    }
    const all = points.list(store.chosen);
    const joints = way.map((name) => /** @type {number[]} */ (all.find((point) => point.name === name)?.q));
    await plan('plan_points', { points: timedPoints([from, ...joints], value) });
  }, { 'data-needs': 'plan' });
  const clear = h('button', { type: 'button', t: 'run.clear', on: { click: () => {
    way = [];
    draw();
  } } });
  store.on('points chosen welcome', draw);
  draw();
  return h('section', { class: 'card' }, h('h3', { t: 'run.points' }), empty, choices, order,
    h('div', { class: 'buttons' }, speed.element, planButton, clear));
}

/**
 * @param {App} app
 * @param {Runner['plan']} plan
 */
function makeLogRun(app, plan) {
  const { store } = app;
  const select = /** @type {HTMLSelectElement} */ (h('select', { id: 'log-file' }));
  const speed = numberField({ label: 'run.log_speed', unit: '%', scale: 100, value: 50, low: 5, high: 100, decimals: 0 });
  const none = h('p', { class: 'empty', t: 'run.no_logs' });
  const list = h('button', { type: 'button', t: 'run.list', on: { click: () => void fill() } });
  const planButton = actionButton('run.make_plan', async () => {
    const [value] = readAll([speed]) ?? [];
    if (value === undefined) return;
    if (!select.value) {
      toast('run.no_logs', 'bad');
      return;
    }
    await plan('plan_log', { file: select.value, speed: value });
  }, { 'data-needs': 'plan' });

  async function fill() {
    if (!store.welcome?.logs || store.welcome.may === 'watch') return;
    const answer = await app.ask('logs', {}, null);
    const logs = answer.data?.logs ?? [];
    select.replaceChildren(...logs.map((/** @type {any} */ log) => h('option', { value: log.file },
      `${log.file} (${fixed(log.size / 1e6, 1)} MB)`)));
    none.hidden = logs.length > 0;
  }

  store.on('welcome', () => void fill());
  return h('section', { class: 'card' }, h('h3', { t: 'run.log' }), none,
    h('div', { class: 'buttons' }, h('label', { for: 'log-file', t: 'run.file' }), select, list),
    h('div', { class: 'buttons' }, speed.element, planButton));
}

/** @param {App} app */
function makePrograms(app) {
  const { store } = app;
  const name = /** @type {HTMLInputElement} */ (h('input', { type: 'text', id: 'program-name', maxlength: 100, autocomplete: 'off' }));
  const said = h('p', { class: 'said' });
  const load = actionButton('program.load', () => app.command('program_load', { name: name.value }), { 'data-needs': 'program_load' });
  const buttons = ['play', 'pause', 'resume', 'stop'].map((what) => actionButton(`program.${what}`, () => app.command(`program_${what}`),
    { 'data-needs': `program_${what}`, 'data-leads': what === 'resume' ? '' : null }));
  const card = h('section', { class: 'card' }, h('h3', { t: 'program.title' }),
    h('div', { class: 'buttons' }, h('label', { for: 'program-name', t: 'program.name' }), name, load),
    h('div', { class: 'buttons' }, ...buttons), said);

  function draw() {
    const { program } = store.record();
    card.hidden = store.arm()?.has?.programs === false;
    const state = `program.state.${program?.state ?? 'unknown'}`;
    setText(said, 'program.now', { state: app.say(app.isText(state) ? state : 'program.state.unknown'), name: program?.program || '–',
      reason: program?.reason ?? '' });
  }

  store.on('program chosen arms welcome', draw);
  draw();
  return card;
}
