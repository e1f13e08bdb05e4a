/** Numbers as the page shows and reads them. */

export const DEGREES = 180 / Math.PI;

/**
 * A number with a fixed count of decimals, a dash where there is none; never "-0.0".
 *
 * @param {number|null|undefined} value
 * @param {number} decimals
 * @returns {string}
 */
export function fixed(value, decimals) {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? (0).toFixed(decimals) : text;
}

/**
 * Return the number that somebody typed: with a comma or a point, or NaN.
 *
 * @param {string} text
 * @returns {number}
 */
export function typedNumber(text) {
  const trimmed = text.trim().replace(',', '.').replace('−', '-');
  return /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i.test(trimmed) ? Number(trimmed) : NaN;
}

/**
 * Roll, pitch, yaw about the fixed axes (R = Rz Ry Rx) of a rotation vector, both rad.
 *
 * @param {number[]} vector
 * @returns {number[]}
 */
export function rpyFromRotationVector(vector) {
  const m = matrixFromRotationVector(vector);
  const pitch = Math.asin(Math.max(-1, Math.min(1, -m[2][0])));
  if (Math.abs(m[2][0]) > 1 - 1e-9) return [0, pitch, Math.atan2(-m[0][1], m[1][1])];
  return [Math.atan2(m[2][1], m[2][2]), pitch, Math.atan2(m[1][0], m[0][0])];
}

/**
 * The rotation vector of roll, pitch, yaw about the fixed axes, both rad; its length is at most pi.
 *
 * @param {number[]} rpy
 * @returns {number[]}
 */
export function rotationVectorFromRpy(rpy) {
  const [r, p, y] = rpy.map((angle) => angle / 2);
  const [cr, sr, cp, sp, cy, sy] = [Math.cos(r), Math.sin(r), Math.cos(p), Math.sin(p), Math.cos(y), Math.sin(y)];
  let q = [cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
    cr * cp * sy - sr * sp * cy];
  if (q[0] < 0) q = q.map((part) => -part);
  const sine = Math.hypot(q[1], q[2], q[3]);
  if (sine < 1e-12) return [0, 0, 0];
  const angle = 2 * Math.atan2(sine, q[0]);
  return [q[1], q[2], q[3]].map((part) => (part / sine) * angle);
}

/**
 * @param {number[]} vector rad
 * @returns {number[][]} Three rows.
 */
function matrixFromRotationVector(vector) {
  const angle = Math.hypot(...vector);
  if (angle < 1e-12) return [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  const [x, y, z] = vector.map((part) => part / angle);
  const c = Math.cos(angle);
  const s = Math.sin(angle);
  const v = 1 - c;
  return [[x * x * v + c, x * y * v - z * s, x * z * v + y * s],
    [x * y * v + z * s, y * y * v + c, y * z * v - x * s],
    [x * z * v - y * s, y * z * v + x * s, z * z * v + c]];
}
