export * from "three/addons/math/SimplexNoise.js";
