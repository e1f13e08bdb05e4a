import assert from 'node:assert/strict';
import { readdirSync, readFileSync, statSync } from 'node:fs';
import { test } from 'node:test';
import { en } from '../../../../tools/jaka_panel/web/i18n/en.js';
import { zh } from '../../../../tools/jaka_panel/web/i18n/zh.js';
import { chooseLanguage, firstLanguage, translate } from '../../../../tools/jaka_panel/web/js/ui/i18n.js';

const WEB = new URL('../../../../tools/jaka_panel/web/', import.meta.url);
const places = (/** @type {string} */ text) => [...text.matchAll(/\{(\w+)\}/g)].map((match) => match[1]).sort();

/**
 * @param {URL} folder
 * @returns {string[]} Texts of the page's own files.
 */
function sources(folder) {
  return readdirSync(folder).filter((name) => !['vendor', 'i18n'].includes(name)).flatMap((name) => {
    const path = new URL(name, folder);
    return statSync(path).isDirectory() ? sources(new URL(`${name}/`, folder)) : [readFileSync(path, 'utf8')];
  });
}

test('both languages have the same texts, with the same places, in the same order', () => {
  assert.deepEqual(Object.keys(zh), Object.keys(en));
  for (const key of Object.keys(en)) assert.deepEqual(places(zh[key]), places(en[key]), key);
});

test('Chinese texts are Chinese', () => {
  const same = Object.keys(en).filter((key) => zh[key] === en[key] && /[a-z]{4,}/i.test(en[key]));
  assert.deepEqual(same.filter((key) => !/^io\.bank\./.test(key)), []);
});

test('every key that the page names has a text, and every text is used', () => {
  const all = sources(WEB).join('\n');
  const named = [...all.matchAll(/(?:\bt: |tLabel: |label: |setText\([^,\n]+, |data-t(?:-label)?=|actionButton\(|toast\()['"]([a-z]\w*\.[\w.]+)['"]/g)]
    .map((match) => match[1]);
  assert.ok(named.length > 100, String(named.length));
  assert.deepEqual(named.filter((key) => !(key in en)), []);
  const made = ['tab', 'state.name', 'motion', 'level', 'source', 'diagnostics', 'cmd', 'jog.space', 'jog.step', 'jog.end', 'may', 'plots',
    'view', 'io.bank', 'setup', 'program', 'sim.fault', 'move.kind', 'link', 'line', 'owner', 'wall', 'size', 'io.extent',
    'teach.point', 'teach.name', 'cell.kept', 'list.kind', 'list.value', 'mark'];
  assert.deepEqual(Object.keys(en).filter((key) => !all.includes(`'${key}'`) && !all.includes(`"${key}"`)
    && !made.some((start) => key.startsWith(`${start}.`))), []);
});

test('the language is the one that was chosen, else the browser’s, else English', () => {
  const kept = (/** @type {string|null} */ code) => /** @type {any} */ ({ getItem: () => code, setItem() {} });
  assert.equal(firstLanguage(kept('zh'), ['en-GB']), 'zh');
  assert.equal(firstLanguage(kept(null), ['de', 'zh-CN', 'en']), 'zh');
  assert.equal(firstLanguage(null, ['de']), 'en');
  chooseLanguage('zh');
  assert.equal(translate('state.on'), '开');
  assert.equal(translate('age.fresh', { ms: 5 }), '实时，5 毫秒前');
  assert.equal(translate('no.such.key'), 'no.such.key');
  chooseLanguage('en');
});

test('what STOP says before the page is there is what the page says', async () => {
  Object.assign(globalThis, { window: { addEventListener() {} }, document: { getElementById: () => null }, location: { hash: '' } });
  const { UNCONFIRMED } = await import('../../../../tools/jaka_panel/web/js/control/first_stop.js');
  assert.deepEqual(UNCONFIRMED, { en: en['stop.unconfirmed'], zh: zh['stop.unconfirmed'] });
});
