"use strict";
// Draws a multibody scene on a plain 2-D canvas: mbrsViewer(element, scene). The scene is made by view/drawing.py.
// World: right-handed, z up. Screen: x right, y down, depth grows towards the viewer.
const mbrsViewer = (() => {
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

  // Slate for what stands still, through teal to orange for what moves most; light from the upper left. A body with a colour of
  // its own goes from that to orange.
  const RAMP = [[112, 133, 158], [72, 149, 166], [88, 173, 137], [214, 183, 86], [222, 116, 60]];
  const colours = new Map();
  function colour(level, light, own) {
    const key = (own || "") + (Math.round(Math.min(level, 1) * 31) * 16 + Math.round(light * 15));
    if (!colours.has(key)) {
      const number = Number(own ? key.slice(own.length) : key);
      const ramp = own ? [[1, 3, 5].map((i) => parseInt(own.slice(i, i + 2), 16)), RAMP[4]] : RAMP;
      const t = Math.floor(number / 16) / 31 * (ramp.length - 1), i = Math.min(Math.floor(t), ramp.length - 2);
      const shade = 0.62 + 0.5 * (number % 16) / 15;
      const rgb = ramp[i].map((c, j) => Math.min(255, Math.round((c + (ramp[i + 1][j] - c) * (t - i)) * shade)));
      colours.set(key, [`rgb(${rgb})`, `rgb(${rgb.map((c) => Math.round(c * 0.66))})`]);
    }
    return colours.get(key);
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

  // What is painted: {depth, draw, label, area or line}, area and line being screen points under which a pointer finds it.
  const ROUND = 30;
  const LIGHT = [-0.4, 0.5, 0.77];
  const STYLE = {
    joint: { fill: "#c0392b", ground: "#f4f6f8", edge: "#8e2b20" },
    spring: { fill: "#9aa5b1", ground: "#9aa5b1", edge: "#3b4757" },
    load: { fill: "#7d3c98", ground: "#7d3c98", edge: "#6c2e86" },
  };

  // Faces of a solid with vertices on the screen; those that look away are hidden. ``style(face, shade)``: [fill, edge].
  function faceItems(ctx, screen, faces, cam, items, { style, alpha, outline, depth, label, lift }) {
    for (const face of faces) {
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
      const shade = Math.max(0, (nx * LIGHT[0] + ny * LIGHT[1] + nz * LIGHT[2]) / norm);
      const area = face.map((i) => screen[i]);
      items.push({ label, area, depth: (lift || 0) + (depth ?? area.reduce((sum, p) => sum + p[2], 0) / area.length), draw: () => {
        ctx.beginPath();
        area.forEach((p, j) => (j ? ctx.lineTo(p[0], p[1]) : ctx.moveTo(p[0], p[1])));
        ctx.closePath();
        if (outline) {
          ctx.strokeStyle = "rgba(90,105,125,0.28)";
          ctx.lineWidth = 0.8;
        } else {
          const [fill, edge] = style(face, shade);
          ctx.fillStyle = fill;
          ctx.strokeStyle = edge;
          ctx.lineWidth = 0.7;
          ctx.globalAlpha = alpha;
          ctx.fill();
          ctx.globalAlpha = 1;
        }
        ctx.stroke();
      } });
    }
  }

  function lineItem(ctx, line, items, { colour: ink, width, label, lift }) {
    items.push({ label, line, depth: line.reduce((sum, p) => sum + p[2], 0) / line.length + (lift || 0), draw: () => {
      ctx.strokeStyle = ink;
      ctx.lineWidth = width;
      ctx.beginPath();
      line.forEach((p, j) => (j ? ctx.lineTo(p[0], p[1]) : ctx.moveTo(p[0], p[1])));
      ctx.stroke();
    } });
  }

  // ``tint``: how much each body glows, 0 to 1; without it, how far it is from its place.
  function bodyItems(ctx, scene, state, cam, items, outline, alpha, tint) {
    const byBody = scene.bodies.length > 800;
    for (const solid of scene.solids) {
      const o = scene.origins[solid.b], k = 12 * solid.b, n = solid.v.length / 3, screen = [], level = [];
      for (let i = 0; i < n; i++) {
        const x = solid.v[3 * i], y = solid.v[3 * i + 1], z = solid.v[3 * i + 2], p = [0, 0, 0];
        let travel = 0;
        for (let j = 0; j < 3; j++) {
          const d = state[k + j] + state[k + 3 + 3 * j] * x + state[k + 4 + 3 * j] * y + state[k + 5 + 3 * j] * z;
          p[j] = o[j] + d;
          travel += (d - solid.v[3 * i + j]) ** 2;
        }
        screen.push(cam.project(p));
        level.push(tint ? tint[solid.b] : Math.sqrt(travel) / scene.reach);
      }
      faceItems(ctx, screen, scene.faces[solid.f], cam, items, {
        alpha, outline, label: scene.bodies[solid.b].n,
        depth: byBody ? screen.reduce((sum, p) => sum + p[2], 0) / n : undefined,
        style: (face, shade) => {
          const [fill, edge] = colour(face.reduce((sum, i) => sum + level[i], 0) / face.length, shade, solid.c);
          return [fill, n > ROUND ? fill : edge];  // edges of round things are none
        },
      });
    }
  }

  // Lines of flexible bodies: ``points(i)`` are those of the i-th now, world.
  function elasticItems(ctx, scene, cam, items, points) {
    const width = Math.max(2, Math.min(12, 1.1 * scene.grain * cam.scale));
    scene.flexible.forEach((label, i) => {
      const line = points(i).map((p) => cam.project(p));
      const style = label.startsWith("wake ") ? { colour: "#9aa0b8", width: 1, label } : { colour: "#3f8c96", width, label };
      line.slice(1).forEach((q, k) => lineItem(ctx, [line[k], q], items, style));
    });
  }

  // Springs, dampers, gaps and rods: the symbols of scene.glyphs between two points, beside each other where there are several.
  function linkItems(ctx, scene, state, cam, items, shown) {
    for (const link of scene.links) {
      if (!shown[link.g]) continue;
      const p = cam.project(moved(link.p, link.a, state, scene.origins)), q = cam.project(moved(link.q, link.b, state, scene.origins));
      const width = Math.max(1.5, Math.min(7, 1.3 * scene.grain * cam.scale));
      const dx = q[0] - p[0], dy = q[1] - p[1], length = Math.hypot(dx, dy), depth = (p[2] + q[2]) / 2;
      const parts = link.k.filter((part) => part !== "bushing"), apart = parts.length > 1;
      const style = { colour: link.g === "joint" ? STYLE.joint.edge : STYLE.spring.edge, width: 1.3, label: link.n };
      if (length > 4) {
        const nx = -dy / length * width, ny = dx / length * width;
        const to = (t, s) => [p[0] + t * dx + s * nx, p[1] + t * dy + s * ny, depth];
        parts.forEach((part, i) => {
          const shift = apart ? 2.6 * (i - (parts.length - 1) / 2) : 0;
          for (const line of scene.glyphs[part]) {
            const points = line.map(([t, s]) => (apart ? to(0.1 + 0.8 * t, s + shift) : to(t, s)));
            lineItem(ctx, points, items, { ...style, width: part === "rod" ? 2.6 : 1.3 });
          }
        });
        if (apart) {
          const half = 1.3 * (parts.length - 1);
          for (const line of [[to(0, 0), to(0.1, 0)], [to(0.9, 0), to(1, 0)], [to(0.1, -half), to(0.1, half)], [to(0.9, -half), to(0.9, half)]]) {
            lineItem(ctx, line, items, style);
          }
        }
        items.push({ label: link.n, line: [p, q], depth, draw: () => {} });
      }
      if (link.k.includes("bushing")) {
        const c = [(p[0] + q[0]) / 2, (p[1] + q[1]) / 2], w = 1.4 * width;
        const area = [[-w, -w], [w, -w], [w, w], [-w, w]].map(([x, y]) => [c[0] + x, c[1] + y, depth]);
        items.push({ label: link.n, area, depth: depth + 3 * scene.grain, draw: () => {
          ctx.fillStyle = "rgba(235,239,243,0.85)";
          ctx.strokeStyle = STYLE.spring.edge;
          ctx.lineWidth = 1.3;
          ctx.beginPath();
          [0, 1, 2, 3, 0, 2].forEach((i) => (i ? ctx.lineTo(area[i][0], area[i][1]) : ctx.moveTo(area[0][0], area[0][1])));
          ctx.fill();
          ctx.moveTo(area[1][0], area[1][1]);
          ctx.lineTo(area[3][0], area[3][1]);
          ctx.stroke();
        } });
      }
    }
  }

  // Symbols of joints, ground, torsion springs and loads: they move with a body and, but for loads fixed in the world, turn with it.
  function markItems(ctx, scene, state, cam, items, shown) {
    for (const mark of scene.marks) {
      if (!shown[mark.g]) continue;
      const o = moved(mark.o, mark.b, state, scene.origins), k = 12 * mark.b + 3, turns = mark.b >= 0 && !mark.w;
      const to = (flat, i) => {
        const [x, y, z] = [flat[3 * i], flat[3 * i + 1], flat[3 * i + 2]];
        return cam.project(turns ? [0, 1, 2].map((j) => o[j] + state[k + 3 * j] * x + state[k + 1 + 3 * j] * y + state[k + 2 + 3 * j] * z)
          : [o[0] + x, o[1] + y, o[2] + z]);
      };
      const all = (flat) => Array.from({ length: flat.length / 3 }, (_, i) => to(flat, i));
      const { fill, ground, edge } = STYLE[mark.g], base = mark.i ? fill : ground;
      // joints lie within bodies; a load is to be seen in front of everything
      const lift = mark.g === "load" ? scene.size : 3 * scene.grain;
      for (const [flat, f] of mark.s) {
        faceItems(ctx, all(flat), scene.faces[f], cam, items, {
          alpha: 1, label: mark.n, lift, style: (_, shade) => [colour(0, shade, base)[0], edge],
        });
      }
      for (const flat of mark.l) {
        const line = all(flat);
        line.slice(1).forEach((q, i) => lineItem(ctx, [line[i], q], items, {
          colour: edge, width: mark.g === "load" ? 2.4 : 1.3, label: mark.n, lift,
        }));
      }
    }
  }

  function inside(p, area) {
    let found = false;
    area.forEach((a, i) => {
      const b = area[(i + 1) % area.length];
      if ((a[1] > p[1]) !== (b[1] > p[1]) && p[0] < a[0] + (b[0] - a[0]) * (p[1] - a[1]) / (b[1] - a[1])) found = !found;
    });
    return found;
  }

  function near(p, line, reach) {
    return line.slice(1).some((b, i) => {
      const a = line[i], dx = b[0] - a[0], dy = b[1] - a[1], square = dx * dx + dy * dy;
      const t = square > 0 ? Math.max(0, Math.min(1, ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / square)) : 0;
      return Math.hypot(p[0] - a[0] - t * dx, p[1] - a[1] - t * dy) <= reach;
    });
  }

  // What is seen at a point of the canvas: a line within 5 pixels before the face behind it, else the frontmost; or null.
  function seen(items, p) {
    let face = null;
    for (let i = items.length - 1; i >= 0; i--) {
      const item = items[i];
      if (!item.label) continue;
      if (item.line && near(p, item.line, 5)) return item.label;
      if (item.area && inside(p, item.area)) {
        face = item.label;
        break;
      }
    }
    return face;
  }

  function drawLabels(ctx, scene, state, cam, shown) {
    ctx.font = "11px system-ui, sans-serif";
    ctx.textAlign = "left";
    ctx.textBaseline = "middle";
    const used = [];
    const write = (text, p, ink) => {
      const box = [p[0] + 7, p[1] - 7, p[0] + 7 + ctx.measureText(text).width, p[1] + 7];
      for (let tries = 0; tries < 6 && used.some((b) => b[0] < box[2] && box[0] < b[2] && b[1] < box[3] && box[1] < b[3]); tries++) {
        box[1] += 13;
        box[3] += 13;
      }
      used.push(box);
      ctx.lineWidth = 3;
      ctx.strokeStyle = "rgba(255,255,255,0.85)";
      ctx.strokeText(text, box[0], box[1] + 7);
      ctx.fillStyle = ink;
      ctx.fillText(text, box[0], box[1] + 7);
    };
    scene.bodies.forEach((body, b) => write(body.n, cam.project(moved(scene.origins[b], b, state, scene.origins)), "#1d2733"));
    const done = new Set();
    for (const mark of scene.marks) {
      if (!shown[mark.g] || done.has(mark.t)) continue;
      done.add(mark.t);
      write(mark.t, cam.project(moved(mark.o, mark.b, state, scene.origins)), STYLE[mark.g].edge);
    }
    for (const link of scene.links) {
      if (!shown[link.g] || done.has(link.t)) continue;
      const p = moved(link.p, link.a, state, scene.origins), q = moved(link.q, link.b, state, scene.origins);
      write(link.t, cam.project([0, 1, 2].map((i) => (p[i] + q[i]) / 2)), STYLE[link.g].edge);
    }
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

  // Everything that scenes of all kinds need before they are painted.
  function prepare(scene) {
    scene.origins = scene.bodies.map((body) => body.o);
    scene.flexible = (scene.elastic || []).map((one) => (Array.isArray(one) ? one[0] : one.n));
    scene.lines = (scene.elastic || []).map((one) => (Array.isArray(one) ? null : points(one.p)));
  }

  function points(flat) {
    return Array.from({ length: flat.length / 3 }, (_, i) => [flat[3 * i], flat[3 * i + 1], flat[3 * i + 2]]);
  }

  // Bodies at their places.
  function rest(n) {
    return pose(new Float64Array(12 * n), n, 0, 0);
  }

  // Checkboxes of what is shown; returns a function that tells their state.
  function toggles(stage, scene, names) {
    const there = (group) => [...scene.marks, ...scene.links].some((one) => one.g === group);
    const boxes = { names: checkbox(stage.bar, "names", names) };
    for (const [group, label] of [["joint", "joints"], ["spring", "springs"], ["load", "loads"]]) {
      if (there(group)) boxes[group] = checkbox(stage.bar, label, true);
    }
    boxes.clear = checkbox(stage.bar, "see through", false);
    Object.values(boxes).forEach((box) => box.addEventListener("input", () => { stage.dirty = true; }));
    return () => {
      const on = (key) => Boolean(boxes[key] && boxes[key].checked);
      return { names: on("names"), clear: on("clear"), shown: { joint: on("joint"), spring: on("spring"), load: on("load") } };
    };
  }

  // The part that modes, motions and models share: a canvas to turn, shift and zoom, and the bar of controls below it.
  function makeStage(root, scene, label) {
    const home = () => ({ az: scene.view[0], el: scene.view[1], zoom: 1, pan: [0, 0] });
    const box = make(root, "div", { className: "mbrs-stage" });
    const canvas = make(box, "canvas", { tabIndex: 0 });
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", label);
    const title = make(box, "div", { className: "mbrs-title" });
    const bar = make(box, "div", { className: "mbrs-bar" });
    const tip = make(box, "div", { className: "mbrs-tip", hidden: true });
    const stage = { canvas, title, bar, tip, view: home(), dirty: true, items: [] };
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
      if (!from) {
        point(stage, e);
        return;
      }
      stage.tip.hidden = true;
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
    canvas.onpointerleave = () => { stage.tip.hidden = true; };
    canvas.oncontextmenu = (e) => e.preventDefault();
    canvas.addEventListener("wheel", (e) => {
      e.preventDefault();
      stage.view.zoom = Math.max(0.05, Math.min(200, stage.view.zoom * Math.exp(-0.0015 * e.deltaY)));
      stage.dirty = true;
    }, { passive: false });
    new ResizeObserver(() => { stage.dirty = true; }).observe(canvas);
  }

  // The name of what lies under the pointer, beside it.
  function point(stage, e) {
    const box = stage.canvas.getBoundingClientRect(), x = e.clientX - box.left, y = e.clientY - box.top;
    const label = seen(stage.items, [x, y]);
    stage.tip.hidden = label === null;
    if (label !== null) {
      stage.tip.textContent = label;
      stage.tip.style.left = `${Math.max(0, Math.min(x + 14, box.width - 12 - stage.tip.offsetWidth))}px`;
      stage.tip.style.top = `${y + 14}px`;
    }
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
    items.splice(0).forEach((item) => item.draw());
    bodyItems(ctx, scene, state, cam, items, false, options.clear ? 0.45 : 1, options.tint);
    elasticItems(ctx, scene, cam, items, options.elastic || ((i) => scene.lines[i]));
    linkItems(ctx, scene, state, cam, items, options.shown);
    markItems(ctx, scene, state, cam, items, options.shown);
    items.sort((p, q) => p.depth - q.depth).forEach((item) => item.draw());
    stage.items = items;
    if (options.names) drawLabels(ctx, scene, state, cam, options.shown);
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
    prepare(scene);
    const shapes = scene.modes.map((mode) => decode(mode.shape)), n = scene.bodies.length;
    const bends = scene.modes.map((mode) => (mode.elastic || []).map(decode));
    let current = scene.start, phase = 0, playing = true;

    root.classList.add("mbrs-viewer");
    const list = make(root, "div", { className: "mbrs-modes" });
    const stage = makeStage(root, scene, "animated mode shape"), { bar, title, canvas } = stage;
    const play = make(bar, "button", { type: "button", textContent: "Pause" });
    const amplitude = slider(bar, "amplitude", 0, 3, 1), speed = slider(bar, "speed", 0.05, 2, 0.5);
    const ghost = checkbox(bar, "rest position", n <= 200), shown = toggles(stage, scene, false);
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
    [amplitude, speed, ghost].forEach((input) => input.addEventListener("input", () => { stage.dirty = true; }));
    if (scene.phase !== null) {
      phase = scene.phase;
      play.click();
    }
    select(current);
    animate(stage, () => playing, (elapsed) => {
      phase = (phase + 2 * Math.PI * Number(speed.value) * elapsed) % (2 * Math.PI);
      const state = pose(shapes[current], n, phase, Number(amplitude.value));
      const ground = ghost.checked ? pose(shapes[current], n, 0, 0) : null;
      const c = Math.cos(phase) * Number(amplitude.value), s = Math.sin(phase) * Number(amplitude.value), bend = bends[current];
      const elastic = (i) => scene.lines[i].map((p, k) => p.map((x, j) => x + c * bend[i][6 * k + 2 * j] - s * bend[i][6 * k + 2 * j + 1]));
      paint(stage, scene, state, ground, { ...shown(), elastic });
    });
  }, { pose, rotation, moved, rest, decode, make, slider, checkbox, toggles, prepare, makeStage, paint, animate, seen });
})();
if (typeof module !== "undefined") module.exports = mbrsViewer;
