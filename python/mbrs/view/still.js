"use strict";
// Draws a model that does not move, with the painter of viewer.js: mbrsStill(element, scene). The scene is made by view/still.py.
const mbrsStill = ((viewer) => {
  // Muted colours that tell neighbours apart.
  const BODIES = ["#6f8fb0", "#8fae7f", "#c9a36a", "#9d8bb8", "#7fb0ad", "#b98a84", "#a3a16b", "#8696a3"];

  return function (root, scene) {
    viewer.prepare(scene);
    scene.solids.forEach((solid) => { solid.c = solid.c || BODIES[solid.b % BODIES.length]; });
    const n = scene.bodies.length, state = viewer.rest(n), still = new Float32Array(n);
    root.classList.add("mbrs-viewer");
    const stage = viewer.makeStage(root, scene, "model"), { bar, title } = stage;
    title.textContent = scene.title;
    // more names than these cover each other
    const named = n + new Set([...scene.marks, ...scene.links].map((one) => one.t)).size;
    const shown = viewer.toggles(stage, scene, named <= 30);
    stage.addReset();
    viewer.animate(stage, () => false, () => viewer.paint(stage, scene, state, null, { ...shown(), tint: still }));
  };
})(typeof mbrsViewer === "undefined" ? require("./viewer.js") : mbrsViewer);
if (typeof module !== "undefined") module.exports = mbrsStill;
