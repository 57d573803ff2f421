// The own tool as it is drawn. Pure.

/** @typedef {import("./wire.js").Tool} Tool */

/**
 * The own tool stands where the hand is, not where the server last saw it: that is a round trip old.
 * @param {Tool[]} tools @param {number} own its index, -1 none @param {{position: number[], quaternion?: number[]} | null} hand
 *   pose that was sent last; null: it is away
 * @returns {Tool[]}
 */
export const withOwnTool = (tools, own, hand) =>
    hand && tools[own]?.held && !tools[own].away
        ? tools.map((tool, i) => (i === own ? { ...tool, ...hand } : tool))
        : tools;
