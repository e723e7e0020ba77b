"use strict";
// Draws what the pages of a report show, from plain data in them: charts as SVG, models and what moves on them on canvas.
// The pages hold all that it needs, and it asks no network for anything. `case.js` moves what is drawn here.
const Drawing = (() => {
  const MM = 1e3;
  const FONT = "11px system-ui, sans-serif";
  /** Signs of what happens in a run, and what they mean. */
  const EVENTS = { contact: ["▾", "contact begins"], impact: ["✶", "impact"], release: ["▴", "contact ends"] };

  // --- elements -----------------------------------------------------------------------------------------------------

  /** An element of HTML: of its attributes functions are listeners, and false and null are left out. */
  function element(name, attributes = {}, ...children) {
    const node = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) {
      if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
      else if (value !== false && value !== null) node.setAttribute(key, value === true ? "" : value);
    }
    node.append(...children);
    return node;
  }

  /** An element of SVG. */
  function svg(name, attributes = {}, ...children) {
    const node = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) if (value !== null) node.setAttribute(key, value);
    node.append(...children);
    return node;
  }

  // --- numbers ------------------------------------------------------------------------------------------------------

  /** Numbers of Python's `case_data.floats`, as so many columns of (n,). */
  function columns(text, count, Kind = Float32Array) {
    const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
    const flat = new Kind(bytes.buffer), rows = flat.length / count;
    return Array.from({ length: count }, (_, c) => Float64Array.from({ length: rows }, (_, k) => flat[k * count + c]));
  }

  const dot = (one, two) => one.reduce((sum, x, i) => sum + x * two[i], 0);
  const minus = (one, two) => one.map((x, i) => x - two[i]);
  const unit = (vector) => { const length = Math.hypot(...vector) || 1; return vector.map((x) => x / length); };
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  /** The length of the vector in row k of columns. */
  const size = (vectors, k) => Math.hypot(...vectors.map((column) => column[k]));
  const largest = (vectors) => (vectors ? vectors[0].reduce((most, _, k) => Math.max(most, size(vectors, k)), 0) : 0);
  /** Decimals of numbers up to one, of which four digits count. */
  const decimals = (most) => Math.min(Math.max(3 - Math.floor(Math.log10(most || 1)), 0), 12);
  /** A number in so many digits, with a minus as wide as a plus. */
  const digits = (value, count) => String(Number(value.toPrecision(count))).replace("-", "−");

  /** The least and the greatest of each coordinate of points. */
  class Bounds {
    constructor() { this.low = [Infinity, Infinity]; this.high = [-Infinity, -Infinity]; }
    add(point) { for (const i of [0, 1]) { this.low[i] = Math.min(this.low[i], point[i]); this.high[i] = Math.max(this.high[i], point[i]); } }
    get middle() { return [0, 1].map((i) => 0.5 * (this.low[i] + this.high[i])); }
    get sides() { return [0, 1].map((i) => this.high[i] - this.low[i]); }
    get widest() { return Math.max(...this.sides); }
  }

  // --- runs ---------------------------------------------------------------------------------------------------------

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

  /** A run at a time: hand, tool and force as columns of one row, on the line between samples that are ticks apart.
      In a gap the hand is where it was last, and there is no tool and no force. */
  function stateAt(run, time) {
    const k = sampleAt(run, time), step = run.time[k + 1] - run.time[k];
    const far = step > 1.5 * run.dt, begins = run.starts.has(k + 1);
    const gap = far && begins && time > run.time[k] + 1.5 * run.dt;
    const share = far && !begins ? Math.min(Math.max((time - run.time[k]) / step, 0), 1) : 0;
    const row = (vectors) => vectors && vectors.map((c) => [share ? c[k] + share * (c[k + 1] - c[k]) : c[k]]);
    const hip = row(run.hip), apart = row(run.apart);
    return {
      hip, gap, rotation: row(run.rotation), translation: row(run.translation), apart: gap ? null : apart, force: gap ? null : row(run.force), touches: gap ? 0 : run.touches[k],
      ihip: apart && hip.map((column, c) => [column[0] + apart[c][0]]),
    };
  }

  /** A run at so many times, evenly; `shift` is a share of the time between two. */
  function evenly(run, count, shift = 0) {
    const first = run.time[0], span = run.time[run.time.length - 1] - first;
    return Array.from({ length: count }, (_, k) => stateAt(run, first + (span * (k + shift)) / count));
  }

  const readPath = ({ time, hip, hip_step, starts, body_rotation: rotation, body_translation: translation }, dimension) => ({
    time: columns(time, 1, Float64Array)[0], hip: columns(hip, dimension), hip_step: columns(hip_step, 1),
    starts: new Set(starts),
    rotation: rotation ? columns(rotation, dimension ** 2) : null, translation: translation ? columns(translation, dimension) : null,
  });

  /** Vectors (columns) of the body's frame in the world's, R v, and points with a translation, R x + t; of poses a row, or of one. */
  function inWorld(vectors, rotation, translation = null) {
    const count = vectors.length, one = rotation[0].length === 1;
    return vectors.map((_, i) => Float64Array.from(vectors[0], (_, k) => {
      const row = one ? 0 : k;
      return vectors.reduce((sum, column, j) => sum + rotation[count * i + j][row] * column[k], translation ? translation[i][row] : 0);
    }));
  }

  /** A run of the document with its channels by columns; `path` is that of its hand, which others may share. */
  function readRun(spec, paths, dimension) {
    const read = (text, count = 1) => (text === undefined ? null : columns(text, count)), path = paths[spec.path];
    const apart = read(spec.apart, dimension), force = read(spec.force, dimension);
    const ihip = apart && path.hip.map((column, c) => column.map((value, k) => value + apart[c][k]));
    const touches = path.time.map((_, k) => (apart && apart.some((column) => column[k] !== 0) ? 1 : 0));
    // The same in either frame: the body's, and where it moves the world's.
    const body = { hip: path.hip, apart, ihip, force };
    const turned = (vectors) => vectors && inWorld(vectors, path.rotation), placed = (points) => points && inWorld(points, path.rotation, path.translation);
    const world = path.rotation && { hip: placed(path.hip), apart: turned(apart), ihip: placed(ihip), force: turned(force) };
    return {
      ...spec, ...path, path, ...body, body, world, touches, shown: true,
      step: read(spec.step), off: read(spec.off), along: read(spec.along),
      depthDecimals: decimals(MM * largest(apart)), forceDecimals: decimals(largest(force)),
    };
  }

  /** What a panel draws of a run, (n,): N, m/s, or mm; null where it was not recorded. See Python's `case_data.Term`. */
  function termValues(run, name) {
    const [channel, column] = name.replaceAll("|", "").split(".");
    const vectors = run[channel], scale = channel === "force" || channel === "along" ? 1 : MM;
    if (!vectors || (column && !vectors[column])) return null;
    if (name.startsWith("|")) return Float64Array.from(vectors[0], (_, k) => scale * size(vectors, k));
    return Float64Array.from(vectors[column ?? 0], (value) => scale * value);
  }

  /** The runs of a case, at one time: what a scene and plots draw of it. `marks` are the places of verdicts. */
  class Case {
    constructor(data) {
      const paths = data.paths.map((path) => readPath(path, data.dimension));
      Object.assign(this, { data, crosses: data.crosses, marks: [], time: 0, start: 0, end: 0, strongest: 0 });
      this.runs = data.runs.map((spec) => readRun(spec, paths, data.dimension));
      this.closed = data.model?.closed ?? false;
      /** Whether the body moves, and whether the world is shown, in which it does. */
      this.moving = this.runs.some((run) => run.world);
      this.inWorld = false;
      this.rounding = 2 ** -23 * Math.max(0, ...paths.map((path) => largest(path.hip)));  // m: the step of a float
      if (!this.runs.length) return;
      this.markFarRuns();
      this.strongest = Math.max(...this.runs.filter((run) => run.near).map((run) => largest(run.force)));
      this.start = Math.min(...this.runs.map((run) => run.time[0]));
      this.end = Math.max(...this.runs.map((run) => run.time[run.time.length - 1]));
      this.marks = (data.marks ?? []).map((mark) => ({ ...mark, run: this.runs[mark.run] }));
      this.go(data.time ?? this.start);
      this.showWorld(this.moving);
    }

    /** Show the world, or the frame of the body. */
    showWorld(on) {
      this.inWorld = on && this.moving;
      for (const run of this.runs) Object.assign(run, (this.inWorld && run.world) || run.body);
      this.go(this.time);
    }

    /** Where the body is at this time, as the columns of one row; null where it is at rest in what is shown. */
    get pose() { return (this.inWorld && this.runs.find((run) => run.world)?.now) || null; }

    /** A run that goes far beyond the median one would leave the others a dot: the picture is not fitted to it. */
    markFarRuns() {
      const reach = this.runs.map((run) => largest(run.hip));
      const median = [...reach].sort((a, b) => a - b)[reach.length >> 1];
      this.runs.forEach((run, k) => { run.near = reach[k] <= 3 * median; });
    }

    visible() { return this.runs.filter((run) => run.shown); }

    go(time) {
      this.time = Math.min(Math.max(time, this.start), this.end);
      for (const run of this.runs) run.now = stateAt(run, this.time);
    }
  }

  // --- colours ------------------------------------------------------------------------------------------------------
  // SVG takes the colours of the sheet by itself; a canvas has to ask for them, and again where they change.

  const colours = new Map();
  function colour(role) {
    if (!colours.has(role)) {
      const value = getComputedStyle(document.documentElement).getPropertyValue(`--fig-${role}`).trim();
      colours.set(role, value || "#888");
    }
    return colours.get(role);
  }
  const isDark = () => matchMedia("(prefers-color-scheme: dark)").matches && !document.documentElement.classList.contains("paper");

  // --- charts -------------------------------------------------------------------------------------------------------

  const exponent = (n) => String(n).replace(/./g, (sign) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(sign)]);

  /** Where a linear axis has its numbers, about so many: steps of 1, 2 or 5 times a power of ten. */
  function linearTicks(low, high, count) {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = power * [1, 2, 5, 10].find((digit) => digit * power >= 0.7 * raw);
    const tiny = Math.max(Math.abs(low), Math.abs(high)) < 1e-3, huge = Math.max(Math.abs(low), Math.abs(high)) >= 1e5;
    const places = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const text = (value) => (tiny || huge ? digits(value, 3) : value.toFixed(places).replace("-", "−"));
    const first = Math.ceil(low / step - 1e-9), last = Math.floor(high / step + 1e-9);
    return Array.from({ length: last - first + 1 }, (_, k) => [(first + k) * step, text((first + k) * step)]);
  }

  /** Where a logarithmic axis has its numbers: powers of ten, at most about so many; of a short axis also 2 and 5 times. */
  function logTicks(low, high, count) {
    const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9);
    const by = Math.max(1, Math.ceil((last - first) / count));
    const powers = Array.from({ length: Math.max(0, Math.floor((last - first) / by) + 1) }, (_, k) => first + by * k);
    if (powers.length > 2) return powers.map((n) => [10 ** n, Math.abs(n) <= 3 ? digits(10 ** n, 1) : `10${exponent(n)}`]);
    const values = [];
    for (let n = first - 1; n <= last + 1; n++) for (const digit of [1, 2, 5]) values.push(digit * 10 ** n);
    return values.filter((value) => value >= low && value <= high).map((value) => [value, digits(value, 1)]);
  }

  /** The range of an axis: as it is asked for, or that of the numbers with a margin, of `zero` axes with zero in sight. */
  function rangeOf(axis, numbers) {
    if (axis.range) return axis.range;
    if (axis.names) return [axis.names.length - 0.5, -0.5];  // from the top
    let low = axis.zero ? 0 : Infinity, high = axis.zero ? 0 : -Infinity;
    for (const values of numbers) for (const value of values) {
      if (!Number.isFinite(value) || (axis.log && value <= 0)) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
    if (low > high) [low, high] = axis.log ? [0.1, 1] : [0, 1];
    if (axis.tight) return high > low ? [low, high] : [low, low + 1e-3];
    if (axis.log) return [low / 1.6, high * 1.6];
    // Nothing but rounding errors: an axis from 0 to 1.
    if (high - low < 1e-9 * Math.max(1, Math.abs(high))) high = low + 1;
    const pad = 0.06 * (high - low);
    return [axis.zero && low >= 0 ? 0 : low - pad, axis.zero && high <= 0 ? 0 : high + pad];
  }

  /** An axis from its range to pixels: `place` of a value, `value` of a place, and its ticks, (value, text). */
  function makeScale(axis, numbers, from, to) {
    const [low, high] = rangeOf(axis, numbers);
    const along = axis.log ? (value) => Math.log10(value) : (value) => value;
    const [first, last] = [along(low), along(high)], count = Math.max(2, Math.round(Math.abs(to - from) / (axis.across ? 70 : 38)));
    return {
      low, high,
      place: (value) => from + ((along(axis.log ? Math.max(value, 1e-300) : value) - first) / (last - first)) * (to - from),
      value: (place) => { const share = first + ((place - from) / (to - from)) * (last - first); return axis.log ? 10 ** share : share; },
      ticks: axis.names?.map((name, k) => [k, name]) ?? (axis.log ? logTicks : linearTicks)(low, high, count),
    };
  }

  /** The path of a line through places in pixels, broken where one is not finite; `steps` go across, then up. */
  function linePath(xs, ys, steps) {
    let path = "", pen = false, last = 0;
    for (let k = 0; k < xs.length; k++) {
      if (!Number.isFinite(xs[k]) || !Number.isFinite(ys[k])) { pen = false; continue; }
      const x = xs[k].toFixed(1), y = ys[k].toFixed(1);
      path += pen ? (steps ? `H${x}V${y}` : `L${x} ${y}`) : `M${x} ${y}`;
      pen = true;
      last = k;
    }
    return path && xs.length === 1 ? `M${xs[last]} ${ys[last]}h.1` : path;
  }

  const read = (values) => (typeof values === "string" ? columns(values, 1)[0] : values);
  const stroke = (role) => `var(--fig-${role})`;
  let clips = 0;

  /** A chart of Python's `chart.Chart` in a holder, as wide as that; drawn anew where its width changes. */
  class Chart {
    constructor(holder, spec, height, options = {}) {
      Object.assign(this, { holder, height, options, clip: `clip${++clips}` });
      this.keys = element("div", { class: "keys" });
      this.picture = svg("svg", { class: "chart", role: "img", "aria-label": spec.title });
      holder.append(this.keys, this.picture);
      this.show(spec);
      new ResizeObserver(() => { if (Math.abs(this.room() - this.width) > 1) this.draw(); }).observe(holder);
    }

    room() { return this.holder.clientWidth || 400; }

    /** Show another chart in the same place. */
    show(spec) {
      this.spec = spec;
      this.curves = spec.curves.map((curve) => ({ ...curve, x: read(curve.x), y: read(curve.y) }));
      this.keys.replaceChildren(...this.curves.filter((curve) => curve.label).map(legendKey));
      this.draw();
    }

    draw() {
      const { spec } = this, width = (this.width = this.room());
      // A character is about 6 px wide; names take two fifths of the chart at most.
      const names = Math.max(0, ...(spec.y.names ?? []).map((name) => 6 * name.length));
      const left = names ? Math.min(names + 10, 0.4 * width) : spec.y.label ? 58 : 40;
      this.box = { left, right: width - (spec.right ? 52 : 12), top: 10, bottom: this.height - (spec.x.label ? 38 : 20) };
      const { box } = this, on = (right) => this.curves.filter((curve) => Boolean(curve.right) === right);
      this.x = makeScale({ ...spec.x, across: true }, this.curves.map((curve) => curve.x), box.left, box.right);
      this.y = makeScale(spec.y, [...on(false).map((curve) => curve.y)], box.bottom, box.top);
      this.right = spec.right && makeScale(spec.right, on(true).map((curve) => curve.y), box.bottom, box.top);
      this.picture.setAttribute("viewBox", `0 0 ${width} ${this.height}`);
      this.picture.replaceChildren(
        svg("clipPath", { id: this.clip }, svg("rect", this.frame())),
        ...this.shades(), ...this.axes(),
        svg("g", { "clip-path": `url(#${this.clip})` }, ...this.rules(), ...this.curves.flatMap((curve) => this.curve(curve))),
        ...this.notes(), ...this.signs());
      this.options.drawn?.(this);
    }

    frame() { const { left, right, top, bottom } = this.box; return { x: left, y: top, width: right - left, height: bottom - top }; }

    text(x, y, text, attributes = {}) { return svg("text", { x, y, ...attributes }, text); }

    /** Stretches of x, such as those in which another chart of a sphere is at work. */
    shades() {
      return (this.spec.shades ?? []).map(([from, to]) => svg("rect", {
        x: this.x.place(from), y: this.box.top, width: Math.max(this.x.place(to) - this.x.place(from), 0.5),
        height: this.box.bottom - this.box.top, fill: "var(--fig-model)",
      }));
    }

    /** Lines of the grid, numbers and labels of all axes. */
    axes() {
      const { box, spec } = this, { left, right, top, bottom } = box, parts = [], middle = 0.5 * (top + bottom);
      for (const [value, text] of this.x.ticks) {
        const x = this.x.place(value);
        parts.push(svg("path", { d: `M${x} ${top}V${bottom}`, class: "grid-line" }));
        if (spec.x.label) parts.push(this.text(x, bottom + 15, text, { "text-anchor": "middle" }));
      }
      for (const [value, text] of this.y.ticks) {
        const y = this.y.place(value);
        parts.push(svg("path", { d: `M${left} ${y}H${right}`, class: "grid-line" }));
        parts.push(this.text(left - 6, y + 4, text, { "text-anchor": "end" }));
      }
      for (const [value, text] of this.right?.ticks ?? []) parts.push(this.text(right + 6, this.right.place(value) + 4, text));
      const upright = (x, label) => this.text(0, 0, label, { "text-anchor": "middle", transform: `translate(${x} ${middle}) rotate(-90)` });
      if (spec.x.label) parts.push(this.text(0.5 * (left + right), this.height - 5, spec.x.label, { "text-anchor": "middle" }));
      if (spec.y.label) parts.push(upright(12, spec.y.label));
      if (spec.right) parts.push(upright(this.width - 5, spec.right.label));
      return parts;
    }

    /** Straight lines across the chart, at one x or one y, and what is written at them. */
    rules() {
      const { left, right, top, bottom } = this.box;
      return (this.spec.rules ?? []).flatMap((rule) => {
        const upright = rule.x !== undefined, at = upright ? this.x.place(rule.x) : this.y.place(rule.y);
        const line = svg("path", {
          d: upright ? `M${at} ${top}V${bottom}` : `M${left} ${at}H${right}`, fill: "none", stroke: stroke(rule.role),
          "stroke-width": rule.width ?? 1, "stroke-dasharray": rule.dash?.join(" ") ?? null,
        });
        if (!rule.text) return [line];
        return [line, upright ? this.text(at - 4, top + 12, rule.text, { "text-anchor": "end" }) : this.text(left + 5, at - 4, rule.text)];
      });
    }

    /** A line and its markers, each where there is one. */
    curve({ x, y, role, dash, width, steps, shape, size: high = 6, hollow, line = true, right, faint }) {
      const scale = right ? this.right : this.y;
      const xs = Array.from(x, this.x.place), ys = Array.from(y, (value) => (Number.isFinite(value) ? scale.place(value) : NaN));
      const parts = [];
      if (line) parts.push(svg("path", {
        d: linePath(xs, ys, steps), fill: "none", stroke: stroke(role), "stroke-width": width ?? 1.5, "stroke-linejoin": "round",
        "stroke-dasharray": dash?.length ? dash.join(" ") : null, opacity: faint ? 0.6 : null,
      }));
      // A marker is drawn about (17, 6) and 9 high, as in a swatch.
      if (shape) xs.forEach((at, k) => parts.push(svg("path", {
        d: shape, transform: `translate(${at} ${ys[k]}) scale(${high / 8}) translate(-17 -6)`, stroke: stroke(role),
        "stroke-width": 1.6, fill: hollow ? "var(--paper)" : stroke(role),
      })));
      return parts;
    }

    /** Words at points, where they cover no earlier ones and leave the chart on no side. */
    notes() {
      const taken = [];
      return (this.spec.notes ?? []).flatMap(({ x, y, text }) => {
        const [at, up, wide] = [this.x.place(x), this.y.place(y), 6.2 * text.length];
        // Above the point, else below it, else farther below.
        const clear = (y) => y > this.box.top && !taken.some(([a, b, c]) => at < a + c + 6 && a < at + wide + 6 && Math.abs(y - b) < 13);
        const level = [up - 4, up + 12, up + 26].find(clear);
        if (level === undefined) return [];
        taken.push([at, level, wide]);
        const turned = at + wide + 8 > this.width;
        return [this.text(at + (turned ? -7 : 7), level, text, { "text-anchor": turned ? "end" : "start", class: "note-text" })];
      });
    }

    /** Signs above the chart, at times: what happens there. */
    signs() {
      return (this.spec.signs ?? []).filter(({ x }) => x >= this.x.low && x <= this.x.high).map(({ x, text, role, title }) =>
        svg("text", { x: this.x.place(x), y: this.box.top + 2, class: "sign", "text-anchor": "middle", fill: stroke(role) }, svg("title", {}, title), text));
    }
  }

  /** A line's look and its name. */
  function legendKey({ role, dash, shape, line = true, hollow, label }) {
    const picture = svg("svg", { viewBox: "0 0 34 12", class: "key", "aria-hidden": "true" });
    if (line) picture.append(svg("path", { d: "M0 6H34", stroke: stroke(role), "stroke-width": 2, fill: "none", "stroke-dasharray": dash?.join(" ") || null }));
    if (shape) picture.append(svg("path", { d: shape, stroke: stroke(role), "stroke-width": 1.6, fill: hollow ? "var(--paper)" : stroke(role) }));
    return element("span", {}, picture, ` ${label}`);
  }

  /** Ticks to either side of a verdict's place that a second plot shows, as Python's `case_data.CLOSE_TICKS`. */
  const CLOSE_TICKS = 20;

  /** The times of a close-up about a time: some ticks to either side; null where the whole of a run is not much longer. */
  function closeRange(shown, time) {
    const reach = CLOSE_TICKS * Math.max(...shown.runs.map((run) => run.dt));
    return reach > 0 && shown.end - shown.start > 4 * reach ? [time - reach, time + reach] : null;
  }

  /** The chart of a panel: its first term of every run, and all terms of a run that is alone; `close`: scaled to its range. */
  function panelChart(shown, panel, { range, last, signs, close }) {
    const runs = shown.visible(), alone = runs.length === 1, curves = [];
    for (const run of runs) {
      panel.terms.slice(0, alone ? panel.terms.length : 1).forEach(([name, label], k) => {
        const values = termValues(run, name);
        if (!values) return;
        // What lies below a logarithmic panel runs along its floor; no line leads over a gap.
        const floored = panel.range ? values.map((value) => Math.max(value, panel.range[0])) : values;
        const time = [], drawn = [];
        const [first, end] = close ? [sampleAt(run, range[0]), sampleAt(run, range[1]) + 1] : [0, floored.length - 1];
        floored.forEach((value, i) => { if (i < first || i > end) return; if (run.starts.has(i)) { time.push(run.time[i]); drawn.push(NaN); } time.push(run.time[i]); drawn.push(value); });
        curves.push({
          x: time, y: drawn, role: k ? ["one", "two", "three"][k - 1] : run.role, dash: k ? [[6, 2], [2, 2], [6, 2, 2, 2]][k - 1] : run.dash,
          width: k ? 1.1 : 1.5, label: alone && !close && panel.terms.length > 1 ? label : "",
        });
      });
    }
    const events = signs ? runs.flatMap((run) => run.events.map(([time, kind]) => ({
      x: time, text: EVENTS[kind][0], role: run.role, title: `${EVENTS[kind][1]}: ${run.name}, t = ${time.toFixed(3)} s`,
    }))) : [];
    const rules = (close ? [{ run: { role: "mark", shown: true }, time: 0.5 * (range[0] + range[1]) }] : shown.marks).filter((mark) => mark.run.shown).map((mark) => ({ x: mark.time, role: mark.run.role, dash: [2, 2], width: 1.5 }));
    return {
      title: `${panel.label} against time${close ? ", close up" : ""}`, x: { label: last ? "time (s)" : "", range, tight: true },
      y: { label: panel.label, zero: true, log: Boolean(panel.range), range: panel.range }, curves, rules, signs: events,
    };
  }

  // --- a model and what moves on it -----------------------------------------------------------------------------------

  const MARKERS = 14, CHUNK = 8, RAYS = 60, ARROW = 56;
  /** A lens opens where hand and tool are this share of the picture apart, or less; its side as a share. */
  const LENS_BELOW = 0.06, LENS_SIDE = 0.36;
  /** The cosine at which the side that the tool is on still faces the eye. */
  const SIDEWAYS = 0.35;

  function drawArrow(g, x, y, toX, toY, role) {
    const length = Math.hypot(toX - x, toY - y), head = Math.min(8, 0.5 * length), angle = Math.atan2(toY - y, toX - x);
    if (length < 2) return;
    g.strokeStyle = g.fillStyle = colour(role);
    g.lineWidth = 2;
    g.beginPath(); g.moveTo(x, y); g.lineTo(toX - 0.7 * head * Math.cos(angle), toY - 0.7 * head * Math.sin(angle)); g.stroke();
    g.beginPath(); g.moveTo(toX, toY);
    for (const side of [2.7, -2.7]) g.lineTo(toX + head * Math.cos(angle + side), toY + head * Math.sin(angle + side));
    g.fill();
  }

  /** A renderer's marker, r px in radius; its shape lies about (17, 6) and is 4 px in radius. */
  function drawMarker(g, shape, [x, y], r) {
    g.save();
    g.translate(x, y); g.scale(r / 4, r / 4); g.translate(-17, -6);
    g.fill(new Path2D(shape));
    g.restore();
  }

  /** The triangles of a solid: normals, middles, and its centre, m. */
  function readMesh({ vertices: text, triangles }) {
    const vertices = columns(text, 3), count = triangles.length / 3, normals = [], middles = [];
    const corner = (k, i) => vertices.map((column) => column[triangles[3 * k + i]]);
    for (let k = 0; k < count; k++) {
      const [a, b, c] = [corner(k, 0), corner(k, 1), corner(k, 2)];
      normals.push(unit(cross(minus(b, a), minus(c, a))));
      middles.push(a.map((x, i) => (x + b[i] + c[i]) / 3));
    }
    const centre = vertices.map((column) => 0.5 * (column.reduce((m, x) => Math.min(m, x)) + column.reduce((m, x) => Math.max(m, x))));
    return { vertices, triangles, normals, middles, count, centre };
  }

  /** The picture of a `Case`: the model, the paths on it, and hand and tools at its time. */
  class Scene {
    constructor(shown, box, title) {
      this.shown = shown;
      this.space = shown.data.dimension === 3;
      const { model } = shown.data;
      this.solid = { rings: model?.rings?.map((ring) => columns(ring, 2)) ?? [], mesh: model?.vertices ? readMesh(model) : null };
      Object.assign(this, this.solid);
      /** Rows are what lies to the right, up, and towards the eye. */
      this.home = this.turn = model?.turn ?? [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
      this.following = this.space;
      this.canvas = element("canvas", { class: "live-canvas", role: "img", "aria-label": title });
      this.still = document.createElement("canvas");  // what does not move, drawn once
      box.append(this.canvas);
      this.resize();
      new ResizeObserver(() => this.resize()).observe(this.canvas);
    }

    resize() {
      const box = this.canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
      if (!box.width || (box.width === this.width && box.height === this.height)) return;
      const first = !this.width, grown = first ? 1 : box.width / this.width;
      [this.width, this.height] = [box.width, box.height];
      for (const canvas of [this.canvas, this.still]) [canvas.width, canvas.height] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
      if (first) this.fit(); else this.scale *= grown;
      this.draw();
    }

    /** Put the model to where the body is at this time; tell whether it moved. */
    placeModel() {
      const { pose } = this.shown, at = pose ? [...pose.rotation, ...pose.translation].map(([x]) => x).join() : "";
      if (at === (this.placedAt ?? "")) return false;
      this.placedAt = at;
      if (!pose) { Object.assign(this, this.solid); return true; }
      const { rings, mesh } = this.solid, { rotation, translation } = pose;
      const rows = (vectors, ...where) => { const [x, y, z] = inWorld([0, 1, 2].map((i) => vectors.map((vector) => vector[i])), ...where); return vectors.map((_, k) => [x[k], y[k], z[k]]); };
      this.rings = rings.map((ring) => inWorld(ring, rotation, translation));
      this.mesh = mesh && {
        ...mesh, vertices: inWorld(mesh.vertices, rotation, translation), normals: rows(mesh.normals, rotation),
        middles: rows(mesh.middles, rotation, translation), centre: rows([mesh.centre], rotation, translation)[0],
      };
      return true;
    }

    // Where things lie in the picture.

    /** A point (columns, row) in the plane of the picture, m. */
    flat(vectors, k) {
      if (!this.space) return [vectors[0][k], vectors[1][k]];
      const [right, up] = this.turn, point = vectors.map((column) => column[k]);
      return [dot(right, point), dot(up, point)];
    }
    depth(vectors, k) { return dot(this.turn[2], vectors.map((column) => column[k])); }
    screen([x, y]) { return [this.width / 2 + (x - this.centre[0]) * this.scale, this.height / 2 - (y - this.centre[1]) * this.scale]; }
    /** A point (columns, row) in pixels. */
    place(vectors, k) { return this.screen(this.flat(vectors, k)); }

    /** Show all paths, and the model where they fill much of it, or nothing moves. */
    fit() {
      this.turn = this.home;
      this.placeModel();
      this.follow();
      const paths = new Bounds(), solid = new Bounds();
      const add = (bounds, vectors) => { for (let k = 0; k < vectors[0].length; k++) bounds.add(this.flat(vectors, k)); };
      for (const run of this.shown.runs.filter((run) => run.near)) for (const vectors of [run.hip, run.ihip]) if (vectors) add(paths, vectors);
      for (const vectors of this.mesh ? [this.mesh.vertices] : this.rings) add(solid, vectors);
      const rests = !(paths.widest > 1e-6);
      if (solid.widest > 0 && this.shown.closed && (rests || this.shown.inWorld || solid.widest < 2.5 * paths.widest)) { paths.add(solid.low); paths.add(solid.high); }
      this.centre = paths.middle;
      const [wide, high] = paths.sides.map((side) => Math.max(side, 1e-6));
      this.scale = this.fitted = 0.86 * Math.min(this.width / wide, (this.height - 20) / high);
    }

    /** Enlarge about a place in pixels, or the middle. */
    zoom(factor, at = [this.width / 2, this.height / 2]) {
      const next = Math.min(Math.max(this.scale * factor, 0.2 * this.fitted), 1e7 * this.fitted);
      const [x, y] = [at[0] - this.width / 2, this.height / 2 - at[1]];
      this.centre = [this.centre[0] + x / this.scale - x / next, this.centre[1] + y / this.scale - y / next];
      this.scale = next;
    }

    /** Where hand and tools are at this time: the middle, and half of the side of the square about them, m; 0 where nothing touches. */
    surroundings() {
      const bounds = new Bounds(), runs = this.shown.visible(), touching = runs.filter((run) => run.now.touches);
      for (const run of touching.length ? touching : runs) for (const vectors of [run.now.hip, run.now.ihip]) if (vectors) bounds.add(this.flat(vectors, 0));
      return { middle: bounds.middle, half: touching.length ? 0.5 * bounds.widest : 0 };
    }

    closeUp() {
      const { middle, half } = this.surroundings();
      this.centre = middle;
      this.scale = half > 0 ? (0.28 * Math.min(this.width, this.height)) / half : 8 * this.fitted;
    }

    // How a solid turns.

    /** Turn the solid, as little as need be, so that the side on which the tool is faces the eye; tell whether it turned. */
    follow() {
      const run = this.shown.visible().find(({ now }) => now.touches) ?? this.shown.visible()[0];
      if (!this.following || !this.mesh || !run) return false;
      const { apart, ihip, hip, touches } = run.now, tool = (ihip ?? hip).map(([x]) => x);
      const outwards = touches && size(apart, 0) > 0 ? apart.map(([x]) => x) : minus(tool, this.mesh.centre);
      if (!Math.hypot(...outwards)) return false;
      const side = unit(outwards), eye = this.turn[2], cosine = dot(side, eye);
      if (cosine >= SIDEWAYS - 1e-9) return false;
      // In the plane of eye and side, the eye goes to where it sees that side under the angle of SIDEWAYS.
      let across = eye.map((x, i) => x - cosine * side[i]);
      if (Math.hypot(...across) < 1e-6) across = this.turn[0];
      across = unit(across);
      this.look(side.map((x, i) => SIDEWAYS * x + Math.sqrt(1 - SIDEWAYS ** 2) * across[i]));
      return true;
    }

    /** Look from a direction, upright: what is to the right lies level, but for a look from straight above. */
    look(eye) {
      let right = [-eye[1], eye[0], 0];
      if (Math.hypot(...right) < 0.05) right = this.turn[0].map((x, i) => x - dot(this.turn[0], eye) * eye[i]);
      right = unit(right);
      this.turn = [right, cross(eye, right), eye];
    }

    /** Turn by angles (rad) about the eye's own axes. */
    rotate(yaw, pitch) {
      const mix = (a, b, angle) => [a.map((x, i) => Math.cos(angle) * x - Math.sin(angle) * b[i]), b.map((x, i) => Math.cos(angle) * x + Math.sin(angle) * a[i])];
      let [right, up, eye] = this.turn;
      [right, eye] = mix(right, eye, yaw);
      [up, eye] = mix(up, eye, pitch);
      this.turn = [right, up, eye];
    }

    // What is drawn.

    /** Begin to draw on a canvas, in pixels of the page. */
    begin(canvas) {
      const ratio = window.devicePixelRatio || 1, g = canvas.getContext("2d");
      g.setTransform(ratio, 0, 0, ratio, 0, 0);
      g.clearRect(0, 0, this.width, this.height);
      g.font = FONT;
      return g;
    }

    draw() {
      if (!this.width) return;
      this.placeModel();
      const g = this.begin(this.still);
      if (this.mesh) this.drawSolid(g); else { this.drawModel(g); this.drawPaths(g); }
      this.drawOffsets(g);
      this.drawMarks(g);
      this.drawEvents(g);
      this.drawCrosses(g);
      this.drawScale(g);
      this.move();
    }

    /** Draw what moves over what does not: hand and tools at this time. */
    move() {
      if (!this.width) return;
      if (this.placeModel() || this.follow()) { this.draw(); return; }
      const g = this.begin(this.canvas);
      g.save();
      g.setTransform(1, 0, 0, 1, 0, 0);  // pixel by pixel
      g.drawImage(this.still, 0, 0);
      g.restore();
      this.drawNow(g, 5);
      this.drawLens(g);
    }

    /** The outline in the plane, filled; rings within it are holes. */
    drawModel(g) {
      g.fillStyle = colour("model");
      g.strokeStyle = colour("ink");
      g.lineWidth = 1.3;
      g.beginPath();
      for (const [x, y] of this.rings) {
        for (let k = 0; k < x.length; k++) g.lineTo(...this.screen([x[k], y[k]]));
        g.closePath();
      }
      g.fill("evenodd");
      g.stroke();
    }

    /** The path of each hand, once where runs share it, and that of each tool, `isTool`. */
    paths() {
      const runs = this.shown.visible(), hands = new Map(), paths = [];
      for (const run of runs) hands.set(run.path, [...(hands.get(run.path) ?? []), run]);
      for (const [, [run, ...others]] of hands) {
        const alone = !others.length && hands.size > 1;
        paths.push({ run, points: run.hip, role: alone ? run.role : "quiet", dash: [], width: 0.9, isTool: false });
      }
      for (const run of runs) if (run.ihip) paths.push({ run, points: run.ihip, role: run.role, dash: run.dash, width: 1.7, isTool: true });
      return paths;
    }

    /** Draw rows of a path; no line leads over a gap, nor where a tool is free. */
    tracePath(g, { run, points, role, width, isTool }, first, end) {
      g.strokeStyle = colour(role);
      g.lineWidth = width;
      g.beginPath();
      for (let k = first; k < end; k++) {
        const breaks = k === first || run.starts.has(k) || (isTool && !(run.touches[k] && run.touches[k - 1]));
        if (breaks) g.moveTo(...this.place(points, k)); else g.lineTo(...this.place(points, k));
      }
      g.stroke();
    }

    drawPaths(g) {
      for (const path of this.paths()) {
        g.setLineDash(path.dash);
        this.tracePath(g, path, 0, path.points[0].length);
      }
      g.setLineDash([]);
    }

    /** Triangles from the farthest to the nearest, with pieces of the paths between them: what lies behind shines through. */
    drawSolid(g) {
      const { vertices, triangles, normals, middles, count } = this.mesh, eye = this.turn[2], parts = [];
      for (let k = 0; k < count; k++) {
        const facing = dot(normals[k], eye);
        if (facing > 0) parts.push([dot(middles[k], eye), () => this.drawTriangle(g, corners, triangles, k, facing)]);
      }
      for (const path of this.paths()) for (let k = 1; k < path.points[0].length; k += CHUNK) {
        const end = Math.min(k + CHUNK, path.points[0].length);
        parts.push([this.depth(path.points, (k + end - 1) >> 1), () => this.tracePath(g, path, k - 1, end)]);
      }
      const corners = Array.from(vertices[0], (_, k) => this.place(vertices, k));
      this.dark = isDark();
      for (const [, drawPart] of parts.sort((a, b) => a[0] - b[0])) drawPart();
    }

    /** One triangle, the lighter the more it faces the eye, on a dark page too. */
    drawTriangle(g, corners, triangles, k, facing) {
      const shade = Math.round(this.dark ? 38 + 46 * facing : 190 + 52 * facing);
      g.fillStyle = `rgba(${shade},${shade + 3},${shade + 8},.62)`;
      g.strokeStyle = this.dark ? "rgba(150,158,170,.16)" : "rgba(110,118,130,.16)";
      g.lineWidth = 0.5;
      g.beginPath();
      for (const corner of [0, 1, 2]) g.lineTo(...corners[triangles[3 * k + corner]]);
      g.closePath();
      g.fill();
      g.stroke();
    }

    /** Markers along the tools' paths; of a run that is alone also the lines from hand to tool. */
    drawOffsets(g) {
      const runs = this.shown.visible();
      if (runs.length === 1 && runs[0].ihip) {
        g.strokeStyle = colour("ray");
        g.lineWidth = 0.8;
        g.beginPath();
        for (const { hip, ihip, touches } of evenly(runs[0], RAYS)) if (touches) { g.moveTo(...this.place(hip, 0)); g.lineTo(...this.place(ihip, 0)); }
        g.stroke();
      }
      runs.forEach((run, k) => {
        g.fillStyle = colour(run.role);
        // Those of different runs stand side by side.
        if (run.ihip) for (const { ihip, touches } of evenly(run, MARKERS, k / runs.length)) if (touches) drawMarker(g, run.shape, this.place(ihip, 0), 3);
      });
    }

    /** A ring where a verdict points, with its number; rings close to each other share what is written. */
    drawMarks(g) {
      const labels = [];
      for (const { run, time, number } of this.shown.marks) {
        if (!run.shown) continue;
        const [x, y] = this.place(run.ihip ?? run.hip, sampleAt(run, time));
        g.strokeStyle = colour(run.role);
        g.lineWidth = 1.6;
        g.beginPath(); g.arc(x, y, 6.5, 0, 2 * Math.PI); g.stroke();
        const label = labels.find((other) => Math.hypot(other.x - x, other.y - y) < 16);
        if (label) label.numbers.push(number); else labels.push({ x, y, numbers: [number] });
      }
      g.fillStyle = colour("ink");
      for (const { x, y, numbers } of labels) g.fillText(numbers.join(","), x + 8, y - 6);
    }

    drawEvents(g) {
      g.font = "15px system-ui, sans-serif";
      g.textAlign = "center";
      for (const run of this.shown.visible()) for (const [time, kind] of run.events) {
        const [x, y] = this.place(run.ihip ?? run.hip, sampleAt(run, time));
        g.fillStyle = colour(run.role);
        g.fillText(EVENTS[kind][0], x, y + 5);
      }
      g.textAlign = "start";
      g.font = FONT;
    }

    /** Crosses where renderers refuse the model. */
    drawCrosses(g) {
      for (const [name, position] of Object.entries(this.shown.crosses)) {
        const [x, y] = this.place(position.map((value) => [value]), 0);
        g.strokeStyle = colour("ihip");
        g.lineWidth = 2;
        g.beginPath(); g.moveTo(x - 5, y - 5); g.lineTo(x + 5, y + 5); g.moveTo(x + 5, y - 5); g.lineTo(x - 5, y + 5); g.stroke();
        g.fillStyle = colour("quiet");
        g.fillText(`${name} refuses`, x + 9, y + 12);
      }
    }

    /** A bar of a round length, in space the coordinates' directions, and how long the arrow of the strongest force is. */
    drawScale(g) {
      g.fillStyle = g.strokeStyle = colour("quiet");
      g.lineWidth = 1;
      if (this.space) this.drawDirections(g);
      const most = ((0.28 * this.width) / this.scale) * MM, power = 10 ** Math.floor(Math.log10(most));
      const mm = [5, 2, 1].map((digit) => digit * power).find((length) => length <= most), pixels = (mm / MM) * this.scale;
      const [x, y] = [10, this.height - 8], [word, factor] = mm >= 0.1 ? ["mm", 1] : mm >= 1e-4 ? ["µm", 1e3] : ["nm", 1e6];
      g.beginPath();
      g.moveTo(x, y - 4); g.lineTo(x, y); g.lineTo(x + pixels, y); g.lineTo(x + pixels, y - 4);
      g.stroke();
      g.fillText(`${digits(factor * mm, 2)} ${word}`, x + 5, y - 5);
      if (!this.shown.strongest) return;
      drawArrow(g, x, y - 26, x + ARROW, y - 26, "quiet");
      g.fillText(`force on the hand: ${digits(this.shown.strongest, 2)} N`, x + ARROW + 6, y - 22);
    }

    drawDirections(g) {
      const [x, y] = [this.width - 38, this.height - 34], [right, up] = this.turn;
      ["y₁", "y₂", "y₃"].forEach((name, c) => {
        g.beginPath(); g.moveTo(x, y); g.lineTo(x + 22 * right[c], y - 22 * up[c]); g.stroke();
        g.fillText(name, x + 30 * right[c] - 5, y - 30 * up[c] + 4);
      });
    }

    /** Hand and tools at this time, with the forces; runs at one place share the hand, r px in radius. */
    drawNow(g, r) {
      const hands = new Set();
      for (const run of this.shown.visible()) {
        const { now } = run, hand = this.place(now.hip, 0), touches = run.ihip && now.touches;
        if (touches) this.drawTool(g, run, hand, r);
        if (now.force) this.drawForce(g, run, this.place(touches ? now.ihip : now.hip, 0));
        const key = hand.map(Math.round).join();
        if (hands.has(key)) continue;
        hands.add(key);
        g.beginPath(); g.arc(...hand, r, 0, 2 * Math.PI);
        g.fillStyle = colour("paper"); g.fill();
        g.strokeStyle = colour("ink"); g.lineWidth = 1.8; g.stroke();
      }
    }

    /** A tool on the surface, and the line from the hand to it. */
    drawTool(g, run, hand, r) {
      const tool = this.place(run.now.ihip, 0);
      g.strokeStyle = colour(run.role);
      g.lineWidth = 1.6;
      g.beginPath(); g.moveTo(...hand); g.lineTo(...tool); g.stroke();
      // A rim of the paper's colour parts it from what lies below.
      for (const [role, radius] of [["paper", r + 2.2], [run.role, r + 0.6]]) { g.fillStyle = colour(role); drawMarker(g, run.shape, tool, radius); }
    }

    /** The force on the hand as an arrow: the largest of all runs is ARROW pixels long. */
    drawForce(g, { now, role }, [x, y]) {
      const [right, up] = this.flat(now.force, 0).map((part) => (ARROW * part) / (this.shown.strongest || 1));
      drawArrow(g, x, y, x + right, y - up, role);
    }

    /** What happens at this time, enlarged, where hand and tool cannot be told apart in the picture. */
    drawLens(g) {
      if (this.space || !this.shown.runs.length) return;
      const { middle, half } = this.surroundings(), side = Math.round(LENS_SIDE * Math.min(this.width, this.height));
      const times = (0.3 * side) / (half * this.scale);
      if (!(half > 0) || half * this.scale > LENS_BELOW * this.width || half < 2 * this.shown.rounding || times < 2) return;
      const hand = this.screen(middle), [x, y] = this.lensCorner(hand, side);
      g.save();
      g.beginPath(); g.rect(x, y, side, side); g.clip();
      g.fillStyle = colour("paper"); g.fillRect(x, y, side, side);
      g.translate(x, y);
      // The same picture about another place, larger.
      const { centre, scale, width, height } = this;
      Object.assign(this, { centre: middle, scale: scale * times, width: side, height: side });
      if (!this.mesh) { this.drawModel(g); this.drawPaths(g); }
      this.drawNow(g, 4);
      Object.assign(this, { centre, scale, width, height });
      g.fillStyle = colour("ink");
      g.fillText(`× ${digits(times, 2)}`, 6, 14);
      g.restore();
      g.strokeStyle = colour("quiet");
      g.lineWidth = 1;
      g.strokeRect(x + 0.5, y + 0.5, side - 1, side - 1);
      const box = Math.max(3, (0.5 * side) / times);
      g.strokeRect(hand[0] - box, hand[1] - box, 2 * box, 2 * box);
    }

    /** The corner for the lens: where it is, as long as the hand is clear of it, or else the farthest from the hand. */
    lensCorner(hand, side) {
      const far = ([x, y]) => Math.hypot(x + side / 2 - hand[0], y + side / 2 - hand[1]);
      if (this.lensAt && far(this.lensAt) > 0.8 * side) return this.lensAt;
      const right = this.width - side - 6;
      const corners = [[right, 6], [6, 6], [right, this.height - side - 6], [6, this.height - side - 40]];
      return (this.lensAt = corners.reduce((best, corner) => (far(corner) > 1.05 * far(best) ? corner : best)));
    }
  }

  // --- the pages ----------------------------------------------------------------------------------------------------

  /** Pixels of a chart of Python's `chart.Chart` that says nothing of it. */
  const USUAL_HEIGHT = 280;
  const scenes = new Set();

  /** What a figure's data say, and a box in their place, before the figure's caption. */
  function readFigure(figure) {
    const script = figure.querySelector("script[type='application/json']"), box = element("div");
    script.before(box);
    return [JSON.parse(script.textContent), box];
  }

  /** A picture that nothing moves: the scene at the time of its document, and the plots below it. */
  function drawStill(figure) {
    const [data, box] = readFigure(figure), shown = new Case(data);
    scenes.add(new Scene(shown, box, data.title));
    const range = data.time === null ? null : closeRange(shown, shown.time);
    const pairs = element("div", { class: range ? "pairs" : "" });
    box.append(pairs);
    data.panels.forEach((panel, k) => {
      const last = k === data.panels.length - 1, holder = () => pairs.appendChild(element("div"));
      new Chart(holder(), panelChart(shown, panel, { last, signs: !k }), 130);
      if (range) new Chart(holder(), panelChart(shown, panel, { range, last, close: true }), 130);
    });
    if (range) box.append(element("p", { class: "quiet close-words" }, closeWords(shown.time)));
  }

  const closeWords = (time) => `right: ${CLOSE_TICKS} ticks to either side of t = ${Number(time.toPrecision(6))} s`;

  /** The charts of a figure; of many that share their axes each in a place of its own, below its title. */
  function drawCharts(figure) {
    const [charts, box] = readFigure(figure), several = figure.classList.contains("multiples");
    for (const spec of charts) {
      const holder = several ? box.appendChild(element("div", {}, element("b", {}, spec.title))) : box;
      new Chart(holder, spec, spec.height ?? USUAL_HEIGHT);
    }
  }

  function drawAll() {
    for (const figure of document.querySelectorAll("figure.still")) drawStill(figure);
    for (const figure of document.querySelectorAll("figure.drawn")) drawCharts(figure);
  }

  /** Draw anew what is on canvas, in the colours that are now those of the page. */
  function recolour() {
    colours.clear();
    for (const scene of scenes) scene.draw();
  }

  // Paper is white, whatever the screen is.
  const onPaper = (paper) => { document.documentElement.classList.toggle("paper", paper); recolour(); };
  addEventListener("beforeprint", () => onPaper(true));
  addEventListener("afterprint", () => onPaper(false));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour);
  if (document.readyState === "loading") addEventListener("DOMContentLoaded", drawAll); else drawAll();

  return { Case, Scene, Chart, EVENTS, MM, CLOSE_TICKS, closeRange, element, svg, sampleAt, size, termValues, panelChart, scenes };
})();
