// What is inside the bodies: the panel of section planes, and the interiors that the server sends while a field is shown
// in a section or a volume. What draws them is loaded when it is first used.
import { buttonById, htmlById, inputById, makeOption } from "./dom.js";
import { DIRECTIONS, entryOf, noPlanes } from "./section_planes.js";
import { outerFaces } from "./slice.js";
import { text } from "./text.js";

/**
 * @typedef {{epoch: number, rest: Float32Array, tets: Uint32Array, outer: Uint8Array, width: number, x: Float32Array,
 *   value: Float32Array, low: number, high: number, field: string, revision: number}} Interior of one part: outer and
 *   width as sliceTets takes them; x and value of the nodes as the server sent them last; revision: of these
 */

/** @param {number} share */
const percent = (share) => `${Math.round(100 * share)} %`;

export class Inside {
    /**
     * @param {import("./app_state.js").AppState} state @param {import("./stage.js").Stage} stage
     * @param {import("./field_display.js").FieldDisplay} fields
     */
    constructor(state, stage, fields) {
        this.state = state;
        this.stage = stage;
        this.fields = fields;
        fields.inside = this;
        this.planes = noPlanes();
        /** @type {Map<number, Interior>} by part */
        this.interiors = new Map();
        /** @type {import("./section.js").Section | null} null: never used */
        this.section = null;
        /** @type {import("./plane_handles.js").PlaneHandles | null} null: never used */
        this.handles = null;
        /** @type {(() => void)[]} writes each plane into its row of the panel */
        this.showPlane = [];
        /** @type {import("./volume.js").Volume | null} null: never used */
        this.cloud = null;
        this.volume = false; // is the field drawn as a cloud?
        this.threshold = Number(inputById("inside-threshold").value);
        inputById("inside-volume").onchange = () => {
            this.volume = inputById("inside-volume").checked;
            inputById("inside-threshold").disabled = !this.volume;
            this.changed();
        };
        inputById("inside-threshold").oninput = () => {
            this.threshold = Number(inputById("inside-threshold").value);
            inputById("inside-threshold").ariaValueText = percent(this.threshold);
            this.stage.dirty = true;
        };
        this.button = buttonById("inside-toggle");
        this.button.onclick = () => this.toggle();
        this.listPlanes();
    }

    listPlanes() {
        const names = DIRECTIONS.map((name) =>
            makeOption(name, text(/** @type {import("./text.js").TextKey} */ (`inside.direction.${name}`))),
        );
        htmlById("inside-planes").replaceChildren(
            ...this.planes.map((plane, i) => {
                const row = document.createElement("div");
                const direction = document.createElement("select");
                const at = Object.assign(document.createElement("input"), { type: "range", max: "1", step: "0.002" });
                const flip = Object.assign(document.createElement("button"), { textContent: "⇄", type: "button" });
                const number = { number: i + 1 };
                direction.append(...names.map((name) => /** @type {HTMLOptionElement} */ (name.cloneNode(true))));
                direction.ariaLabel = text("inside.plane", number);
                at.ariaLabel = text("inside.position", number);
                flip.ariaLabel = flip.title = text("inside.flip");
                const show = () => {
                    direction.options[DIRECTIONS.indexOf("turned")].hidden = !plane.turned;
                    direction.value = plane.direction;
                    at.value = String(plane.at);
                    at.ariaValueText = percent(plane.at);
                    at.disabled = flip.disabled = plane.direction === "none";
                };
                show();
                this.showPlane.push(show);
                direction.onchange = () => {
                    plane.direction = direction.value;
                    show();
                    this.changed();
                };
                at.oninput = () => this.movePlane(i, Number(at.value));
                flip.onclick = () => {
                    plane.flipped = !plane.flipped;
                    this.changed();
                };
                row.append(direction, at, flip);
                return row;
            }),
        );
    }

    /** @param {number} i plane @param {number} at */
    movePlane(i, at) {
        this.planes[i].at = at;
        this.showPlane[i]();
        this.changed();
    }

    /** @param {number} i plane @param {number[]} turned unit vector along which it lies at `at` @param {number} at */
    turnPlane(i, turned, at) {
        Object.assign(this.planes[i], { direction: "turned", turned });
        this.movePlane(i, at);
    }

    toggle() {
        const panel = htmlById("inside");
        panel.hidden = !panel.hidden;
        this.button.setAttribute("aria-expanded", String(!panel.hidden));
        this.stage.dirty = true; // the handles come and go with the panel
    }

    /** are values inside looked at? */
    get wanted() {
        return this.volume || this.planes.some(({ direction }) => direction !== "none");
    }

    async changed() {
        this.button.setAttribute("aria-pressed", String(this.wanted));
        this.fields.setInterior(this.wanted);
        if (!this.wanted) this.interiors.forEach((interior) => (interior.field = ""));
        if (this.wanted && !this.section) {
            const [{ Section }, { PlaneHandles }] = await Promise.all([
                import("./section.js"),
                import("./plane_handles.js"),
            ]);
            this.section ??= new Section(this.stage, this.state, this);
            this.handles ??= new PlaneHandles(this.stage, this);
        }
        if (this.volume && !this.cloud) {
            const { Volume } = await import("./volume.js");
            this.cloud ??= new Volume(this.stage, this.state, this);
        }
        this.showNote();
        this.stage.dirty = true;
    }

    /** what is missing for values inside */
    showNote() {
        const { field, parts } = this.state;
        const missing = !this.wanted
            ? ""
            : !parts.some((part) => part.interior)
              ? text("inside.surface")
              : field === "none"
                ? text("inside.choose")
                : "";
        htmlById("inside-note").textContent = missing;
    }

    /** before a picture */
    update() {
        this.cloud?.update(this.section?.chosen() ?? []);
        this.section?.update();
        this.handles?.update(!htmlById("inside").hidden);
    }

    /** @param {import("./interior_link.js").InteriorMesh} message */
    takeMesh({ part, epoch, rest, tets }) {
        this.interiors.set(part, {
            epoch,
            rest,
            tets,
            outer: outerFaces(tets),
            width: edgeOf(rest, tets),
            x: rest.slice(),
            value: new Float32Array(rest.length / 3),
            low: 0,
            high: 0,
            field: "",
            revision: 0,
        });
    }

    /** @param {import("./interior_link.js").InteriorValues} message */
    takeValues({ part, epoch, name, low, high, move, level }) {
        const interior = this.interiors.get(part);
        // values of a field that is no longer chosen may still arrive
        if (!interior || interior.epoch !== epoch || name !== this.state.field || !this.wanted) return;
        for (let i = 0; i < move.length; i++) interior.x[i] = interior.rest[i] + move[i];
        for (let i = 0; i < level.length; i++) interior.value[i] = low + ((high - low) * level[i]) / 255;
        Object.assign(interior, { low, high, field: name, revision: interior.revision + 1 });
        this.fields.updateRange();
        this.stage.dirty = true;
    }

    /** values of the chosen field in a part; null: none yet @param {number} part @param {number} epoch */
    interiorOf(part, epoch) {
        const interior = this.interiors.get(part);
        return interior && interior.epoch === epoch && interior.field === this.state.field ? interior : null;
    }

    /** ranges of the values that are shown inside @returns {{low: number, high: number}[]} */
    ranges() {
        return [...this.interiors.values()].filter(({ field }) => field === this.state.field);
    }

    /** begins a ray where the planes leave something to touch @param {import("./three.js").Ray} ray @returns {boolean} false: nowhere */
    trim(ray) {
        const planes = this.section?.chosen() ?? [];
        const entry = entryOf(ray.origin.toArray(), ray.direction.toArray(), planes);
        if (entry === Infinity) return false;
        ray.origin.addScaledVector(ray.direction, entry);
        return true;
    }
}

/** longest edge of the first tetrahedron, m: about that of all @param {Float32Array} x @param {Uint32Array} tets */
function edgeOf(x, tets) {
    let max = 0;
    for (let a = 0; a < 4; a++)
        for (let b = 0; b < a; b++)
            max = Math.max(max, Math.hypot(...[0, 1, 2].map((c) => x[3 * tets[a] + c] - x[3 * tets[b] + c])));
    return max;
}
