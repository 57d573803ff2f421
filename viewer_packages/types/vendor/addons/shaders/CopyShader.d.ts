export * from "three/addons/shaders/CopyShader.js";
