/** The room in 3D: camera, light, floor; drawn only when something in it has changed, and never for long. */
import * as THREE from '../../vendor/three/three.module.js';
import { OrbitControls } from '../../vendor/three/controls/OrbitControls.js';
import { fit } from './framing.js';
import { onThemeChange, themeColour } from '../ui/theme.js';

const FASTEST_MS = 33;
/** Drawing may take this share of the time of the page's thread; slow machines see fewer pictures. */
const SHARE = 0.35;
/** Most points that are kept in view. */
const MOST = 2000;
/** The places of the camera, from the middle of what it looks at. */
const VIEWS = /** @type {Record<string, [number, number, number]>} */ ({
  home: [0.82, -0.92, 0.38], front: [1, 0.001, 0.06], side: [0.001, -1, 0.06], top: [0.001, -0.001, 1],
});

export class View {
  /** @param {HTMLElement} root Throws where the browser has no WebGL. */
  constructor(root) {
    THREE.Object3D.DEFAULT_UP.set(0, 0, 1);
    this.root = root;
    this.canvas = document.createElement('canvas');
    const context = this.canvas.getContext('webgl2', { antialias: true, alpha: true, powerPreference: 'high-performance' });
    if (!context) throw new Error('no WebGL');
    this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, context });
    root.append(this.canvas);
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(38, 1, 0.01, 50);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener('change', () => this.invalidate());
    this.controls.addEventListener('start', () => {
      this.isTurned = true;
    });
    this.controls.maxDistance = 12;
    this.controls.minDistance = 0.15;
    /** The points that are to be seen, m. */
    this.points = [new THREE.Vector3(-0.4, -0.4, 0), new THREE.Vector3(0.4, 0.4, 0.9)];
    this.box = new THREE.Box3().setFromPoints(this.points);
    this.name = 'home';
    /** Somebody has turned or moved the view: it stays as it is. */
    this.isTurned = false;
    this.isDirty = true;
    this.drawnAt = 0;
    this.cost = 0;
    this.addLight();
    this.floor = new THREE.Group();
    this.scene.add(this.floor);
    this.paintFloor();
    this.look('home');
    onThemeChange(() => this.paintFloor());
    new ResizeObserver(() => this.resize()).observe(root);
    this.resize();
    this.loop = this.loop.bind(this);
    requestAnimationFrame(this.loop);
  }

  addLight() {
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x5a6470, 2.1));
    const sun = new THREE.DirectionalLight(0xffffff, 1.8);
    sun.position.set(2, -3, 4);
    this.scene.add(sun);
  }

  paintFloor() {
    this.floor.clear();
    const grid = new THREE.GridHelper(3, 30, new THREE.Color(themeColour('--grid-strong')), new THREE.Color(themeColour('--grid')));
    grid.rotation.x = Math.PI / 2;
    this.floor.add(grid);
    this.invalidate();
  }

  /** @param {string} name Of one of the views. */
  look(name) {
    this.name = name;
    this.isTurned = false;
    const direction = new THREE.Vector3(...VIEWS[name]).normalize();
    const high = Math.tan((this.camera.fov * Math.PI) / 360);
    // what is to be seen stays above the buttons at the foot of the picture
    const foot = /** @type {HTMLElement|null} */ (this.root.querySelector('.view-buttons'))?.offsetHeight ?? 0;
    const free = 1 - Math.min(0.4, (1.2 * foot) / (this.root.clientHeight || 1));
    const { target, distance, above } = fit(this.points, direction, this.camera.up, high * free, high * this.camera.aspect);
    this.controls.target.copy(target).addScaledVector(above, -distance * high * (1 - free));
    this.camera.position.copy(this.controls.target).addScaledVector(direction, distance);
    this.controls.update();
    this.invalidate();
  }

  /**
   * Has what is seen fit the picture: in place of what was framed before, or besides it where it has grown beyond that.
   *
   * @param {any[]} points Vector3, m.
   * @param {boolean} [isNew]
   */
  frame(points, isNew = false) {
    if (!points.length || (!isNew && points.every((point) => this.box.containsPoint(point)))) return;
    this.points = isNew ? points : [...this.points, ...points].slice(-MOST);
    this.box.setFromPoints(this.points);
    if (!this.isTurned) this.look(this.name);
  }

  resize() {
    const { clientWidth, clientHeight } = this.root;
    if (!clientWidth || !clientHeight) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    if (!this.isTurned) this.look(this.name);
    this.invalidate();
  }

  invalidate() {
    this.isDirty = true;
  }

  /** @param {number} now ms */
  loop(now) {
    requestAnimationFrame(this.loop);
    if (!this.isDirty || now - this.drawnAt < Math.max(FASTEST_MS, this.cost / SHARE)) return;
    this.isDirty = false;
    const started = performance.now();
    this.renderer.render(this.scene, this.camera);
    this.cost = 0.8 * this.cost + 0.2 * (performance.now() - started);
    this.drawnAt = now;
  }
}
