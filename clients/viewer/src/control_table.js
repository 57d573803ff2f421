// The text messages of palpate.v2 as one table: protocol/control_table.c has the same one, and
// test/control_table.test.js compares the two. The types of all messages follow from it. Pure.
//
// A field is a kind, a table (an object), or a list of one table (objects). A key that ends in "?" may be absent.
// Kinds: u16, u32, u64 and f64 numbers; bool; text; role; tool (index, -1 any, null none); vector (three numbers);
// numbers; texts; args (numbers by name).

const part = /** @type {const} */ ({
    name: "text",
    epoch: "u32",
    n_vertex: "u32",
    n_triangle: "u32",
    asset: "text",
    "images?": "texts",
    error_m: "f64",
    "fields?": "texts",
    "interior?": "text",
    "adaptive?": "bool",
    "sculptable?": "bool",
    "appearance?": "text",
    "colour?": "text",
    "control_cells?": "text",
});

const member = /** @type {const} */ ({
    id: "u16",
    role: "role",
    name: "text",
    "tool?": "tool",
    colour: "u32",
    "rights?": "text",
    "muted?": "bool",
});

export const SERVER_MESSAGES = Object.freeze(
    /** @type {const} */ ({
        hello: {
            version: "u32",
            session: "text",
            title: "text",
            organ: "text",
            "accuracy?": "text",
            step_rate_hz: "f64",
            frame_rate_hz: "f64",
            credit: "u32",
            box_min_m: "vector",
            box_max_m: "vector",
            up: "vector",
            "anatomical_axes?": "text",
            parts: [part],
            tools: [
                {
                    name: "text",
                    radius_m: "f64",
                    "force_cap_N?": "f64",
                    "instrument?": "text",
                    "trocar_m?": "numbers",
                },
            ],
            components: "texts",
            "component_parts?": "numbers",
            "component_reasons?": "texts",
            "component_required?": "numbers",
            "estimates?": "bool",
            "relay?": "bool",
            "started?": "u32",
            "marks?": [{ time_s: "f64", text: "text" }],
            you: { id: "u16", role: "role", name: "text", "tool?": "tool" },
        },
        topology: {
            parts: [part],
            "components?": "texts",
            "component_parts?": "numbers",
            "component_reasons?": "texts",
            "component_required?": "numbers",
        },
        status: {
            tick: "u64",
            sim_time_s: "f64",
            paused: "bool",
            frozen: "bool",
            step_rate_hz: "f64",
            slowdown: "f64",
            substeps: "u32",
            step_ms: "f64",
            component_ms: "numbers",
            "components?": "texts",
            members: "u32",
            "viewers?": "u32",
            bytes_s: "f64",
            rtt_ms: "f64",
            skipped_cycles: "u32",
            late_steps: "u64",
            refused_inputs: "u64",
            "diagnostic?": "text",
            "active?": [{ part: "u32", nodes: "u32", springs: "u32", finest_nodes: "u32", finest_springs: "u32" }],
            "component_parts?": "numbers",
            "parts?": [
                {
                    part: "u32",
                    "frozen?": "bool",
                    "asleep?": "bool",
                    "reason?": "text",
                    "safeguards?": "u64",
                    "safeguard_ms?": "f64",
                },
            ],
            "disabled?": [{ component: "text", part: "u32" }],
            "unobserved_steps?": "u64",
            "devices?": [{ tool: "u32", "force_error_N?": "f64", "opening?": "f64" }],
            "energies?": [{ part: "u32", time_s: "f64", kinetic_J: "f64", elastic_J: "f64" }],
            "playback?": [{ plays: "bool", time_s: "f64", length_s: "f64", speed: "f64", "ended?": "bool" }],
        },
        members: { members: [member], "locked_tools?": "numbers", "locked?": "bool" },
        orders: {
            orders: [{ id: "u16", name: "text", verb: "text", "target?": "text", "text?": "text", age_s: "f64" }],
        },
        error: { code: "text", text: "text" },
        pong: { stamp_ms: "f64" },
        answer: { verb: "text", text: "text", "args?": "args" },
        study: {
            body: "text",
            step_ms: "f64",
            "reference_m?": "f64",
            "points?": [
                {
                    index: "u32",
                    method: "text",
                    label: "text",
                    cost_ms: "f64",
                    error_m: "f64",
                    "force_percent?": "f64",
                    "pareto_optimal?": "bool",
                },
            ],
        },
        estimate: {
            body: "text",
            configuration: "text",
            "study_point?": "f64",
            tick: "u64",
            time_s: "f64",
            "age_s?": "f64",
            "cost_ms?": "f64",
            estimate_ms: "f64",
            "max_displacement_m?": "f64",
            "error_m?": "f64",
            "discretisation_m?": "f64",
            "algebraic_m?": "f64",
            "time_m?": "f64",
            "model_m?": "f64",
            "force_percent?": "f64",
            "energy_error_percent?": "f64",
            "locking?": "bool",
            "diagnostic?": "text",
            "neighbours?": [
                {
                    parameter: "text",
                    label: "text",
                    "cost_ms?": "f64",
                    "error_m?": "f64",
                    "size?": "u32",
                    "step_ms?": "f64",
                    "tolerance?": "f64",
                },
            ],
        },
        move: { address: "text", session: "text", "ticket?": "text" },
    }),
);

export const CLIENT_MESSAGES = Object.freeze(
    /** @type {const} */ ({
        join: { name: "text", role: "role", "tool?": "tool", "topology_deltas?": "bool", "moves?": "bool" },
        command: { verb: "text", "target?": "text", "args?": "args" },
        take_tool: { tool: "tool" },
        release_tool: {},
        ping: { stamp_ms: "f64" },
        subscribe_field: { part: "u32", field: "text", "interior?": "bool", "energy?": "bool" },
    }),
);

export const ROLES = Object.freeze(/** @type {const} */ (["viewer", "trainee", "instructor"]));

/**
 * @typedef {typeof ROLES[number]} Role
 * @typedef {{u16: number, u32: number, u64: number, f64: number, bool: boolean, text: string, role: Role,
 *   tool: number | null, vector: number[], numbers: number[], texts: string[], args: Record<string, number>}} Kinds
 */
/**
 * Value of one field of the table.
 * @template F
 * @typedef {F extends keyof Kinds ? Kinds[F] : F extends readonly [infer T] ? Message<T>[] : Message<F>} Value
 */
/**
 * Object that a table of fields describes.
 * @template T
 * @typedef {{-readonly [K in keyof T as K extends `${string}?` ? never : K]: Value<T[K]>} &
 *   {-readonly [K in keyof T as K extends `${infer Key}?` ? Key : never]?: Value<T[K]>}} Message
 */
/**
 * Union of the messages of one direction, told apart by `type`.
 * @template T
 * @typedef {{[K in keyof T]: {type: K} & Message<T[K]>}[keyof T]} MessageOf
 */
/**
 * @typedef {MessageOf<typeof SERVER_MESSAGES>} ServerMessage
 * @typedef {MessageOf<typeof CLIENT_MESSAGES>} ClientMessage
 * @typedef {Message<typeof SERVER_MESSAGES.hello>} Hello
 * @typedef {Message<typeof SERVER_MESSAGES.topology>} Topology
 * @typedef {Message<typeof SERVER_MESSAGES.status>} Status
 * @typedef {Message<typeof SERVER_MESSAGES.answer>} Answer
 * @typedef {Message<typeof SERVER_MESSAGES.study>} Study
 * @typedef {Message<typeof SERVER_MESSAGES.estimate>} Estimate
 * @typedef {Message<typeof SERVER_MESSAGES.move>} Move
 * @typedef {Message<typeof part>} Part
 * @typedef {Message<typeof member>} Member
 * @typedef {NonNullable<Study["points"]>[number]} StudyPoint
 * @typedef {NonNullable<Estimate["neighbours"]>[number]} Neighbour
 * @typedef {NonNullable<Status["active"]>[number]} Activity
 * @typedef {NonNullable<Status["parts"]>[number]} PartState
 */
