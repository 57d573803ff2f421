// The force of the own tool in words. Pure.
import { decimal, text } from "./text.js";

const AT_CAP = 0.995; // share of the cap at which the force is the cap

/**
 * A force at the cap of its tool is no measurement: the tissue would resist more.
 * @param {number} force N @param {number | undefined} cap N
 */
export const forceText = (force, cap) =>
    cap && force >= AT_CAP * cap
        ? text("force.limit", { N: decimal(String(Number(cap.toPrecision(3)))) })
        : `${decimal(force.toFixed(2))} N`;
