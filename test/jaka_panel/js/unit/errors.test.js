import assert from 'node:assert/strict';
import { test } from 'node:test';
import { sentenceOf } from '../../../../tools/jaka_panel/web/js/ui/errors.js';

test('errors of the operating system are sentences, and the rest of a text stays', () => {
  for (const [text, said] of [
    ['down: [Errno 111] Connection refused', 'down: nothing listens at that address'],
    ["[Errno 111] Connect call failed ('127.0.0.1', 10005)", 'nothing listens at that address (127.0.0.1:10005)'],
    ['lost: [Errno 104] Connection reset by peer; it is tried again', 'lost: the other side has closed the connection; it is tried again'],
    ['[Errno 113] No route to host', 'the network cannot reach it'],
    ['[Errno 5] Input/output error', 'Input/output error'],
    ['[Errno 110]', 'there is no answer'],
    ['refused: <b>the drives</b> have no power', 'refused: <b>the drives</b> have no power'],
  ]) assert.equal(sentenceOf(text), said);
});
