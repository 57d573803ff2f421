// The one door to three.js: the served copy stands beside this folder, put there by the build.
export * from "../vendor/three.module.min.js";
