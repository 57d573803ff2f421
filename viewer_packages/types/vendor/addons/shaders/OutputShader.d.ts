export * from "three/addons/shaders/OutputShader.js";
