// The image of a body on its surface, in place of the colour of its tissue. It is drawn when it has come; until then, and
// when it cannot be read, the body looks as it does without.
import * as THREE from "./three.js";

/**
 * @param {import("./body_mesh.js").BodyMesh} body
 * @param {Float32Array} uv of its vertices, from the lower left corner [n][2] @param {string} address of a PNG or JPEG
 * @param {import("./stage.js").Stage} stage
 */
export function showImage(body, uv, address, stage) {
    const material = /** @type {THREE.MeshPhysicalMaterial} */ (body.mesh.material);
    body.geometry.setAttribute("uv", new THREE.BufferAttribute(uv, 2));
    new THREE.TextureLoader().load(address, (texture) => {
        texture.colorSpace = THREE.SRGBColorSpace;
        texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
        texture.anisotropy = stage.renderer.capabilities.getMaxAnisotropy();
        material.addEventListener("dispose", () => texture.dispose());
        material.map = texture;
        material.color.set(0xffffff);
        material.needsUpdate = true;
        stage.dirty = true;
    });
}
