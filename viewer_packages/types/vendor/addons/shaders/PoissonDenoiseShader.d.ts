export * from "three/addons/shaders/PoissonDenoiseShader.js";
