// Reads a text message of the server by the table. Pure: anything that is not exactly one known message throws
// WireError; keys that the table does not have are left out.
import { ROLES, SERVER_MESSAGES } from "./control_table.js";
import { WireError } from "./wire.js";

/** @param {number} max @returns {(value: unknown) => boolean} */
const whole = (max) => (value) => Number.isInteger(value) && Number(value) >= 0 && Number(value) <= max;
/** @param {unknown} value */
const number = (value) => typeof value === "number" && Number.isFinite(value);
/** @param {unknown} value */
const text = (value) => typeof value === "string";
/** @param {(value: unknown) => boolean} check @returns {(value: unknown) => boolean} */
const list = (check) => (value) => Array.isArray(value) && value.every(check);
/** @param {unknown} value @returns {value is Record<string, unknown>} */
const isObject = (value) => typeof value === "object" && value !== null && !Array.isArray(value);

/** @type {Record<keyof import("./control_table.js").Kinds, (value: unknown) => boolean>} */
const CHECKS = {
    u16: whole(2 ** 16 - 1),
    u32: whole(2 ** 32 - 1),
    u64: whole(Number.MAX_SAFE_INTEGER),
    f64: number,
    bool: (value) => typeof value === "boolean",
    text,
    role: (value) => ROLES.some((role) => role === value),
    tool: (value) => value === null || (Number.isInteger(value) && Number(value) >= -1),
    vector: (value) => list(number)(value) && /** @type {unknown[]} */ (value).length === 3,
    numbers: list(number),
    texts: list(text),
    args: (value) => isObject(value) && Object.values(value).every(number),
};

/** @typedef {{readonly [key: string]: unknown}} Table of control_table.js */

/** @param {unknown} kind of a field @param {unknown} value @param {string} path @returns {unknown} */
function readField(kind, value, path) {
    if (Array.isArray(kind)) {
        if (!Array.isArray(value)) throw new WireError("FIELD", `${path} is not a list`);
        return value.map((item, i) => readFields(kind[0], item, `${path}[${i}]`));
    }
    if (isObject(kind)) return readFields(kind, value, path);
    if (!CHECKS[/** @type {keyof typeof CHECKS} */ (kind)](value))
        throw new WireError("FIELD", `${path} is not ${kind}`);
    return value;
}

/** @param {Table} table @param {unknown} value @param {string} path @returns {Record<string, unknown>} */
function readFields(table, value, path) {
    if (!isObject(value)) throw new WireError("FIELD", `${path} is not an object`);
    /** @type {Record<string, unknown>} */
    const out = {};
    for (const [name, kind] of Object.entries(table)) {
        const optional = name.endsWith("?");
        const key = optional ? name.slice(0, -1) : name;
        if (value[key] !== undefined) out[key] = readField(kind, value[key], `${path}.${key}`);
        else if (!optional) throw new WireError("FIELD", `${path} has no ${key}`);
    }
    return out;
}

/**
 * @param {string} json
 * @returns {import("./control_table.js").ServerMessage}
 */
export function readControl(json) {
    /** @type {unknown} */
    let value;
    try {
        value = JSON.parse(json);
    } catch {
        throw new WireError("JSON", "a text message is not JSON");
    }
    const type = isObject(value) ? value.type : undefined;
    if (typeof type !== "string" || !Object.hasOwn(SERVER_MESSAGES, type))
        throw new WireError("KIND", `message type ${type}`);
    const table = SERVER_MESSAGES[/** @type {keyof typeof SERVER_MESSAGES} */ (type)];
    return /** @type {import("./control_table.js").ServerMessage} */ ({ type, ...readFields(table, value, type) });
}
