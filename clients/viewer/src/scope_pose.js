// Where an endoscope looks: a shaft that turns about a port, optics that look along it or aside from it, and a camera on
// it. Pure: vectors are arrays of three numbers, a basis is three of them, x to the right, y up and z backwards.

/**
 * @typedef {{
 *   port: number[], yaw: number, pitch: number, depth: number, angle: number, turn: number, roll: number
 * }} ScopePose port: fixed point of the shaft, m; yaw, pitch: of the shaft, rad, as azimuth and elevation of the port
 *   seen from what the shaft points at; depth: from port to tip, m; angle: between shaft and direction of view, rad;
 *   turn: of the optics about the shaft, rad, 0: they look down; roll: of the horizon, rad
 * @typedef {{a: number[], b: number[], up: number[]}} Ground two unit vectors normal to up, and up
 */

export const PITCH_MAX = 1.4; // rad: at the pole the yaw has no meaning
const SWING_MAX = 1.2; // rad, of the shaft to every side: a port does not allow more

/** @param {number[]} u @param {number} s @param {number[]} v @param {number} t @returns {number[]} s u + t v */
const sum = (u, s, v, t) => u.map((c, k) => s * c + t * v[k]);
/** @param {number[]} u @param {number[]} v */
const cross = (u, v) => [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
/** @param {number[]} u */
const unit = (u) => u.map((c) => c / Math.hypot(...u));
/** @param {number} v @param {number} low @param {number} high */
const clamp = (v, low, high) => Math.max(low, Math.min(high, v));

/**
 * A basis turned about its own axis.
 * @param {number[][]} basis @param {0 | 1 | 2} axis @param {number} angle rad @returns {number[][]}
 */
export function turned(basis, axis, angle) {
    const [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
    const out = [...basis];
    out[i] = sum(basis[i], Math.cos(angle), basis[j], Math.sin(angle));
    out[j] = sum(basis[j], Math.cos(angle), basis[i], -Math.sin(angle));
    return out;
}

/** unit vector at an azimuth and elevation @param {Ground} ground @param {number} azimuth @param {number} elevation rad */
export const direction = ({ a, b, up }, azimuth, elevation) =>
    sum(sum(a, Math.sin(azimuth), b, -Math.cos(azimuth)), Math.cos(elevation), up, Math.sin(elevation));

/**
 * Tip of the shaft and basis of the camera. Turning the optics turns where they look, not the horizon: the camera is
 * held while the shaft turns in it.
 * @param {ScopePose} pose @param {Ground} ground @returns {{tip: number[], shaft: number[], basis: number[][]}}
 */
export function scopeView({ port, yaw, pitch, depth, angle, turn, roll }, ground) {
    const back = direction(ground, yaw, pitch);
    const right = unit(cross(ground.up, back));
    const straight = [right, cross(back, right), back];
    const basis = turned(turned(turned(straight, 2, turn), 0, -angle), 2, roll - turn);
    return { tip: sum(port, 1, back, -depth), shaft: back.map((c) => -c), basis };
}

/**
 * Angle between the shaft and the line from its port to a point at which its optics look.
 * @param {number} angle of the optics, rad @param {number} depth of the tip, of the distance from port to point
 */
export const aim = (angle, depth) => angle - Math.asin(depth * Math.sin(angle));

/**
 * The shaft turned about its port by a drag of the picture, which follows the pointer.
 * @param {ScopePose} pose @param {{yaw: number, pitch: number}} straight into the scene: the middle of its range
 * @param {number} dx to the right @param {number} dy down, rad @returns {ScopePose}
 */
export function pivot(pose, straight, dx, dy) {
    // the pointer moves in the picture, which the roll has turned
    const across = dx * Math.cos(pose.roll) + dy * Math.sin(pose.roll);
    const down = dy * Math.cos(pose.roll) - dx * Math.sin(pose.roll);
    const high = Math.min(PITCH_MAX, straight.pitch + SWING_MAX);
    const low = Math.max(-PITCH_MAX, straight.pitch - SWING_MAX);
    return {
        ...pose,
        yaw: clamp(pose.yaw + across, straight.yaw - SWING_MAX, straight.yaw + SWING_MAX),
        pitch: clamp(pose.pitch - down, low, high),
    };
}

/**
 * The round picture in the part of a pane that panels leave free: its middle and radius, pixels.
 * @param {number} width @param {number} height @param {{left: number, right: number, bottom: number}} covered margins
 */
export function roundPicture(width, height, { left, right, bottom }) {
    const free = [Math.max(width - left - right, 0.25 * width), Math.max(height - bottom, 0.25 * height)];
    return { x: left + free[0] / 2, y: free[1] / 2, radius: Math.min(...free) / 2 };
}
