// Meshes of instruments: steel, an insulated shaft, a ring in the colour of the member; jaws that open and close.
import { turnedTowards } from "./instrument_pose.js";
import { SHAFT_RADIUS } from "./instrument_shapes.js";
import { corners, turned } from "./solid_shapes.js";
import * as THREE from "./three.js";

/**
 * @typedef {import("./wire.js").Tool} Tool
 * @typedef {import("./control_table.js").Hello["tools"][number]} ToolInfo
 * @typedef {import("./solid_shapes.js").Solid} Solid
 * @typedef {import("./instrument_shapes.js").Shape} Shape
 */

const Z_AXIS = new THREE.Vector3(0, 0, 1); // of three's torus
// about z: the x axis of a tool points to the hand, that of its solids to the tip
const HALF_TURN = new THREE.Quaternion(0, 0, 1, 0);
const SHAFT_LENGTH = 44; // radii of the tool: 330 mm for 7.5 mm
const BEYOND_PORT = 8; // radii of the tool by which a shaft is at least longer than the way to its port
const RING_LENGTH = 0.7; // of the ring in the colour of the member, radii of the tool
const BLEND_MS = 150; // duration in which open jaws close
const GHOST_OPACITY = 0.22;
// tissue is drawn first, then what of an instrument it hides, then the instrument
const GHOST_ORDER = 1;
const SOLID_ORDER = 2;

const steel = new THREE.MeshStandardMaterial({ color: 0xdde1e5, metalness: 0.6, roughness: 0.32, transparent: true });
const black = new THREE.MeshStandardMaterial({ color: 0x1b1d21, metalness: 0, roughness: 0.38, transparent: true });

/** @type {Map<Solid, THREE.BufferGeometry>} by their first solid */
const geometries = new Map();

/** @param {Solid[]} solids */
function geometryOf(solids) {
    let geometry = geometries.get(solids[0]);
    if (!geometry) {
        const { positions, normals } = corners(solids);
        geometry = new THREE.BufferGeometry();
        geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
        geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
        geometries.set(solids[0], geometry);
    }
    return geometry;
}

/** from x = -1 to 0, of radius 1 */
const ROD = turned([
    [-1, 1],
    [0, 1],
]);

export class Instrument {
    /** @param {THREE.Scene} scene @param {ToolInfo} info @param {Shape} shape */
    constructor(scene, info, shape) {
        this.scene = scene;
        this.shape = shape;
        this.group = new THREE.Group();
        this.ringMaterial = new THREE.MeshStandardMaterial({ roughness: 0.45, transparent: true });
        // where tissue hides the instrument, it shines through
        this.ghostMaterial = new THREE.MeshBasicMaterial({
            transparent: true,
            opacity: GHOST_OPACITY,
            depthFunc: THREE.GreaterDepth,
            depthWrite: false,
        });
        this.add(shape.steel, steel);
        if (shape.black.length) this.add(shape.black, black);
        this.shaft = this.add([ROD], black);
        this.shaft.position.x = shape.neck;
        const ring = this.add([ROD], this.ringMaterial);
        ring.position.x = shape.neck - RING_LENGTH;
        ring.scale.set(RING_LENGTH, 1.15 * SHAFT_RADIUS, 1.15 * SHAFT_RADIUS);
        this.jaws = shape.jaws.map((jaw) => {
            const mesh = this.add([jaw], steel);
            mesh.position.x = shape.hinge;
            return mesh;
        });
        this.angle = shape.open; // of each jaw, rad
        this.turning = false; // the jaws are on their way
        this.updatedAt = 0; // ms
        this.port = info.trocar_m ? new THREE.Vector3().fromArray(info.trocar_m) : null;
        this.trocar = new THREE.Mesh(new THREE.TorusGeometry(0.85, 0.3, 16, 32), this.ringMaterial);
        this.trocar.renderOrder = SOLID_ORDER;
        if (this.port) this.trocar.position.copy(this.port);
        this.show(false);
        scene.add(this.group, this.trocar);
    }

    /** @param {Solid[]} solids @param {THREE.Material} material */
    add(solids, material) {
        const mesh = new THREE.Mesh(geometryOf(solids), material);
        const ghost = new THREE.Mesh(mesh.geometry, this.ghostMaterial);
        mesh.renderOrder = SOLID_ORDER;
        ghost.renderOrder = GHOST_ORDER;
        mesh.add(ghost);
        this.group.add(mesh);
        return mesh;
    }

    /** @param {boolean} shown */
    show(shown) {
        if (!shown) {
            this.angle = this.shape.open;
            this.turning = false;
        }
        this.group.visible = shown;
        this.trocar.visible = shown && this.port !== null;
    }

    /**
     * @param {Tool} tool @param {number[]} orientation quaternion w x y z @param {number} radius as drawn, m
     * @param {number} now ms
     */
    update(tool, orientation, radius, now) {
        const { group, port, shape, trocar } = this;
        const [w, x, y, z] = orientation;
        group.position.fromArray(tool.position);
        group.quaternion.set(x, y, z, w).multiply(HALF_TURN);
        group.scale.setScalar(radius);
        const toPort = port ? port.distanceTo(group.position) / radius + BEYOND_PORT : 0;
        this.shaft.scale.set(Math.max(SHAFT_LENGTH, toPort), SHAFT_RADIUS, SHAFT_RADIUS);
        trocar.scale.setScalar(radius);
        trocar.quaternion.setFromUnitVectors(Z_AXIS, new THREE.Vector3(1, 0, 0).applyQuaternion(group.quaternion));
        const wanted = tool.grasps ? shape.held : tool.contact ? 0 : shape.open;
        const step = (shape.open * (now - this.updatedAt)) / BLEND_MS;
        // while it was not drawn, no time passes for the jaws
        this.angle = turnedTowards(this.angle, wanted, this.turning ? step : 0);
        this.turning = this.angle !== wanted;
        this.updatedAt = now;
        this.jaws.forEach((jaw, i) => jaw.rotation.set(0, 0, i ? -this.angle : this.angle));
        this.ringMaterial.color.setHex(tool.colour);
        this.ghostMaterial.color.setHex(tool.colour);
    }

    /** the middle of its ring, in the scene @param {THREE.Vector3} out @returns {THREE.Vector3} */
    ringAt(out) {
        const { group, shape } = this;
        return out
            .set((shape.neck - 0.5 * RING_LENGTH) * group.scale.x, 0, 0)
            .applyQuaternion(group.quaternion)
            .add(group.position);
    }

    dispose() {
        this.scene.remove(this.group, this.trocar);
        this.ringMaterial.dispose();
        this.ghostMaterial.dispose();
        this.trocar.geometry.dispose();
    }
}
