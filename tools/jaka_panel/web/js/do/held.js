/**
 * Settings as the controller holds them. Fields begin with what it holds; what differs is shown beside them; before
 * anything is written it is read again, the changes are asked for, and what was written is read back. A field that nobody
 * changed is written as it is held, to the last digit.
 */
import { clearText, h, setText } from '../ui/dom.js';
import { actionButton, numberField, readAll } from '../ui/field.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {import('../ui/field.js').NumberField} NumberField */

/**
 * The answer to the command `settings`; null: the controller does not tell.
 *
 * @typedef {object} Settings
 * @property {number|null} tool
 * @property {number|null} user_frame
 * @property {{p: number[], r: number[]}[]|null} tools m, rad
 * @property {{p: number[], r: number[]}[]|null} user_frames m, rad
 * @property {{mass: number, centre: number[]}|null} payload kg, m
 * @property {number|null} collision_level
 */

export class HeldSettings {
  /** @param {App} app */
  constructor(app) {
    this.app = app;
    /** @type {Settings|null} */
    this.settings = null;
    /** @type {((settings: Settings|null, message: string) => void)[]} */
    this.listeners = [];
    app.store.on('chosen welcome', () => this.take(null, ''));
    app.store.on('tab', (name) => {
      if (name === 'setup') void this.read();
    });
  }

  /** @param {(settings: Settings|null, message: string) => void} listener */
  onChange(listener) {
    this.listeners.push(listener);
    listener(this.settings, '');
  }

  /**
   * @param {Settings|null} settings
   * @param {string} message Why there are none.
   */
  take(settings, message) {
    this.settings = settings;
    for (const listener of this.listeners) listener(settings, message);
  }

  /** @returns {Promise<Settings|null>} What the controller holds now; null where it cannot be read. */
  async read() {
    const arm = this.app.store.chosen;
    const answer = await this.app.ask('settings', {}, arm);
    if (arm !== this.app.store.chosen) return this.settings;
    this.take(answer.ok && answer.data && 'payload' in answer.data ? answer.data : null, answer.message || '');
    return this.settings;
  }
}

/**
 * Return the values to write: what stands in the fields, and in place of fields that nobody changed what is held.
 *
 * @param {NumberField[]} fields
 * @param {number[]} values In the unit of the wire.
 * @param {number[]|null} held
 * @returns {number[]}
 */
export function valuesToWrite(fields, values, held) {
  return values.map((value, index) => (held && fields[index].shows(held[index]) ? held[index] : value));
}

/**
 * The changes in words: `Mass 2.50 → 0.00 kg`.
 *
 * @param {NumberField[]} fields
 * @param {number[]} values In the unit of the wire.
 * @param {number[]|null} held
 * @param {(label: string) => string} say
 * @returns {string[]}
 */
export function changesInWords(fields, values, held, say) {
  return fields.flatMap((field, index) => {
    if (held && field.shows(held[index])) return [];
    const label = field.label.includes('.') ? say(field.label) : field.label;
    return [`${label}: ${held ? field.textOf(held[index]) : '?'} → ${field.textOf(values[index])} ${field.unit}`];
  });
}

/**
 * A card for one setting of a tool or user frame.
 *
 * @param {object} options
 * @param {App} options.app
 * @param {HeldSettings} options.held
 * @param {string} options.title Key.
 * @param {string} [options.label] Key, of the number.
 * @param {NumberField[]} options.fields
 * @param {number} options.low Lowest number of a tool or user frame.
 * @param {number} options.high
 * @param {'tool'|'user_frame'} options.active Which number becomes the active one with it.
 * @param {(settings: Settings, number: number) => number[]|null} options.read In the unit of the wire.
 * @param {(number: number, values: number[]) => Promise<import('../link/messages.js').Answer>} options.write
 * @param {(now: number[]|null, wanted: number[]) => string|null} [options.warning] Key.
 */
export function makeSetting({ app, held, title, label = 'setup.number', fields, low, high, active, read, write, warning = () => null }) {
  const number = numberField({ label, unit: `${low}–${high}`, decimals: 0, low, high, onChange: () => {
    isNumberTouched = true;
    fill(true);
  } });
  const said = h('p', { class: 'said', role: 'status' });
  const list = h('ul', { class: 'changes' });
  const warned = h('p', { class: 'bad', hidden: true });
  const question = h('div', { class: 'ask', role: 'group', tLabel: 'setup.ask', hidden: true });
  /** The values with which the fields began. @type {number[]|null} */
  let began = null;
  /** @type {Set<NumberField>} */
  const touched = new Set();
  let isNumberTouched = false;

  for (const field of fields) {
    field.input.addEventListener('input', () => {
      touched.add(field);
      note();
    });
  }

  /** Shows beside each field what is held, where something else stands in it. */
  function note() {
    fields.forEach((field, index) => {
      const isOther = began !== null && !field.shows(began[index]);
      field.note.hidden = !isOther;
      if (isOther) setText(field.note, 'setup.now', { value: field.textOf(/** @type {number[]} */ (began)[index]) });
    });
  }

  /** @param {boolean} isAnew What was typed before belonged to another number. */
  function fill(isAnew = false) {
    const { settings } = held;
    question.hidden = true;
    if (isAnew) touched.clear();
    if (settings && !isNumberTouched && settings[active] !== null) number.set(Math.max(low, settings[active]));
    const value = number.value();
    began = settings && Number.isInteger(value) ? read(settings, value) : null;
    fields.forEach((field, index) => {
      if (touched.has(field)) return;
      if (began) field.set(began[index]);
      else field.input.value = '';
    });
    note();
    if (settings && !began) setText(said, 'setup.not_told');
    else if (said.getAttribute('data-t') === 'setup.not_told') clearText(said);
  }

  /** @returns {Promise<{n: number, values: number[], now: number[]|null}|null>} What is to be written; says why nothing is. */
  async function check() {
    const values = readAll([number, ...fields]);
    if (!values) return null;
    const n = Math.round(values[0]);
    const before = began;
    const arm = app.store.chosen;
    const settings = await held.read();
    if (arm !== app.store.chosen) return null;
    const now = settings ? read(settings, n) : null;
    if (before && now && before.some((value, index) => Math.abs(value - now[index]) > 1e-6)) {
      setText(said, 'setup.moved');
      return null;
    }
    const wanted = valuesToWrite(fields, values.slice(1), now);
    const isActive = !settings || settings[active] === n;
    const changes = changesInWords(fields, wanted, now, (label) => app.say(label));
    if (!isActive) changes.unshift(app.say(`setup.${active}_active`, { before: settings?.[active] ?? '?', after: n }));
    if (!changes.length) {
      setText(said, 'setup.nothing');
      return null;
    }
    list.replaceChildren(...changes.map((text) => h('li', {}, text)));
    const key = warning(now, wanted);
    warned.hidden = !key;
    if (key) setText(warned, key);
    return { n, values: wanted, now };
  }

  /** @type {{n: number, values: number[]}|null} */
  let asked = null;
  const apply = actionButton('setup.apply', async () => {
    clearText(said);
    asked = await check();
    question.hidden = !asked;
    if (!asked) return;
    question.scrollIntoView({ block: 'nearest' });
    cancel.focus();
  }, { 'data-needs': 'setting' });
  const send = actionButton('setup.write', async () => {
    if (!asked) return;
    const { n, values } = asked;
    const arm = app.store.chosen;
    const answer = await write(n, values);
    if (arm !== app.store.chosen) return;
    question.hidden = true;
    asked = null;
    if (!answer.ok) return;
    touched.clear();
    const settings = await held.read();
    if (arm !== app.store.chosen) return;
    const now = settings ? read(settings, n) : null;
    const isSame = now?.every((value, index) => Math.abs(value - values[index]) < 1e-4);
    setText(said, now ? (isSame ? 'setup.written' : 'setup.differs') : 'setup.unverified');
    said.classList.toggle('bad', Boolean(now) && !isSame);
  }, { 'data-needs': 'setting' });
  const cancel = h('button', { type: 'button', t: 'setup.cancel', on: { click: () => {
    asked = null;
    question.hidden = true;
  } } });
  question.append(h('p', { t: 'setup.ask' }), list, warned, h('div', { class: 'buttons' }, send, cancel));
  held.onChange(() => fill());
  app.store.on('chosen', () => {
    asked = null;
    clearText(said);
    isNumberTouched = false;
    fill(true);
  });
  return h('section', { class: 'card' }, h('h3', { t: title }), h('div', { class: 'fields' }, number.element,
    ...fields.map((field) => field.element)), h('div', { class: 'buttons' }, apply), said, question);
}
