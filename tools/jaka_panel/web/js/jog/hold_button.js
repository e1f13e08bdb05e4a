/** A button that acts while it is pressed, by pointer or by the Enter key, and by nothing else. */

/** The button of a mouse that presses; a finger and the tip of a pen count as it, too. A bit of `buttons`. */
const MAIN = 1;
/** The pointer may leave the button by so much, px. */
const SLACK = 12;

/**
 * Tells when a button is pressed and when it is let go, in every way in which a browser loses a press.
 *
 * @param {HTMLElement} button
 * @param {() => boolean} press True where it is held from now on.
 * @param {(why: string) => void} release
 */
export function makeHoldButton(button, press, release) {
  /** @type {number|null} */
  let pointer = null;
  let byKey = false;

  /** @param {boolean} held */
  const show = (held) => button.classList.toggle('held', held);

  /** @param {string} why */
  function letGo(why) {
    if (pointer === null && !byKey) return;
    pointer = null;
    byKey = false;
    show(false);
    release(why);
  }

  button.addEventListener('pointerdown', (event) => {
    if (event.button !== 0 || pointer !== null || byKey) return;
    event.preventDefault();
    button.focus();
    if (!press()) return;
    pointer = event.pointerId;
    show(true);
    try {
      button.setPointerCapture(event.pointerId);
    } catch {
      letGo('released');  // the pointer is gone already
    }
  });
  button.addEventListener('pointermove', (event) => {
    if (event.pointerId !== pointer) return;
    const box = button.getBoundingClientRect();
    const isInside = event.clientX >= box.left - SLACK && event.clientX <= box.right + SLACK
      && event.clientY >= box.top - SLACK && event.clientY <= box.bottom + SLACK;
    if (!isInside || !(event.buttons & MAIN)) letGo('released');  // another button may still be down
  });
  for (const kind of ['pointerup', 'pointercancel', 'lostpointercapture']) {
    button.addEventListener(kind, (event) => {
      if (/** @type {PointerEvent} */ (event).pointerId === pointer) letGo('released');
    });
  }
  button.addEventListener('keydown', (event) => {
    if (event.key !== 'Enter') return;
    event.preventDefault();  // no click, and none again by the keyboard's repetition
    if (event.repeat || byKey || pointer !== null || !press()) return;
    byKey = true;
    show(true);
  });
  button.addEventListener('keyup', (event) => {
    if (event.key === 'Enter' && byKey) letGo('released');
  });
  button.addEventListener('blur', () => letGo('not seen'));
  button.addEventListener('contextmenu', (event) => event.preventDefault());
  button.addEventListener('holdover', () => {  // ended elsewhere: the press means nothing any more
    pointer = null;
    byKey = false;
    show(false);
  });
}
