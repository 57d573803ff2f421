// Which views the page shows: the free one, an endoscope, both side by side, or one for each eye. What is not used does not
// exist: it is made and loaded when it is chosen first.
import { OrbitView } from "./orbit_view.js";
import { MOVE_MS, between, smooth } from "./saved_views.js";
import { standardView } from "./standard_views.js";
import { ViewPane } from "./view_pane.js";

/** @typedef {import("./endoscope.js").Endoscope} Endoscope */
/** @typedef {{pane: ViewPane, free: OrbitView | null, scope: Endoscope | null}} Side what a pane can show */

export class ViewModes {
    moving = 0; // from one view to another: the request of the next picture
    split = false; // two views side by side
    stereo = false; // a picture for each eye
    /** @type {import("./xr_view.js").XrView | null} in a headset */
    immersive = null;
    /** @type {ViewPane[]} */
    eyes = [];

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
        stage.panes[0].stacks = true;
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
        this.arrange();
    }

    /** panes as the modes say */
    arrange() {
        const [left, right] = this.sides.map(({ pane }) => pane);
        left.to = this.split ? 0.5 : 1;
        for (const eye of this.eyes) eye.view = left.view;
        this.stage.setPanes(this.stereo ? this.eyes : this.split ? [left, right] : [left]);
        this.changed();
    }

    /** the free view and the endoscope, side by side @param {boolean} on */
    async setSplit(on) {
        const [first, second] = this.sides;
        if (on) {
            this.stereo = false;
            await this.show(first, "endoscope");
            // the endoscope goes to the other side
            const other = second ?? { pane: new ViewPane(first.pane.view, 0.5, 1, true), free: null, scope: null };
            other.scope = first.scope;
            first.scope = null;
            this.sides = [first, other];
            this.split = true;
            await this.show(other, "endoscope");
            await this.show(first, "free");
        } else {
            // what was worked in stays
            const { kind } = this.stage.view;
            const shot = this.shot();
            first.scope ??= second.scope;
            second.scope = first.scope === second.scope ? null : second.scope;
            this.split = false;
            await this.show(first, kind);
            first.pane.view.restore(shot);
        }
    }

    /** @param {boolean} on */
    async setStereo(on) {
        if (on && !this.eyes.length) {
            const { stereoPanes } = await import("./stereo_view.js");
            this.eyes = stereoPanes(this.sides[0].pane.view);
        }
        if (on && this.split) await this.setSplit(false);
        this.stereo = on;
        this.arrange();
    }

    /** @template {import("./view_pane.js").View} T @param {T} view */
    add(view) {
        this.stage.views.push(view);
        return view;
    }

    /** of the pane that takes the input */
    shot() {
        return this.stage.view.state();
    }

    /** moves the pane that takes the input to a view @param {import("./saved_views.js").Shot} shot */
    async go(shot) {
        const { side, stage } = this;
        cancelAnimationFrame(this.moving);
        if (side.pane.view.kind !== shot.kind) await this.show(side, shot.kind);
        const { view } = side.pane;
        const from = view.state();
        const begin = performance.now();
        const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
        const step = () => {
            const t = still ? 1 : Math.min(1, (performance.now() - begin) / MOVE_MS);
            view.restore(t < 1 ? between(from, shot, smooth(t)) : shot);
            stage.dirty = true;
            if (t < 1) this.moving = requestAnimationFrame(step);
            else this.changed();
        };
        step();
    }

    /** @param {typeof import("./standard_views.js").STANDARD[number]} from @param {string} axes of the patient, "" unknown */
    goStandard(from, axes) {
        const { stage } = this;
        const [a, b] = stage.ground();
        const ground = { a: a.toArray(), b: b.toArray(), up: stage.up.toArray() };
        const [x, y, z] = stage.centre.toArray();
        return this.go({ kind: "free", values: { x, y, z, near: 1, ...standardView(from, ground, axes) } });
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
