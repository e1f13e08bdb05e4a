/** The file of the cell's data, or one of its versions, as a download. */
import { h } from '../ui/dom.js';
import { toast } from '../ui/toast.js';

/**
 * @param {import('../app.js').App} app
 * @param {number|null} [version] null: as it is now.
 */
export async function exportCell({ cell }, version = null) {
  const answer = await cell.ask('cell_export', { version });
  if (!answer.ok) {
    toast(answer.message || 'cmd.failed', 'bad', 'cell.export');
    return;
  }
  const address = URL.createObjectURL(new Blob([answer.data.text], { type: 'application/json' }));
  const link = h('a', { href: address, download: `cell-${version ?? cell.revision}.json` });
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}
