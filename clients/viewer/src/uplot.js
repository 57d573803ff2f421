// The only import of uPlot: the served copy stands beside this folder, put there by the build. Its style comes with it.
const style = { rel: "stylesheet", href: "vendor/uPlot.min.css" };
document.head.append(Object.assign(document.createElement("link"), style));
export { default } from "../vendor/uPlot.esm.js";
