export * from "three/addons/postprocessing/RenderPass.js";
