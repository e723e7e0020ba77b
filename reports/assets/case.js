"use strict";
// The moving part of a case page: reads the runs, and moves HIP and IHIP over model and plots with one slider.
// Everything that it shows is in the page as figures too; without script those stay.
(() => {
  const MM = 1e3, MARKERS = 14, CHUNK = 8, RAYS = 60, FINE = 0.06, LENS = 0.36, ARROW = 56, SIDEWAYS = 0.35;
  const EVENTS = { contact: ["▾", "contact begins"], impact: ["✶", "impact"], release: ["▴", "contact ends"] };

  // --- data -------------------------------------------------------------------------------------------------------
  /** The numbers of `case_data.floats`, by columns. */
  function columns(text, count, Kind = Float32Array) {
    const flat = new Kind(Uint8Array.from(atob(text), (character) => character.charCodeAt(0)).buffer);
    return Array.from({ length: count }, (_, c) => Float64Array.from({ length: flat.length / count }, (_, k) => flat[k * count + c]));
  }

  const dot = (one, two) => one.reduce((sum, x, i) => sum + x * two[i], 0);
  const extent = (column) => column.reduce(([low, high], x) => [Math.min(low, x), Math.max(high, x)], [Infinity, -Infinity]);
  const size = (columns, k) => Math.hypot(...columns.map((each) => each[k]));

  /** The last sample of a run at or before a time, within a rounding; the first before it begins. */
  function sampleAt(run, time) {
    let low = 0, high = run.time.length - 1;
    const until = time + 1e-9 + 1e-9 * Math.abs(time);
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (run.time[middle] <= until) low = middle; else high = middle - 1;
    }
    return low;
  }

  /** A run at a time: hand, tool and force as columns of one, between two samples on the line unless they are one tick apart.
      In a hole, where nothing is held of it, the hand is where it was last, and there is no tool and no force. */
  function at(run, time) {
    const k = sampleAt(run, time), after = run.time[k + 1] - run.time[k];
    const far = after > 1.5 * run.dt, hole = far && run.starts.has(k + 1) && time > run.time[k] + 1.5 * run.dt;
    const share = far && !run.starts.has(k + 1) ? Math.min(Math.max((time - run.time[k]) / after, 0), 1) : 0;
    const of = (columns) => columns && columns.map((column) => [share ? column[k] + share * (column[k + 1] - column[k]) : column[k]]);
    const hip = of(run.hip), apart = of(run.apart);
    return { hip, apart: hole ? null : apart, force: hole ? null : of(run.force), ihip: apart && hip.map((column, c) => [column[0] + apart[c][0]]), touches: hole ? 0 : run.touches[k], hole };
  }

  /** A run at so many times, evenly. */
  const evenly = (run, count, shift = 0) => {
    const first = run.time[0], span = run.time[run.time.length - 1] - first;
    return Array.from({ length: count }, (_, k) => at(run, first + (span * (k + shift)) / count));
  };

  const makePath = ({ time, hip, hip_step, starts }, dimension) => ({
    time: columns(time, 1, Float64Array)[0], hip: columns(hip, dimension), hip_step: columns(hip_step, 1), starts: new Set(starts),
  });

  /** A run of the document with its channels by columns; `path` is that of its hand, which others may share. */
  function makeRun(spec, paths, dimension) {
    const of = (text, count = 1) => (text === undefined ? null : columns(text, count)), path = paths[spec.path];
    const apart = of(spec.apart, dimension), force = of(spec.force, dimension);
    const ihip = apart && path.hip.map((column, c) => column.map((value, k) => value + apart[c][k]));
    const touches = path.time.map((_, k) => (apart && apart.some((column) => column[k] !== 0) ? 1 : 0));
    return {
      ...spec, ...path, path, apart, ihip, force, step: of(spec.step), off: of(spec.off), along: of(spec.along), touches, shown: true,
      depthDecimals: decimals(MM * largest(apart)), forceDecimals: decimals(largest(force)),
    };
  }
  const largest = (channel) => (channel ? channel[0].reduce((most, _, k) => Math.max(most, size(channel, k)), 0) : 0);
  /** Decimals of numbers up to one, of which four digits count. */
  const decimals = (most) => Math.min(Math.max(3 - Math.floor(Math.log10(most || 1)), 0), 12);

  /** What a panel draws of a run, as Python's `case_figure.panel_values`. */
  function term(run, name) {
    const [channel, column] = name.replaceAll("|", "").split(".");
    const columns = run[channel], scale = channel === "force" || channel === "along" ? 1 : MM;
    if (!columns || (column && !columns[column])) return null;
    if (column) return Float64Array.from(columns[column], (value) => scale * value);
    if (!name.startsWith("|")) return Float64Array.from(columns[0], (value) => scale * value);
    return Float64Array.from(columns[0], (_, k) => scale * size(columns, k));
  }

  // --- how things are drawn -----------------------------------------------------------------------------------------
  const colours = new Map();
  const colour = (role) => {
    if (!colours.has(role)) colours.set(role, getComputedStyle(document.documentElement).getPropertyValue(`--fig-${role}`).trim() || "#888");
    return colours.get(role);
  };

  function arrow(g, x, y, toX, toY, stroke) {
    const length = Math.hypot(toX - x, toY - y), head = Math.min(8, 0.5 * length), angle = Math.atan2(toY - y, toX - x);
    if (length < 2) return;
    g.strokeStyle = g.fillStyle = stroke;
    g.lineWidth = 2;
    g.beginPath(); g.moveTo(x, y); g.lineTo(toX - 0.7 * head * Math.cos(angle), toY - 0.7 * head * Math.sin(angle)); g.stroke();
    g.beginPath(); g.moveTo(toX, toY);
    for (const side of [2.7, -2.7]) g.lineTo(toX + head * Math.cos(angle + side), toY + head * Math.sin(angle + side));
    g.fill();
  }

  function marker(g, kind, x, y, r) {
    g.beginPath();
    if (kind === "o") g.arc(x, y, r, 0, 2 * Math.PI);
    else if (kind === "s") g.rect(x - 0.9 * r, y - 0.9 * r, 1.8 * r, 1.8 * r);
    else if (kind === "D") { g.moveTo(x, y - 1.2 * r); g.lineTo(x + 1.2 * r, y); g.lineTo(x, y + 1.2 * r); g.lineTo(x - 1.2 * r, y); }
    else if (kind === "^" || kind === "v") {
      const s = kind === "^" ? 1 : -1;
      g.moveTo(x, y - 1.1 * r * s); g.lineTo(x + r, y + 0.8 * r * s); g.lineTo(x - r, y + 0.8 * r * s);
    } else {
      const turn = kind === "X" ? Math.PI / 4 : 0, w = 0.38 * r;
      const corners = [[w, -1.1 * r], [w, -w], [1.1 * r, -w], [1.1 * r, w], [w, w], [w, 1.1 * r], [-w, 1.1 * r], [-w, w], [-1.1 * r, w], [-1.1 * r, -w], [-w, -w], [-w, -1.1 * r]];
      corners.forEach(([a, b]) => g.lineTo(x + a * Math.cos(turn) - b * Math.sin(turn), y + a * Math.sin(turn) + b * Math.cos(turn)));
    }
    g.closePath();
    g.fill();
  }

  const element = (name, attributes = {}, ...children) => {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) {
      if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
      else if (value !== false && value !== null) made.setAttribute(key, value === true ? "" : value);
    }
    made.append(...children);
    return made;
  };

  // --- the model and what moves on it -------------------------------------------------------------------------------
  class Scene {
    constructor(view, box, document_) {
      this.view = view;
      this.space = document_.dimension === 3;
      this.canvas = element("canvas", { class: "live-canvas", role: "img", "aria-label": box.querySelector("svg")?.getAttribute("aria-label") ?? "model" });
      this.base = document.createElement("canvas");
      this.lens = true;
      const model = document_.model;
      this.rings = model?.rings?.map((ring) => columns(ring, 2)) ?? [];
      if (model?.vertices) this.mesh = this.meshOf(columns(model.vertices, 3), model.triangles);
      this.turn = model?.turn ?? [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
      this.home = JSON.stringify(this.turn);
      const button = (text, label, act) => element("button", { type: "button", "aria-label": /\w/.test(text) ? null : label, title: label, onclick: () => { act(); this.draw(); } }, text);
      const bar = element("div", { class: "zoom", role: "group", "aria-label": "view of the model" },
        button("+", "zoom in", () => this.zoom(1.6)), button("−", "zoom out", () => this.zoom(1 / 1.6)),
        button("hand", "close up on the hand", () => this.closeUp()), button("all", "show everything", () => { this.setFollowing(true); this.fit(); }));
      if (this.space) {
        this.followButton = button("follow", "turn the solid so that the tool stays in sight", () => this.setFollowing(!this.following));
        bar.append(this.followButton);
        this.setFollowing(true);
      }
      if (this.space) bar.append(button("←", "turn to the left", () => { this.setFollowing(false); this.rotate(-0.3, 0); }), button("→", "turn to the right", () => { this.setFollowing(false); this.rotate(0.3, 0); }), button("↑", "tilt up", () => { this.setFollowing(false); this.rotate(0, -0.3); }), button("↓", "tilt down", () => { this.setFollowing(false); this.rotate(0, 0.3); }));
      box.append(bar, this.canvas);
      this.listen();
      new ResizeObserver(() => this.resize()).observe(this.canvas);
    }

    meshOf(vertices, triangles) {
      const count = triangles.length / 3, normals = [], middles = [];
      for (let k = 0; k < count; k++) {
        const [a, b, c] = [0, 1, 2].map((corner) => vertices.map((column) => column[triangles[3 * k + corner]]));
        const u = b.map((x, i) => x - a[i]), v = c.map((x, i) => x - a[i]);
        const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        const length = Math.hypot(...n) || 1;
        normals.push(n.map((x) => x / length));
        middles.push(a.map((x, i) => (x + b[i] + c[i]) / 3));
      }
      const centre = vertices.map((column) => 0.5 * (Math.min(...extent(column)) + Math.max(...extent(column))));
      return { vertices, triangles, normals, middles, count, centre };
    }

    listen() {
      let last = null, moved = false;
      this.canvas.addEventListener("pointerdown", (event) => { last = [event.offsetX, event.offsetY]; moved = false; this.canvas.setPointerCapture(event.pointerId); });
      this.canvas.addEventListener("pointermove", (event) => {
        if (!last) return;
        const dx = event.offsetX - last[0], dy = event.offsetY - last[1];
        if (!moved && Math.hypot(dx, dy) < 3) return;
        moved = true;
        last = [event.offsetX, event.offsetY];
        if (this.space && !event.shiftKey) { this.setFollowing(false); this.rotate(0.01 * dx, 0.01 * dy); }
        else this.centre = [this.centre[0] - dx / this.scale, this.centre[1] + dy / this.scale];
        this.draw();
      });
      for (const name of ["pointerup", "pointercancel"]) this.canvas.addEventListener(name, () => { last = null; });
      this.canvas.addEventListener("wheel", (event) => {
        if (!event.ctrlKey && !event.metaKey) return;
        event.preventDefault();
        this.zoom(Math.exp(-0.004 * event.deltaY), [event.offsetX, event.offsetY]);
        this.draw();
      }, { passive: false });
      this.canvas.addEventListener("dblclick", (event) => { this.zoom(2, [event.offsetX, event.offsetY]); this.draw(); });
    }

    setFollowing(on) {
      this.following = on;
      this.followButton?.setAttribute("aria-pressed", String(on));
      if (on && this.width) this.follow();
    }

    /** Turn the solid, as little as need be, so that the side on which the tool is faces the eye; tell whether it was turned. */
    follow() {
      const run = this.view.visible().find(({ now }) => now.touches) ?? this.view.visible()[0];
      if (!this.following || !this.mesh || !run) return false;
      const { apart, ihip, hip } = run.now, tool = (ihip ?? hip).map(([x]) => x);
      const out = run.now.touches && size(apart, 0) > 0 ? apart.map(([x]) => x) : tool.map((x, i) => x - this.mesh.centre[i]);
      const length = Math.hypot(...out), eye = this.turn[2];
      if (!length) return false;
      const side = out.map((x) => x / length), cosine = dot(side, eye);
      if (cosine >= SIDEWAYS - 1e-9) return false;
      // within the plane of eye and side: the eye goes to where it sees that side under the angle of SIDEWAYS
      let across = eye.map((x, i) => x - cosine * side[i]);
      if (Math.hypot(...across) < 1e-6) across = this.turn[0];
      across = across.map((x) => x / Math.hypot(...across));
      this.look(side.map((x, i) => SIDEWAYS * x + Math.sqrt(1 - SIDEWAYS ** 2) * across[i]));
      return true;
    }

    /** Look from a direction, upright: what is to the right lies level, but for a look from straight above. */
    look(eye) {
      let right = [-eye[1], eye[0], 0];
      if (Math.hypot(...right) < 0.05) right = this.turn[0].map((x, i) => x - dot(this.turn[0], eye) * eye[i]);
      right = right.map((x) => x / Math.hypot(...right));
      this.turn = [right, [eye[1] * right[2] - eye[2] * right[1], eye[2] * right[0] - eye[0] * right[2], eye[0] * right[1] - eye[1] * right[0]], eye];
    }

    rotate(yaw, pitch) {
      const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
      // rows of `turn` are right, up and towards the eye; turned about the eye's own axes
      let [r, u, e] = this.turn;
      [r, e] = [r.map((x, i) => cy * x - sy * e[i]), e.map((x, i) => cy * x + sy * r[i])];
      [u, e] = [u.map((x, i) => cp * x - sp * e[i]), e.map((x, i) => cp * x + sp * u[i])];
      this.turn = [r, u, e];
    }

    /** Where a point (columns, number) lies in the plane of the picture, m. */
    flat(columns, k) {
      if (!this.space) return [columns[0][k], columns[1][k]];
      const [r, u] = this.turn, x = columns[0][k], y = columns[1][k], z = columns[2][k];
      return [r[0] * x + r[1] * y + r[2] * z, u[0] * x + u[1] * y + u[2] * z];
    }
    depth(columns, k) { const e = this.turn[2]; return e[0] * columns[0][k] + e[1] * columns[1][k] + e[2] * columns[2][k]; }
    screen(point) { return [this.width / 2 + (point[0] - this.centre[0]) * this.scale, this.height / 2 - (point[1] - this.centre[1]) * this.scale]; }

    resize() {
      const box = this.canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
      if (!box.width || (box.width === this.width && box.height === this.height)) return;
      const first = !this.width;
      const grown = this.width ? box.width / this.width : 1;
      [this.width, this.height] = [box.width, box.height];
      for (const each of [this.canvas, this.base]) [each.width, each.height] = [box.width * ratio, box.height * ratio];
      if (first) this.fit(); else this.scale *= grown;
      this.draw();
    }

    fit() {
      this.turn = JSON.parse(this.home);
      this.follow();
      let low = [Infinity, Infinity], high = [-Infinity, -Infinity];
      const add = (point) => { low = low.map((x, i) => Math.min(x, point[i])); high = high.map((x, i) => Math.max(x, point[i])); };
      const runs = this.view.runs.filter((run) => run.near);
      for (const run of runs) for (const columns of [run.hip, run.ihip]) if (columns) for (let k = 0; k < columns[0].length; k += 1) add(this.flat(columns, k));
      const solid = this.mesh ? [this.mesh.vertices] : this.rings, wide = Math.max(high[0] - low[0], high[1] - low[1], 1e-6);
      let [least, most] = [[Infinity, Infinity], [-Infinity, -Infinity]];
      for (const columns of solid) for (let k = 0; k < columns[0].length; k++) {
        const point = this.flat(columns, k);
        least = least.map((x, i) => Math.min(x, point[i])); most = most.map((x, i) => Math.max(x, point[i]));
      }
      // The solid where the paths go over much of it, and where nothing moves: a tool at rest is seen on what holds it.
      const fills = wide <= 1e-6 || Math.max(most[0] - least[0], most[1] - least[1]) < 2.5 * wide;
      if (solid.length && this.view.closed && fills) { add(least); add(most); }
      this.centre = [0, 1].map((i) => 0.5 * (low[i] + high[i]));
      this.scale = 0.86 * Math.min(this.width / Math.max(high[0] - low[0], 1e-6), (this.height - 20) / Math.max(high[1] - low[1], 1e-6));
      this.whole = this.scale;
    }

    zoom(factor, at = null) {
      const next = Math.min(Math.max(this.scale * factor, 0.2 * this.whole), 1e7 * this.whole);
      if (at) {
        const x = (at[0] - this.width / 2), y = (this.height / 2 - at[1]);
        this.centre = [this.centre[0] + x / this.scale - x / next, this.centre[1] + y / this.scale - y / next];
      }
      this.scale = next;
    }

    /** The box of hand and tools at this time: middle and half a side, m; half is 0 where nothing touches. */
    now() {
      let low = [Infinity, Infinity], high = [-Infinity, -Infinity];
      const runs = this.view.visible(), touching = runs.filter((run) => run.now.touches);
      for (const run of touching.length ? touching : runs) for (const columns of [run.now.hip, run.now.ihip]) if (columns) {
        const point = this.flat(columns, 0);
        low = low.map((x, i) => Math.min(x, point[i])); high = high.map((x, i) => Math.max(x, point[i]));
      }
      return { middle: [0, 1].map((i) => 0.5 * (low[i] + high[i])), half: touching.length ? 0.5 * Math.max(high[0] - low[0], high[1] - low[1]) : 0 };
    }
    closeUp() {
      const { middle, half } = this.now();
      this.centre = middle;
      this.scale = half > 0 ? (0.28 * Math.min(this.width, this.height)) / half : 8 * this.whole;
    }

    draw() {
      if (!this.width) return;
      const ratio = window.devicePixelRatio || 1, g = this.base.getContext("2d");
      g.setTransform(ratio, 0, 0, ratio, 0, 0);
      g.clearRect(0, 0, this.width, this.height);
      if (this.mesh) this.drawSolid(g); else this.drawModel(g);
      this.drawPaths(g);
      this.drawMarks(g);
      this.drawScale(g);
      this.move();
    }

    /** Draw what moves: the picture of `draw`, and on it the hand and the tools at this time. */
    move() {
      if (!this.width) return;
      if (this.follow()) { this.draw(); return; }
      const ratio = window.devicePixelRatio || 1, g = this.canvas.getContext("2d");
      g.setTransform(1, 0, 0, 1, 0, 0);
      g.clearRect(0, 0, this.canvas.width, this.canvas.height);
      g.drawImage(this.base, 0, 0);
      g.setTransform(ratio, 0, 0, ratio, 0, 0);
      this.drawNow(g);
      this.drawLens(g);
    }

    drawModel(g) {
      g.fillStyle = colour("model");
      g.strokeStyle = colour("ink");
      g.lineWidth = 1.3;
      g.beginPath();
      for (const ring of this.rings) {
        for (let k = 0; k < ring[0].length; k++) g.lineTo(...this.screen([ring[0][k], ring[1][k]]));
        g.closePath();
      }
      g.fill("evenodd");
      g.stroke();
    }

    /** Triangles from the farthest to the nearest, with the paths between them: what lies behind shines through. */
    drawSolid(g) {
      const { vertices, triangles, normals, middles, count } = this.mesh, eye = this.turn[2], order = [];
      for (let k = 0; k < count; k++) {
        const n = normals[k], facing = n[0] * eye[0] + n[1] * eye[1] + n[2] * eye[2];
        if (facing > 0) { const m = middles[k]; order.push([m[0] * eye[0] + m[1] * eye[1] + m[2] * eye[2], k, facing]); }
      }
      for (const [run, columns, role, , width] of this.curves()) {
        for (let k = 1; k < columns[0].length; k += CHUNK) {  // some segments at a time, at the depth of their middle
          const end = Math.min(k + CHUNK, columns[0].length);
          order.push([this.depth(columns, (k + end - 1) >> 1), columns, k, role, width, end, run]);
        }
      }
      order.sort((a, b) => a[0] - b[0]);
      const dark = matchMedia("(prefers-color-scheme: dark)").matches, points = [];
      for (let k = 0; k < vertices[0].length; k++) points.push(this.screen(this.flat(vertices, k)));
      g.setLineDash([]);
      for (const part of order) {
        g.beginPath();
        if (part.length === 3) {
          const shade = Math.round(dark ? 38 + 46 * part[2] : 190 + 52 * part[2]);
          g.fillStyle = `rgba(${shade},${shade + 3},${shade + 8},.62)`;
          for (let corner = 0; corner < 3; corner++) g.lineTo(...points[triangles[3 * part[1] + corner]]);
          g.closePath();
          g.fill();
          g.strokeStyle = dark ? "rgba(150,158,170,.16)" : "rgba(110,118,130,.16)";
          g.lineWidth = 0.5;
        } else {
          const [, columns, first, role, width, end, run] = part;
          g.strokeStyle = colour(role);
          g.lineWidth = width;
          g.moveTo(...this.screen(this.flat(columns, first - 1)));
          for (let k = first; k < end; k++) {
            const point = this.screen(this.flat(columns, k));
            const free = columns === run.ihip && !(run.touches[k] && run.touches[k - 1]);
            if (free || run.starts.has(k)) g.moveTo(...point); else g.lineTo(...point);
          }
        }
        g.stroke();
      }
    }

    /** Every path that is drawn: run, columns, role of its colour, dashes, width. The hand's once, where runs share it. */
    curves() {
      const drawn = [], hands = new Map(), runs = this.view.visible();
      for (const run of runs) hands.set(run.path, [...(hands.get(run.path) ?? []), run]);
      for (const [, group] of hands) {
        const alone = group.length === 1 && this.view.runs.length > 1 && hands.size > 1;
        drawn.push([group[0], group[0].hip, alone ? group[0].role : "quiet", [], 0.9]);
      }
      for (const run of runs) if (run.ihip) drawn.push([run, run.ihip, run.role, run.dash, 1.7]);
      return drawn;
    }

    drawPaths(g) {
      const runs = this.view.visible();
      if (!this.mesh) for (const [run, columns, role, dash, width] of this.curves()) {
        g.strokeStyle = colour(role);
        g.lineWidth = width;
        g.setLineDash(dash);
        g.beginPath();
        let pen = false;
        for (let k = 0; k < columns[0].length; k++) {
          const free = columns === run.ihip && !run.touches[k];
          if (free || run.starts.has(k)) pen = false;
          if (free) continue;
          const point = this.screen(this.flat(columns, k));
          if (pen) g.lineTo(...point); else g.moveTo(...point);
          pen = true;
        }
        g.stroke();
        g.setLineDash([]);
      }
      if (runs.length === 1 && runs[0].ihip) {
        const [run] = runs;
        g.strokeStyle = colour("ray");
        g.lineWidth = 0.8;
        g.beginPath();
        for (const { hip, ihip, touches } of evenly(run, RAYS)) if (touches) { g.moveTo(...this.screen(this.flat(hip, 0))); g.lineTo(...this.screen(this.flat(ihip, 0))); }
        g.stroke();
      }
      runs.forEach((run, index) => {
        if (!run.ihip) return;
        g.fillStyle = colour(run.role);
        for (const { ihip, touches } of evenly(run, MARKERS, index / runs.length)) if (touches) marker(g, run.marker, ...this.screen(this.flat(ihip, 0)), 3);
      });
    }

    drawMarks(g) {
      const places = new Map();
      for (const { run, time, number } of this.view.marks) {
        if (!run.shown) continue;
        const [x, y] = this.screen(this.flat(run.ihip ?? run.hip, sampleAt(run, time)));
        g.strokeStyle = colour(run.role);
        g.lineWidth = 1.6;
        g.beginPath();
        g.arc(x, y, 6.5, 0, 2 * Math.PI);
        g.stroke();
        const near = [...places.keys()].find((key) => Math.hypot(key[0] - x, key[1] - y) < 16);
        if (near) places.get(near).push(number); else places.set([x, y], [number]);
      }
      for (const [name, position] of Object.entries(this.view.crosses)) {
        const [x, y] = this.screen(this.flat(position.map((each) => [each]), 0));
        g.strokeStyle = colour("ink");
        g.beginPath();
        g.moveTo(x - 5, y - 5); g.lineTo(x + 5, y + 5); g.moveTo(x + 5, y - 5); g.lineTo(x - 5, y + 5);
        g.stroke();
        g.font = "11px system-ui, sans-serif";
        g.fillStyle = colour("quiet");
        g.fillText(`${name} refuses`, x + 9, y + 12);
      }
      g.font = "15px system-ui, sans-serif";
      g.textAlign = "center";
      for (const run of this.view.visible()) for (const [time, kind] of run.events) {
        const [x, y] = this.screen(this.flat(run.ihip ?? run.hip, sampleAt(run, time)));
        g.fillStyle = colour(run.role);
        g.fillText(EVENTS[kind][0], x, y + 5);
      }
      g.textAlign = "start";
      g.fillStyle = colour("ink");
      g.font = "11px system-ui, sans-serif";
      for (const [[x, y], numbers] of places) g.fillText(numbers.join(","), x + 8, y - 6);
    }

    drawScale(g) {
      g.font = "11px system-ui, sans-serif";
      g.fillStyle = colour("quiet");
      g.strokeStyle = colour("quiet");
      g.lineWidth = 1;
      if (this.space) this.drawAxes(g);
      const most = ((0.28 * this.width) / this.scale) * MM, power = 10 ** Math.floor(Math.log10(most));
      const mm = [5, 2, 1].map((each) => each * power).find((each) => each <= most), pixels = (mm / MM) * this.scale, x = 10, y = this.height - 8;
      g.beginPath();
      g.moveTo(x, y - 4); g.lineTo(x, y); g.lineTo(x + pixels, y); g.lineTo(x + pixels, y - 4);
      g.stroke();
      const [unit, factor] = mm >= 0.1 ? ["mm", 1] : mm >= 1e-4 ? ["µm", 1e3] : ["nm", 1e6];
      g.fillText(`${Number((factor * mm).toPrecision(2))} ${unit}`, x + 5, y - 5);
      if (!this.view.strongest) return;
      arrow(g, x, y - 26, x + ARROW, y - 26, colour("quiet"));
      g.fillText(`force on the hand: ${Number(this.view.strongest.toPrecision(2))} N`, x + ARROW + 6, y - 22);
    }

    drawAxes(g) {
      const x = this.width - 38, y = this.height - 34;
      ["y₁", "y₂", "y₃"].forEach((name, c) => {
        const [r, u] = this.turn;
        g.beginPath(); g.moveTo(x, y); g.lineTo(x + 22 * r[c], y - 22 * u[c]); g.stroke();
        g.fillText(name, x + 30 * r[c] - 5, y - 30 * u[c] + 4);
      });
    }

    drawNow(g, screen = (point) => this.screen(point), r = 5) {
      const runs = this.view.visible(), hands = new Set();
      for (const run of runs) {
        const hip = screen(this.flat(run.now.hip, 0));
        if (run.ihip && run.now.touches) {
          const ihip = screen(this.flat(run.now.ihip, 0));
          g.strokeStyle = colour(run.role);
          g.lineWidth = 1.6;
          g.beginPath(); g.moveTo(...hip); g.lineTo(...ihip); g.stroke();
          g.fillStyle = colour("paper");
          marker(g, run.marker, ...ihip, r + 2.2);
          g.fillStyle = colour(run.role);
          marker(g, run.marker, ...ihip, r + 0.6);
        }
        if (run.now.force) this.drawForce(g, run, screen(this.flat(run.now.touches && run.ihip ? run.now.ihip : run.now.hip, 0)));
        const key = hip.map(Math.round).join();
        if (hands.has(key)) continue;
        hands.add(key);
        g.beginPath();
        g.arc(...hip, r, 0, 2 * Math.PI);
        g.fillStyle = colour("paper"); g.fill();
        g.strokeStyle = colour("ink"); g.lineWidth = 1.8; g.stroke();
      }
    }

    /** The force on the hand as an arrow from the tool: the largest of all runs is ARROW pixels long. */
    drawForce(g, { now, role }, [x, y]) {
      const [right, up] = this.flat(now.force, 0).map((part) => (ARROW * part) / (this.view.strongest || 1));
      arrow(g, x, y, x + right, y - up, colour(role));
    }

    /** What happens at this time, enlarged, where hand and tool cannot be told apart in the picture. */
    drawLens(g) {
      const { middle, half } = this.now();
      const side = Math.round(LENS * Math.min(this.width, this.height));
      if (this.space || !(half > 0) || half * this.scale > FINE * this.width || half < 2 * this.view.fine) return;
      const times = (0.3 * side) / (half * this.scale);
      if (times < 2) return;
      const hand = this.screen(middle), corners = [[this.width - side - 6, 6], [6, 6], [this.width - side - 6, this.height - side - 6], [6, this.height - side - 24]];
      const free = this.lensAt && Math.hypot(this.lensAt[0] + side / 2 - hand[0], this.lensAt[1] + side / 2 - hand[1]) > 0.8 * side ? this.lensAt : null;
      const [x, y] = (this.lensAt = free ?? corners.reduce((best, each) => {
        const far = (c) => Math.hypot(c[0] + side / 2 - hand[0], c[1] + side / 2 - hand[1]);
        return far(each) > 1.05 * far(best) ? each : best;
      }));
      const kept = [this.centre, this.scale, this.width, this.height];
      g.save();
      g.beginPath(); g.rect(x, y, side, side); g.clip();
      g.fillStyle = colour("paper"); g.fillRect(x, y, side, side);
      g.translate(x, y);
      [this.centre, this.scale, this.width, this.height] = [middle, this.scale * times, side, side];
      if (!this.mesh) { this.drawModel(g); this.drawPaths(g); }
      this.drawNow(g, undefined, 4);
      [this.centre, this.scale, this.width, this.height] = kept;
      g.fillStyle = colour("ink");
      g.font = "11px system-ui, sans-serif";
      g.fillText(`× ${Number(times.toPrecision(2))}`, 6, 14);
      g.restore();
      g.strokeStyle = colour("quiet"); g.lineWidth = 1;
      g.strokeRect(x + 0.5, y + 0.5, side - 1, side - 1);
      const box = Math.max(3, (0.5 * side) / times);
      g.strokeRect(hand[0] - box, hand[1] - box, 2 * box, 2 * box);
    }
  }

  // --- plots --------------------------------------------------------------------------------------------------------
  class Plots {
    constructor(view, box, panels) {
      Object.assign(this, { view, box, panels });
      this.holder = element("div", { class: "live-plots" });
      box.append(this.holder);
      this.made = [];
      this.make();
      new ResizeObserver(() => {
        if (this.holder.clientWidth) this.made.forEach((each) => each.setSize({ width: this.holder.clientWidth, height: this.height() }));
        this.move();
      }).observe(this.holder);
    }

    height() { return Math.round(Math.max(150, Math.min(210, 460 / this.panels.length))); }

    make() {
      const range = this.made[0] && [this.made[0].scales.x.min, this.made[0].scales.x.max];
      this.made.forEach((each) => each.destroy());
      this.holder.replaceChildren();
      this.made = this.panels.map((panel, index) => this.plot(panel, index));
      if (range && isFinite(range[0])) this.made[0].setScale("x", { min: range[0], max: range[1] });
      this.move();
    }

    plot(panel, index) {
      const runs = this.view.visible(), alone = runs.length === 1, tables = [], series = [{}];
      for (const run of runs) panel.terms.slice(0, alone ? undefined : 1).forEach(([name, label], k) => {
        const values = term(run, name);
        if (!values) return;
        const cut = Array.from(values, (value) => (panel.range ? Math.max(value, panel.range[0]) : value));
        const times = Array.from(run.time);
        for (const start of [...run.starts].sort((a, b) => b - a)) {  // a hole in the clock is a hole in the line
          cut.splice(start, 0, null);
          times.splice(start, 0, 0.5 * (run.time[start - 1] + run.time[start]));
        }
        tables.push([times, cut]);
        const roles = [run.role, "one", "two", "three"], dashes = [run.dash, [6, 2], [2, 2], [6, 2, 2, 2]];
        series.push({ label: alone ? label : run.name, stroke: colour(roles[k]), dash: dashes[k].length ? dashes[k] : undefined, width: k ? 1.1 : 1.6, points: { show: false } });
      });
      this.holder.append(element("div", { class: "keys", "aria-hidden": "true" }, ...(alone ? series.slice(1).map((each) => keyed(each)) : [])));
      if (!tables.length) tables.push([[this.view.start, this.view.end], [null, null]]), series.push({});
      const data = window.uPlot.join(tables, tables.map(() => [0, 2])), last = index === this.panels.length - 1;
      const axis = { stroke: colour("ink"), grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("grid"), width: 1 }, font: "11px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif" };
      const sync = this.view.key;
      const made = new window.uPlot({
        width: this.holder.clientWidth || 400, height: this.height(), series, legend: { show: false },
        cursor: { sync: { key: sync }, drag: { x: true, y: false }, points: { show: false } },
        scales: { x: { time: false }, y: panel.range ? { distr: 3, range: () => panel.range } : { range: (_, low, high) => zeroed(low, high) } },
        axes: [{ ...axis, label: last ? "time (s)" : undefined, labelSize: 18, size: 26 }, { ...axis, label: panel.label, labelSize: 18, size: 52, ...(panel.range ? { splits: () => decades(panel.range), values: (_, all) => all.map(power), filter: (_, all) => all } : {}) }],
      }, data, this.holder);
      for (const [name, value] of Object.entries({ role: "slider", tabindex: 0, "aria-label": `${panel.label} against time`, "aria-valuemin": this.view.start, "aria-valuemax": this.view.end })) made.root.setAttribute(name, value);
      made.root.addEventListener("keydown", (event) => this.view.keys(event));
      made.read = () => {
        const numbers = runs.map((run) => [run.name, term(run, panel.terms[0][0])]).filter(([, values]) => values).map(([name, values], k) => `${name} ${Number(values[sampleAt(runs[k], this.view.time)].toPrecision(3))}`);
        made.root.setAttribute("aria-valuenow", this.view.time);
        made.root.setAttribute("aria-valuetext", `${this.view.time.toFixed(this.view.decimals())} s: ${numbers.join(", ")}`);
      };
      const line = element("div", { class: "now-line" });
      made.over.append(line);
      made.line = line;
      for (const mark of this.view.marks) if (mark.run.shown) made.over.append(Object.assign(element("div", { class: "mark-line", style: `border-color:${colour(mark.run.role)}` }), { time: mark.time }));
      if (!index) for (const run of runs) for (const [time, kind] of run.events) made.over.append(Object.assign(element("div", { class: "mark-event", style: `color:${colour(run.role)}`, title: `${EVENTS[kind][1]}: ${run.name}, t = ${time.toFixed(3)} s` }, EVENTS[kind][0]), { time }));
      made.over.addEventListener("click", (event) => this.view.go(made.posToVal(event.offsetX, "x")));
      made.hooks.setScale = [...(made.hooks.setScale ?? []), () => requestAnimationFrame(() => this.move())];
      return made;
    }

    move() {
      for (const each of this.made) {
        each.read();
        for (const line of each.over.querySelectorAll(".now-line, .mark-line, .mark-event")) {
          const left = each.valToPos(line.time ?? this.view.time, "x");
          line.hidden = !(left >= -1 && left <= each.over.clientWidth + 1);
          line.style.transform = `translateX(${left}px)`;
        }
      }
    }
  }

  /** A line's look and its name. */
  function keyed(series) {
    const dash = series.dash ? ` stroke-dasharray="${series.dash.join(" ")}"` : "", made = element("span", { style: `color:${series.stroke}` });
    made.innerHTML = `<svg viewBox="0 0 22 8" width="22" height="8"><path d="M0 4H22" stroke="currentColor" stroke-width="2"${dash}/></svg>`;
    return element("span", {}, made, ` ${series.label}`);
  }

  const decades = ([low, high]) => {
    const first = Math.round(Math.log10(low)), last = Math.floor(Math.log10(high)), by = Math.max(1, Math.ceil((last - first) / 4));
    return Array.from({ length: Math.floor((last - first) / by) + 1 }, (_, k) => 10 ** (first + by * k));
  };
  const power = (value) => `10${String(Math.round(Math.log10(value))).replace(/./g, (each) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(each)])}`;

  function zeroed(low, high) {
    low = Math.min(low ?? 0, 0); high = Math.max(high ?? 0, 0);
    if (high - low < 1e-9) high = 1;
    const pad = 0.06 * (high - low);
    return [low < 0 ? low - pad : 0, high + pad];
  }

  // --- the page -----------------------------------------------------------------------------------------------------
  class View {
    constructor(section, document_, key) {
      this.section = section;
      this.key = key;
      const paths = document_.paths.map((path) => makePath(path, document_.dimension));
      this.runs = document_.runs.map((spec) => makeRun(spec, paths, document_.dimension));
      this.closed = document_.model?.closed ?? false;
      this.fine = 2 ** -23 * Math.max(...paths.map((path) => largest(path.hip)));  // m: the step of a float
      this.crosses = document_.crosses;
      const far = this.runs.map((run) => run.hip.reduce((most, column) => column.reduce((m, value) => Math.max(m, Math.abs(value)), most), 0));
      const median = [...far].sort((a, b) => a - b)[far.length >> 1];
      this.runs.forEach((run, k) => { run.near = far[k] <= 3 * median; });
      for (const box of section.querySelectorAll(".runs-shown input")) for (const run of this.runs) if (run.number === Number(box.dataset.run)) run.shown = box.checked;
      this.strongest = Math.max(...this.runs.filter((run) => run.near).map((run) => largest(run.force)));
      this.start = Math.min(...this.runs.map((run) => run.time[0]));
      this.end = Math.max(...this.runs.map((run) => run.time[run.time.length - 1]));
      this.times = [...new Set(this.runs.flatMap((run) => [...run.time]))].sort((a, b) => a - b);
      this.time = this.start;
      this.verdicts = [...section.querySelectorAll(".check li[data-time]")];
      this.marks = this.verdicts.filter((each) => each.dataset.mark).map((each) => ({ run: this.runs.find((run) => run.number === Number(each.dataset.run)), time: Number(each.dataset.time), number: each.dataset.mark })).filter((each) => each.run);
      const seen = new Set();
      this.marks = this.marks.filter((each) => !seen.has(each.number) && seen.add(each.number));
      const stage = section.querySelector(".stage"), views = stage.querySelector(".views");
      this.transport(stage, views);
      section.classList.add("live");
      this.scene = new Scene(this, views.querySelector(".plane"), document_);
      this.plots = new Plots(this, views.querySelector(".plots"), document_.panels);
      for (const box of section.querySelectorAll(".runs-shown input")) box.addEventListener("change", () => this.choose(box));
      for (const verdict of this.verdicts) {
        const time = verdict.querySelector("i"), link = element("a", { class: "jump", href: `#${verdict.id}` }, time.textContent);
        link.addEventListener("click", (event) => { event.preventDefault(); history.replaceState(null, "", link.hash); this.jump(verdict); });
        time.replaceWith(link);
      }
      const worst = document.getElementById(section.dataset.worst)?.closest("li[data-time]");
      this.go(worst ? Number(worst.dataset.time) : this.start);
      worst?.classList.add("current");
      this.table();
      this.scene.resize();
    }

    visible() { return this.runs.filter((run) => run.shown); }

    choose(box) {
      const run = this.runs.find((each) => each.number === Number(box.dataset.run));
      if (run) run.shown = box.checked;
      this.scene.draw();
      this.plots.make();
      this.table();
    }

    transport(stage, views) {
      const { section } = this;
      this.range = element("input", { type: "range", min: this.start, max: this.end, step: "any", "aria-label": "time", oninput: () => this.go(Number(this.range.value)) });
      this.range.addEventListener("keydown", (event) => this.keys(event));
      this.clock = element("output", { class: "clock" });
      this.button = element("button", { type: "button", class: "play", "aria-label": "play", onclick: () => (this.playing ? this.stop() : this.play()) }, "▶");
      const span = this.end - this.start, speeds = [0.01, 0.1, 0.25, 1, 4, 20];
      const usual = speeds.find((each) => span / each <= 14) ?? 20;
      this.speed = element("select", { "aria-label": "speed" }, ...speeds.map((each) => element("option", { value: each, selected: each === usual }, `${each} ×`)));
      this.ticks = element("div", { class: "ticks", "aria-hidden": "true" });
      for (const each of new Map(this.marks.map((mark) => [mark.time, mark])).values()) this.ticks.append(element("i", { style: `left:${100 * (each.time - this.start) / (span || 1)}%;background:var(--fig-${each.run.role})` }));
      const kinds = Object.keys(EVENTS).filter((kind) => this.runs.some((run) => run.events.some((event) => event[1] === kind)));
      if (kinds.length) views.append(element("p", { class: "event-key quiet" }, kinds.map((kind) => EVENTS[kind].join(" ")).join(" · ")));
      if (this.runs.length > this.visible().length) {
        const all = element("button", { type: "button", onclick: () => { for (const box of section.querySelectorAll(".runs-shown input:not([disabled])")) { box.checked = true; this.choose(box); } all.remove(); } }, "show all");
        section.querySelector(".runs-shown").append(all);
      }
      views.after(
        element("div", { class: "transport" }, this.button, element("div", { class: "track" }, this.ticks, this.range), this.clock, this.speed),
        element("div", { class: "scroll-now", tabindex: "0", role: "region", "aria-label": "values at this time" }, (this.values = element("table", { class: "now" }))));
    }

    keys(event) {
      const at = this.index(this.time), big = Math.max(1, Math.round(this.times.length / 20));
      const to = { ArrowRight: at + 1, ArrowUp: at + 1, ArrowLeft: at - 1, ArrowDown: at - 1, PageUp: at + big, PageDown: at - big, Home: 0, End: this.times.length - 1 }[event.key];
      if (to === undefined) return;
      event.preventDefault();
      this.go(this.times[Math.min(Math.max(to, 0), this.times.length - 1)]);
    }

    index(time) { return sampleAt({ time: this.times }, time); }

    go(time) {
      this.time = Math.min(Math.max(time, this.start), this.end);
      for (const run of this.runs) run.now = at(run, this.time);
      this.range.value = this.time;
      const text = `${this.time.toFixed(this.decimals())} s`;
      this.range.setAttribute("aria-valuetext", text);
      this.clock.textContent = `t = ${text}`;
      this.scene?.move();
      this.plots?.move();
      this.fill();
    }

    decimals() { return this.end - this.start > 1e-1 ? 3 : 6; }

    table() {
      const head = element("tr", {}, ...["renderer", "|IHIP − HIP| (mm)", "force (N)", "HIP (mm)", "IHIP (mm)"].map((text) => element("th", { scope: "col" }, text)));
      this.rows = this.visible().map((run) => {
        const cells = Array.from({ length: 4 }, () => element("td"));
        const swatch = this.section.querySelector(`.runs-shown input[data-run="${run.number}"]`)?.parentElement.querySelector("svg")?.cloneNode(true);
        return [run, cells, element("tr", {}, element("th", { scope: "row" }, swatch ?? "", ` ${run.name}`), ...cells)];
      });
      this.values.replaceChildren(element("thead", {}, head), element("tbody", {}, ...this.rows.map((each) => each[2])));
      this.fill();
    }

    fill() {
      const point = (columns) => (columns ? columns.map((column) => (MM * column[0]).toFixed(3).replace("-", "−")).join(", ") : "–");
      for (const [{ now, depthDecimals, forceDecimals }, cells] of this.rows ?? []) {
        cells[0].textContent = now.apart ? (MM * size(now.apart, 0)).toFixed(depthDecimals) : "–";
        cells[1].textContent = now.force ? size(now.force, 0).toFixed(forceDecimals) : "–";
        cells[2].textContent = point(!now.hole && now.hip);
        cells[3].textContent = point(!now.hole && now.ihip);
      }
    }

    play() {
      this.playing = true;
      this.button.textContent = "❚❚";
      this.button.setAttribute("aria-label", "pause");
      if (this.time >= this.end) this.go(this.start);
      let last = performance.now();
      const frame = (now) => {
        if (!this.playing) return;
        this.go(this.time + ((now - last) / 1000) * Number(this.speed.value));
        last = now;
        if (this.time >= this.end) this.stop(); else requestAnimationFrame(frame);
      };
      requestAnimationFrame(frame);
    }
    stop() { this.playing = false; this.button.textContent = "▶"; this.button.setAttribute("aria-label", "play"); }

    /** Go to the place of a verdict, and show its renderer. */
    jump(verdict) {
      this.stop();
      const box = this.section.querySelector(`.runs-shown input[data-run="${verdict.dataset.run}"]`);
      if (box && !box.checked) { box.checked = true; this.choose(box); }
      for (const each of this.section.querySelectorAll(".check li.current")) each.classList.remove("current");
      verdict.classList.add("current");
      this.go(Number(verdict.dataset.time));
      const views = this.section.querySelector(".views").getBoundingClientRect();
      if (views.bottom < 80 || views.top > innerHeight - 80) this.section.querySelector(".views").scrollIntoView({ block: "start" });
    }
  }

  const views = new Map();

  function begin(section) {
    const script = section.querySelector("script.case-data");
    if (!views.has(section) && script) views.set(section, new View(section, JSON.parse(script.textContent), section.id));
    return views.get(section);
  }

  function follow() {
    const name = location.hash.slice(1);
    const target = name && (document.getElementById(name) ?? document.getElementById(decodeURIComponent(name)));
    const section = target && target.closest(".one-case");
    if (!section || target === section) return;
    const view = begin(section);
    const verdict = target.closest(".check li[data-time]");
    if (view && verdict) view.jump(verdict);
  }

  function start() {
    if (!window.uPlot) return;
    const sections = [...document.querySelectorAll(".one-case")];
    if (sections.length === 1) begin(sections[0]);
    else {
      const watch = new IntersectionObserver((entries) => { for (const each of entries) if (each.isIntersecting) { watch.unobserve(each.target); begin(each.target); } }, { rootMargin: "300px" });
      sections.forEach((each) => watch.observe(each));
    }
    follow();
    document.documentElement.dataset.ready = String(Math.round(performance.now()));
  }

  addEventListener("hashchange", follow);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colours.clear(); for (const view of views.values()) { view.scene.draw(); view.plots.make(); } });
  if (document.readyState === "loading") addEventListener("DOMContentLoaded", start); else start();
})();
