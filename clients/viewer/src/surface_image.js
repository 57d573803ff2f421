// The images of a body on its surface, in place of the colour of its tissue. They are drawn when all have come; until then
// the body looks as it does without, and so does for good what an image that cannot be read would have covered.
import { assetAddress } from "./asset.js";
import * as THREE from "./three.js";

/** a texture of one colour @param {string} colour */
function plainTexture(colour) {
    const [r, g, b] = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
    const texture = new THREE.DataTexture(Uint8Array.of(r, g, b, 255), 1, 1);
    texture.needsUpdate = true;
    return texture;
}

/**
 * @param {import("./body_mesh.js").BodyMesh} body
 * @param {Float32Array} uv of its vertices, from the lower left corner [n][2]
 * @param {string[]} addresses of PNGs and JPEGs, in the order of the looks of its vertices
 * @param {string} colour of its tissue
 * @param {import("./stage.js").Stage} stage
 */
export async function showImages(body, uv, addresses, colour, stage) {
    const material = /** @type {THREE.MeshPhysicalMaterial} */ (body.mesh.material);
    body.geometry.setAttribute("uv", new THREE.BufferAttribute(uv, 2));
    const loader = new THREE.TextureLoader();
    const textures = await Promise.all(
        addresses.map((address) =>
            loader.loadAsync(assetAddress(address, location.href)).catch(() => plainTexture(colour)),
        ),
    );
    for (const texture of textures) {
        texture.colorSpace = THREE.SRGBColorSpace;
        texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
        texture.anisotropy = stage.renderer.capabilities.getMaxAnisotropy();
        material.addEventListener("dispose", () => texture.dispose());
    }
    material.userData.images = textures;
    /** @type {{defines: Record<string, string>}} */ (/** @type {unknown} */ (material)).defines.TISSUE_IMAGES = String(
        textures.length,
    );
    material.needsUpdate = true;
    stage.dirty = true;
}
