export * from "three/addons/postprocessing/ShaderPass.js";
