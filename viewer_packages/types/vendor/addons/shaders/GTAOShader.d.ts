export * from "three/addons/shaders/GTAOShader.js";
