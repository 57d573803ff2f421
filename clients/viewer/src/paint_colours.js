// The material in colour while a tool paints or measures it; afterwards the user's choice again.
import { offered } from "./legend.js";

/** the field that a tool changes or measures, null: none @param {string} tool @param {string} paint of PAINTS @returns {string | null} */
export function materialField(tool, paint) {
    if (tool === "probe") return "young";
    if (tool !== "paint") return null;
    return paint === "heavier" || paint === "lighter" ? "density" : "young";
}

export class PaintColours {
    /**
     * @param {{parts: {fields?: string[]}[], field: string}} state
     * @param {{choose: (field: string) => void}} fields
     */
    constructor(state, fields) {
        this.state = state;
        this.fields = fields;
        /** @type {string | null} chosen here, null: none */
        this.shown = null;
        this.before = "none"; // the user's choice
    }

    /** @param {string | null} field of the material; null: no tool needs one */
    show(field) {
        const wanted = field && offered(this.state.parts).includes(field) ? field : null;
        if (wanted === this.shown) return;
        // the user may have chosen another one meanwhile
        if (this.state.field !== this.shown) this.before = this.state.field;
        this.shown = wanted;
        this.fields.choose(wanted ?? this.before);
    }
}
