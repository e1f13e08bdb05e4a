/** The arm of a robot description: its meshes where it names some, capsules along its links where it does not. */
import * as THREE from '../../vendor/three/three.module.js';
import URDFLoader from '../../vendor/urdf-loader/URDFLoader.js';

/** Radius of a capsule as a share of the arm's reach. */
const THICKNESS = 0.05;
const SHORTEST = 1e-4;
const BODY = 0xd9dde3;
const JOINT = 0x2f5f9f;

/**
 * Loads an arm; its meshes may still be loading when it is returned.
 *
 * @param {string} arm Id.
 * @param {string} prefix In front of the names of joints and links.
 * @param {() => void} onChange Something has arrived that is seen.
 * @returns {Promise<ArmModel>} Rejected with the server's text where there is no description.
 */
export async function loadArm(arm, prefix, onChange) {
  const response = await fetch(`/description?arm=${encodeURIComponent(arm)}`);
  const text = await response.text();
  if (!response.ok) throw new Error(text);
  const manager = new THREE.LoadingManager();
  manager.setURLModifier((/** @type {string} */ url) => (/^(package|file):\/\//.test(url)
    ? `/mesh?arm=${encodeURIComponent(arm)}&uri=${encodeURIComponent(url)}` : url));
  manager.onLoad = onChange;
  const loader = new URDFLoader(manager);
  loader.packages = (/** @type {string} */ name) => `package://${name}`;
  const robot = loader.parse(text, '');
  addCapsules(robot);
  return new ArmModel(robot, prefix);
}

/**
 * Puts capsules where a link has no mesh: from its joint along the axis, and from there to the next joint.
 *
 * @param {any} robot
 */
function addCapsules(robot) {
  const joints = Object.values(robot.joints);
  const reach = joints.reduce((sum, joint) => sum + joint.position.length(), 0);
  const radius = THICKNESS * reach;
  const body = new THREE.MeshPhongMaterial({ color: BODY, shininess: 40 });
  const hub = new THREE.MeshPhongMaterial({ color: JOINT, shininess: 40 });
  for (const link of Object.values(robot.links)) {
    if (link.urdfNode.querySelector('visual mesh')) continue;
    for (const child of [...link.children]) {
      if (child.isURDFVisual) child.visible = false;
    }
    for (const child of link.children.filter((/** @type {any} */ one) => one.isURDFJoint)) {
      const corner = new THREE.Vector3(0, 0, child.position.z);
      addCapsule(link, new THREE.Vector3(), corner, radius * 0.8, body);
      addCapsule(link, corner, child.position, radius * 0.8, body);
      if (child.jointType !== 'fixed') addHub(child, radius, hub);
      else addHub(child, radius * 0.75, hub, 0.35);
    }
  }
  const base = new THREE.Mesh(new THREE.CylinderGeometry(radius * 1.5, radius * 1.7, radius * 0.7, 32), hub);
  base.rotation.x = Math.PI / 2;
  base.position.z = radius * 0.35;
  robot.add(base);
}

/**
 * @param {any} parent
 * @param {any} from
 * @param {any} to
 * @param {number} radius m
 * @param {any} material
 */
function addCapsule(parent, from, to, radius, material) {
  const way = to.clone().sub(from);
  const length = way.length();
  if (length < SHORTEST) return;
  const capsule = new THREE.Mesh(new THREE.CapsuleGeometry(radius, length, 6, 20), material);
  capsule.position.copy(from).addScaledVector(way, 0.5);
  capsule.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), way.normalize());
  parent.add(capsule);
}

/**
 * @param {any} joint
 * @param {number} radius m
 * @param {any} material
 * @param {number} [height] As a share of the radius.
 */
function addHub(joint, radius, material, height = 1.9) {
  const mesh = new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, radius * height, 28), material);
  mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), joint.axis.clone().normalize());
  joint.add(mesh);
}

export class ArmModel {
  /**
   * @param {any} robot
   * @param {string} prefix
   */
  constructor(robot, prefix) {
    this.robot = robot;
    this.prefix = prefix;
    this.names = [1, 2, 3, 4, 5, 6].map((n) => `${prefix}joint_${n}`);
    if (!this.names.every((name) => robot.joints[name])) {
      this.names = Object.values(robot.joints).filter((joint) => joint.jointType !== 'fixed').slice(0, 6)
        .map((joint) => joint.urdfName);
    }
    for (const name of this.names) robot.joints[name].ignoreLimits = true;
  }

  /** @param {number[]} q rad */
  setJoints(q) {
    this.names.forEach((name, index) => this.robot.joints[name].setJointValue(q[index]));
  }

  /**
   * @param {string} frame Name of a link, with the prefix or without.
   * @returns {any} The link; that of the last joint where there is none of this name.
   */
  link(frame) {
    const { links, joints } = this.robot;
    return links[frame] ?? links[this.prefix + frame] ?? joints[this.names[this.names.length - 1]];
  }

  /** @returns {ArmModel} Another one like it, that shows through and in one colour. */
  makeGhost(/** @type {number} */ colour) {
    const robot = this.robot.clone(true);
    const material = new THREE.MeshPhongMaterial({ color: colour, transparent: true, opacity: 0.38, depthWrite: false });
    robot.traverse((/** @type {any} */ part) => {
      if (part.isMesh) part.material = material;
    });
    return new ArmModel(robot, this.prefix);
  }

  /**
   * Return the place of a frame at these joints, in the base frame.
   *
   * @param {number[]} q rad
   * @param {string} frame
   * @param {any} [shift] Of the tool in that frame, m.
   * @returns {any} Vector3, m.
   */
  placeAt(q, frame, shift) {
    this.setJoints(q);
    this.robot.updateMatrixWorld(true);
    const place = shift ? shift.clone() : new THREE.Vector3();
    return this.link(frame).localToWorld(place);
  }

  dispose() {
    this.robot.traverse((/** @type {any} */ part) => {
      part.geometry?.dispose?.();
      for (const material of [part.material].flat()) material?.dispose?.();
    });
    this.robot.removeFromParent();
  }
}
