// Effects of the picture: shadows of the key light, and ambient occlusion, which darkens folds and contacts. They own the
// passes of three.js that they need. An effect that is off has no light that casts, no pass and no buffer.
import { EffectChoice, forcedEffects } from "./effect_choice.js";
import { text } from "./text.js";
import * as THREE from "./three.js";

/** in the order in which they are tried */
export const EFFECTS = Object.freeze(/** @type {const} */ (["shadow", "occlusion"]));

const SHADOW_PIXELS = 2048;
const SHADOW_DARKNESS = 0.9; // share of the key light that shadows take
const SHADOW_REACH = 0.8; // half of the lit square, in units of the scene's size: the scene and what is pulled out of it
const OCCLUSION_RADIUS = 0.2; // of the scene's size: wider folds are lit
const OCCLUSION_RESOLUTION = 0.5; // pixels per pixel of the picture: occlusion is smooth, and a quarter of the cost
const OCCLUSION_DARKNESS = 0.85;

/**
 * Does an object cast and catch shadows? Lines, marks that shine through, and what has no light of its own do not.
 * @param {THREE.Object3D} object @returns {object is THREE.Mesh}
 */
function isSolid(object) {
    if (!(object instanceof THREE.Mesh)) return false;
    const material = /** @type {THREE.Material} */ (object.material);
    return material instanceof THREE.MeshStandardMaterial && !material.transparent && material.depthTest;
}

/** drawn nowhere */
const HIDDEN = new THREE.MeshBasicMaterial({ visible: false });

/** @typedef {{castsNone?: boolean, normals?: THREE.Material}} EffectData of an object's userData, see section.js */

/** shadows of the key light, over the whole scene */
class Shadow {
    /** @param {import("./stage.js").Stage} stage */
    constructor(stage) {
        this.stage = stage;
        const { key, renderer } = stage;
        renderer.shadowMap.enabled = true;
        renderer.shadowMap.type = THREE.PCFSoftShadowMap;
        key.castShadow = true;
        key.shadow.mapSize.set(SHADOW_PIXELS, SHADOW_PIXELS);
        key.shadow.intensity = SHADOW_DARKNESS;
    }

    /** fits the lit square to the scene */
    before() {
        const { centre, key, scene, size } = this.stage;
        const reach = SHADOW_REACH * size;
        const camera = key.shadow.camera;
        const away = key.position
            .clone()
            .sub(key.target.position)
            .setLength(3 * size);
        key.target.position.copy(centre);
        key.position.copy(centre).add(away);
        key.target.updateMatrixWorld();
        camera.left = camera.bottom = -reach;
        camera.right = camera.top = reach;
        camera.near = 3 * size - 1.5 * reach;
        camera.far = 3 * size + 1.5 * reach;
        camera.updateProjectionMatrix();
        // two pixels of the map: less gives stripes where light grazes, more detaches shadows from contacts
        key.shadow.normalBias = (2 * 2 * reach) / SHADOW_PIXELS;
        key.shadow.bias = -5e-4;
        scene.traverse((object) => {
            if (!isSolid(object)) return;
            object.castShadow = !(/** @type {EffectData} */ (object.userData).castsNone);
            object.receiveShadow = true;
        });
    }

    dispose() {
        const { key, renderer } = this.stage;
        key.castShadow = false;
        key.shadow.map?.dispose();
        key.shadow.map = null;
        renderer.shadowMap.enabled = false;
    }
}

const fetchAddons = () =>
    Promise.all([
        import("../vendor/addons/postprocessing/GTAOPass.js"),
        import("../vendor/addons/postprocessing/Pass.js"),
    ]);

/**
 * three's ambient occlusion, multiplied into the finished picture. Normals and depths are drawn here: what a section
 * removes occludes nothing, caps are the surface there, and marks and handles are none.
 */
class Occlusion {
    /**
     * @param {import("./stage.js").Stage} stage
     * @param {Awaited<ReturnType<typeof fetchAddons>>} addons
     */
    constructor(stage, [{ GTAOPass }, { FullScreenQuad }]) {
        this.stage = stage;
        this.buffer = new THREE.Vector2();
        this.pass = new GTAOPass(stage.scene, stage.camera, 1, 1);
        this.pass.output = GTAOPass.OUTPUT.Off;
        const depthTexture = new THREE.DepthTexture(1, 1, THREE.UnsignedInt248Type);
        depthTexture.format = THREE.DepthStencilFormat;
        this.surface = new THREE.WebGLRenderTarget(1, 1, {
            minFilter: THREE.NearestFilter,
            magFilter: THREE.NearestFilter,
            type: THREE.HalfFloatType,
            stencilBuffer: true, // caps of sections
            depthTexture,
        });
        this.pass.setGBuffer(depthTexture, this.surface.texture);
        /** @type {WeakMap<THREE.Material, THREE.MeshNormalMaterial>} by the material of the picture */
        this.normals = new WeakMap();
        this.pass.updatePdMaterial({ lumaPhi: 10, normalPhi: 3, radius: 10, rings: 2, samples: 16 });
        this.quad = new FullScreenQuad(
            new THREE.ShaderMaterial({
                uniforms: { map: { value: null }, darkness: { value: OCCLUSION_DARKNESS } },
                vertexShader: "varying vec2 at;\nvoid main() { at = uv; gl_Position = vec4(position.xy, 0.0, 1.0); }",
                fragmentShader: `uniform sampler2D map;
uniform float darkness;
varying vec2 at;
void main() { gl_FragColor = vec4(vec3(mix(1.0, texture2D(map, at).r, darkness)), 1.0); }`,
                blending: THREE.MultiplyBlending,
                premultipliedAlpha: true,
                depthTest: false,
                depthWrite: false,
                toneMapped: false,
            }),
        );
    }

    /** what is drawn of an object @param {THREE.Mesh} object @returns {THREE.Material} */
    normalsOf(object) {
        const own = /** @type {EffectData} */ (object.userData).normals;
        if (own || !isSolid(object)) return own ?? HIDDEN;
        const material = /** @type {THREE.Material} */ (object.material);
        const { side, clippingPlanes, clipIntersection } = material;
        const normals = this.normals.get(material) ?? new THREE.MeshNormalMaterial({ blending: THREE.NoBlending });
        this.normals.set(material, normals);
        return Object.assign(normals, { side, clippingPlanes, clipIntersection });
    }

    /** normals and depths of the scene @param {THREE.PerspectiveCamera} camera */
    drawSurface(camera) {
        const { renderer, scene } = this.stage;
        /** @type {[THREE.Mesh, THREE.Material | THREE.Material[]][]} */
        const drawn = [];
        scene.traverseVisible((object) => {
            // meshes, lines, points and sprites
            const mesh = /** @type {THREE.Mesh} */ (object);
            if (mesh.material) drawn.push([mesh, mesh.material]);
        });
        const { background } = scene;
        const colour = renderer.getClearColor(new THREE.Color());
        const alpha = renderer.getClearAlpha();
        const shadows = renderer.shadowMap.autoUpdate;
        for (const [mesh] of drawn) mesh.material = this.normalsOf(mesh);
        scene.background = null;
        renderer.shadowMap.autoUpdate = false;
        renderer.setRenderTarget(this.surface);
        renderer.setClearColor(0x7777ff, 1); // a normal towards the viewer
        renderer.render(scene, camera);
        renderer.setClearColor(colour, alpha);
        renderer.shadowMap.autoUpdate = shadows;
        scene.background = background;
        for (const [mesh, material] of drawn) mesh.material = material;
    }

    /** after the scene @param {THREE.PerspectiveCamera} camera */
    after(camera) {
        const { renderer, size } = this.stage;
        this.pass.camera = camera;
        const { x, y } = renderer.getDrawingBufferSize(this.buffer);
        const [width, height] = [Math.ceil(x * OCCLUSION_RESOLUTION), Math.ceil(y * OCCLUSION_RESOLUTION)];
        if (width !== this.pass.width || height !== this.pass.height) this.pass.setSize(width, height);
        this.surface.setSize(width, height);
        this.pass.updateGtaoMaterial({
            radius: OCCLUSION_RADIUS * size,
            thickness: OCCLUSION_RADIUS * size,
            distanceExponent: 1.5,
            distanceFallOff: 0.2,
            scale: 1.25,
            samples: 16,
        });
        this.pass.updatePdMaterial({ depthPhi: 0.25 * OCCLUSION_RADIUS * size }); // farther places are of another surface
        this.drawSurface(camera);
        // with its output off the pass writes its own buffers alone
        this.pass.render(renderer, this.pass.gtaoRenderTarget, this.pass.gtaoRenderTarget, 0, false);
        /** @type {THREE.ShaderMaterial} */ (this.quad.material).uniforms.map.value = this.pass.gtaoMap;
        const clears = renderer.autoClear;
        renderer.autoClear = false;
        renderer.setRenderTarget(null);
        this.quad.render(renderer);
        renderer.autoClear = clears;
    }

    dispose() {
        this.pass.dispose();
        this.surface.depthTexture?.dispose();
        this.surface.dispose();
        /** @type {THREE.Material} */ (this.quad.material).dispose();
        this.quad.dispose();
    }
}

export class PictureEffects {
    /** @type {Shadow | null} */
    shadow = null;
    /** @type {Occlusion | null} */
    occlusion = null;
    loading = false;

    /** @param {import("./stage.js").Stage} stage @param {readonly string[] | null} forced on whatever they cost */
    constructor(stage, forced) {
        this.stage = stage;
        this.choice = new EffectChoice(EFFECTS, forced);
        this.apply();
    }

    /** makes what is on and removes what is off */
    apply() {
        const { on } = this.choice;
        if (!on.has("shadow")) {
            this.shadow?.dispose();
            this.shadow = null;
        } else this.shadow ??= new Shadow(this.stage);
        if (!on.has("occlusion")) {
            this.occlusion?.dispose();
            this.occlusion = null;
        } else if (!this.occlusion && !this.loading) this.load();
        this.stage.dirty = true;
    }

    /** the addon is fetched when it is first used */
    async load() {
        this.loading = true;
        const addons = await fetchAddons();
        this.loading = false;
        if (this.choice.on.has("occlusion")) this.occlusion = new Occlusion(this.stage, addons);
        this.stage.dirty = true;
    }

    /** draws the scene with the effects that are on @param {THREE.PerspectiveCamera} camera */
    render(camera) {
        const { renderer, scene } = this.stage;
        this.shadow?.before();
        renderer.render(scene, camera);
        this.occlusion?.after(camera);
    }

    /** the cost of the finished picture @param {number} ms */
    take(ms) {
        if (!this.loading && this.choice.take(ms)) this.apply();
    }
}

/**
 * The effects of a stage. Without a graphics card there are none unless the address asks for them.
 * @param {import("./stage.js").Stage} stage @param {boolean} software @param {string | null} asked `effects` of the address
 */
export function makeEffects(stage, software, asked) {
    const forced = forcedEffects(asked, EFFECTS);
    return forced?.length === 0 || (software && !forced) ? null : new PictureEffects(stage, forced);
}

/** the effects that are on and what they cost, for people @param {PictureEffects | null} effects */
export function effectsText(effects) {
    const { on = new Set(), cost = new Map() } = effects?.choice ?? {};
    const names = EFFECTS.filter((name) => on.has(name)).map((name) => {
        const ms = cost.has(name) ? ` ${cost.get(name)?.toFixed(1)} ms` : "";
        return text(`details.picture_effects.${name}`) + ms;
    });
    return names.join(", ") || text("details.picture_effects.none");
}
