/** The cell's data as a whole: what is kept, the file, its export, import and versions of before. */
import { h, replaceText, setText } from '../ui/dom.js';
import { DEGREES, fixed, rpyFromRotationVector } from '../ui/format.js';
import { numberField, readAll } from '../ui/field.js';
import { toast } from '../ui/toast.js';
import { exportCell } from './export.js';
import { makeLayout, makeNames } from './names.js';
import { twiceButton } from './twice.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {import('../link/messages.js').Answer} Answer */

const LONGEST = 60;
const LARGEST = 256 * 1024;
const MM = 1000;
const AT_ONCE = 100;

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountCell(root, app) {
  root.append(makeOffer(app), makeFrames(app), makePayloads(app), makeNames(app), makeLayout(app), makeFile(app));
}

/**
 * @param {Answer} answer
 * @param {string} about Key.
 */
function say(answer, about) {
  toast(answer.ok ? 'cmd.done' : (answer.message || 'cmd.failed'), answer.ok ? 'good' : 'bad', about);
}

/**
 * The points that this browser kept before: offered once, then taken over or left alone.
 *
 * @param {App} app
 */
function makeOffer(app) {
  const said = h('p', {});
  const take = h('button', { type: 'button', class: 'primary', t: 'cell.offer_take', on: { click: () => void bring() } });
  const leave = h('button', { type: 'button', t: 'cell.offer_leave', on: { click: () => {
    app.points.decline();
    draw();
  } } });
  const card = h('section', { class: 'card', id: 'cell-offer', hidden: true }, h('h3', { t: 'cell.offer' }), said,
    h('div', { class: 'buttons' }, take, leave));

  async function bring() {
    /** @type {Answer} */
    let answer = { ok: true, message: '' };
    for (let points = app.points.kept(); points.length > 0 && answer.ok; points = points.slice(AT_ONCE)) {
      answer = await app.cell.change(points.slice(0, AT_ONCE));
    }
    say(answer, 'cell.offer');
    if (answer.ok) app.points.decline();
    draw();
  }

  function draw() {
    const count = app.cell.isKnown() && app.store.welcome?.may === 'command' ? app.points.kept().length : 0;
    card.hidden = count === 0;
    setText(said, 'cell.offer_count', { count });
  }

  let isTold = false;
  app.store.on('cell-data welcome', () => {
    draw();
    if (!card.hidden && !isTold) {
      isTold = true;
      toast('cell.offer_where', 'good', 'cell.offer');
    }
  });
  return card;
}

/** @param {App} app */
function makeFrames(app) {
  const lists = /** @type {['user_frames', 'tool_frames']} */ (['user_frames', 'tool_frames']).map((section) => {
    const list = h('ul', { class: 'points' });
    const draw = () => list.replaceChildren(...app.cell.entries(section, app.store.chosen).map(([name, entry]) => h('li', {},
      h('span', { class: 'point-name' }, name),
      h('span', { class: 'second' }, `${entry.p.map((/** @type {number} */ value) => fixed(value * MM, 1)).join(' / ')} mm, ${
        rpyFromRotationVector(entry.r).map((value) => fixed(value * DEGREES, 1)).join(' / ')} °${
        entry.residual === undefined || entry.residual === null ? '' : `, ± ${fixed(entry.residual * MM, 2)} mm`}`),
      entry.number ? twiceButton('teach.set', 'teach.set_sure', () => app.command(section === 'user_frames' ? 'user_frame' : 'tool_frame',
        { number: entry.number, p: entry.p, r: entry.r }), { needs: 'setting', values: () => ({ number: entry.number }) }) : null,
      removeButton(app, section, name))));
    app.store.on('cell-data chosen', () => {
      draw();
      app.lockControls();
    });
    return h('div', {}, h('p', { class: 'hint', t: `cell.kept.${section}` }), list);
  });
  return h('section', { class: 'card' }, h('h3', { t: 'cell.frames' }), ...lists);
}

/**
 * @param {App} app
 * @param {string} section
 * @param {string} name
 */
function removeButton(app, section, name) {
  const arm = app.store.chosen;
  return twiceButton('points.remove', 'cell.remove_sure', async () => {
    const answer = await app.cell.change([{ section, arm, name, entry: null }]);
    if (!answer.ok) say(answer, 'points.remove');
  }, { values: () => ({ name }) });
}

/** @param {App} app */
function makePayloads(app) {
  const list = h('ul', { class: 'points' });
  const name = /** @type {HTMLInputElement} */ (h('input', { type: 'text', id: 'payload-name', maxlength: LONGEST, autocomplete: 'off' }));
  const tool = numberField({ label: 'tool.title', unit: '1–11', decimals: 0, value: 1, low: 1, high: 11 });
  const mass = numberField({ label: 'setup.mass', unit: 'kg', low: 0, high: 100 });
  const centre = ['X', 'Y', 'Z'].map((label) => numberField({ label, unit: 'mm', scale: MM, low: -1000, high: 1000 }));
  const keep = h('button', { type: 'button', t: 'teach.keep', on: { click: () => void store() } });

  async function store() {
    const values = readAll([tool, mass, ...centre]);
    if (!values) return;
    if (!name.value.trim()) {
      toast('teach.name_first', 'bad', 'teach.keep');
      name.focus();
      return;
    }
    say(await app.cell.change([{ section: 'payloads', arm: app.store.chosen, name: name.value.trim(),
      entry: { tool: Math.round(values[0]), mass: values[1], centre: values.slice(2) } }]), 'teach.keep');
  }

  const draw = () => list.replaceChildren(...app.cell.entries('payloads', app.store.chosen).map(([one, entry]) => h('li', {},
    h('span', { class: 'point-name' }, one),
    h('span', { class: 'second' }, `${fixed(entry.mass, 2)} kg, ${entry.centre.map((/** @type {number} */ value) => fixed(value * MM, 1)).join(' / ')} mm`),
    entry.tool ? twiceButton('teach.set', 'cell.payload_sure', () => app.command('payload',
      { tool: entry.tool, mass: entry.mass, centre: entry.centre }), { needs: 'setting', values: () => ({ number: entry.tool }) }) : null,
    removeButton(app, 'payloads', one))));
  app.store.on('cell-data chosen', () => {
    draw();
    app.lockControls();
  });
  return h('section', { class: 'card' }, h('h3', { t: 'cell.payloads' }), list,
    h('div', { class: 'fields' }, tool.element, mass.element, ...centre.map((field) => field.element)),
    h('div', { class: 'buttons' }, h('label', { for: name.id, t: 'points.name' }), name, keep));
}

/** @param {App} app */
function makeFile(app) {
  const { cell } = app;
  const said = h('p', { id: 'cell-said' });
  const problem = h('p', { class: 'warnings', role: 'alert' });
  const select = /** @type {HTMLSelectElement} */ (h('select', { id: 'cell-version' }));
  const file = /** @type {HTMLInputElement} */ (h('input', { type: 'file', id: 'cell-import', accept: '.json,application/json' }));
  let isFilled = false;
  const take = h('button', { type: 'button', t: 'cell.export', on: { click: () => void exportCell(app) } });
  const takeVersion = h('button', { type: 'button', t: 'cell.export', on: { click: () => {
    if (select.value) void exportCell(app, Number(select.value));
  } } });
  const bring = twiceButton('cell.import', 'cell.import_sure', async () => {
    const chosen = file.files?.[0];
    if (!chosen) {
      toast('cell.import_which', 'bad', 'cell.import');
    } else if (chosen.size > LARGEST) {
      toast('cell.import_large', 'bad', 'cell.import');
    } else {
      say(await cell.replace(await chosen.text()), 'cell.import');
    }
  }, { values: () => {
    const chosen = file.files?.[0];
    return { name: chosen?.name ?? '–', size: chosen?.size ?? 0, changed: chosen?.lastModified ?? 0 };
  } });
  const list = h('button', { type: 'button', t: 'run.list', on: { click: () => void fill() } });
  const restore = twiceButton('cell.restore', 'cell.restore_sure', async () => {
    if (select.value) say(await cell.ask('cell_restore', { version: Number(select.value) }), 'cell.restore');
  }, { values: () => ({ version: select.value || '–' }) });

  async function fill() {
    if (!app.store.welcome || app.store.welcome.may === 'watch') return;
    isFilled = true;
    const answer = await cell.ask('cell_versions');
    select.replaceChildren(...(answer.data?.versions ?? []).map((/** @type {any} */ one) => h('option', { value: one.revision },
      `${one.revision} · ${one.saved} · ${one.by}`)));
  }

  app.store.on('cell-data', () => {
    setText(said, 'cell.file_said', { file: cell.file, revision: cell.revision, by: cell.by || '–', saved: cell.saved || '–' });
    replaceText(problem, cell.problem);
    if (!isFilled) void fill();
  });
  return h('section', { class: 'card', id: 'cell-file' }, h('h3', { t: 'cell.file' }), h('p', { class: 'hint', t: 'cell.hint' }), said, problem,
    h('div', { class: 'buttons' }, take), h('div', { class: 'buttons' }, h('label', { for: file.id, t: 'cell.import_file' }), file, bring),
    h('div', { class: 'buttons' }, h('label', { for: select.id, t: 'cell.versions' }), select, list, takeVersion, restore));
}
