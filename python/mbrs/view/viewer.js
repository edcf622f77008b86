"use strict";
// Draws a multibody scene on a plain 2-D canvas: mbrsViewer(element, scene). The scene is made by mbrs/animate/viewer.py.
// World: right-handed, z up. Screen: x right, y down, depth grows towards the viewer.
const mbrsViewer = (() => {
  const KIND = { spring: 0, bushing: 1, torsion: 2 };
  const AXIS_COLOURS = ["#c0392b", "#27865a", "#2a5db0"];

  // Rotation matrix (row-major, 9) of a rotation vector: exact, so that bodies keep their shape at any amplitude.
  function rotation(x, y, z) {
    const angle = Math.hypot(x, y, z);
    const s = angle < 1e-9 ? 1 : Math.sin(angle) / angle;
    const c = angle < 1e-9 ? 0.5 : (1 - Math.cos(angle)) / (angle * angle);
    return [
      1 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y,
      c * x * y + s * z, 1 - c * (x * x + z * z), c * y * z - s * x,
      c * x * z - s * y, c * y * z + s * x, 1 - c * (x * x + y * y)];
  }

  // Displacement of every body at one instant: Re(phi exp(i phase)) times the amplitude; 12 numbers a body (u, R).
  function pose(shape, nBodies, phase, amplitude) {
    const cos = Math.cos(phase) * amplitude, sin = Math.sin(phase) * amplitude;
    const out = new Float64Array(12 * nBodies);
    for (let b = 0; b < nBodies; b++) {
      const at = (i) => shape[12 * b + 2 * i] * cos - shape[12 * b + 2 * i + 1] * sin;
      out.set([at(0), at(1), at(2)], 12 * b);
      out.set(rotation(at(3), at(4), at(5)), 12 * b + 3);
    }
    return out;
  }

  // A world point that moves with body b (-1: ground, stays).
  function moved(p, b, state, origins) {
    if (b < 0) return p;
    const o = origins[b], k = 12 * b, x = p[0] - o[0], y = p[1] - o[1], z = p[2] - o[2];
    return [0, 1, 2].map((i) =>
      o[i] + state[k + i] + state[k + 3 + 3 * i] * x + state[k + 4 + 3 * i] * y + state[k + 5 + 3 * i] * z);
  }

  function decode(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  }

  // Pixels per metre at which the box around the scene fills the canvas as first looked at, with room for the motion.
  function fit(scene, width, height) {
    const [az, el] = scene.view, ca = Math.cos(az), sa = Math.sin(az), ce = Math.cos(el), se = Math.sin(el);
    const [hx, hy, hz] = scene.half.map((h) => h + scene.reach);
    const across = Math.abs(sa) * hx + Math.abs(ca) * hy, up = Math.abs(se * ca) * hx + Math.abs(se * sa) * hy + ce * hz;
    return Math.min(0.44 * width / across, 0.4 * height / up);
  }

  function camera(view, width, height, scene) {
    const ca = Math.cos(view.az), sa = Math.sin(view.az), ce = Math.cos(view.el), se = Math.sin(view.el);
    const far = 5 * scene.size, [cx, cy, cz] = scene.centre;
    const scale = view.zoom * fit(scene, width, height);
    return {
      scale,
      project(p) {
        const x = p[0] - cx, y = p[1] - cy, z = p[2] - cz;
        const depth = ce * ca * x + ce * sa * y + se * z;
        const k = scale * far / Math.max(far - depth, 0.05 * far);
        return [width / 2 + view.pan[0] + k * (-sa * x + ca * y),
          height / 2 + view.pan[1] - k * (-se * ca * x - se * sa * y + ce * z), depth];
      },
    };
  }

  // Slate for what stands still, through teal to orange for what moves most; light from the upper left.
  const RAMP = [[112, 133, 158], [72, 149, 166], [88, 173, 137], [214, 183, 86], [222, 116, 60]];
  const colours = new Map();
  function colour(level, light) {
    const key = Math.round(Math.min(level, 1) * 31) * 16 + Math.round(light * 15);
    if (!colours.has(key)) {
      const t = Math.floor(key / 16) / 31 * (RAMP.length - 1), i = Math.min(Math.floor(t), RAMP.length - 2);
      const shade = 0.62 + 0.5 * (key % 16) / 15;
      const rgb = RAMP[i].map((c, j) => Math.min(255, Math.round((c + (RAMP[i + 1][j] - c) * (t - i)) * shade)));
      colours.set(key, [`rgb(${rgb})`, `rgb(${rgb.map((c) => Math.round(c * 0.66))})`]);
    }
    return colours.get(key);
  }

  function zigzag(ctx, a, b, width, teeth) {
    const dx = b[0] - a[0], dy = b[1] - a[1], length = Math.hypot(dx, dy) || 1;
    const nx = -dy / length * width, ny = dx / length * width;
    ctx.beginPath();
    ctx.moveTo(a[0], a[1]);
    ctx.lineTo(a[0] + 0.15 * dx, a[1] + 0.15 * dy);
    for (let i = 0; i < teeth; i++) {
      const t = 0.15 + 0.7 * (i + 0.5) / teeth, side = i % 2 ? -1 : 1;
      ctx.lineTo(a[0] + t * dx + side * nx, a[1] + t * dy + side * ny);
    }
    ctx.lineTo(a[0] + 0.85 * dx, a[1] + 0.85 * dy);
    ctx.lineTo(b[0], b[1]);
    ctx.stroke();
  }

  function drawGrid(ctx, cam, scene) {
    const { size, floor } = scene, power = 10 ** Math.floor(Math.log10(size / 8));
    const step = power * [1, 2, 5, 10].find((k) => k * power >= size / 8), n = Math.ceil(0.75 * size / step);
    const x0 = Math.round(scene.centre[0] / step) * step, y0 = Math.round(scene.centre[1] / step) * step;
    ctx.strokeStyle = "#dde3ea";
    ctx.lineWidth = 1;
    ctx.beginPath();
    for (let i = -n; i <= n; i++) {
      for (const [p, q] of [[[x0 + i * step, y0 - n * step, floor], [x0 + i * step, y0 + n * step, floor]],
        [[x0 - n * step, y0 + i * step, floor], [x0 + n * step, y0 + i * step, floor]]]) {
        const a = cam.project(p), b = cam.project(q);
        ctx.moveTo(a[0], a[1]);
        ctx.lineTo(b[0], b[1]);
      }
    }
    ctx.stroke();
    return step;
  }

  function drawTriad(ctx, view, height) {
    const ca = Math.cos(view.az), sa = Math.sin(view.az), ce = Math.cos(view.el), se = Math.sin(view.el);
    const axes = [[-sa, -se * ca, ce * ca], [ca, -se * sa, ce * sa], [0, ce, se]];
    ctx.font = "12px system-ui, sans-serif";
    ctx.textAlign = "center";
    ctx.textBaseline = "middle";
    [0, 1, 2].sort((i, j) => axes[i][2] - axes[j][2]).forEach((i) => {
      const [x, y] = axes[i];
      ctx.strokeStyle = ctx.fillStyle = AXIS_COLOURS[i];
      ctx.lineWidth = 2;
      ctx.beginPath();
      ctx.moveTo(44, height - 44);
      ctx.lineTo(44 + 26 * x, height - 44 - 26 * y);
      ctx.stroke();
      ctx.fillText("xyz"[i], 44 + 35 * x, height - 44 - 35 * y);
    });
  }

  // Faces of all bodies that look towards the viewer, as [depth, painter]; bodies are convex, so the others are hidden.
  // ``tint``: how much each body glows, 0 to 1; without it, how far it is from its place.
  function bodyItems(ctx, scene, state, cam, items, outline, alpha, tint) {
    const light = [-0.4, 0.5, 0.77], byBody = scene.bodies.length > 800;
    scene.bodies.forEach((body, b) => {
      const o = scene.origins[b], k = 12 * b, n = body.v.length / 3, screen = [], level = [];
      for (let i = 0; i < n; i++) {
        const x = body.v[3 * i], y = body.v[3 * i + 1], z = body.v[3 * i + 2], p = [0, 0, 0];
        let travel = 0;
        for (let j = 0; j < 3; j++) {
          const d = state[k + j] + state[k + 3 + 3 * j] * x + state[k + 4 + 3 * j] * y + state[k + 5 + 3 * j] * z;
          p[j] = o[j] + d;
          travel += (d - body.v[3 * i + j]) ** 2;
        }
        screen.push(cam.project(p));
        level.push(tint ? tint[b] : Math.sqrt(travel) / scene.reach);
      }
      const whole = screen.reduce((sum, p) => sum + p[2], 0) / n;
      for (const face of scene.faces[body.f]) {
        // Newell's sum over the loop: right also where three neighbours lie on a line
        let nx = 0, ny = 0, nz = 0;
        face.forEach((i, j) => {
          const p = screen[i], q = screen[face[(j + 1) % face.length]];
          nx -= (p[1] - q[1]) * (p[2] + q[2]) * cam.scale;
          ny += (p[2] - q[2]) * (p[0] + q[0]) * cam.scale;
          nz -= (p[0] - q[0]) * (p[1] + q[1]);
        });
        if (nz <= 0 && !outline) continue;
        const norm = Math.hypot(nx, ny, nz) || 1;
        const shade = Math.max(0, (nx * light[0] + ny * light[1] + nz * light[2]) / norm);
        const depth = byBody ? whole : face.reduce((sum, i) => sum + screen[i][2], 0) / face.length;
        items.push([depth, () => {
          ctx.beginPath();
          face.forEach((i, j) => (j ? ctx.lineTo(screen[i][0], screen[i][1]) : ctx.moveTo(screen[i][0], screen[i][1])));
          ctx.closePath();
          if (outline) {
            ctx.strokeStyle = "rgba(90,105,125,0.28)";
            ctx.lineWidth = 0.8;
          } else {
            const [fill, edge] = colour(face.reduce((sum, i) => sum + level[i], 0) / face.length, shade);
            ctx.fillStyle = fill;
            ctx.strokeStyle = edge;
            ctx.lineWidth = 0.7;
            ctx.globalAlpha = alpha;
            ctx.fill();
            ctx.globalAlpha = 1;
          }
          ctx.stroke();
        }]);
      }
    });
  }

  function linkItems(ctx, scene, state, cam, items) {
    for (const [kind, a, b, ...xyz] of scene.links) {
      const p = cam.project(moved(xyz.slice(0, 3), a, state, scene.origins));
      const q = cam.project(moved(xyz.slice(3, 6), b, state, scene.origins));
      const width = Math.max(1, Math.min(7, 1.3 * scene.grain * cam.scale)), length = Math.hypot(q[0] - p[0], q[1] - p[1]);
      items.push([(p[2] + q[2]) / 2, () => {
        ctx.strokeStyle = "#3b4757";
        ctx.lineWidth = 1.3;
        if (kind !== KIND.torsion && length > 4) zigzag(ctx, p, q, width, Math.max(5, Math.min(14, Math.round(length / 9))));
        if (kind !== KIND.spring) ctx.strokeRect((p[0] + q[0]) / 2 - width, (p[1] + q[1]) / 2 - width, 2 * width, 2 * width);
        ctx.fillStyle = "#7b8794";
        if (a < 0) ctx.fillRect(p[0] - 3.5, p[1] - 3.5, 7, 7);
        if (b < 0) ctx.fillRect(q[0] - 3.5, q[1] - 3.5, 7, 7);
      }]);
    }
  }

  function jointItems(ctx, scene, state, cam, items) {
    for (const [, a, b, at, axis] of scene.joints) {
      const ends = [a, b].filter((i) => i >= 0).map((i) => moved(at, i, state, scene.origins));
      const p = at.map((_, i) => ends.reduce((sum, e) => sum + e[i], 0) / (ends.length || 1));
      const c = cam.project(ends.length ? p : at), r = Math.min(5, 1.4 * scene.grain * cam.scale);
      if (r < 0.8) continue;
      items.push([c[2] + 3 * scene.grain, () => {
        if (axis) {
          const h = 4 * scene.grain, u = cam.project(p.map((x, i) => x - h * axis[i])), v = cam.project(p.map((x, i) => x + h * axis[i]));
          ctx.strokeStyle = "#8e2b20";
          ctx.lineWidth = 1.4;
          ctx.beginPath();
          ctx.moveTo(u[0], u[1]);
          ctx.lineTo(v[0], v[1]);
          ctx.stroke();
        }
        ctx.fillStyle = a < 0 || b < 0 ? "#f4f6f8" : "#c0392b";
        ctx.strokeStyle = "#8e2b20";
        ctx.lineWidth = 1.3;
        ctx.beginPath();
        ctx.arc(c[0], c[1], r, 0, 2 * Math.PI);
        ctx.fill();
        ctx.stroke();
      }]);
    }
  }

  function drawLabels(ctx, scene, state, cam) {
    ctx.font = "11px system-ui, sans-serif";
    ctx.textAlign = "left";
    ctx.textBaseline = "middle";
    scene.bodies.forEach((body, b) => {
      const p = cam.project(moved(scene.origins[b], b, state, scene.origins));
      ctx.lineWidth = 3;
      ctx.strokeStyle = "rgba(255,255,255,0.85)";
      ctx.strokeText(body.n, p[0] + 7, p[1]);
      ctx.fillStyle = "#1d2733";
      ctx.fillText(body.n, p[0] + 7, p[1]);
    });
  }

  function make(parent, tag, properties, children) {
    const node = Object.assign(document.createElement(tag), properties);
    (children || []).forEach((child) => node.append(child));
    parent.append(node);
    return node;
  }

  function slider(parent, label, min, max, value) {
    const box = make(parent, "label", {}, [label]);
    return make(box, "input", { type: "range", min, max, step: 0.01, value, ariaLabel: label });
  }

  function checkbox(parent, label, checked) {
    const box = make(parent, "label", {});
    const input = make(box, "input", { type: "checkbox", checked });
    box.append(label);
    return input;
  }

  // The part that modes and motions share: a canvas to turn, shift and zoom, and the bar of controls below it.
  function makeStage(root, scene, label) {
    const home = () => ({ az: scene.view[0], el: scene.view[1], zoom: 1, pan: [0, 0] });
    const box = make(root, "div", { className: "mbrs-stage" });
    const canvas = make(box, "canvas", { tabIndex: 0 });
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", label);
    const title = make(box, "div", { className: "mbrs-title" });
    const bar = make(box, "div", { className: "mbrs-bar" });
    const stage = { canvas, title, bar, view: home(), dirty: true };
    stage.addReset = () => {
      make(bar, "button", { type: "button", textContent: "Reset view" }).onclick = () => {
        stage.view = home();
        stage.dirty = true;
      };
    };
    interact(stage);
    return stage;
  }

  function interact(stage) {
    const { canvas } = stage, pointers = new Map();
    canvas.onpointerdown = (e) => {
      canvas.setPointerCapture(e.pointerId);
      pointers.set(e.pointerId, [e.clientX, e.clientY]);
    };
    canvas.onpointerup = canvas.onpointercancel = (e) => pointers.delete(e.pointerId);
    canvas.onpointermove = (e) => {
      const from = pointers.get(e.pointerId), { view } = stage;
      if (!from) return;
      const dx = e.clientX - from[0], dy = e.clientY - from[1];
      pointers.set(e.pointerId, [e.clientX, e.clientY]);
      if (pointers.size > 1 || e.shiftKey || e.buttons === 2 || e.buttons === 4) {
        view.pan = [view.pan[0] + dx / pointers.size, view.pan[1] + dy / pointers.size];
      } else {
        view.az -= 0.008 * dx;
        view.el = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, view.el + 0.008 * dy));
      }
      stage.dirty = true;
    };
    canvas.oncontextmenu = (e) => e.preventDefault();
    canvas.addEventListener("wheel", (e) => {
      e.preventDefault();
      stage.view.zoom = Math.max(0.05, Math.min(200, stage.view.zoom * Math.exp(-0.0015 * e.deltaY)));
      stage.dirty = true;
    }, { passive: false });
    new ResizeObserver(() => { stage.dirty = true; }).observe(canvas);
  }

  // Draws one instant: ``state`` of the bodies, outlines at ``ghost`` if given, ``behind`` and ``options`` as the caller likes.
  function paint(stage, scene, state, ghost, options) {
    const { canvas, view } = stage, ctx = canvas.getContext("2d");
    const width = canvas.clientWidth, height = canvas.clientHeight, ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, width, height);
    ctx.lineJoin = "round";
    const cam = camera(view, width, height, scene), step = drawGrid(ctx, cam, scene), items = [];
    if (options.behind) options.behind(ctx, cam);
    if (ghost) bodyItems(ctx, scene, ghost, cam, items, true, 1);
    items.splice(0).forEach((item) => item[1]());
    bodyItems(ctx, scene, state, cam, items, false, options.clear ? 0.45 : 1, options.tint);
    linkItems(ctx, scene, state, cam, items);
    jointItems(ctx, scene, state, cam, items);
    if (options.more) options.more(ctx, cam, items);
    items.sort((p, q) => p[0] - q[0]).forEach((item) => item[1]());
    if (options.names) drawLabels(ctx, scene, state, cam);
    drawTriad(ctx, view, height);
    ctx.fillStyle = "#66727f";
    ctx.textAlign = "right";
    ctx.fillText(`grid ${Number(step.toPrecision(3))} m`, width - 12, height - 16);
  }

  // Calls draw(seconds since the last call) as often as the screen shows a picture, while there is something new.
  function animate(stage, playing, draw) {
    let last = null;
    function tick(now) {
      const elapsed = last === null ? 0 : Math.min((now - last) / 1000, 0.1);
      last = now;
      if ((playing() || stage.dirty) && stage.canvas.clientWidth > 0) {
        stage.dirty = false;
        draw(playing() ? elapsed : 0);
      }
      requestAnimationFrame(tick);
    }
    requestAnimationFrame(tick);
  }

  return Object.assign(function (root, scene) {
    scene.origins = scene.bodies.map((body) => body.o);
    const shapes = scene.modes.map((mode) => decode(mode.shape)), n = scene.bodies.length;
    let current = scene.start, phase = 0, playing = true;

    root.classList.add("mbrs-viewer");
    const list = make(root, "div", { className: "mbrs-modes" });
    const stage = makeStage(root, scene, "animated mode shape"), { bar, title, canvas } = stage;
    const play = make(bar, "button", { type: "button", textContent: "Pause" });
    const amplitude = slider(bar, "amplitude", 0, 3, 1), speed = slider(bar, "speed", 0.05, 2, 0.5);
    const ghost = checkbox(bar, "rest position", n <= 200), names = checkbox(bar, "names", false);
    const clear = checkbox(bar, "see through", false);
    stage.addReset();

    const table = make(list, "table", {});
    const head = make(make(table, "thead", {}), "tr", {});
    ["mode", "f [Hz]", "zeta"].forEach((text) => make(head, "th", { textContent: text }));
    const body = make(table, "tbody", {});
    const rows = scene.modes.map((mode, i) => {
      const row = make(body, "tr", { onclick: () => select(i), title: mode.kind });
      [mode.label, mode.f, mode.zeta].forEach((text) => make(row, "td", { textContent: text }));
      return row;
    });

    function select(i) {
      current = Math.max(0, Math.min(scene.modes.length - 1, i));
      rows.forEach((row, j) => row.classList.toggle("mbrs-chosen", j === current));
      const mode = scene.modes[current];
      title.textContent = `mode ${mode.label}:  ${mode.f} Hz,  zeta ${mode.zeta}  (${mode.kind})`;
      // scrollIntoView would move the page that holds the viewer as well
      const row = rows[current], top = row.offsetTop - 40;
      if (top < list.scrollTop || top > list.scrollTop + list.clientHeight - 80) list.scrollTop = top;
      stage.dirty = true;
    }

    canvas.onkeydown = (e) => {
      const action = { ArrowUp: () => select(current - 1), ArrowDown: () => select(current + 1), " ": () => play.click() }[e.key];
      if (action) {
        e.preventDefault();
        action();
      }
    };
    play.onclick = () => {
      playing = !playing;
      play.textContent = playing ? "Pause" : "Play";
    };
    [amplitude, speed, ghost, names, clear].forEach((input) => input.addEventListener("input", () => { stage.dirty = true; }));
    if (scene.phase !== null) {
      phase = scene.phase;
      play.click();
    }
    select(current);
    animate(stage, () => playing, (elapsed) => {
      phase = (phase + 2 * Math.PI * Number(speed.value) * elapsed) % (2 * Math.PI);
      const state = pose(shapes[current], n, phase, Number(amplitude.value));
      const rest = ghost.checked ? pose(shapes[current], n, 0, 0) : null;
      paint(stage, scene, state, rest, { clear: clear.checked, names: names.checked });
    });
  }, { pose, rotation, moved, decode, make, slider, checkbox, makeStage, paint, animate });
})();
if (typeof module !== "undefined") module.exports = mbrsViewer;
