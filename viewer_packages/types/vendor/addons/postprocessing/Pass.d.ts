export * from "three/addons/postprocessing/Pass.js";
