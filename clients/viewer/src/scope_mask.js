// What an endoscope's picture has around it: a dark surround with a soft rim, a notch in the rim that shows how the optics
// are turned, and less light towards the rim.
import * as THREE from "./three.js";

const FRAGMENT = `
uniform vec2 size;
uniform vec3 round; // middle and radius, pixels from the upper left corner
uniform float notch; // rad, 0: above
varying vec2 at;
void main() {
  vec2 p = vec2(at.x * size.x, (1.0 - at.y) * size.y) - round.xy;
  float r = length(p) / round.z;
  float pixel = 1.0 / round.z;
  float vignette = 0.6 * smoothstep(0.5, 1.02, r);
  vec2 q = vec2(p.x * cos(notch) + p.y * sin(notch), p.x * sin(notch) - p.y * cos(notch)) / round.z;
  float tooth = smoothstep(-pixel, pixel, q.y - 0.95 - 0.9 * abs(q.x));
  float dark = max(smoothstep(1.0 - 5.0 * pixel, 1.0, r), tooth);
  gl_FragColor = vec4(0.012, 0.012, 0.014, mix(vignette, 1.0, dark));
}`;

/** to be drawn over a picture with `size` in pixels of the page */
export function makeMask() {
    const size = new THREE.Vector2(1, 1);
    const round = new THREE.Vector3();
    const notch = { value: 0 };
    const material = new THREE.ShaderMaterial({
        uniforms: { size: { value: size }, round: { value: round }, notch },
        vertexShader: "varying vec2 at; void main() { at = uv; gl_Position = vec4(position.xy, 0.0, 1.0); }",
        fragmentShader: FRAGMENT,
        transparent: true,
        depthTest: false,
        depthWrite: false,
        toneMapped: false,
    });
    const quad = new THREE.Mesh(new THREE.PlaneGeometry(2, 2), material);
    quad.frustumCulled = false;
    const scene = new THREE.Scene();
    scene.add(quad);
    return { scene, camera: new THREE.Camera(), size, round, notch };
}
