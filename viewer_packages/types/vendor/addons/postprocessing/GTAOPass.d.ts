export * from "three/addons/postprocessing/GTAOPass.js";
