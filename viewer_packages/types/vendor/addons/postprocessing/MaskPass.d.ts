export * from "three/addons/postprocessing/MaskPass.js";
