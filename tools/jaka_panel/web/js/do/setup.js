/** Settings of the arm: tool and user frame, payload, collision sensitivity, hand guiding, the force sensor's zero. */
import { clearText, h, setText } from '../ui/dom.js';
import { DEGREES, rotationVectorFromRpy, rpyFromRotationVector } from '../ui/format.js';
import { actionButton, numberField } from '../ui/field.js';
import { makeChoice } from '../ui/choice.js';
import { HeldSettings, makeSetting } from './held.js';

export { readAll } from '../ui/field.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {import('../ui/field.js').NumberField} NumberField */

const LEVELS = ['off', 'level1', 'level2', 'level3', 'level4'];

/** @returns {NumberField[]} x, y, z in mm and roll, pitch, yaw in degrees; empty. */
export function poseFields(/** @type {(() => void)|undefined} */ onChange) {
  return [...['X', 'Y', 'Z'].map((label) => numberField({ label, unit: 'mm', scale: 1000, decimals: 2, onChange })),
    ...['Rx', 'Ry', 'Rz'].map((label) => numberField({ label, unit: '°', scale: DEGREES, decimals: 2, onChange }))];
}

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountSetup(root, app) {
  const held = new HeldSettings(app);
  const again = h('button', { type: 'button', t: 'setup.read', on: { click: () => void held.read() } });
  const said = h('p', { class: 'hint', role: 'status' });
  held.onChange((settings, message) => {
    setText(said, settings ? 'setup.read_done' : (message ? 'setup.unread' : 'setup.not_read'), { why: message });
  });
  root.append(h('div', { class: 'buttons' }, again, said), h('div', { class: 'cards' },
    makeFrame(app, held, 'tool_frame', 11), makeFrame(app, held, 'user_frame', 10), makePayload(app, held), makeCollision(app, held),
    makeGuiding(app)));
}

/**
 * @param {App} app
 * @param {HeldSettings} held
 * @param {'tool_frame'|'user_frame'} name
 * @param {number} highest
 */
function makeFrame(app, held, name, highest) {
  const isTool = name === 'tool_frame';
  return makeSetting({
    app, held, title: `setup.${name}`, fields: poseFields(undefined), low: 1, high: highest,
    active: isTool ? 'tool' : 'user_frame',
    read: (settings, number) => {
      const frame = (isTool ? settings.tools : settings.user_frames)?.[number];
      return frame ? [...frame.p, ...rpyFromRotationVector(frame.r)] : null;
    },
    write: (number, values) => app.command(name, { number, p: values.slice(0, 3), r: rotationVectorFromRpy(values.slice(3)) }),
  });
}

/**
 * @param {App} app
 * @param {HeldSettings} held
 */
function makePayload(app, held) {
  const mass = numberField({ label: 'setup.mass', unit: 'kg', low: 0, high: 100 });
  const centre = ['X', 'Y', 'Z'].map((label) => numberField({ label, unit: 'mm', scale: 1000 }));
  return makeSetting({
    app, held, title: 'setup.payload', label: 'tool.title', fields: [mass, ...centre], low: 0, high: 11, active: 'tool',
    read: (settings, number) => (settings.payload && settings.tool === number ? [settings.payload.mass, ...settings.payload.centre] : null),
    write: (number, values) => app.command('payload', { tool: number, mass: values[0], centre: values.slice(1) }),
    warning: (now, wanted) => (now && wanted[0] < now[0] ? 'setup.lighter' : null),
  });
}

/**
 * @param {App} app
 * @param {HeldSettings} held
 */
function makeCollision(app, held) {
  const level = makeChoice('setup.collision', LEVELS, 'setup.collision', () => {});
  const said = h('p', { class: 'said', role: 'status' });
  const now = h('p', { class: 'hint' });
  let isTouched = false;
  level.element.addEventListener('click', () => {
    isTouched = true;
    setText(said, 'setup.unwritten');
  });
  level.choose('');
  const set = actionButton('setup.apply', async () => {
    const wanted = LEVELS.indexOf(level.chosen());
    if (wanted < 0 || wanted === held.settings?.collision_level) {
      setText(said, 'setup.nothing');
      return;
    }
    const arm = app.store.chosen;
    const answer = await app.command('collision', { level: wanted });
    if (!answer.ok || arm !== app.store.chosen) return;
    isTouched = false;
    await held.read();
    if (arm !== app.store.chosen) return;
    const isSame = held.settings?.collision_level === wanted;
    setText(said, isSame ? 'setup.written' : 'setup.differs');
  }, { 'data-needs': 'sensitivity' });
  held.onChange((settings) => {
    const value = settings?.collision_level ?? null;
    if (value === null) setText(now, 'setup.not_told');
    else setText(now, 'setup.collision.now', { level: value === 0 ? app.say('setup.collision.off') : value });
    if (!isTouched) level.choose(value === null ? '' : (LEVELS[value] ?? ''));
  });
  app.store.on('chosen', () => {  // what was chosen was for the arm of before
    isTouched = false;
    level.choose('');
    clearText(said);
  });
  return h('section', { class: 'card' }, h('h3', { t: 'setup.collision' }), h('p', { class: 'hint', t: 'setup.collision.hint' }), now,
    h('div', { class: 'buttons' }, level.element, set), said);
}

/**
 * The button that has the arm guided by hand, and ends that.
 *
 * @param {App} app
 * @returns {HTMLElement}
 */
export function guideButton(app) {
  const isOn = () => app.store.record().state?.hand_guiding === true;
  const guide = actionButton('setup.guiding_on', () => app.command('drag', { on: !isOn() }), { 'data-needs': 'guiding_on' });
  app.onFrame(() => {
    setText(guide, isOn() ? 'setup.guiding_off' : 'setup.guiding_on');
    const needs = isOn() ? 'guiding_off' : 'guiding_on';
    if (guide.getAttribute('data-needs') === needs) return;
    guide.setAttribute('data-needs', needs);
    app.offers.lock(guide);
  });
  return guide;
}

/** @param {App} app */
function makeGuiding(app) {
  const guide = guideButton(app);
  const zero = actionButton('setup.zero_force', () => app.command('zero_force'), { 'data-needs': 'zero_force' });
  app.onFrame((state) => {
    zero.hidden = !state?.wrench && app.store.arm()?.has?.zero_force !== true;
  });
  return h('section', { class: 'card' }, h('h3', { t: 'setup.guiding' }), h('p', { class: 'hint', t: 'setup.guiding.hint' }),
    h('div', { class: 'buttons' }, guide, zero));
}
