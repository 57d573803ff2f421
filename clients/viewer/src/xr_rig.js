// How the room of a headset lies in the scene: moved, turned about the vertical and scaled, so that the floor stays level.
// Pure. Points are arrays of three numbers with y up; `level` points are those of the scene in the axes a, up, -b.

/** @typedef {{at: number[], yaw: number, scale: number}} Rig at: origin of the room, m; scale: metres of the scene a metre */

const REACH_M = 0.5; // from head to scene at first: an arm's length
const BELOW_M = 0.32; // of the head: where hands work
const EXTENT_M = 0.5; // of the scene's diagonal at first
const EXTENT_RANGE_M = [0.1, 6];
const NEAR_M = 0.02; // hands that are closer to each other do not scale

/** @param {number[]} p @param {number} yaw @returns {number[]} */
const turn = ([x, y, z], yaw) => [Math.cos(yaw) * x + Math.sin(yaw) * z, y, Math.cos(yaw) * z - Math.sin(yaw) * x];

/** a level point of a point of the room @param {Rig} rig @param {number[]} p */
export const toLevel = ({ at, yaw, scale }, p) => turn(p, yaw).map((c, k) => at[k] + scale * c);

/** the rig in which a point of the room is a level point @param {number[]} p @param {number[]} level @param {number} yaw @param {number} scale @returns {Rig} */
const pinned = (p, level, yaw, scale) => ({ at: turn(p, yaw).map((c, k) => level[k] - scale * c), yaw, scale });

/**
 * The scene before the user, seen from the azimuth of the free view.
 * @param {{position: number[], yaw: number}} head in the room
 * @param {{centre: number[], size: number, azimuth: number}} scene centre: level
 */
export function startRig(head, { centre, size, azimuth }) {
    const ahead = turn([0, -BELOW_M, -REACH_M], head.yaw).map((c, k) => head.position[k] + c);
    return pinned(ahead, centre, azimuth - head.yaw, size / EXTENT_M);
}

/**
 * The rig after hands that hold the scene have moved: what each held, it still holds. One hand moves the scene, two turn
 * and scale it as well.
 * @param {Rig} rig @param {number[][]} before @param {number[][]} after hands in the room @param {number} size of the
 *   scene, m @returns {Rig}
 */
export function regrip(rig, before, after, size) {
    if (before.length < 2) return before.length ? pinned(after[0], toLevel(rig, before[0]), rig.yaw, rig.scale) : rig;
    const [u, v] = [before, after].map(([p, q]) => p.map((c, k) => q[k] - c));
    const [from, to] = [before, after].map(([p, q]) => p.map((c, k) => (c + q[k]) / 2)); // between the hands
    const flat = Math.min(Math.hypot(u[0], u[2]), Math.hypot(v[0], v[2]));
    const ratio = Math.hypot(...u) > NEAR_M && Math.hypot(...v) > NEAR_M ? Math.hypot(...u) / Math.hypot(...v) : 1;
    const yaw = rig.yaw + (flat > NEAR_M ? Math.atan2(u[0], u[2]) - Math.atan2(v[0], v[2]) : 0);
    const [small, large] = EXTENT_RANGE_M;
    const scale = Math.max(size / large, Math.min(size / small, rig.scale * ratio));
    return pinned(to, toLevel(rig, from), yaw, scale);
}
