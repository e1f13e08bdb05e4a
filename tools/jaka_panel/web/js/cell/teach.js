/** Teaching: a user frame by three points, the tip of a tool by four poses; both with their error, kept for the cell. */
import { h, setText } from '../ui/dom.js';
import { DEGREES, fixed, rpyFromRotationVector } from '../ui/format.js';
import { numberField, readAll } from '../ui/field.js';
import { toast } from '../ui/toast.js';
import { guideButton } from '../do/setup.js';
import { twiceButton } from './twice.js';

/** @typedef {import('../app.js').App} App */

const MOST_POSES = 20;
const LEAST_POSES = 4;
const LONGEST = 60;
/** Error above which a result is shown as doubtful, m. */
const DOUBTFUL_M = 0.001;
const MM = 1000;

/**
 * @typedef {object} Pose
 * @property {number[]} p m
 * @property {number[]} r rad
 */

/**
 * @typedef {object} Taken Where the arm rested when a pose was taken.
 * @property {number[]} q rad
 * @property {Pose} tool
 * @property {Pose} flange
 * @property {string} model
 */

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountTeach(root, app) {
  root.append(makeGuiding(app), makeUserFrame(app), makeTool(app));
}

/** @param {App} app */
function makeGuiding(app) {
  return h('section', { class: 'card' }, h('p', { class: 'hint', t: 'teach.hint' }), h('div', { class: 'buttons' }, guideButton(app)));
}

/**
 * @param {App} app
 * @returns {Promise<Taken|null>} Where the arm rests now, as the server has it; null, with the reason shown, elsewhere.
 */
async function takePose(app) {
  const answer = await app.ask('present_pose', {});
  if (answer.ok && answer.data) return answer.data;
  toast(answer.message || 'points.no_state', 'bad', 'teach.take');
  return null;
}

/**
 * @param {number[]} p m
 * @returns {string}
 */
function millimetres(p) {
  return `${p.map((value) => fixed(value * MM, 1)).join(' / ')} mm`;
}

/**
 * Make the part that shows what was computed, and keeps it for the cell or sets it on the controller.
 *
 * @param {App} app
 * @param {object} options
 * @param {'user_frames'|'tool_frames'} options.section
 * @param {'user_frame'|'tool_frame'} options.cmd
 * @param {number} options.highest Number of a frame.
 */
function makeResult(app, { section, cmd, highest }) {
  /** @type {any} */
  let entry = null;
  const said = h('p', { class: 'said', role: 'status' });
  const error = h('p', { class: 'mark' });
  const name = /** @type {HTMLInputElement} */ (h('input', { type: 'text', id: `teach-${cmd}-name`, maxlength: LONGEST, autocomplete: 'off' }));
  const number = numberField({ label: 'setup.number', unit: `1–${highest}`, decimals: 0, value: 1, low: 1, high: highest });
  const keep = h('button', { type: 'button', t: 'teach.keep', on: { click: () => void store() } });
  const set = twiceButton('teach.keep_and_set', 'teach.set_sure', async () => {
    const [chosen] = readAll([number]) ?? [];
    const { chosen: arm } = app.store;
    const kept = entry;
    if (!kept || chosen === undefined || !await store()) return;
    await app.command(cmd, { number: Math.round(chosen), p: kept.p, r: kept.r }, { arm });  // those of the press
  }, { needs: 'setting', values: () => ({ number: number.input.value, name: name.value, taken: entry?.taken ?? 0 }) });
  const element = h('div', { hidden: true }, said, error,
    h('div', { class: 'buttons' }, h('label', { for: name.id, t: 'points.name' }), name, keep),
    h('div', { class: 'buttons' }, number.element, set));

  /** @returns {Promise<boolean>} Whether it is kept. */
  async function store() {
    const typed = name.value.trim();
    if (!entry || !typed) {
      toast('teach.name_first', 'bad', 'teach.keep');
      name.focus();
      return false;
    }
    const chosen = number.value();
    const answer = await app.cell.change([{ section, arm: app.store.chosen, name: typed,
      entry: { ...entry, ...(Number.isNaN(chosen) ? {} : { number: Math.round(chosen) }) } }]);
    toast(answer.ok ? 'cmd.done' : (answer.message || 'cmd.failed'), answer.ok ? 'good' : 'bad', 'teach.keep');
    return answer.ok;
  }

  /** @returns {string} A name that no frame of the arm has. */
  function freeName() {
    let count = 1;
    while (app.cell.entry(section, app.store.chosen, app.say(`teach.name.${section}`, { n: count }))) count += 1;
    return app.say(`teach.name.${section}`, { n: count });
  }

  return {
    element,
    /**
     * @param {any} next What is kept; null where nothing is computed.
     * @param {string} [errorKey] Text about its error.
     * @param {Record<string, string|number>} [values]
     */
    show(next, errorKey = '', values = {}) {
      entry = next;
      element.hidden = next === null;
      if (!next) return;
      name.value ||= freeName();
      const turn = rpyFromRotationVector(next.r).map((value) => fixed(value * DEGREES, 2)).join(' / ');
      setText(said, 'teach.result', { p: millimetres(next.p), r: `${turn} °` });
      setText(error, errorKey, values);
      error.setAttribute('data-mark', next.residual === undefined || Math.max(next.residual, next.uncertainty ?? 0) > DOUBTFUL_M ? 'warn' : 'ok');
    },
  };
}

/** @param {App} app */
function makeUserFrame(app) {
  const names = ['origin', 'x_axis', 'plane', 'check'];
  /** @type {(Taken|null)[]} */
  let taken = [null, null, null, null];
  let asked = 0;
  const places = names.map(() => h('span', { class: 'second' }));
  const refused = h('p', { class: 'warnings', role: 'alert' });
  const result = makeResult(app, { section: 'user_frames', cmd: 'user_frame', highest: 10 });
  const rows = names.map((name, n) => h('li', {}, h('span', { class: 'point-name', t: `teach.point.${name}` }), places[n],
    h('button', { type: 'button', t: 'teach.take', 'data-point': name, on: { click: () => void take(n) } })));
  const clear = h('button', { type: 'button', t: 'run.clear', on: { click: () => forget() } });

  function forget() {
    taken = [null, null, null, null];
    void compute();
  }

  /** @param {number} n */
  async function take(n) {
    const arm = app.store.chosen;
    const pose = await takePose(app);
    if (!pose || arm !== app.store.chosen) return;
    taken[n] = pose;
    await compute();
  }

  async function compute() {
    asked += 1;
    const number = asked;
    places.forEach((place, n) => { place.textContent = taken[n] ? millimetres(/** @type {Taken} */ (taken[n]).tool.p) : '–'; });
    refused.textContent = '';
    result.show(null);
    const there = taken.filter((pose) => pose !== null);
    if (!taken[0] || !taken[1] || !taken[2]) return;
    const points = there.map((pose) => pose.tool.p);
    const answer = await app.ask('teach_user_frame', { points }, null);
    if (number !== asked) return;
    if (!answer.ok) {
      refused.textContent = answer.message;
      return;
    }
    const { p, r, residual, turn } = answer.data;
    const kept = { p, r, points, model: there[0].model, taken: Date.now() / 1000, ...(residual === null ? {} : { residual }) };
    result.show(kept, residual === null ? 'teach.frame_unchecked' : 'teach.frame_error',
      { mm: residual === null ? '' : fixed(residual * MM, 2), turn: fixed(turn * DEGREES, 2) });
  }

  app.store.on('chosen', forget);
  void compute();
  return h('section', { class: 'card', id: 'teach-frame' }, h('h3', { t: 'teach.user_frame' }), h('p', { class: 'hint', t: 'teach.user_frame.hint' }),
    h('ul', { class: 'points' }, ...rows), h('div', { class: 'buttons' }, clear), refused, result.element);
}

/** @param {App} app */
function makeTool(app) {
  /** @type {Taken[]} */
  let poses = [];
  let asked = 0;
  const list = h('ol', { class: 'points' });
  const refused = h('p', { class: 'warnings', role: 'alert' });
  const result = makeResult(app, { section: 'tool_frames', cmd: 'tool_frame', highest: 11 });
  const take = h('button', { type: 'button', t: 'teach.take', on: { click: () => void add() } });
  const clear = h('button', { type: 'button', t: 'run.clear', on: { click: () => forget() } });

  function forget() {
    poses = [];
    void compute();
  }

  async function add() {
    const arm = app.store.chosen;
    if (poses.length >= MOST_POSES) return;
    const pose = await takePose(app);
    if (!pose || arm !== app.store.chosen) return;
    poses = [...poses, pose];
    await compute();
  }

  function draw() {
    list.replaceChildren(...poses.map((pose, n) => h('li', {}, h('span', { class: 'point-name' }, `${n + 1}`),
      h('span', { class: 'second' }, `${millimetres(pose.flange.p)}, ${rpyFromRotationVector(pose.flange.r)
        .map((value) => fixed(value * DEGREES, 0)).join(' / ')} °`),
      h('button', { type: 'button', class: 'plain', t: 'points.remove', 'aria-label': `${app.say('points.remove')} ${n + 1}`,
        on: { click: () => {
          poses = poses.filter((one) => one !== pose);
          void compute();
        } } }))));
  }

  async function compute() {
    asked += 1;
    const number = asked;
    draw();
    refused.textContent = '';
    result.show(null);
    if (poses.length < LEAST_POSES) return;
    const flanges = poses.map((pose) => pose.flange);
    const answer = await app.ask('teach_tool', { poses: flanges }, null);
    if (number !== asked) return;
    if (!answer.ok) {
      refused.textContent = answer.message;
      return;
    }
    const { p, r, residual, worst, uncertainty } = answer.data;
    result.show({ p, r, residual, uncertainty, poses: flanges, model: poses[0].model, taken: Date.now() / 1000 },
      'teach.tool_error', { mm: fixed(residual * MM, 2), worst, sure: fixed(uncertainty * MM, 2) });
  }

  app.store.on('chosen', forget);
  void compute();
  return h('section', { class: 'card', id: 'teach-tool' }, h('h3', { t: 'teach.tool' }), h('p', { class: 'hint', t: 'teach.tool.hint' }),
    list, h('div', { class: 'buttons' }, take, clear), refused, result.element);
}
