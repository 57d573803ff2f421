// The instruments as solids. The unit of length is the radius of the tool, whose sphere of contact lies around the
// origin. Axes: x along the shaft from hand to tip, the jaws open in the plane of x and y, the origin is the tip. Pure.
import { ellipse, loft, mirrored, moved, plate, swept, turned } from "./solid_shapes.js";

/**
 * @typedef {import("./solid_shapes.js").Solid} Solid
 * @typedef {{steel: Solid[], black: Solid[], jaws: Solid[], hinge: number, open: number, held: number, neck: number}} Shape
 *   steel, black: parts that do not move; jaws: none, or the upper and the lower one, closed, about the
 *   hinge at their origin, which is at x = hinge; open, held: angle of each jaw, rad, when it is open and when it holds tissue; neck: where the
 *   shaft begins, x
 */

export const SHAFT_RADIUS = 0.5;
const DEGREE = Math.PI / 180;
const HINGE = -3.2; // x: jaws of 24 mm for a tool of 7.5 mm
const NECK = -5.6;
const BEVEL = 0.07; // of edges
const STEPS = 40; // rings of a jaw: two for each tooth of the grasper

/** rounded end of a length of 1: 1 along it, falling to 0 over the last `share` @param {number} s @param {number} share */
const rounded = (s, share) => Math.sqrt(Math.max(0.002, 1 - Math.max(0, (s - 1 + share) / share) ** 2));

/** half of an ellipse over a flat side: width along z, height along y from `low` */
function jawSection(/** @type {number} */ width, /** @type {number} */ height, /** @type {number} */ low) {
    const arc = Array.from({ length: 13 }, (_, i) => (Math.PI * i) / 12);
    return arc.map((angle) => [low + (height - low) * Math.sin(angle), width * Math.cos(angle)]);
}

/** upper jaw of a grasper: tapered, its inner side with teeth, its tip rounded */
function graspingJaw() {
    return loft(
        Array.from({ length: STEPS + 1 }, (_, i) => {
            const s = i / STEPS;
            const x = -HINGE * s - 0.5 * (1 - Math.min(1, 8 * s));
            const end = rounded(s, 0.16);
            const tooth = s < 0.2 ? 0.03 : 0.01 + 0.1 * (i % 2) * end;
            return jawSection((0.5 - 0.12 * s) * end, (0.62 - 0.26 * s) * end, Math.min(tooth, 0.3 * end)).map(
                ([y, z]) => [x, y, z],
            );
        }),
    );
}

/** upper blade of scissors, on one side of the plane in which it turns, curved to that side */
function scissorBlade() {
    return loft(
        Array.from({ length: STEPS + 1 }, (_, i) => {
            const s = i / STEPS;
            const x = -HINGE * s - 0.4 * (1 - Math.min(1, 8 * s));
            const back = 0.5 * (1 - 0.55 * s) * rounded(s, 0.3);
            const bend = s * (s - 1);
            // the edge lies on the plane of turning and reaches below the axis, so that the blades pass each other
            return [
                [-0.1, 0.0],
                [back, 0.0],
                [back, 0.14],
                [0.1 * back, 0.14],
            ].map(([y, z]) => [x, y, z + bend]);
        }),
    );
}

/** fork with a pin, in which jaws turn, and the collar that ties it to the shaft */
function wrist() {
    const cheek = [
        [NECK + 0.7, -0.34],
        [HINGE - 0.1, -0.34],
        ...Array.from({ length: 9 }, (_, i) => {
            const angle = (-80 + 20 * i) * DEGREE;
            return [HINGE + 0.34 * Math.cos(angle), 0.34 * Math.sin(angle)];
        }),
        [HINGE - 0.1, 0.34],
        [NECK + 0.7, 0.34],
    ];
    const pin = plate(
        ellipse(0.16, 0.16).map(([x, y]) => [HINGE + x, y]),
        -0.68,
        0.68,
        0.05,
    );
    const collar = turned([
        [NECK - 0.02, 0.46],
        [NECK, SHAFT_RADIUS],
        [NECK + 0.5, SHAFT_RADIUS],
        [NECK + 0.8, 0.44],
        [NECK + 1.1, 0.36],
    ]);
    return [collar, plate(cheek, 0.4, 0.58, BEVEL), plate(cheek, -0.58, -0.4, BEVEL), pin];
}

/** hook of electrosurgery: a wire that leaves its insulation and bends by a right angle */
function hook() {
    const bend = 0.45;
    const arc = Array.from({ length: 9 }, (_, i) => (90 * i * DEGREE) / 8);
    const path = [
        ...[-2.6, -1.8, -1].map((x) => [x, 0]),
        ...arc.map((angle) => [-bend + bend * Math.sin(angle), bend - bend * Math.cos(angle)]),
        [0, 0.8],
        [0, 1.15],
        [0, 1.2],
    ];
    return swept(path, (s) => ellipse(0.15 * rounded(s, 0.06), 0.19 * rounded(s, 0.06), 12));
}

/** plate of a retractor: broad, thin, arched, with a rounded end; its hollow side faces -z */
function retractorPlate() {
    const half = 32 * DEGREE; // of the arch, whose chord is the axis of the shaft
    const radius = (0.5 * -NECK - 0.5) / Math.sin(half);
    const path = Array.from({ length: 41 }, (_, i) => {
        const angle = half * (i / 20 - 1);
        return [radius * (Math.sin(angle) - Math.sin(half)), radius * (Math.cos(angle) - Math.cos(half))];
    });
    const arched = swept(path, (s) => {
        const widening = Math.min(1, s / 0.3);
        const width = (0.3 + 0.95 * widening * widening * (3 - 2 * widening)) * rounded(s, 0.2);
        return ellipse(0.13, 0.13, 12).map(([y, z]) => [y, z + Math.sign(z) * Math.max(0, width - 0.13)]);
    });
    return { points: arched.points.map(([x, y, z]) => [x, -z, y]), triangles: arched.triangles };
}

/** @type {Record<string, () => Partial<Shape>>} */
const MAKERS = {
    probe: () => ({
        steel: [
            turned(
                Array.from({ length: 19 }, (_, i) => {
                    const angle = (-162 + 9 * i) * DEGREE;
                    return [Math.cos(angle), Math.max(0.02, -Math.sin(angle))];
                }),
                32,
            ),
            turned([
                [NECK, 0.4],
                [-0.8, 0.4],
            ]),
        ],
    }),
    grasper: () => {
        const upper = graspingJaw();
        return { steel: wrist(), jaws: [upper, mirrored(upper)], open: 20 * DEGREE, held: 2 * DEGREE };
    },
    scissors: () => {
        const upper = scissorBlade();
        // the lower blade lies on the other side of the plane and bends with the upper one
        const lower = moved(mirrored(upper), [0, 0, -0.14]);
        return { steel: wrist(), jaws: [upper, lower], open: 18 * DEGREE, held: 1 * DEGREE };
    },
    hook: () => ({
        steel: [hook()],
        black: [
            turned([
                [-4, SHAFT_RADIUS],
                [-2.9, 0.34],
                [-2.3, 0.3],
                [-2.2, 0.2],
            ]),
        ],
        neck: -4,
    }),
    retractor: () => ({
        steel: [
            retractorPlate(),
            turned([
                [NECK - 0.02, 0.46],
                [NECK, SHAFT_RADIUS],
                [NECK + 0.6, SHAFT_RADIUS],
                [NECK + 1.1, 0.2],
            ]),
        ],
    }),
};

/** @type {Map<string, Shape>} */
const made = new Map();

/** the words of instruments that have a shape; every other tool is a ball */
export const INSTRUMENTS = Object.keys(MAKERS);

/** @param {string | undefined} instrument @returns {Shape | null} null: a ball */
export function shapeOf(instrument) {
    if (!instrument || !Object.hasOwn(MAKERS, instrument)) return null;
    let shape = made.get(instrument);
    if (!shape) {
        shape = { steel: [], black: [], jaws: [], hinge: HINGE, open: 0, held: 0, neck: NECK, ...MAKERS[instrument]() };
        made.set(instrument, shape);
    }
    return shape;
}
