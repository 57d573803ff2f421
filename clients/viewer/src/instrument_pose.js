// Orientation of an instrument. Quaternions are w x y z; axes of the tool as in protocol/README.md: x from tip to hand,
// the jaws turn about z. Pure.
import { cross, dot, subtract, unit } from "./solid_shapes.js";

/**
 * The hand that holds an instrument: its shaft passes `port` (m); `from` is its orientation when the hand was
 * in the direction `axis` of the tip; roll: turn about the shaft since then, rad.
 * @typedef {{port: number[], axis: number[], from: number[], roll: number}} Hand
 */

const PARALLEL = 0.99; // cosine above which a direction says nothing about the turn about another

/** @param {number[]} a @param {number[]} b */
export const multiply = ([w, x, y, z], [a, b, c, d]) => [
    w * a - x * b - y * c - z * d,
    w * b + x * a + y * d - z * c,
    w * c - x * d + y * a + z * b,
    w * d + x * c - y * b + z * a,
];

/** @param {number[]} q @param {number[]} v */
export function rotate([w, ...u], v) {
    const t = cross(u, v).map((c) => 2 * c);
    return v.map((c, k) => c + w * t[k] + cross(u, t)[k]);
}

/** rotation about a unit vector @param {number[]} axis @param {number} angle rad */
const turn = (axis, angle) => [Math.cos(angle / 2), ...axis.map((v) => v * Math.sin(angle / 2))];

/** shortest rotation from one unit vector to another @param {number[]} a @param {number[]} b */
export function between(a, b) {
    const w = 1 + dot(a, b);
    if (w > 1e-9) return unit([w, ...cross(a, b)]);
    return [0, ...unit(cross(a, Math.abs(a[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]))];
}

/**
 * Orientation whose x axis is `axis` and whose z axis is as near as possible to `facing`.
 * @param {number[]} axis unit @param {number[]} facing unit
 */
export function facing(axis, facing) {
    const hint = Math.abs(dot(axis, facing)) < PARALLEL ? facing : [axis[2], axis[0], axis[1]];
    const z = unit(hint.map((v, k) => v - dot(hint, axis) * axis[k]));
    const first = between([1, 0, 0], axis);
    const begun = rotate(first, [0, 0, 1]);
    return multiply(turn(axis, Math.atan2(dot(cross(begun, z), axis), dot(begun, z))), first);
}

/**
 * A hand at a port, with the tip at a point and the jaws seen from the side by who looks along -`towards`.
 * @param {number[]} port m @param {number[]} tip m @param {number[]} towards unit, to the eye @returns {Hand}
 */
export function handAt(port, tip, towards) {
    const axis = unit(subtract(port, tip));
    return { port, axis, from: facing(axis, towards), roll: 0 };
}

/** orientation with the tip at a point: the shaft turns about the port on the shortest way @param {Hand} hand @param {number[]} tip m */
export function aim({ port, axis, from, roll }, tip) {
    const now = unit(subtract(port, tip));
    const turned = multiply(between(axis, now), from);
    return multiply(turn(now, roll), turned);
}

/** has anybody said how the tool is turned? @param {number[]} q */
export const isOriented = (q) => Math.abs(q[0]) < 1;

/** on the way from one orientation to another @param {number[]} a @param {number[]} b @param {number} share */
export function mixed(a, b, share) {
    const sign = a.reduce((sum, v, k) => sum + v * b[k], 0) < 0 ? -1 : 1;
    return unit(a.map((v, k) => v + share * (sign * b[k] - v)));
}

/** an angle that moves to another by at most a step @param {number} angle @param {number} wanted @param {number} step */
export const turnedTowards = (angle, wanted, step) =>
    Math.abs(wanted - angle) <= step ? wanted : angle + Math.sign(wanted - angle) * step;
