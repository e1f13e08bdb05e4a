/**
 * Moves to a typed or stored target. A ghost arm shows the target first, and GO goes exactly there: it can be pressed
 * only while the ghost stands for what is typed, and for a line while tool and user frame are those in which it was shown.
 */
import { h, setAttribute, setText } from '../ui/dom.js';
import { DEGREES, rotationVectorFromRpy, rpyFromRotationVector } from '../ui/format.js';
import { actionButton, numberField, readAll } from '../ui/field.js';
import { makeChoice } from '../ui/choice.js';
import { toast } from '../ui/toast.js';
import { exportCell } from '../cell/export.js';
import { poseFields } from './setup.js';

/** @typedef {import('../app.js').App} App */

const PREVIEW_MS = 250;
/** Calls that replace a frame, which may be the active one; its number stays. */
const FRAME_CALLS = ['set_toolframe', 'set_userframe'];

/** @typedef {import('../link/messages.js').ArmState} ArmState */

/**
 * @param {ArmState|null} state
 * @returns {unknown[]} What names the active tool and user frame; null: not told.
 */
function framesOf(state) {
  return [state?.tool_id ?? null, state?.user_id ?? null, state?.tool?.frame ?? null];
}

/**
 * @typedef {object} Target
 * @property {'joint'|'line'} kind
 * @property {number[]} q rad
 * @property {number[]} [p] m
 * @property {number[]} [r] rad
 * @property {unknown[]} [frames] Tool and user frame in which a line's end is given.
 */

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountMove(root, app) {
  const { store } = app;
  /** The target that the ghost shows. @type {Target|null} */
  let target = null;
  let asked = 0;
  /** @type {any} */
  let timer = null;
  let isTyped = false;
  const said = h('p', { class: 'said', role: 'status', t: 'move.idle' });
  const joints = [0, 1, 2, 3, 4, 5].map((n) => numberField({ label: `J${n + 1}`, unit: '°', scale: DEGREES, decimals: 2,
    onChange: typed }));
  const pose = poseFields(typed);
  const jointPart = h('div', { class: 'fields six' }, ...joints.map((field) => field.element));
  const posePart = h('div', { class: 'fields six', hidden: true }, ...pose.map((field) => field.element));
  const frame = h('p', { class: 'hint', hidden: true, t: 'move.frame' });
  const kind = makeChoice('move.kind', ['joint', 'line'], 'move.kind', () => {
    const isLine = kind.chosen() === 'line';
    jointPart.hidden = isLine;
    posePart.hidden = frame.hidden = !isLine;
    speed.element.hidden = isLine;
    lineSpeed.element.hidden = !isLine;
    clear();
    fromArm();
  });
  const speed = numberField({ label: 'move.speed', unit: '°/s', scale: DEGREES, value: 20, low: 0.1, high: 180, decimals: 0 });
  const lineSpeed = numberField({ label: 'move.speed', unit: 'mm/s', scale: 1000, value: 50, low: 0.1, high: 1500, decimals: 0 });
  lineSpeed.element.hidden = true;

  const go = actionButton('move.go', async () => {
    const [value] = readAll([kind.chosen() === 'line' ? lineSpeed : speed]) ?? [];
    dropOfOtherFrames(store.record().state);
    if (!target || value === undefined) {
      if (!target) toast('move.no_preview', 'bad');
      return;
    }
    setText(said, 'move.under_way');
    const sent = target;
    const answer = sent.kind === 'line'
      ? await app.command('linear_move', { p: sent.p, r: sent.r, q: sent.q, speed: value })
      : await app.command('joint_move', { q: sent.q, speed: value });
    if (target !== sent) return;  // the next target was typed meanwhile: it stays
    setText(said, answer.ok ? 'move.arrived' : 'move.ended');
    if (answer.ok) clear(false);
  }, { class: 'needs-control go', 'data-needs': 'move', 'data-leads': '' });
  const here = h('button', { type: 'button', t: 'move.from_arm', on: { click: () => {
    clear();
    fromArm();
  } } });
  const drop = h('button', { type: 'button', t: 'move.drop', on: { click: () => clear() } });

  function typed() {
    isTyped = true;
    target = null;
    showGo();
    clearTimeout(timer);
    timer = setTimeout(() => void preview(), PREVIEW_MS);
  }

  async function preview() {
    const number = ++asked;
    const fields = kind.chosen() === 'line' ? pose : joints;
    const values = fields.map((field) => field.value());
    if (values.some((value) => Number.isNaN(value))) {
      app.preview.ghost(null);
      app.preview.path(null);
      setText(said, 'move.incomplete');
      return;
    }
    const { state } = store.record();
    const near = state?.q;
    const frames = framesOf(state);
    /** @type {Target} */
    let next = { kind: 'joint', q: values };
    if (kind.chosen() === 'line') {
      const p = values.slice(0, 3);
      const r = rotationVectorFromRpy(values.slice(3));
      const answer = await app.ask('ik', { p, r, near });
      if (number !== asked) return;
      if (!answer.ok || !answer.data?.q) {
        app.preview.ghost(null);
        app.preview.path(null);
        setText(said, 'move.unreachable', { why: answer.message });
        return;
      }
      next = { kind: 'line', q: answer.data.q, p, r, frames };
    }
    const limits = store.arm()?.joints;
    const beyond = limits ? next.q.findIndex((value, n) => value < limits[n].lower || value > limits[n].upper) : -1;
    app.preview.ghost(next.q);
    app.preview.path(near ? wayOf(next, near) : null);
    if (beyond >= 0) {
      setText(said, 'move.beyond', { joint: `J${beyond + 1}` });
      return;
    }
    target = next;
    setText(said, 'move.shown');
    showGo();
  }

  /**
   * Joints along the way to a target: all joints together, or the line's two ends.
   *
   * @param {Target} next
   * @param {number[]} from rad
   * @returns {number[][]}
   */
  function wayOf(next, from) {
    if (next.kind === 'line') return [from, next.q];
    return Array.from({ length: 25 }, (_, step) => from.map((value, n) => value + ((next.q[n] - value) * step) / 24));
  }

  function showGo() {
    app.offer = target !== null ? 'move' : (app.offer === 'move' ? null : app.offer);
    app.offers.look();
    setAttribute(go, 'data-ready', String(target !== null));
  }

  function clear(hasText = true) {
    asked += 1;
    clearTimeout(timer);
    target = null;
    isTyped = false;
    app.preview.ghost(null);
    app.preview.path(null);
    if (hasText) setText(said, 'move.idle');
    showGo();
  }

  function frameHasChanged() {
    clear(false);
    setText(said, 'move.frame_changed');
  }

  /** @param {ArmState|null} state */
  function dropOfOtherFrames(state) {
    const shown = target?.frames;
    if (shown && framesOf(state).some((now, n) => now !== null && shown[n] !== null && now !== shown[n])) frameHasChanged();
  }

  function fromArm() {
    const state = store.record().state;
    if (state?.q) joints.forEach((field, n) => field.set(/** @type {number[]} */ (state.q)[n]));
    if (state?.tool) {
      const values = [...state.tool.p, ...rpyFromRotationVector(state.tool.r)];
      pose.forEach((field, n) => field.set(values[n]));
    }
  }

  root.append(h('div', { class: 'buttons' }, kind.element, here), jointPart, posePart, frame,
    h('div', { class: 'fields' }, speed.element, lineSpeed.element), h('div', { class: 'buttons' }, go, drop), said,
    makePointList(app, (q) => {
      kind.choose('joint');
      joints.forEach((field, n) => field.set(q[n]));
      typed();
    }));
  let isFilled = false;
  store.on('call', ({ arm, call }) => {
    if (arm === store.chosen && FRAME_CALLS.includes(call.name) && isTyped && kind.chosen() === 'line') frameHasChanged();
  });
  app.onFrame((state) => {
    dropOfOtherFrames(state);
    if (!isFilled && state?.q && !isTyped) {
      isFilled = true;
      fromArm();
    }
  });
  store.on('chosen', () => {
    isFilled = false;
    clear();
  });
  showGo();
}

/**
 * The stored points: each can be shown as a target, and taken away.
 *
 * @param {App} app
 * @param {(q: number[]) => void} show
 * @returns {HTMLElement}
 */
function makePointList(app, show) {
  const { store, points } = app;
  const list = h('ul', { class: 'points' });
  const empty = h('p', { class: 'empty', t: 'points.none' });
  const name = /** @type {HTMLInputElement} */ (h('input', { type: 'text', id: 'point-name', maxlength: 60, autocomplete: 'off' }));

  function draw() {
    const all = points.list(store.chosen);
    empty.hidden = all.length > 0;
    list.replaceChildren(...all.map((point) => h('li', {}, h('span', { class: 'point-name' }, point.name),
      h('span', { class: 'second' }, point.q.map((value) => (value * DEGREES).toFixed(0)).join(' / ')),
      h('button', { type: 'button', t: 'points.show', 'aria-label': `${app.say('points.show')} ${point.name}`,
        on: { click: () => show(point.q) } }),
      h('button', { type: 'button', class: 'plain', t: 'points.remove', 'aria-label': `${app.say('points.remove')} ${point.name}`,
        on: { click: () => {
          points.remove(store.chosen, point.name);
          store.tell('points');
        } } }))));
  }

  const save = h('button', { type: 'button', t: 'points.save', on: { click: () => {
    const q = store.isFresh() ? store.record().state?.q : null;
    if (!q) {
      toast('points.no_state', 'bad');
      return;
    }
    if (store.moves()) {
      toast('why.moving', 'bad', 'points.save');
      return;
    }
    points.add(store.chosen, name.value, q);
    name.value = '';
    store.tell('points');
  } } });
  store.on('chosen points welcome', draw);
  draw();
  return h('section', { class: 'card' }, h('h3', { t: 'points.title' }),
    h('div', { class: 'buttons' }, h('label', { for: 'point-name', t: 'points.name' }), name, save,
      h('button', { type: 'button', t: 'points.export', on: { click: () => void exportCell(app) } })), empty, list);
}
