"use strict";
// Plays a motion over the scene of viewer.js: mbrsMotion(element, scene). The scene is made by mbrs/animate/motion.py.
const mbrsMotion = ((viewer) => {
  const PATHS = ["#1f5fa8", "#d9662b", "#2e8b57", "#8e4fa8", "#b8860b", "#c2334d"];

  // Row-major rotation matrix (9) of a unit quaternion, scalar first.
  function matrix(w, x, y, z) {
    return [
      1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
      2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
      2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)];
  }

  // Displacements and turns of all bodies at time t, 12 numbers a body as `pose` of viewer.js makes them. Frames are so
  // close that straight lines between them will do.
  function at(motion, t) {
    const { from, step, count, n, p, q } = motion;
    const place = Math.max(0, Math.min(count - 1, step > 0 ? (t - from) / step : 0));
    const i = Math.min(Math.floor(place), Math.max(count - 2, 0)), j = Math.min(i + 1, count - 1), s = place - i;
    const out = new Float64Array(12 * n);
    for (let b = 0; b < n; b++) {
      const u = 3 * (i * n + b), v = 3 * (j * n + b), g = 4 * (i * n + b), h = 4 * (j * n + b);
      for (let k = 0; k < 3; k++) out[12 * b + k] = p[u + k] + s * (p[v + k] - p[u + k]);
      let dot = 0, square = 0;
      for (let k = 0; k < 4; k++) dot += q[g + k] * q[h + k];
      const mixed = [0, 1, 2, 3].map((k) => q[g + k] + s * ((dot < 0 ? -1 : 1) * q[h + k] - q[g + k]));
      for (const c of mixed) square += c * c;
      out.set(matrix(...mixed.map((c) => c / Math.sqrt(square))), 12 * b + 3);
    }
    return out;
  }

  // Speeds of the bodies at a frame, as parts of the largest of the whole motion.
  function glow(motion, t) {
    const { from, step, count, n, speed } = motion;
    const i = Math.round(Math.max(0, Math.min(count - 1, step > 0 ? (t - from) / step : 0)));
    return speed.subarray(i * n, (i + 1) * n);
  }

  function drawPaths(ctx, cam, scene, motion, t) {
    scene.paths.forEach(([, , points], i) => {
      const xyz = viewer.decode(points), last = motion.step > 0 ? Math.floor((t - motion.from) / motion.step) : 0;
      ctx.strokeStyle = PATHS[i % PATHS.length];
      [[0, motion.count - 1, 0.25], [0, last, 1]].forEach(([first, end, alpha]) => {
        ctx.globalAlpha = alpha;
        ctx.lineWidth = alpha < 1 ? 1 : 1.6;
        ctx.beginPath();
        for (let k = first; k <= Math.min(end, motion.count - 1); k++) {
          const c = cam.project([xyz[3 * k], xyz[3 * k + 1], xyz[3 * k + 2]]);
          if (k === first) ctx.moveTo(c[0], c[1]);
          else ctx.lineTo(c[0], c[1]);
        }
        ctx.stroke();
      });
      ctx.globalAlpha = 1;
    });
  }

  // Points (k, 3) of an elastic line at time t, straight between frames.
  function bent(line, motion, t) {
    const { k, xyz } = line, place = Math.max(0, Math.min(motion.count - 1, motion.step > 0 ? (t - motion.from) / motion.step : 0));
    const i = Math.min(Math.floor(place), Math.max(motion.count - 2, 0)), j = Math.min(i + 1, motion.count - 1), s = place - i;
    return Array.from({ length: k }, (_, n) => [0, 1, 2].map((c) => {
      const u = xyz[3 * (i * k + n) + c], v = xyz[3 * (j * k + n) + c];
      return u + s * (v - u);
    }));
  }

  function elasticItems(ctx, cam, scene, lines, motion, t, items) {
    const width = Math.max(2, Math.min(12, 1.1 * scene.grain * cam.scale));
    for (const line of lines) {
      const points = bent(line, motion, t).map((p) => cam.project(p));
      points.slice(1).forEach((q, n) => {
        const p = points[n];
        items.push([(p[2] + q[2]) / 2, () => {
          ctx.strokeStyle = "#3f8c96";
          ctx.lineWidth = width;
          ctx.lineCap = "round";
          ctx.beginPath();
          ctx.moveTo(p[0], p[1]);
          ctx.lineTo(q[0], q[1]);
          ctx.stroke();
          ctx.lineCap = "butt";
        }]);
      });
    }
  }

  return Object.assign(function (root, scene) {
    scene.origins = scene.bodies.map((body) => body.o);
    const m = scene.motion, n = scene.bodies.length;
    const motion = { ...m, n, p: viewer.decode(m.p), q: viewer.decode(m.q), speed: viewer.decode(m.speed) };
    const lines = (scene.elastic || []).map(([, k, xyz]) => ({ k, xyz: viewer.decode(xyz) }));
    const end = m.from + m.step * (m.count - 1);
    let time = m.from, playing = m.step > 0;

    root.classList.add("mbrs-viewer");
    const stage = viewer.makeStage(root, scene, "animated motion"), { bar, title, canvas } = stage;
    const play = viewer.make(bar, "button", { type: "button", textContent: playing ? "Pause" : "Play" });
    const scrub = viewer.slider(bar, "time", m.from, end, m.from);
    scrub.step = "any";
    scrub.classList.add("mbrs-scrub");
    const speed = viewer.slider(bar, "speed", -3, 1, 0);
    const pace = viewer.make(bar, "span", { className: "mbrs-pace" });
    const paths = scene.paths.length ? viewer.checkbox(bar, "paths", true) : { checked: false };
    const ghost = viewer.checkbox(bar, "start", false), names = viewer.checkbox(bar, "names", false);
    const clear = viewer.checkbox(bar, "see through", false);
    stage.addReset();
    const start = at(motion, m.from), factor = () => scene.pace * 10 ** Number(speed.value);

    function show() {
      title.textContent = `${scene.title}   t = ${time.toFixed(scene.decimals)} s`;
      const text = factor();
      pace.textContent = `${Number(text.toPrecision(2))} x`;
    }
    function go(t) {
      time = Math.max(m.from, Math.min(end, t));
      scrub.value = time;
      stage.dirty = true;
    }
    play.onclick = () => {
      playing = !playing && m.step > 0;
      if (playing && time >= end) go(m.from);
      play.textContent = playing ? "Pause" : "Play";
    };
    scrub.addEventListener("input", () => go(Number(scrub.value)));
    [speed, ghost, names, clear, paths].forEach((input) => input.addEventListener?.("input", () => { stage.dirty = true; }));
    canvas.onkeydown = (e) => {
      const action = { ArrowLeft: () => go(time - m.step), ArrowRight: () => go(time + m.step), " ": () => play.click(),
        Home: () => go(m.from), End: () => go(end) }[e.key];
      if (action) {
        e.preventDefault();
        action();
      }
    };
    if (scene.at !== null) {
      go(scene.at);
      play.click();
    }
    const home = [...scene.centre];
    // the view travels with a body, over a floor that stays
    function track(state) {
      if (scene.follow >= 0) scene.centre = home.map((c, k) => c + state[12 * scene.follow + k] - start[12 * scene.follow + k]);
      return state;
    }
    viewer.animate(stage, () => playing, (elapsed) => {
      if (elapsed > 0) {
        // from the end it begins again
        go(time + elapsed * factor() > end && time < end ? end : time >= end ? m.from : time + elapsed * factor());
      }
      show();
      viewer.paint(stage, scene, track(at(motion, time)), ghost.checked ? start : null, {
        clear: clear.checked, names: names.checked, tint: glow(motion, time),
        more: (ctx, cam, items) => elasticItems(ctx, cam, scene, lines, motion, time, items),
        behind: paths.checked ? (ctx, cam) => drawPaths(ctx, cam, scene, motion, time) : null,
      });
    });
  }, { at, bent, matrix });
})(typeof mbrsViewer === "undefined" ? require("./viewer.js") : mbrsViewer);
if (typeof module !== "undefined") module.exports = mbrsMotion;
