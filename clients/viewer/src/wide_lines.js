// three.js's addon for lines that are wider than a pixel; imported when such lines are first drawn.
export { LineMaterial } from "../vendor/addons/lines/LineMaterial.js";
export { LineSegments2 } from "../vendor/addons/lines/LineSegments2.js";
export { LineSegmentsGeometry } from "../vendor/addons/lines/LineSegmentsGeometry.js";
