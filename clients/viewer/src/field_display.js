// The field shown in colour: which one is chosen, what the server is asked for, the range of the colours, the legend.
import { htmlById, makeOption, selectById } from "./dom.js";
import { gradientOf } from "./colour_maps.js";
import { FIELDS, mapOf, missing, offered, rangeOf, restText, shareOf, ticksOf, titleOf } from "./legend.js";
import { text } from "./text.js";

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
        /** @type {import("./inside.js").Inside | null} set by itself */
        this.inside = null;
        this.interior = false; // are values inside wanted?
        this.energy = false; // are energies wanted in the status?
        this.share = 0; // of the colours, see shareOf
        this.list = selectById("field");
        this.list.onchange = () => this.choose(this.list.value);
    }

    /** subscribes to the chosen field of every part that has it, and to no field of the others */
    subscribe() {
        this.state.parts.forEach((part, i) => {
            if (!part.fields) return;
            const field = part.fields.includes(this.state.field) ? this.state.field : "none";
            this.send({
                type: "subscribe_field",
                part: i,
                field,
                ...(this.interior && part.interior && { interior: true }),
                ...(this.energy && part.fields.includes("energy") && { energy: true }),
            });
        });
    }

    /** @param {boolean} wanted values inside the bodies */
    setInterior(wanted) {
        if (wanted === this.interior) return;
        this.interior = wanted;
        if (this.state.field !== "none") this.subscribe();
    }

    /** @param {boolean} wanted energies of the bodies in the status */
    setEnergy(wanted) {
        if (wanted === this.energy) return;
        this.energy = wanted;
        this.subscribe();
    }

    /** @param {string} name of a field, or "none" */
    choose(name) {
        this.state.field = name;
        this.state.range = null;
        this.list.value = name;
        this.list.classList.toggle("chosen", name !== "none");
        for (const body of this.state.newestBodies.values()) body.colours.drop();
        this.subscribe();
        this.showLegend();
        this.inside?.showNote();
        this.stage.dirty = true;
    }

    /** the next in the list */
    chooseNext() {
        const names = [...this.list.options].filter((option) => !option.disabled).map((option) => option.value);
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
            makeOption("none", text("field.none")),
            ...names.map((name) => makeOption(name, titleOf(name))),
            ...(note ? [Object.assign(makeOption("", note), { disabled: true })] : []),
        );
        const stays = chosen === "none" || names.includes(chosen);
        if (reconnected || !stays) this.choose(stays ? chosen : "none");
        else {
            this.list.value = chosen;
            this.subscribe(); // parts that have the field only now
        }
        if (!stays) this.layout.notice(text("fields.gone", { field: titleOf(chosen) }), NOTICE_MS, "calm");
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
        values.push(...(this.inside?.ranges() ?? []));
        const former = this.state.range;
        const low = Math.min(...values.map((v) => v.low));
        const high = Math.max(...values.map((v) => v.high));
        const { field } = this.state;
        const range = rangeOf(field, low, high, former);
        const share = shareOf(field, low, high);
        this.state.range = range;
        for (const body of bodies) {
            body.colours.setRange(range, mapOf(field));
            body.colours.enable(body.colours.values ? share : 0);
        }
        const rested = this.share === 0;
        this.share = share;
        if (range.low !== former?.low || range.high !== former.high || rested !== (share === 0)) this.showLegend();
    }

    showLegend() {
        const { field, range } = this.state;
        htmlById("legend").hidden = field === "none";
        if (field === "none") return;
        const { unit, ticks } = range ? ticksOf(field, range) : { unit: "", ticks: [] };
        htmlById("legend-title").textContent = titleOf(field);
        htmlById("legend-unit").textContent = unit;
        htmlById("legend-colours").style.background = gradientOf(mapOf(field));
        htmlById("legend-ticks").replaceChildren(
            ...ticks.map((tick, k) => {
                const mark = Object.assign(document.createElement("span"), { textContent: tick });
                mark.style.left = `${(100 * k) / (ticks.length - 1)}%`;
                return mark;
            }),
        );
        htmlById("legend-state").textContent = !range ? text("legend.wait") : this.share === 0 ? restText(field) : "";
    }
}
