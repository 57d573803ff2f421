export * from "three/addons/postprocessing/OutputPass.js";
