// The time plots: nothing but this flag until the panel opens, which loads uPlot.
import { htmlById } from "./dom.js";

export class Plots {
    /** @param {import("./app_state.js").AppState} state @param {import("./field_display.js").FieldDisplay} fields */
    constructor(state, fields) {
        this.state = state;
        this.fields = fields;
        this.opened = false;
        /** @type {import("./plots_panel.js").PlotsPanel | null} */
        this.panel = null;
    }

    /** @param {boolean} opened */
    async open(opened) {
        if (opened === this.opened) return;
        this.opened = opened;
        htmlById("plots").hidden = !opened;
        this.fields.setEnergy(opened);
        this.panel?.close();
        this.panel = null;
        if (!opened) return;
        const { PlotsPanel } = await import("./plots_panel.js");
        if (this.opened && !this.panel) this.panel = new PlotsPanel(this.state);
    }

    /** @param {number} time of the simulation, s @param {import("./wire.js").Tool[]} tools */
    take(time, tools) {
        this.panel?.take(time, tools);
    }
}
