// Which views the page shows: the free one, an endoscope, both side by side, or one for each eye. What is not used does not
// exist: it is made and loaded when it is chosen first.
import { OrbitView } from "./orbit_view.js";
import { ViewPane } from "./view_pane.js";

/** @typedef {import("./endoscope.js").Endoscope} Endoscope */
/** @typedef {{pane: ViewPane, free: OrbitView | null, scope: Endoscope | null}} Side what a pane can show */

export class ViewModes {
    split = false;
    stereo = false;

    /**
     * @param {import("./stage.js").Stage} stage
     * @param {(ray: import("./three.js").Ray) => import("./picking.js").Hit | null} pick
     * @param {() => void} changed called after each change
     */
    constructor(stage, pick, changed) {
        this.stage = stage;
        this.pick = pick;
        this.changed = changed;
        /** @type {Side[]} */
        this.sides = [{ pane: stage.panes[0], free: stage.free, scope: null }];
    }

    /** of the pane that takes the input @returns {Side} */
    get side() {
        return this.sides.find(({ pane }) => pane === this.stage.pane) ?? this.sides[0];
    }

    /** the endoscope that takes the input, null: it is the free view */
    get scope() {
        const { scope, pane } = this.side;
        return pane.view === scope ? scope : null;
    }

    /** @param {Side} side @param {"free" | "endoscope"} kind */
    async show(side, kind) {
        if (kind === "endoscope" && !side.scope) {
            const { Endoscope } = await import("./endoscope.js");
            // a second call may have been faster
            side.scope ??= this.add(new Endoscope(this.stage, this.pick));
        }
        if (kind === "free" && !side.free) {
            side.free = this.add(new OrbitView(this.stage));
            side.free.restore(this.stage.free.state());
        }
        const view = kind === "free" ? side.free : side.scope;
        if (view) side.pane.view = view;
        this.stage.setPanes(this.stage.panes);
        this.changed();
    }

    /** @template {import("./view_pane.js").View} T @param {T} view */
    add(view) {
        this.stage.views.push(view);
        return view;
    }

    toggleEndoscope() {
        return this.show(this.side, this.scope ? "free" : "endoscope");
    }

    /** @param {number} degrees */
    setAngle(degrees) {
        this.scope?.setAngle(degrees);
        this.stage.dirty = true;
        this.changed();
    }
}
