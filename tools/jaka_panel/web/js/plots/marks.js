/** The events beside the curves: alarms, calls that change something, motions; as marks on the time axis of the plots. */
import { sentenceOf } from '../ui/errors.js';
import { fixed } from '../ui/format.js';

/**
 * @typedef {object} Mark
 * @property {string} id The same for the same thing, as long as it is known.
 * @property {'error'|'warning'|'call'|'failed'|'move'} kind
 * @property {number} at By the server's clock, s.
 * @property {number|null} to End of a motion, s; of one that goes on, when the arm was last seen.
 * @property {[string, Record<string, string|number>]} says Key of a text, and its values.
 */

/** Shapes by kind, in the order of their weight: none is told by its colour alone. @type {Record<Mark['kind'], string>} */
export const SHAPES = { error: '■', failed: '✕', warning: '▲', call: '◆', move: '▬' };
/** Calls that only ask. */
const ASKS = /^get_|^set_workspace$/;

/**
 * Return whether a call changes something, or was to.
 *
 * @param {import('../link/messages.js').Call} call
 * @returns {boolean}
 */
export function changes(call) {
  return !ASKS.test(call.name) || (call.name === 'set_workspace' && !/^yaml: ["']{2}\s*$/.test(call.request.trim()));
}

/**
 * All marks, in the order of time.
 *
 * @param {{alarms: import('../link/messages.js').Alarm[], calls: import('../link/messages.js').Call[], moves: import('../link/messages.js').Move[]}} record
 * @param {number} lead Unix time less the server's clock, s.
 * @param {number} seen When the arm was last seen, s.
 * @param {(owner: string) => string} ownerName
 * @param {(wall: number) => string} timeOf Time of day.
 * @returns {Mark[]}
 */
export function marksOf({ alarms, calls, moves }, lead, seen, ownerName, timeOf) {
  const marks = /** @type {Mark[]} */ ([]);
  for (const { n, wall, level, code, text } of alarms) {
    if (level === 'info') continue;
    marks.push({ id: `alarm ${n}`, kind: level, at: wall - lead, to: null,
      says: [`mark.${level}`, { time: timeOf(wall), text: `${code ? `${code} ` : ''}${sentenceOf(text)}` }] });
  }
  for (const call of calls) {
    if (!changes(call)) continue;
    marks.push({ id: `call ${call.n}`, kind: call.ok ? 'call' : 'failed', at: call.wall - lead, to: null,
      says: [call.ok ? 'mark.call' : 'mark.failed', { time: timeOf(call.wall), name: call.name, caller: call.caller, s: fixed(call.took, 2) }] });
  }
  for (const { n, s, to, owner, lost } of moves) {
    const says = lost ? 'mark.move_lost' : (to === null ? 'mark.move_on' : 'mark.move');
    marks.push({ id: `move ${n}`, kind: 'move', at: s, to: to ?? Math.max(s, seen),
      says: [says, { time: timeOf(s + lead), s: fixed((to ?? Math.max(s, seen)) - s, 1), owner: ownerName(owner) }] });
  }
  return marks.sort((one, other) => one.at - other.at);
}

/**
 * The marks within a time span, those of the same stretch of time together: as time goes on, each stays with its own.
 *
 * @param {Mark[]} marks In the order of time.
 * @param {number} from s
 * @param {number} to s
 * @param {number} least Length of a stretch, s.
 * @returns {Mark[][]} The one of the most weight first in each.
 */
export function grouped(marks, from, to, least) {
  const weight = (/** @type {Mark} */ { kind }) => Object.keys(SHAPES).indexOf(kind);
  /** @type {Map<number, Mark[]>} */
  const groups = new Map();
  for (const mark of marks) {
    if (mark.at > to || (mark.to ?? mark.at) < from) continue;
    const stretch = mark.at < from ? -Infinity : Math.floor(mark.at / least);
    groups.set(stretch, [...(groups.get(stretch) ?? []), mark]);
  }
  return [...groups.values()].map((group) => group.sort((one, other) => weight(one) - weight(other)));
}
