// The force that the user feels as the saturation of the background (paper A Fig. 8). Off at first where the system asks
// for less motion.
import { paintBackdrop } from "./backdrop.js";
import { inputById } from "./dom.js";
import { blendLevel, forceLevel } from "./force_level.js";
import { store, stored } from "./storage.js";

const STORED = "palpate.force_cue";
const STEPS = 40; // of the level: a smaller change is not seen, and needs no new picture

export class ForceCue {
    /** @param {import("./stage.js").Stage} stage @param {import("./app_state.js").AppState} state */
    constructor(stage, state) {
        this.stage = stage;
        this.state = state;
        this.level = 0;
        this.at = 0; // of the last update, ms
        this.light = window.matchMedia("(prefers-color-scheme: light)");
        const reduced = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
        const box = inputById("force-cue");
        box.checked = (stored(STORED) ?? (reduced ? "off" : "on")) === "on";
        box.onchange = () => store(STORED, box.checked ? "on" : "off");
        this.isOn = () => box.checked;
    }

    /** level of the own tool; who has none sees the largest of all */
    wanted() {
        const { state } = this;
        const levels = state.tools.map((tool, i) =>
            tool.away || !tool.held ? 0 : forceLevel(Math.hypot(...tool.force), state.hello?.tools[i]?.force_cap_N),
        );
        return state.ownTool < 0 ? Math.max(0, ...levels) : (levels[state.ownTool] ?? 0);
    }

    /** before each picture @param {number} now ms */
    update(now) {
        const wanted = this.isOn() ? this.wanted() : 0;
        this.level = blendLevel(this.level, wanted, (now - this.at) / 1000);
        this.at = now;
        const step = Math.round(STEPS * this.level);
        const texture = /** @type {import("./three.js").CanvasTexture | null} */ (this.stage.scene.background);
        // a view may have a ground of its own; a new one is painted without force
        if (texture?.name !== "backdrop" || step === (texture.userData.step ?? 0)) return;
        texture.userData.step = step;
        paintBackdrop(texture, this.light.matches, step / STEPS);
        this.stage.dirty = true;
    }
}
