(function () {
  "use strict";
  function read(id) { return JSON.parse(document.getElementById(id).textContent); }
  var root = document.documentElement, stage = document.getElementById("stage");
  var picked = document.getElementById("picked"), scene = read("scene");
  function tell(name) {
    scene.wheels.forEach(function (wheel) {
      if (wheel.name === name) { picked.textContent = (wheel.label || name) + ": " + wheel.toe_text + ", " + wheel.camber_text; }
    });
  }
  root.classList.add("js");
  Wheelplane3D.mount(stage, scene, { onWheel: tell, words: read("viewer-words") });
  if (stage.querySelector(".w3d-none")) { root.classList.add("flat"); }
})();
