// The force of the own tool in words. Pure.

const AT_CAP = 0.995; // share of the cap at which the force is the cap

/**
 * A force at the cap of its tool is no measurement: the tissue would resist more.
 * @param {number} force N @param {number | undefined} cap N
 */
export const forceText = (force, cap) =>
    cap && force >= AT_CAP * cap ? `> ${Number(cap.toPrecision(3))} N, limit` : `${force.toFixed(2)} N`;
