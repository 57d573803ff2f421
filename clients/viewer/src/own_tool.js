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

/**
 * How far the surface of the tool is behind the point where the hand went down, along the view, m; 0: it presses nothing.
 * @param {{grasp: boolean, into: import("./three.js").Vector3, at: import("./three.js").Vector3} | null} drag at: that point; into: unit
 * @param {Pick<Tool, "contact" | "position" | "radius"> | undefined} tool
 */
export function pressDepth(drag, tool) {
    if (!drag || drag.grasp || !tool?.contact) return 0;
    const at = drag.at.toArray();
    const behind = drag.into.toArray().reduce((sum, v, k) => sum + v * (tool.position[k] - at[k]), 0);
    return Math.max(0, behind + tool.radius);
}
