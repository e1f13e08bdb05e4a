/** The marks of the plots: lines and bars in each of them, and in the first one buttons that say by focus what each is. */
import { h, replaceText, setAttribute } from '../ui/dom.js';
import { themeColour } from '../ui/theme.js';
import { timeOfDay } from '../state/events.js';
import { ownerText } from '../state/can_move.js';
import { grouped, marksOf, SHAPES } from './marks.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {import('./marks.js').Mark} Mark */

/** Width of a mark, px; for fingers. */
const WIDE = 24;
const TABLET = 48;
/** Most marks that are named where they lie upon each other. */
const NAMED = 3;
const COLOURS = /** @type {Record<Mark['kind'], string>} */ ({ error: '--bad', failed: '--bad', warning: '--warn', call: '--accent', move: '--ok' });

export class MarkLane {
  /**
   * @param {App} app
   * @param {() => void} onChoice Another mark is chosen.
   */
  constructor(app, onChoice) {
    this.app = app;
    this.onChoice = onChoice;
    /** The line with the name of the chosen mark. */
    this.said = h('p', { class: 'mark-said', hidden: true });
    this.element = h('div', { class: 'mark-lane', role: 'group', tLabel: 'mark.lane', on: {
      keydown: (/** @type {KeyboardEvent} */ event) => this.step(event),
      focusin: (/** @type {FocusEvent} */ event) => this.choose(this.idOf(event.target)), focusout: () => this.choose(''),
    } });
    /** @type {Record<string, string>} */
    this.colours = {};
    /** @type {Mark[][]} */
    this.groups = [];
    /** Id of the mark that is named. */
    this.chosen = '';
    /** Id of the one that the key Tab leads to. */
    this.stop = '';
    /** @type {Map<string, HTMLElement>} By the id of the first mark of a group. */
    this.buttons = new Map();
  }

  /** Begins anew in a plot, in the page's present colours. @param {any} plot */
  enter(plot) {
    for (const [kind, name] of Object.entries(COLOURS)) this.colours[kind] = themeColour(name);
    plot.over.append(this.element);
  }

  /** @returns {number} px */
  get wide() {
    return document.documentElement.dataset.view === 'tablet' ? TABLET : WIDE;
  }

  /**
   * @param {number} from s
   * @param {number} to s
   * @param {number} seen When the arm was last seen, s.
   * @param {number} width Of a plot, px.
   */
  update(from, to, seen, width) {
    const { store } = this.app;
    const lead = (store.welcome?.wall ?? 0) - (store.welcome?.now ?? 0);
    const marks = marksOf(store.record(), lead, seen, (owner) => (owner ? ownerText(this.app, owner) : this.app.say('owner.unknown')),
      (wall) => timeOfDay(wall).slice(0, 8));
    this.groups = grouped(marks, from, to, ((to - from) * this.wide) / Math.max(width, this.wide));
    const kept = new Set(this.groups.map(([mark]) => mark.id));
    for (const [id, button] of this.buttons) {
      if (kept.has(id)) continue;
      button.remove();
      this.buttons.delete(id);
      if (this.stop === id) this.stop = '';
      if (this.chosen === id) this.chosen = '';
    }
    this.stop ||= this.groups.at(-1)?.[0].id ?? '';
    for (const group of this.groups) {
      const [mark] = group;
      let button = this.buttons.get(mark.id);
      if (!button) {
        button = h('button', { type: 'button', 'data-mark-id': mark.id });
        this.buttons.set(mark.id, button);
        this.element.append(button);
      }
      setAttribute(button, 'class', `plot-mark ${mark.kind}${mark.id === this.chosen ? ' chosen' : ''}`);
      setAttribute(button, 'tabindex', mark.id === this.stop ? '0' : '-1');
      setAttribute(button, 'aria-label', this.nameOf(group));
      setAttribute(button, 'data-shape', SHAPES[mark.kind] + (group.length > 1 ? String(group.length) : ''));
      button.style.left = `${(100 * (Math.max(mark.at, from) - from)) / (to - from)}%`;
    }
    this.say();
  }

  /**
   * @param {Mark[]} group
   * @returns {string}
   */
  nameOf(group) {
    const names = group.slice(0, NAMED).map(({ says: [key, values] }) => this.app.say(key, values));
    if (group.length > NAMED) names.push(this.app.say('mark.more', { count: group.length - NAMED }));
    return names.join(' · ');
  }

  /** @param {EventTarget|null} target */
  idOf(target) {
    return (target instanceof Element && this.element.contains(target) ? target.getAttribute('data-mark-id') : null) ?? '';
  }

  /** @param {string} id Empty for none. */
  choose(id) {
    if (id === this.chosen) return;
    this.chosen = id;
    if (id) this.stop = id;
    for (const [one, button] of this.buttons) {
      button.classList.toggle('chosen', one === id);
      setAttribute(button, 'tabindex', one === this.stop ? '0' : '-1');
    }
    this.say();
    this.onChoice();
  }

  say() {
    const group = this.groups.find(([mark]) => mark.id === this.chosen);
    this.said.hidden = !group;
    if (group) replaceText(this.said, this.nameOf(group));
  }

  /** The arrow keys go from mark to mark. @param {KeyboardEvent} event */
  step(event) {
    const place = this.groups.findIndex(([mark]) => mark.id === this.chosen);
    const next = { ArrowLeft: place - 1, ArrowRight: place + 1, Home: 0, End: this.groups.length - 1 }[event.key];
    if (next === undefined || place < 0) return;
    event.preventDefault();
    const group = this.groups[Math.max(0, Math.min(this.groups.length - 1, next))];
    this.buttons.get(group[0].id)?.focus();
  }

  /** The pointer has left a plot. */
  leave() {
    if (!this.element.contains(document.activeElement)) this.choose('');
  }

  /**
   * Names the mark that is next to the pointer in any of the plots.
   *
   * @param {any} plot
   */
  point(plot) {
    if (this.element.contains(document.activeElement) || !plot.over.matches(':hover')) return;
    const far = (/** @type {Mark[]} */ [mark]) => Math.abs(plot.valToPos(Math.max(mark.at, plot.scales.x.min), 'x') - plot.cursor.left);
    const [near] = [...this.groups].sort((one, other) => far(one) - far(other));
    this.choose(near && far(near) < this.wide / 2 ? near[0].id : '');
  }

  /**
   * Draws the marks into a plot, behind its buttons.
   *
   * @param {any} plot
   */
  draw(plot) {
    const { ctx, bbox } = plot;
    const scale = devicePixelRatio;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    const chosen = this.groups.find(([mark]) => mark.id === this.chosen) ?? [];
    for (const mark of this.groups.flat()) {
      const isChosen = chosen.includes(mark);
      ctx.strokeStyle = ctx.fillStyle = this.colours[mark.kind];
      ctx.lineWidth = (isChosen ? 3 : 1) * scale;
      const x = plot.valToPos(mark.at, 'x', true);
      if (mark.to !== null) {
        const high = (isChosen ? 6 : 4) * scale;
        ctx.fillRect(x, bbox.top + bbox.height - high, Math.max(2 * scale, plot.valToPos(mark.to, 'x', true) - x), high);
        if (!isChosen) continue;
      }
      ctx.setLineDash(mark.kind === 'error' || mark.kind === 'failed' ? [] : (mark.kind === 'move' ? [scale, 2 * scale] : [4 * scale, 3 * scale]));
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
    }
    ctx.restore();
  }
}
