/**
 * Return the marks of the time axis: at round distances from the newest moment, so that they move with the curves.
 *
 * @param {number} from s
 * @param {number} to s
 * @param {number} step Between two marks, s.
 * @param {number} newest s
 * @returns {number[]} s
 */
export function timeTicks(from, to, step, newest) {
  const slack = step * 1e-6;
  const first = Math.ceil((from - newest - slack) / step);
  const last = Math.floor((to - newest + slack) / step);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, n) => newest + (first + n) * step);
}
