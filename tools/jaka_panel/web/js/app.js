/** Puts the page together: one connection, one store, and the parts that show it and act on it. */
import { Connection } from './link/connection.js';
import { Store } from './link/store.js';
import { takeToken } from './link/token.js';
import { byId, h, retranslate, setText } from './ui/dom.js';
import { chooseLanguage, currentLanguage, firstLanguage, isKnown, languages, translate } from './ui/i18n.js';
import { mountDrawer } from './ui/drawer.js';
import { mountView } from './ui/size.js';
import { makeTabs } from './ui/tabs.js';
import { chooseTheme, isDark, keptTheme } from './ui/theme.js';
import { toast } from './ui/toast.js';
import { guardControls, mountArmChoice, mountControl } from './control/control.js';
import { Offers } from './control/offers.js';
import { mountStop } from './control/stop.js';
import { Cell } from './cell/cell.js';
import { mountCell } from './cell/data.js';
import { mountTeach } from './cell/teach.js';
import { mountArmBar } from './do/arm_bar.js';
import { mountIo } from './do/io.js';
import { mountMove } from './do/move.js';
import { Points } from './do/points.js';
import { mountRun } from './do/run.js';
import { mountSetup } from './do/setup.js';
import { mountJog } from './jog/jog.js';
import { mountPlots } from './plots/plots.js';
import { mountSimulator } from './simulator/simulator.js';
import { mountLine } from './state/can_move.js';
import { makeNews, mountAlarms, mountCalls, mountDiagnostics } from './state/events.js';
import { mountJoints } from './state/joints.js';
import { mountLinkLoss } from './state/link_loss.js';
import { mountStatus } from './state/status.js';
import { mountWall } from './state/wall.js';
import { mountTool } from './state/tool.js';
import { mountArmView } from './view/arm_view.js';

/** @typedef {import('./link/messages.js').Answer} Answer */
/** @typedef {import('./link/messages.js').ArmState} ArmState */

/**
 * @param {'localStorage'|'sessionStorage'} name
 * @returns {Storage|null} Null where the browser keeps nothing.
 */
function storageOf(name) {
  try {
    return window[name];
  } catch {
    return null;
  }
}

/** @returns {string} What this page is called in the others. */
function pageName() {
  const agent = navigator.userAgent;
  const browser = /Firefox/.test(agent) ? 'Firefox' : (/Edg\//.test(agent) ? 'Edge' : (/Chrome/.test(agent) ? 'Chrome'
    : (/Safari/.test(agent) ? 'Safari' : 'Browser')));
  return `${browser}, ${screen.width}×${screen.height}`;
}

/** The state and the methods that the parts of the page share. */
export class App {
  constructor() {
    this.local = storageOf('localStorage');
    this.store = new Store();
    this.cell = new Cell({
      write: (message) => this.connection.write(message),
      ask: (cmd, args) => this.ask(cmd, args, null),
      onChange: () => ['cell-data', 'points'].forEach((kind) => this.store.tell(kind)),
    });
    this.points = new Points(this.cell, this.local, (arm) => this.store.frames(arm),
      (answer) => toast(answer.message || 'cmd.failed', 'bad', 'points.title'));
    this.store.on('welcome cell cell_changed', (message) => this.cell.take(message));
    /** @type {import('./jog/hold.js').Hold|null} */
    this.hold = null;
    /** @type {import('./view/arm_view.js').Preview} */
    this.preview = { ghost() {}, path() {}, placeAt: () => null };
    /** @type {((state: ArmState|null) => void)[]} */
    this.painters = [];
    /** @type {(() => void)[]} */
    this.late = [];
    this.isDirty = false;
    this.offers = new Offers(this);
    /** The plan that is drawn and waits for its button. @type {'move'|'run'|null} */
    this.offer = null;
    const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
    this.connection = new Connection({
      url: `${scheme}://${location.host}/ws`, token: takeToken(location, history, storageOf('sessionStorage')), name: pageName(),
      onMessage: (message) => this.take(message),
      onState: (state) => {
        if (state === 'lost') this.store.take({ t: 'control', holder: null, you: false, asked: null });
        this.store.tell('link');
      },
    });
  }

  /** @param {any} message */
  take(message) {
    if (message.t === 'pong') this.store.takeWay(this.connection.roundTrip() / 2);
    this.store.take(message);
    if (message.t === 'state' && message.arm === this.store.chosen) this.paintSoon();
    if (message.t === 'welcome') this.watch();
  }

  watch() {
    this.paintSoon();
    if (!this.store.chosen) return;
    this.connection.write({ t: 'watch', arms: [this.store.chosen], plots: true, rate: this.store.welcome?.rate ?? 30 });
  }

  /**
   * Calls back with the newest state before each picture in which it is another one.
   *
   * @param {(state: ArmState|null) => void} painter
   */
  onFrame(painter) {
    this.painters.push(painter);
  }

  paintSoon() {
    if (this.isDirty) return;
    this.isDirty = true;
    requestAnimationFrame(() => this.paint());
  }

  paint() {
    this.isDirty = false;
    const { state } = this.store.record();
    for (const painter of this.painters) painter(state);
    if (state) this.store.drawn = state.now;
  }

  /** @param {() => void} call When every part is in its place. */
  afterMount(call) {
    this.late.push(call);
  }

  /** Shows what may be pressed of elements that were made just now. */
  lockControls() {
    this.offers.lockAll();
  }

  /**
   * @param {string} text
   * @returns {boolean} Whether it is the key of a text.
   */
  isText(text) {
    return isKnown(text);
  }

  /**
   * @param {string} key
   * @param {Record<string, string|number>} [values]
   * @returns {string} In the page's language, now.
   */
  say(key, values) {
    return translate(key, values);
  }

  /**
   * @param {string} [button] Its name in state/line.js.
   * @returns {boolean} Whether this may be done now; says what stands against it where it may not.
   */
  mayDo(button = 'command') {
    const reason = this.offers.against(button);
    if (!reason) return true;
    toast(reason, 'bad');
    if (!reason.startsWith('control.')) return false;
    byId('control').classList.add('look-here');
    setTimeout(() => byId('control').classList.remove('look-here'), 1500);
    return false;
  }

  /**
   * A question that needs no control and changes nothing.
   *
   * @param {string} cmd
   * @param {Record<string, any>} args
   * @param {string|null} [arm]
   * @returns {Promise<Answer>}
   */
  ask(cmd, args, arm = this.store.chosen) {
    return this.connection.request({ t: 'cmd', arm, cmd, args });
  }

  /**
   * A command to the chosen arm; how it ended is shown.
   *
   * @param {string} cmd
   * @param {Record<string, any>} [args]
   * @param {{arm?: string|null, quiet?: boolean, about?: string}} [options] `quiet`: only a failure is shown.
   * @returns {Promise<Answer>}
   */
  async command(cmd, args = {}, options = {}) {
    if (!this.mayDo()) return { ok: false, message: '' };
    const arm = options.arm === undefined ? this.store.chosen : options.arm;
    const answer = await this.connection.request({ t: 'cmd', arm, cmd, args });
    const about = options.about ?? `cmd.${cmd}`;
    if (!answer.ok) toast(answer.message || 'cmd.failed', 'bad', about);
    else if (!options.quiet) toast(answer.message || 'cmd.done', 'good', about);
    return answer;
  }
}

/** @param {App} app */
function mountSwitches(app) {
  const language = byId('language');
  const theme = byId('theme');
  const showLanguage = () => {
    document.documentElement.lang = currentLanguage() === 'zh' ? 'zh-CN' : 'en';
    retranslate();
    document.title = translate('title');
  };
  language.addEventListener('click', () => {
    const next = languages[(languages.indexOf(currentLanguage()) + 1) % languages.length];
    chooseLanguage(next, app.local);
    showLanguage();
    app.paintSoon();
    app.store.tell('chosen-language');
  });
  theme.addEventListener('click', () => {
    chooseTheme(isDark() ? 'light' : 'dark', app.local);
    setText(theme, isDark() ? 'theme.light' : 'theme.dark');
  });
  showLanguage();
  setText(theme, isDark() ? 'theme.light' : 'theme.dark');
}

function start() {
  const app = new App();
  chooseTheme(keptTheme(app.local), app.local);
  chooseLanguage(firstLanguage(app.local, navigator.languages), app.local);
  guardControls(app);
  mountStop(app);
  mountLinkLoss(app);
  mountControl(app);
  mountLine(app);
  mountArmChoice(app);
  mountStatus(byId('status'), app);
  mountTool(byId('tool'), app);
  mountJoints(byId('joints'), app);
  app.preview = mountArmView(byId('view'), app);
  mountArmBar(byId('arm-bar'), app);
  const doing = makeTabs(byId('doing'), ['jog', 'move', 'run', 'io', 'setup', 'teach', 'cell', 'simulator'], 'tabs.do', (name) => {
    app.hold?.end('not seen');
    app.store.tell('tab', name);
  });
  mountJog(doing.panels.jog, app);
  mountMove(doing.panels.move, app);
  mountRun(doing.panels.run, app);
  mountIo(doing.panels.io, app);
  mountSetup(doing.panels.setup, app);
  mountTeach(doing.panels.teach, app);
  mountCell(doing.panels.cell, app);
  mountSimulator(doing.panels.simulator, app);
  app.store.on('arms welcome chosen', () => doing.hide('simulator', app.store.arm()?.simulator !== true));
  doing.hide('simulator', true);
  mountPlots(byId('plots'), app);
  const seeing = makeTabs(byId('seeing'), ['alarms', 'calls', 'diagnostics'], 'tabs.see');
  mountAlarms(seeing.panels.alarms, app);
  mountCalls(seeing.panels.calls, app);
  mountDiagnostics(seeing.panels.diagnostics, app);
  mountWall(byId('wall'), app);
  mountDrawer(app.local, seeing.row, makeNews(app));
  mountView(app.local);
  mountSwitches(app);
  app.store.on('chosen', () => app.watch());
  for (const call of app.late) call();
  app.offers.start();
  app.connection.start();
  const noscript = h('span', { hidden: true, id: 'mounted' });
  document.body.append(noscript);
}

start();
