/**
 * The WebSocket to the panel's server: hello, pings, requests with an answer, and a new connection when one is lost.
 * What arrives goes to `onMessage`; whether anything arrives is told by `silence`.
 *
 * connecting: no welcome yet, for CONNECT_S at most. open: messages come. silent: none has come for SILENT_S. lost: there
 * is no connection, after LOST_S of silence at the latest; the next attempt follows after a pause that grows.
 */

const PING_S = 0.5;
const TICK_S = 0.1;
const CONNECT_S = 10;
const SILENT_S = 0.8;
const LOST_S = 6;
const RETRY_S = [0.3, 0.6, 1.2, 2.4, 4.8];
/** A connection that has lived so long begins again with the shortest pause. */
const STEADY_S = 5;
/** Round trips of which the quickest counts, and how many it takes to say that a link is slow. */
const TRIPS = 8;
const SURE_TRIPS = 3;
const ANSWER_S = 3600;

/** @typedef {'connecting'|'open'|'silent'|'lost'} LinkState */

/** @typedef {import('./messages.js').Answer} Answer */

/**
 * @typedef {object} Pending
 * @property {(answer: Answer) => void} resolve
 * @property {ReturnType<typeof setTimeout>} timer
 */

export class Connection {
  /**
   * @param {object} options
   * @param {string} options.url
   * @param {string|null} options.token
   * @param {string} options.name What this page is called in the others.
   * @param {(message: any) => void} options.onMessage
   * @param {(state: LinkState) => void} options.onState
   * @param {(url: string, protocols: string[]) => WebSocket} [options.open] For tests.
   */
  constructor({ url, token, name, onMessage, onState, open = (address, protocols) => new WebSocket(address, protocols) }) {
    this.url = url;
    this.token = token;
    this.name = name;
    this.onMessage = onMessage;
    this.onState = onState;
    this.open = open;
    /** @type {WebSocket|null} */
    this.socket = null;
    /** @type {LinkState} */
    this.state = 'connecting';
    this.tries = 0;
    this.requests = 0;
    /** Server's clock in its newest message, s. */
    this.serverNow = 0;
    this.seen = 0;
    this.pingedAt = 0;
    this.heardAt = 0;
    this.triedAt = 0;
    this.welcomedAt = 0;
    /** The newest round trips, s. @type {number[]} */
    this.roundTrips = [];
    /** The code with which the server closed the last connection. */
    this.closeCode = 0;
    /** @type {Map<number, Pending>} */
    this.pending = new Map();
    this.ended = false;
  }

  start() {
    this.ticker = setInterval(() => this.tick(), TICK_S * 1000);
    this.connect();
  }

  connect() {
    // with the token among its protocols the connection is served apart from those of visitors
    const socket = this.open(this.url, ['jaka-panel.v1', ...(this.token ? [`token.${this.token}`] : [])]);
    this.socket = socket;
    this.triedAt = performance.now();
    this.welcomedAt = 0;
    this.roundTrips = [];
    this.change('connecting');
    socket.onopen = () => {
      this.write({ t: 'hello', v: 1, token: this.token, name: this.name, resume: null });
    };
    socket.onmessage = (event) => this.receive(event.data);
    socket.onclose = (event) => {
      if (this.socket !== socket) return;
      this.closeCode = event.code;
      this.lose();
    };
  }

  lose() {
    this.socket = null;
    for (const [id, { resolve, timer }] of this.pending) {
      clearTimeout(timer);
      this.pending.delete(id);
      resolve({ ok: false, message: 'link.gone' });
    }
    if (this.welcomedAt && performance.now() - this.welcomedAt > STEADY_S * 1000) this.tries = 0;
    this.change('lost');
    if (this.ended) return;
    const wait = RETRY_S[Math.min(this.tries, RETRY_S.length - 1)];
    this.tries += 1;
    setTimeout(() => {
      if (!this.ended && !this.socket) this.connect();
    }, wait * 1000);
  }

  /** @param {any} data */
  receive(data) {
    this.heardAt = performance.now();
    let message;
    try {
      message = JSON.parse(data);
    } catch {
      return;
    }
    if (typeof message?.t !== 'string') return;
    if (typeof message.now === 'number') this.serverNow = Math.max(this.serverNow, message.now);
    if (message.t === 'state' && message.n > this.seen) this.seen = message.n;
    if (message.t === 'welcome') {
      this.welcomedAt = performance.now();
      this.serverNow = message.now;
      this.seen = 0;
    }
    if (message.t === 'pong') {
      this.roundTrips = [...this.roundTrips, (performance.now() - message.clock) / 1000].slice(-TRIPS);
    }
    if (message.t === 'answer' || message.t === 'history') this.settle(message);
    if (this.state !== 'open' && message.t !== 'error') this.change('open');
    this.ping();
    this.onMessage(message);
  }

  /** @param {any} message */
  settle(message) {
    const pending = this.pending.get(message.id);
    if (!pending) return;
    clearTimeout(pending.timer);
    this.pending.delete(message.id);
    pending.resolve(message.t === 'history' ? { ok: message.ok !== false, message: '', data: message }
      : { message: '', ...message });
  }

  /** Send a ping; called by the timer and by every message, for timers of a hidden tab are slow. */
  ping() {
    if (performance.now() - this.pingedAt < PING_S * 1000) return;
    this.pingedAt = performance.now();
    this.write({ t: 'ping', clock: performance.now(), echo: this.serverNow, seen: this.seen });
  }

  tick() {
    this.ping();
    if (this.socket && this.state === 'open' && this.silence() > SILENT_S) this.change('silent');
    const { socket } = this;
    const since = this.welcomedAt ? this.silence() : (performance.now() - this.triedAt) / 1000;
    if (socket && since > (this.welcomedAt ? LOST_S : CONNECT_S)) {
      this.lose();
      socket.close();
    }
  }

  /** @returns {number} For how long nothing has come, s. */
  silence() {
    return this.heardAt ? (performance.now() - this.heardAt) / 1000 : Infinity;
  }

  /** @returns {number} The quickest of the newest round trips, s; 0 before the first. */
  roundTrip() {
    return this.roundTrips.length ? Math.min(...this.roundTrips) : 0;
  }

  /**
   * @param {number} most s
   * @returns {boolean} Whether the newest round trips all took longer.
   */
  isSlower(most) {
    return this.roundTrips.length >= SURE_TRIPS && this.roundTrip() > most;
  }

  /** @param {LinkState} state */
  change(state) {
    if (this.state === state) return;
    this.state = state;
    this.onState(state);
  }

  /** @returns {number} Bytes that were sent and have not left the browser. */
  backlog() {
    return this.socket ? this.socket.bufferedAmount : 0;
  }

  /**
   * @param {object} message
   * @returns {boolean} Whether there is a connection to send it on.
   */
  write(message) {
    if (!this.socket || this.socket.readyState !== 1) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  /**
   * Sends a message with an id and waits for the answer that has the same.
   *
   * @param {object} message
   * @param {number} [timeout] s
   * @returns {Promise<Answer>} `ok` false with `message` where there is no connection, or none any more.
   */
  request(message, timeout = ANSWER_S) {
    const id = ++this.requests;
    return new Promise((resolve) => {
      if (!this.write({ ...message, id })) {
        resolve({ ok: false, message: 'link.gone' });
        return;
      }
      const timer = setTimeout(() => {
        this.pending.delete(id);
        resolve({ ok: false, message: 'link.no_answer' });
      }, timeout * 1000);
      this.pending.set(id, { resolve, timer });
    });
  }

  close() {
    this.ended = true;
    clearInterval(this.ticker);
    this.socket?.close();
  }
}
