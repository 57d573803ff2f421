export * from "three/addons/postprocessing/EffectComposer.js";
