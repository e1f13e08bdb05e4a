/** Lists of motions: made of stored points, waits and outputs; drawn first, then run by the number of what was drawn. */
import { h, setText } from '../ui/dom.js';
import { DEGREES, fixed } from '../ui/format.js';
import { actionButton, numberField, readAll } from '../ui/field.js';
import { makeChoice } from '../ui/choice.js';
import { toast } from '../ui/toast.js';
import { terminalWords } from '../do/io_names.js';
import { twiceButton } from './twice.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {Record<string, any>} Step */

const KINDS = ['joint', 'line', 'arc', 'wait', 'output'];
const BANKS = ['cabinet', 'tool', 'extension'];
const LONGEST = 60;
const MOST = 200;
const MM = 1000;

/**
 * Key and values of the text for a step.
 *
 * @param {Step} step
 * @param {(key: string) => string} say
 * @returns {[string, Record<string, string|number>]}
 */
export function wordsOf(step, say) {
  const blend = step.blend ? `, ⌒ ${fixed(step.blend * MM, 0)} mm` : '';
  const point = `${step.point ?? ''}${blend}`;
  switch (step.kind) {
    case 'joint': return ['list.step.joint', { point, speed: `${fixed(step.speed * DEGREES, 0)} °/s` }];
    case 'line': return ['list.step.line', { point, speed: `${fixed(step.speed * MM, 0)} mm/s` }];
    case 'arc': return ['list.step.arc', { point, via: step.via, speed: `${fixed(step.speed * MM, 0)} mm/s` }];
    case 'wait': return ['list.step.wait', { s: fixed(step.s, 1) }];
    default: return ['list.step.output', { where: terminalWords(say, step.bank, step.signal === 'digital' ? 'do' : 'ao', step.index),
      value: typeof step.value === 'boolean' ? say(`list.value.${step.value ? 'on' : 'off'}`) : step.value }];
  }
}

/**
 * Steps with one of them moved; it stays where it is at an end.
 *
 * @param {Step[]} steps
 * @param {number} from
 * @param {number} by
 * @returns {Step[]}
 */
export function moved(steps, from, by) {
  const to = from + by;
  if (to < 0 || to >= steps.length) return steps;
  const next = steps.filter((_, n) => n !== from);
  next.splice(to, 0, steps[from]);
  return next;
}

/**
 * @param {App} app
 * @param {import('../do/run.js').Runner} runner
 * @returns {HTMLElement}
 */
export function makeListRun(app, runner) {
  const { store, cell, points } = app;
  /** @type {Step[]} */
  let steps = [];
  const list = h('ol', { class: 'points', id: 'list-steps' });
  const choose = /** @type {HTMLSelectElement} */ (h('select', { id: 'list-choice', on: { change: () => load() } }));
  const name = /** @type {HTMLInputElement} */ (h('input', { type: 'text', id: 'list-name', maxlength: LONGEST, autocomplete: 'off' }));
  const point = /** @type {HTMLSelectElement} */ (h('select', { id: 'list-point' }));
  const via = /** @type {HTMLSelectElement} */ (h('select', { id: 'list-via' }));
  const bank = /** @type {HTMLSelectElement} */ (h('select', { id: 'list-bank' }, ...BANKS.map((one) => h('option', { value: one, t: `io.bank.${one}` }))));
  const jointSpeed = numberField({ label: 'move.speed', unit: '°/s', scale: DEGREES, value: 20, low: 0.1, high: 180, decimals: 0 });
  const lineSpeed = numberField({ label: 'move.speed', unit: 'mm/s', scale: MM, value: 50, low: 0.1, high: 1500, decimals: 0 });
  const blend = numberField({ label: 'list.blend', unit: 'mm', scale: MM, value: 0, low: 0, high: 500, decimals: 0 });
  const seconds = numberField({ label: 'list.seconds', unit: 's', value: 1, low: 0, high: 3600, decimals: 1 });
  const index = numberField({ label: 'list.index', unit: '', value: 0, low: 0, high: 32767, decimals: 0 });
  const value = makeChoice('list.value', ['on', 'off'], 'list.value', () => {});
  const pointPart = h('span', { class: 'buttons' }, h('label', { for: point.id, t: 'list.point' }), point);
  const viaPart = h('span', { class: 'buttons' }, h('label', { for: via.id, t: 'list.via' }), via);
  const bankPart = h('span', { class: 'buttons' }, h('label', { for: bank.id, t: 'list.output' }), bank, index.element, value.element);
  const kind = makeChoice('list.kind', KINDS, 'list.kind', () => showFields());

  function showFields() {
    const one = kind.chosen();
    const isMotion = one === 'joint' || one === 'line' || one === 'arc';
    pointPart.hidden = blend.element.hidden = !isMotion;
    viaPart.hidden = one !== 'arc';
    jointSpeed.element.hidden = one !== 'joint';
    lineSpeed.element.hidden = one !== 'line' && one !== 'arc';
    seconds.element.hidden = one !== 'wait';
    bankPart.hidden = one !== 'output';
  }

  /** @returns {Step|null} What the fields say. */
  function typed() {
    const one = kind.chosen();
    if (one === 'wait') {
      const [s] = readAll([seconds]) ?? [];
      return s === undefined ? null : { kind: one, s };
    }
    if (one === 'output') {
      const [number] = readAll([index]) ?? [];
      return number === undefined ? null : { kind: one, signal: 'digital', bank: bank.value, index: Math.round(number), value: value.chosen() === 'on' };
    }
    const [speed, rounding] = readAll([one === 'joint' ? jointSpeed : lineSpeed, blend]) ?? [];
    if (speed === undefined) return null;
    if (!point.value || (one === 'arc' && !via.value)) {
      toast('list.no_point', 'bad', 'list.add');
      return null;
    }
    return { kind: one, point: point.value, ...(one === 'arc' ? { via: via.value } : {}), speed, ...(rounding ? { blend: rounding } : {}) };
  }

  const add = h('button', { type: 'button', t: 'list.add', on: { click: () => {
    const step = typed();
    if (!step || steps.length >= MOST) return;
    change([...steps, step]);
    if (step.point && point.selectedIndex < point.length - 1) point.selectedIndex += 1;  // lists go from point to point
  } } });

  /** @param {Step[]} next */
  function change(next) {
    steps = next;
    runner.drop();
    draw();
  }

  function draw() {
    list.replaceChildren(...steps.map((step, n) => {
      const words = h('span', { class: 'point-name' });
      setText(words, ...wordsOf(step, app.say));
      /** @type {(label: string, sign: string, act: () => void) => HTMLElement} */
      const button = (label, sign, act) => h('button', { type: 'button', class: 'plain', tLabel: label, on: { click: act } }, sign);
      return h('li', {}, h('span', {}, `${n + 1}`), words, h('span', { class: 'second' }), h('span', { class: 'buttons' },
        button('list.up', '↑', () => change(moved(steps, n, -1))), button('list.down', '↓', () => change(moved(steps, n, 1))),
        button('points.remove', '×', () => change(steps.filter((one) => one !== step)))));
    }));
  }

  function load() {
    const entry = cell.entry('lists', store.chosen, choose.value);
    name.value = entry ? choose.value : '';
    change(entry ? entry.steps.map((/** @type {Step} */ step) => ({ ...step })) : []);
  }

  function fill() {
    const names = cell.entries('lists', store.chosen).map(([one]) => one);
    const before = choose.value;
    choose.replaceChildren(h('option', { value: '', t: 'list.new' }), ...names.map((one) => h('option', { value: one }, one)));
    choose.value = names.includes(before) ? before : '';
    for (const select of [point, via]) {
      const kept = select.value;
      select.replaceChildren(...points.list(store.chosen).map((one) => h('option', { value: one.name }, one.name)));
      if (points.list(store.chosen).some((one) => one.name === kept)) select.value = kept;
    }
  }

  const keep = h('button', { type: 'button', t: 'teach.keep', on: { click: () => void storeList() } });

  async function storeList() {
    const chosen = name.value.trim();
    if (!chosen || !steps.length) {
      toast(chosen ? 'list.no_steps' : 'teach.name_first', 'bad', 'teach.keep');
      return;
    }
    const answer = await cell.change([{ section: 'lists', arm: store.chosen, name: chosen, entry: { steps } }]);
    toast(answer.ok ? 'cmd.done' : (answer.message || 'cmd.failed'), answer.ok ? 'good' : 'bad', 'teach.keep');
    if (answer.ok) choose.value = chosen;
  }

  const remove = twiceButton('points.remove', 'cell.remove_sure', async () => {
    if (!choose.value) return;
    const answer = await cell.change([{ section: 'lists', arm: store.chosen, name: choose.value, entry: null }]);
    if (!answer.ok) toast(answer.message || 'cmd.failed', 'bad', 'points.remove');
  }, { values: () => ({ name: choose.value || '–', arm: store.chosen }) });

  const planButton = actionButton('run.make_plan', async () => {
    if (!steps.length) {
      toast('list.no_steps', 'bad');
      return;
    }
    await runner.plan('plan_list', { steps });
  }, { 'data-needs': 'plan' });

  const card = h('section', { class: 'card', id: 'list-run' }, h('h3', { t: 'list.title' }), h('p', { class: 'hint', t: 'list.hint' }),
    h('div', { class: 'buttons' }, h('label', { for: choose.id, t: 'list.title' }), choose, remove), list,
    h('div', { class: 'buttons' }, kind.element), h('div', { class: 'buttons' }, pointPart, viaPart, jointSpeed.element, lineSpeed.element,
      blend.element, seconds.element, bankPart, add),
    h('div', { class: 'buttons' }, h('label', { for: name.id, t: 'points.name' }), name, keep, planButton));
  store.on('cell-data', fill);
  store.on('chosen-language', draw);
  store.on('chosen', () => {
    fill();
    steps = [];
    draw();
  });
  store.on('arms welcome chosen', () => { card.hidden = store.arm()?.has?.path !== true; });
  showFields();
  fill();
  return card;
}
