/** The arm as it is, where its tool has been, and a ghost of where it would go. */
import * as THREE from '../../vendor/three/three.module.js';
import { h, replaceText, setText } from '../ui/dom.js';
import { loadArm } from './arm_model.js';
import { cornersOf } from './framing.js';
import { PathLine, Trace } from './lines.js';
import { View } from './scene.js';
import { Zones } from './zones.js';

/** @typedef {import('../app.js').App} App */
/** @typedef {import('./arm_model.js').ArmModel} ArmModel */

const GHOST = 0x2fbf71;
const TRACE = 0xe08a1e;
const PATH = 0x2fbf71;

/**
 * The drawings of other parts of the page in the room.
 *
 * @typedef {object} Preview
 * @property {(q: number[]|null) => void} ghost Shows a ghost arm at these joints, rad; null takes it away.
 * @property {(path: number[][]|null) => void} path Shows the tool's way along these joints, rad.
 * @property {(q: number[]) => number[]|null} placeAt Place of the tool at these joints in the base frame, m.
 */

/**
 * @param {HTMLElement} root
 * @param {App} app
 * @returns {Preview}
 */
export function mountArmView(root, app) {
  const note = h('p', { class: 'view-note', hidden: true });
  /** @type {View} */
  let view;
  try {
    view = new View(root);
  } catch {
    setText(note, 'view.no_webgl');
    note.hidden = false;
    root.append(note);
    return { ghost() {}, path() {}, placeAt: () => null };
  }
  view.canvas.setAttribute('role', 'img');
  view.canvas.setAttribute('data-t-label', 'view.label');
  const trace = new Trace(TRACE);
  const path = new PathLine(PATH);
  const tool = new THREE.AxesHelper(0.12);
  const base = new THREE.AxesHelper(0.25);
  const zones = new Zones();
  view.scene.add(trace.line, path.line, tool, base, zones.group);
  /** @type {ArmModel|null} */
  let arm = null;
  /** @type {ArmModel|null} */
  let ghost = null;
  /** A model that only reckons, and is not drawn. @type {ArmModel|null} */
  let reckoner = null;
  /** The shift of the tool in the flange's frame, m. */
  const shift = new THREE.Vector3();
  let shown = '';
  let shownZones = '';
  let hasTrace = true;
  let isFramed = false;

  const buttons = ['home', 'front', 'side', 'top'].map((name) => h('button', { type: 'button', class: 'plain',
    t: `view.${name}`, on: { click: () => {
      if (arm) view.frame(cornersOf(arm.robot), true);
      view.look(name);
    } } }));
  const traceButton = h('button', { type: 'button', class: 'plain', t: 'view.trace', 'aria-pressed': 'true',
    on: { click: () => {
      hasTrace = !hasTrace;
      trace.clear();
      trace.line.visible = hasTrace;
      traceButton.setAttribute('aria-pressed', String(hasTrace));
      view.invalidate();
    } } });
  root.append(note, h('div', { class: 'view-buttons', role: 'group', tLabel: 'view.label' }, ...buttons, traceButton));

  async function load() {
    const info = app.store.arm();
    const wanted = info ? `${info.id} ${info.description}` : '';
    if (wanted === shown || !info) return;
    shown = wanted;
    try {
      const loaded = await loadArm(info.id, info.prefix ?? '', () => {
        isFramed = false;  // its meshes are there now
        view.invalidate();
      });
      if (shown !== wanted) {
        loaded.dispose();
        return;
      }
      arm?.dispose();
      showGhost(null);
      reckoner?.dispose();
      reckoner = null;
      arm = loaded;
      view.scene.add(arm.robot);
      arm.robot.visible = false;
      isFramed = false;
      trace.clear();
      path.show(null);
      note.hidden = true;
    } catch (error) {
      setText(note, 'view.no_description');
      note.append(h('span', { class: 'second' }, ` ${/** @type {Error} */ (error).message}`));
      note.hidden = false;
      if (shown === wanted) shown = '';
    }
    view.invalidate();
  }

  async function loadZones() {
    const info = app.store.arm();
    const wanted = info?.zones ? `${info.id} ${info.zones}` : '';
    if (wanted === shownZones) return;
    shownZones = wanted;
    zones.show(null);
    view.invalidate();
    const answer = wanted ? await app.ask('zones', {}) : null;
    if (shownZones !== wanted) return;
    if (answer?.ok) zones.show(answer.data ?? null);
    else shownZones = '';
    view.invalidate();
  }

  /** @param {number[]|null} q */
  function showGhost(q) {
    view.invalidate();
    if (q === null || !arm) {
      if (ghost) ghost.robot.removeFromParent();
      ghost = null;
      return;
    }
    if (!ghost) {
      ghost = arm.makeGhost(GHOST);
      view.scene.add(ghost.robot);
      ghost.robot.visible = true;
    }
    ghost.setJoints(q);
    view.frame(cornersOf(ghost.robot));
  }

  /** @param {number[]} q */
  function placeAt(q) {
    const info = app.store.arm();
    if (!arm || !info) return null;
    reckoner ??= arm.makeGhost(GHOST);
    return reckoner.placeAt(q, info.frames.flange, shift);
  }

  app.onFrame((state) => {
    const info = app.store.arm();
    if (!arm || !info || !state?.q) return;
    arm.robot.visible = true;
    arm.setJoints(state.q);
    arm.robot.updateMatrixWorld(true);
    const flange = arm.link(info.frames.flange);
    const inBase = state.tool?.base ?? (state.tool?.frame === info.frames.base ? state.tool : null);
    if (inBase) {
      tool.position.fromArray(inBase.p);
      const turn = new THREE.Vector3().fromArray(inBase.r);
      const angle = turn.length();
      tool.quaternion.setFromAxisAngle(angle > 1e-9 ? turn.normalize() : turn.set(0, 0, 1), angle);
      shift.copy(flange.worldToLocal(tool.position.clone()));
    } else {
      flange.getWorldPosition(tool.position);
      flange.getWorldQuaternion(tool.quaternion);
      shift.set(0, 0, 0);
    }
    if (hasTrace) trace.add(tool.position);
    view.frame([...cornersOf(arm.robot), tool.position.clone()], !isFramed);
    isFramed = true;
    view.invalidate();
  });
  app.store.on('arms welcome chosen', () => {
    void load();
    void loadZones();
  });
  app.store.on('chosen', () => {
    if (arm) arm.robot.visible = false;
    replaceText(note, '');
    trace.clear();
    path.show(null);
    view.invalidate();
  });
  void load();

  return {
    ghost: showGhost,
    path(joints) {
      path.show(joints ? joints.map((q) => placeAt(q)).filter(Boolean) : null);
      view.invalidate();
    },
    placeAt(q) {
      const place = placeAt(q);
      return place ? place.toArray() : null;
    },
  };
}
