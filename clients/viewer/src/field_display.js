// The field shown in colour: which one is chosen, what the server is asked for, the range of the colours, the legend.
import { htmlById, makeOption, selectById } from "./dom.js";
import { FIELDS, labels, missing, offered, rangeOf } from "./legend.js";

const NOTICE_MS = 4000;

export class FieldDisplay {
    /**
     * @param {import("./app_state.js").AppState} state
     * @param {import("./stage.js").Stage} stage
     * @param {(message: import("./control_table.js").ClientMessage) => void} send
     * @param {import("./layout.js").Layout} layout
     */
    constructor(state, stage, send, layout) {
        this.state = state;
        this.stage = stage;
        this.send = send;
        this.layout = layout;
        this.list = selectById("field");
        this.list.onchange = () => this.choose(this.list.value);
    }

    /** subscribes to the chosen field of every part that has it, and to no field of the others */
    subscribe() {
        this.state.parts.forEach((part, i) => {
            if (!part.fields) return;
            this.send({
                type: "subscribe_field",
                part: i,
                field: part.fields.includes(this.state.field) ? this.state.field : "none",
            });
        });
    }

    /** @param {string} name of a field, or "none" */
    choose(name) {
        this.state.field = name;
        this.state.range = null;
        this.list.value = name;
        for (const body of this.state.newestBodies.values()) body.colours.drop();
        this.subscribe();
        this.showLegend();
        this.stage.dirty = true;
    }

    /** the next in the list */
    chooseNext() {
        const names = [...this.list.options].map((option) => option.value);
        this.choose(names[(names.indexOf(this.state.field) + 1) % names.length]);
    }

    /**
     * Lists the fields of the session; the choice stays if it is still possible.
     * @param {boolean} reconnected nothing is subscribed on this connection
     */
    offer(reconnected) {
        const names = offered(this.state.parts);
        const note = missing(this.state.parts);
        const chosen = this.state.field;
        this.list.replaceChildren(
            makeOption("none", "None"),
            ...names.map((name) => makeOption(name, FIELDS[name].title)),
        );
        htmlById("field-note").textContent = note;
        htmlById("field-note").hidden = !note;
        const stays = chosen === "none" || names.includes(chosen);
        if (reconnected || !stays) this.choose(stays ? chosen : "none");
        else {
            this.list.value = chosen;
            this.subscribe(); // parts that have the field only now
        }
        if (!stays) this.layout.notice(`${FIELDS[chosen].title} is not available with this method.`, NOTICE_MS);
    }

    /** @param {Extract<import("./link.js").PageMessage, {type: "field"}>} message */
    takeField({ part, name, level, low, high }) {
        const body = this.state.newestBodies.get(part);
        // values of a field that is no longer chosen may still arrive
        if (name !== this.state.field || !body || 3 * level.length !== body.rest.length) return;
        body.colours.take(level, low, high, performance.now(), body.visible);
        this.updateRange();
        this.stage.dirty = true;
    }

    /** the range of the colours covers the values of all parts */
    updateRange() {
        const bodies = [...this.state.newestBodies.values()];
        const values = bodies.flatMap((body) => body.colours.values ?? []);
        if (values.length === 0) return;
        const former = this.state.range;
        const low = Math.min(...values.map((v) => v.low));
        const high = Math.max(...values.map((v) => v.high));
        const range = rangeOf(this.state.field, low, high, former);
        this.state.range = range;
        for (const body of bodies) body.colours.setRange(range);
        if (range.low !== former?.low || range.high !== former.high) this.showLegend();
    }

    showLegend() {
        const { field, range } = this.state;
        htmlById("legend").hidden = field === "none";
        if (field === "none") return;
        const { low, high, unit } = range ? labels(field, range) : { low: "", high: "", unit: "" };
        htmlById("legend-title").textContent = FIELDS[field].title;
        htmlById("legend-unit").textContent = unit;
        htmlById("legend-low").textContent = low;
        htmlById("legend-high").textContent = high;
        htmlById("legend-wait").hidden = range !== null;
    }
}
