/** Over the whole page when the server says nothing: what is seen below it is the past. STOP stays above it. */
import { byId, setText } from '../ui/dom.js';
import { fixed } from '../ui/format.js';

/** @typedef {import('../app.js').App} App */

/** @param {App} app */
export function mountLinkLoss(app) {
  const cover = byId('link-loss');
  const text = byId('link-loss-text');
  let wasOpen = false;

  function show() {
    const { state, closeCode } = app.connection;
    wasOpen ||= state === 'open';
    cover.hidden = state === 'open';
    document.body.classList.toggle('cut', state !== 'open');
    const silence = app.connection.silence();
    if (closeCode === 1013) setText(text, 'link.full');
    else if (closeCode === 1008) setText(text, 'link.policy');
    else if (!wasOpen) setText(text, 'link.connecting');
    else setText(text, state === 'silent' ? 'link.silent' : 'link.lost', { s: fixed(silence, 0) });
  }

  setInterval(show, 200);
  app.store.on('link', show);
  show();
}
