/** Live plots of joints, speeds and following error. They stand still on request, and when somebody zooms into one. */
import uPlot from '../../vendor/uplot/uPlot.esm.js';
import { h, setAttribute, setText } from '../ui/dom.js';
import { DEGREES } from '../ui/format.js';
import { onThemeChange, themeColour } from '../ui/theme.js';
import { pictureOfHistory, Samples, samplesOfHistory } from './samples.js';
import { MarkLane } from './mark_lane.js';
import { timeTicks } from './ticks.js';

/** @typedef {import('../app.js').App} App */

const KINDS = ['q', 'dq', 'e'];
const UNITS = /** @type {Record<string, string>} */ ({ q: '°', dq: '°/s', e: '°' });
const SPANS_S = [10, 30, 120, 600];
/** Longer spans come from the server's history. */
const OWN_S = 110;
const PERIOD_MS = 100;
const HISTORY_MS = 2000;
const PIECES = 300;
/** Pieces of the history with which the plots begin: each is shorter than a gap. */
const FIRST_PIECES = 550;
/** Heights that a chart can have, px. */
const LOWEST = 90;
const HIGHEST = 420;
const UNFIXED = 132;
/** The height of its caption and the gaps around it, px. */
const BESIDE = 34;

/**
 * @param {HTMLElement} root
 * @param {App} app
 */
export function mountPlots(root, app) {
  const { store, connection } = app;
  const samples = /** @type {Record<string, Samples>} */ (Object.fromEntries(KINDS.map((kind) => [kind, new Samples()])));
  let span = 30;
  let isPaused = false;
  /** Server's clock at the right edge while paused, s. */
  let pausedAt = 0;
  /** The span that is looked at while zoomed in, s. @type {[number, number]|null} */
  let zoomed = null;
  /** Server's clock less that of the page, s; the smallest delay counts. */
  let offset = -Infinity;
  let isSeen = true;
  let historyAt = -Infinity;
  /** True once the plots have begun with what the server has kept. */
  let isSeeded = false;
  const shown = /** @type {Set<number>} */ (new Set([0, 1, 2, 3, 4, 5]));

  const pause = h('button', { type: 'button', t: 'plots.pause', 'aria-pressed': 'false', on: { click: () => setPaused(!isPaused) } });
  const spans = SPANS_S.map((seconds) => h('button', { type: 'button', 'data-span': seconds,
    'aria-pressed': String(seconds === span), on: { click: () => setSpan(seconds) } }, seconds < 120 ? `${seconds} s` : `${seconds / 60} min`));
  const joints = [0, 1, 2, 3, 4, 5].map((n) => h('button', { type: 'button', class: `joint-key joint-${n + 1}`,
    'aria-pressed': 'true', on: { click: () => toggle(n) } }, `J${n + 1}`));
  const charts = KINDS.map((kind) => {
    const place = h('div', { class: 'plot', role: 'group', tLabel: `plots.${kind}` });
    const element = h('figure', {}, h('figcaption', {}, h('span', { t: `plots.${kind}` }), ` ${UNITS[kind]}`), place);
    return { kind, place, element, plot: /** @type {any} */ (null) };
  });
  const lane = new MarkLane(app, () => charts.forEach(({ plot }) => plot?.redraw(false)));
  /** Height of each chart, px. */
  let height = UNFIXED;
  const bar = h('div', { class: 'plot-bar' }, pause, h('div', { class: 'choice', role: 'group', tLabel: 'plots.span' }, ...spans),
    h('div', { class: 'choice', role: 'group', tLabel: 'plots.joints' }, ...joints), h('span', { class: 'hint', t: 'plots.hint' }));
  root.append(bar, h('div', { class: 'charts' }, lane.said, ...charts.map((chart) => chart.element)));

  /** @returns {number} Server's clock as far as the page knows, s. */
  const now = () => (Number.isFinite(offset) ? performance.now() / 1000 + offset : connection.serverNow);

  /** @param {boolean} paused */
  function setPaused(paused) {
    isPaused = paused;
    if (paused) pausedAt = now();
    else zoomed = null;
    setAttribute(pause, 'aria-pressed', String(paused));
    setText(pause, paused ? 'plots.go_on' : 'plots.pause');
    historyAt = -Infinity;
    draw();
  }

  /** @param {number} seconds */
  function setSpan(seconds) {
    span = seconds;
    zoomed = null;
    for (const button of spans) setAttribute(button, 'aria-pressed', String(Number(button.dataset.span) === span));
    historyAt = -Infinity;
    draw();
  }

  /** @param {number} n */
  function toggle(n) {
    if (shown.has(n)) shown.delete(n);
    else shown.add(n);
    setAttribute(joints[n], 'aria-pressed', String(shown.has(n)));
    for (const { plot } of charts) plot?.setSeries(n + 1, { show: shown.has(n) });
  }

  /** @param {typeof charts[0]} chart */
  function make(chart) {
    chart.plot?.destroy();
    const axis = { stroke: themeColour('--muted'), grid: { stroke: themeColour('--grid'), width: 1 },
      ticks: { stroke: themeColour('--grid'), width: 1 }, font: '11px system-ui, sans-serif' };
    const newest = () => (isPaused ? pausedAt : now());
    let origin = 0;
    chart.plot = new uPlot({
      width: Math.max(200, chart.place.clientWidth), height, legend: { show: false },
      cursor: { drag: { x: true, y: false }, sync: { key: 'panel' }, points: { show: false } },
      scales: { x: { time: false }, y: { range: (/** @type {any} */ _, /** @type {number} */ low, /** @type {number} */ high) => widened(low, high) } },
      series: [{}, ...[1, 2, 3, 4, 5, 6].map((n) => ({ stroke: themeColour(`--joint-${n}`), width: 1.5, points: { show: false },
        show: shown.has(n - 1), spanGaps: false }))],
      axes: [{ ...axis, size: 26,
        splits: (/** @type {any} */ _, /** @type {number} */ __, /** @type {number} */ low, /** @type {number} */ high,
          /** @type {number} */ step) => timeTicks(low, high, step, origin = newest()),
        values: (/** @type {any} */ _, /** @type {number[]} */ ticks) => (
          ticks.map((tick) => `${Number((tick - origin).toFixed(2))}`)) }, { ...axis, size: 48 }],
      hooks: { setSelect: [(/** @type {any} */ plot) => zoom(plot)], draw: [(/** @type {any} */ plot) => lane.draw(plot)],
        setCursor: [(/** @type {any} */ plot) => lane.point(plot)] },
    }, [[], [], [], [], [], [], []], chart.place);
    chart.plot.over.addEventListener('pointerleave', () => lane.leave());
    chart.plot.over.addEventListener('dblclick', () => {
      zoomed = null;
      historyAt = -Infinity;
      draw();
    });
  }

  /** @param {any} plot */
  function zoom(plot) {
    if (plot.select.width < 4) return;
    const from = plot.posToVal(plot.select.left, 'x');
    const to = plot.posToVal(plot.select.left + plot.select.width, 'x');
    plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
    if (!isPaused) setPaused(true);
    zoomed = [from, to];
    historyAt = -Infinity;
    draw();
  }

  function draw() {
    if (!isSeen || document.visibilityState !== 'visible') return;
    const end = isPaused ? pausedAt : now();
    const [from, to] = zoomed ?? [end - span, end];
    const isOwn = now() - from < OWN_S;
    lane.update(from, to, samples.q.newest(), charts[0].plot.over.clientWidth);
    if (!isSeeded && Number.isFinite(offset)) void seed();
    if (!isOwn) {
      void fetchHistory(from, to);
      return;
    }
    for (const { kind, plot } of charts) paint(plot, samples[kind].picture(from, to, PIECES), from, to);
  }

  /** Has the plots begin with what was before the page came: as soon as they are seen for the first time. */
  async function seed() {
    isSeeded = true;
    const arm = store.chosen;
    for (const kind of KINDS) {
      const answer = await connection.request({ t: 'history', arm, from: -OWN_S, to: 0, buckets: FIRST_PIECES, what: kind }, 5);
      if (arm !== store.chosen) return;
      if (answer.ok) samples[kind].precede(samplesOfHistory(answer.data, DEGREES));
      else setTimeout(() => { isSeeded = false; }, HISTORY_MS);  // it was asked too often, or the link is slow: again
    }
  }

  /**
   * @param {any} plot
   * @param {(number|null)[][]} rows
   * @param {number} from s
   * @param {number} to s
   */
  function paint(plot, rows, from, to) {
    plot.batch(() => {
      plot.setData(rows, false);
      plot.setScale('x', { min: from, max: to });
    });
  }

  /**
   * @param {number} from s
   * @param {number} to s
   */
  async function fetchHistory(from, to) {
    if (performance.now() - historyAt < HISTORY_MS || (isPaused && historyAt > 0)) return;
    historyAt = performance.now();
    const seconds = connection.serverNow;
    for (const { kind, plot } of charts) {
      const answer = await connection.request({ t: 'history', arm: store.chosen, from: from - seconds, to: Math.min(0, to - seconds),
        buckets: PIECES, what: kind }, 5);
      if (answer.ok) paint(plot, pictureOfHistory(answer.data, (to - from) / PIECES, DEGREES), from, to);
    }
  }

  function rebuild() {
    for (const chart of charts) make(chart);
    lane.enter(charts[0].plot);
    draw();
  }

  store.on('plot', (message) => {
    if (message.arm !== store.chosen) return;
    offset = Math.max(offset, message.now - performance.now() / 1000);
    for (const kind of KINDS) {
      const rows = message[kind];
      if (!rows) continue;
      message.s.forEach((/** @type {number} */ time, /** @type {number} */ index) => {
        samples[kind].add(time, rows.map((/** @type {number[]|null} */ row) => (
          row?.[index] === null || row?.[index] === undefined ? null : row[index] * DEGREES)));
      });
    }
  });
  store.on('chosen welcome', () => {
    offset = -Infinity;
    isSeeded = false;
    for (const kind of KINDS) samples[kind].clear();
    if (isPaused) setPaused(false);
  });
  rebuild();
  onThemeChange(rebuild);
  store.on('chosen-language alarms alarm calls call moves move', draw);
  const isFixed = matchMedia('(min-width: 1000px) and (min-height: 640px)');  // as in layout.css: else the charts make the height
  new ResizeObserver(() => {
    if (!root.clientHeight) return;  // the drawer is closed
    height = !isFixed.matches ? UNFIXED : Math.max(LOWEST, Math.min(HIGHEST, root.clientHeight - bar.offsetHeight - BESIDE));
    for (const { plot, place } of charts) {
      const width = place.clientWidth;
      if (width && (Math.abs(plot.width - width) > 1 || plot.height !== height)) plot.setSize({ width, height });
    }
  }).observe(root);
  new IntersectionObserver(([entry]) => {
    isSeen = entry.isIntersecting;
  }).observe(root);
  setInterval(() => {
    if (!isPaused) draw();
  }, PERIOD_MS);
}

/**
 * The range of a plot's values: a little more than they take, and never nothing.
 *
 * @param {number|null} low
 * @param {number|null} high
 * @returns {[number, number]}
 */
export function widened(low, high) {
  if (low === null || high === null || !Number.isFinite(low) || !Number.isFinite(high)) return [-1, 1];
  const least = Math.max(0.02, 0.02 * Math.max(Math.abs(low), Math.abs(high)));
  const margin = Math.max(0.08 * (high - low), (least - (high - low)) / 2);
  return [low - margin, high + margin];
}
