// Two pictures side by side, one for each eye, of one view: for screens and viewers that show each half to its eye. A
// pane has the camera of an eye, so that a ray through its pixels meets what that eye sees there.
import { StereoCamera } from "./three.js";
import { ViewPane } from "./view_pane.js";

const APART = 1 / 30; // distance of the eyes, of the depth of the middle of the view: comfortable for most people

/** @param {import("./view_pane.js").View} view @returns {ViewPane[]} of the left and of the right eye */
export function stereoPanes(view) {
    const stereo = new StereoCamera();
    return [stereo.cameraL, stereo.cameraR].map((eye, i) => {
        const pane = new ViewPane(view, i / 2, (i + 1) / 2);
        pane.lens = (camera) => {
            camera.focus = pane.view.depth();
            stereo.eyeSep = APART * camera.focus;
            stereo.update(camera);
            eye.projectionMatrixInverse.copy(eye.projectionMatrix).invert();
            eye.updateMatrixWorld();
            eye.matrixWorld.decompose(eye.position, eye.quaternion, eye.scale);
            return Object.assign(eye, { fov: camera.fov, zoom: camera.zoom });
        };
        return pane;
    });
}
