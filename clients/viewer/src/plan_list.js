// What the panel says of the plan and the bodies: components that run and that are disabled, bodies with a remark, what is
// not computed. Pure.
import { decimal, language, text } from "./text.js";

/**
 * @typedef {import("./app_state.js").Plan} Plan
 * @typedef {import("./control_table.js").Status} Status
 * @typedef {{name: string, part: number, reason: string, fixed: boolean, planned: boolean, on: boolean, index: number | null}} Component
 *   reason: key of the scene that requires it; fixed: cannot be disabled; planned: by the scene; index: in the times of
 *   `status`, null: disabled
 * @typedef {{name: string, frozen: boolean, state: string, text: string[]}} BodyRemark
 */

const BAR_MIN_MS = 0.01; // the full bar stands for at least this: a sleeping plan shows no bars
const SHOWN_MIN_MS = 0.0005; // a smaller time is displayed as 0.000

/** digits are grouped from 10,000 on @param {number} n */
const count = (n) => (n < 10000 ? String(n) : n.toLocaleString(language));

/** @param {number} bytes per second */
export function rateText(bytes) {
    return decimal(
        bytes >= 1e6 ? (bytes / 1e6).toFixed(2) + " MB/s" : (bytes / 1e3).toFixed(bytes < 1e4 ? 1 : 0) + " kB/s",
    );
}

/**
 * The active part of each body that adapts, one sentence each, with the body's name if there are several.
 * @param {import("./control_table.js").Activity[]} active @param {{name: string}[]} parts of `hello`
 */
export function activeText(active, parts) {
    return active.map((a) => {
        const name = parts.length > 1 ? `${parts[a.part]?.name ?? a.part}: ` : "";
        return (
            name +
            text("details.active", {
                nodes: count(a.nodes),
                finest_nodes: count(a.finest_nodes),
                springs: count(a.springs),
                finest_springs: count(a.finest_springs),
            })
        );
    });
}

/**
 * The components to list: those that run, in their order, then the disabled ones.
 * @param {Plan} plan of `hello` or `topology` @param {Pick<Status, "components" | "component_parts" | "disabled"> | null} status
 * @returns {Component[]}
 */
export function componentsOf(plan, status) {
    const key = (/** @type {string} */ name, /** @type {number} */ part) => `${name} ${part}`;
    const planned = new Map(plan.components.map((name, i) => [key(name, plan.component_parts?.[i] ?? 0), i]));
    const component = (/** @type {string} */ name, /** @type {number} */ part) => {
        const i = planned.get(key(name, part));
        // a component that the scene does not plan exists while something needs it, and cannot be disabled
        if (i === undefined)
            return { name, part, reason: "", fixed: plan.component_required !== undefined, planned: false };
        return {
            name,
            part,
            reason: plan.component_reasons?.[i] ?? "",
            fixed: plan.component_required?.[i] === 1,
            planned: true,
        };
    };
    const now = status?.components?.length ? status : plan;
    const on = (now.components ?? []).map((name, i) => ({
        ...component(name, now.component_parts?.[i] ?? 0),
        on: true,
        index: i,
    }));
    const off = (status?.disabled ?? []).map(({ component: name, part }) => ({
        ...component(name, part),
        on: false,
        index: null,
    }));
    return [...on, ...off];
}

/**
 * Bodies with a remark.
 * @param {import("./control_table.js").PartState[]} states @param {{name: string}[]} parts of `hello`
 * @returns {BodyRemark[]}
 */
export function bodyRemarks(states, parts) {
    return states.map(({ part, frozen = false, asleep, reason, safeguards = 0, safeguard_ms = 0 }) => {
        const lines = frozen ? [reason || text("body.out_of_bounds")] : [];
        if (safeguards) {
            const ms = decimal(safeguard_ms.toFixed(safeguard_ms < 1 ? 3 : 1));
            lines.push(text(safeguards === 1 ? "body.safeguard" : "body.safeguards", { n: count(safeguards), ms }));
        }
        const state = frozen ? "stopped" : asleep ? "asleep" : "";
        return { name: parts[part]?.name ?? String(part), frozen, state, text: lines };
    });
}

/**
 * What is not computed because no client displays it; empty if everything is.
 * @param {{field: boolean, estimate: boolean, estimates: boolean, unobserved: number}} shown
 */
export function idleText({ field, estimate, estimates, unobserved }) {
    const idle = [
        ...(field ? [] : [text("details.idle.field")]),
        ...(estimate || !estimates ? [] : [text("details.idle.estimate")]),
    ];
    const now = idle.length ? text("details.idle", { what: idle.join(", ") }) : "";
    const before = unobserved > 0 ? text("details.unobserved", { n: count(unobserved) }) : "";
    return [now, before].filter(Boolean).join(" ");
}

/** lengths of bars as shares of the full bar; 0: no bar @param {number[]} ms of components */
export function barLengths(ms) {
    const max = Math.max(BAR_MIN_MS, ...ms);
    return ms.map((v) => (v < SHOWN_MIN_MS ? 0 : v / max));
}

/** why a component cannot be disabled @param {Component} component */
export function fixedReason({ planned }) {
    return text(planned ? "effect.fixed" : "effect.needed");
}
