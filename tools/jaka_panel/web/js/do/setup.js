/** Settings of the arm: tool and user frame, payload, collision level, hand guiding, the force sensor's zero. */
import { h, setText } from '../ui/dom.js';
import { DEGREES, rotationVectorFromRpy } from '../ui/format.js';
import { actionButton, numberField } from '../ui/field.js';
import { makeChoice } from '../ui/choice.js';
import { toast } from '../ui/toast.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {import('../ui/field.js').NumberField} NumberField */

/**
 * Values of fields, or null, with the focus in the first one that holds no number.
 *
 * @param {NumberField[]} fields
 * @returns {number[]|null}
 */
export function readAll(fields) {
  const values = fields.map((field) => field.value());
  const wrong = values.findIndex((value) => Number.isNaN(value));
  if (wrong < 0) return values;
  fields[wrong].input.setAttribute('aria-invalid', 'true');
  fields[wrong].input.focus();
  toast('field.wrong', 'bad');
  return null;
}

/** @returns {NumberField[]} x, y, z in mm and roll, pitch, yaw in degrees. */
export function poseFields(/** @type {(() => void)|undefined} */ onChange) {
  return [...['X', 'Y', 'Z'].map((label) => numberField({ label, unit: 'mm', scale: 1000, decimals: 2, value: 0, onChange })),
    ...['Rx', 'Ry', 'Rz'].map((label) => numberField({ label, unit: '°', scale: DEGREES, decimals: 2, value: 0, onChange }))];
}

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountSetup(root, app) {
  root.append(makeFrame(app, 'tool_frame', 11), makeFrame(app, 'user_frame', 10), makePayload(app), makeCollision(app),
    makeGuiding(app));
}

/**
 * @param {App} app
 * @param {'tool_frame'|'user_frame'} name
 * @param {number} highest
 */
function makeFrame(app, name, highest) {
  const number = numberField({ label: 'setup.number', unit: `1–${highest}`, decimals: 0, value: 1, low: 1, high: highest });
  const pose = poseFields(undefined);
  const set = actionButton('setup.apply', async () => {
    const values = readAll([number, ...pose]);
    if (!values) return;
    await app.command(name, { number: Math.round(values[0]), p: values.slice(1, 4), r: rotationVectorFromRpy(values.slice(4)) });
  });
  return h('section', { class: 'card' }, h('h3', { t: `setup.${name}` }), h('div', { class: 'fields' }, number.element,
    ...pose.map((field) => field.element)), h('div', { class: 'buttons' }, set));
}

/** @param {App} app */
function makePayload(app) {
  const tool = numberField({ label: 'setup.number', unit: '1–11', decimals: 0, value: 1, low: 1, high: 11 });
  const mass = numberField({ label: 'setup.mass', unit: 'kg', value: 0, low: 0, high: 100 });
  const centre = ['X', 'Y', 'Z'].map((label) => numberField({ label, unit: 'mm', scale: 1000, value: 0 }));
  const set = actionButton('setup.apply', async () => {
    const values = readAll([tool, mass, ...centre]);
    if (!values) return;
    await app.command('payload', { tool: Math.round(values[0]), mass: values[1], centre: values.slice(2) });
  });
  return h('section', { class: 'card' }, h('h3', { t: 'setup.payload' }), h('div', { class: 'fields' }, tool.element, mass.element,
    ...centre.map((field) => field.element)), h('div', { class: 'buttons' }, set));
}

/** @param {App} app */
function makeCollision(app) {
  const level = makeChoice('setup.collision', ['level1', 'level2', 'level3', 'level4', 'off'], 'setup.collision', () => {});
  level.choose('level3');
  const set = actionButton('setup.apply', () => app.command('collision', {
    level: level.chosen() === 'off' ? 0 : Number(level.chosen().slice(-1)) }));
  return h('section', { class: 'card' }, h('h3', { t: 'setup.collision' }), h('p', { class: 'hint', t: 'setup.collision.hint' }),
    h('div', { class: 'buttons' }, level.element, set));
}

/** @param {App} app */
function makeGuiding(app) {
  const isOn = () => app.store.record().state?.hand_guiding === true;
  const guide = actionButton('setup.guiding_on', () => app.command('drag', { on: !isOn() }));
  const zero = actionButton('setup.zero_force', () => app.command('zero_force'));
  app.onFrame((state) => {
    setText(guide, isOn() ? 'setup.guiding_off' : 'setup.guiding_on');
    zero.hidden = !state?.wrench && app.store.arm()?.has?.zero_force !== true;
  });
  return h('section', { class: 'card' }, h('h3', { t: 'setup.guiding' }), h('p', { class: 'hint', t: 'setup.guiding.hint' }),
    h('div', { class: 'buttons' }, guide, zero));
}
