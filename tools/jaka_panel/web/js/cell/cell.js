/** The data of the cell, as the server keeps them for all pages: names, points, frames, payloads, lists of motions. */

/** @typedef {import('../link/messages.js').Answer} Answer */

const RATE_MS = 1500;
const PART = 12000;

/**
 * @typedef {object} Change
 * @property {string} section
 * @property {string} arm
 * @property {string} name
 * @property {Record<string, any>|null} entry null takes it away.
 */

/**
 * A copy of data with changes made; the data themselves stay as they are.
 *
 * @param {Record<string, any>} data By section, arm and name.
 * @param {Change[]} changes
 * @returns {Record<string, any>}
 */
export function withChanges(data, changes) {
  const next = { ...data };
  for (const { section, arm, name, entry } of changes) {
    const entries = { ...next[section]?.[arm] };
    if (entry === null) delete entries[name];
    else entries[name] = entry;
    next[section] = { ...next[section], [arm]: entries };
  }
  return next;
}

/**
 * The parts in which a text is sent, none cut within a character.
 *
 * @param {string} text
 * @param {number} [longest]
 * @returns {string[]}
 */
export function partsOf(text, longest = PART) {
  const letters = Array.from(text);
  const parts = [];
  for (let at = 0; at < letters.length || at === 0; at += longest) parts.push(letters.slice(at, at + longest).join(''));
  return parts;
}

/**
 * An answer; of a change that came too late with a text of ours.
 *
 * @param {Answer} answer
 * @returns {Answer}
 */
function told(answer) {
  return answer.data?.stale ? { ...answer, message: 'cell.stale' } : answer;
}

/** The page's copy of the data, kept up to date by the server's messages. */
export class Cell {
  /**
   * @param {object} link
   * @param {(message: object) => boolean} link.write
   * @param {(cmd: string, args: object) => Promise<Answer>} link.ask
   * @param {() => void} link.onChange
   */
  constructor(link) {
    this.link = link;
    this.revision = -1;
    this.saved = '';
    this.by = '';
    this.file = '';
    /** The reason why the server's file cannot be used; empty where it can. */
    this.problem = '';
    /** @type {Record<string, any>} */
    this.data = {};
    /** @type {any} */
    this.timer = null;
    /** @type {Promise<any>} */
    this.last = Promise.resolve();
  }

  /** @returns {boolean} Whether the server's data are there. */
  isKnown() {
    return this.revision >= 0;
  }

  /** Asks for all data, now and again until they are there. */
  fetch() {
    this.link.write({ t: 'cell' });
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.fetch(), RATE_MS);
  }

  /** @param {any} message Of the kinds `welcome`, `cell`, `cell_changed`. */
  take(message) {
    if (message.t === 'welcome') {
      this.fetch();
    } else if (message.t === 'cell') {
      clearTimeout(this.timer);
      this.set(message, message.data);
    } else if (message.t === 'cell_changed') {
      if (message.changes && message.revision === this.revision + 1) this.set(message, withChanges(this.data, message.changes));
      else if (message.revision !== this.revision || !message.changes) this.fetch();
    }
  }

  /**
   * @param {any} message
   * @param {Record<string, any>} data
   */
  set(message, data) {
    this.revision = message.revision;
    this.by = message.by ?? '';
    this.saved = message.saved ?? new Date().toISOString();
    this.problem = message.problem ?? '';
    this.file = message.file ?? this.file;
    this.data = data;
    this.link.onChange();
  }

  /**
   * @param {string} section
   * @param {string} arm Id.
   * @returns {[string, any][]} Name and entry, in their order.
   */
  entries(section, arm) {
    return Object.entries(this.data[section]?.[arm] ?? {});
  }

  /**
   * @param {string} section
   * @param {string} arm
   * @param {string} name
   * @returns {any} undefined where there is none.
   */
  entry(section, arm, name) {
    const entries = this.data[section]?.[arm];
    return entries && Object.hasOwn(entries, name) ? entries[name] : undefined;
  }

  /**
   * Changes entries, one request after the other, each of the revision that the page then shows.
   *
   * @param {Change[]} changes
   * @returns {Promise<Answer>}
   */
  change(changes) {
    const work = this.last.then(async () => {
      const answer = await this.link.ask('cell_change', { revision: this.revision, changes });
      return told(answer);
    });
    this.last = work.catch(() => null);
    return work;
  }

  /**
   * Puts what a file holds in the place of all data.
   *
   * @param {string} text
   * @returns {Promise<Answer>}
   */
  async replace(text) {
    const { revision } = this;
    const parts = partsOf(text);
    /** @type {Answer} */
    let answer = { ok: false, message: '' };
    for (const [index, part] of parts.entries()) {
      answer = await this.link.ask('cell_upload', { revision, part: index + 1, parts: parts.length, text: part });
      if (!answer.ok) return told(answer);
    }
    return answer;
  }

  /**
   * @param {string} cmd
   * @param {object} [args]
   * @returns {Promise<Answer>}
   */
  async ask(cmd, args = {}) {
    return told(await this.link.ask(cmd, { revision: this.revision, ...args }));
  }
}
