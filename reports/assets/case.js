"use strict";
// Moves what `draw.js` draws of a case: a slider over time, renderers that are shown by a tick, a scene that turns.
(() => {
  const { Case, Scene, Chart, EVENTS, MM, CLOSE_TICKS, closeRange, element, sampleAt, size, termValues, panelChart, scenes } = Drawing;
  const HEADINGS = ["renderer", "|IHIP − HIP| (mm)", "force (N)", "HIP (mm)", "IHIP (mm)"];
  const SPEEDS = [0.01, 0.1, 0.25, 1, 4, 20];
  /** Seconds that a run takes at most when it is played at the speed that is chosen at first. */
  const PLAYING_SECONDS = 14;

  // --- the scene, worked by hand ------------------------------------------------------------------------------------

  /** The buttons above a scene: enlarge it, and turn a solid. */
  function sceneButtons(scene) {
    const button = (text, label, act) => element("button", {
      type: "button", "aria-label": /\w/.test(text) ? null : label, title: label, onclick: () => { act(); scene.draw(); },
    }, text);
    const bar = element("div", { class: "zoom", role: "group", "aria-label": "view of the model" },
      button("+", "zoom in", () => scene.zoom(1.6)), button("−", "zoom out", () => scene.zoom(1 / 1.6)),
      button("hand", "close up on the hand", () => scene.closeUp()),
      button("all", "show everything", () => { follow(scene.space); scene.fit(); }));
    if (scene.shown.moving) {
      // Of a body that moves the world is shown, or on demand the body at rest, as checks read it.
      const bodyButton = button("body", "hold the body still", () => {
        scene.shown.showWorld(!scene.shown.inWorld);
        bodyButton.setAttribute("aria-pressed", String(!scene.shown.inWorld));
        scene.fit();
        scene.changed();
      });
      bodyButton.setAttribute("aria-pressed", "false");
      bar.append(bodyButton);
    }
    if (!scene.space) return [bar, () => {}];
    const followButton = button("follow", "turn the solid so that the tool stays in sight", () => follow(!scene.following));
    function follow(on) {
      scene.following = on;
      followButton.setAttribute("aria-pressed", String(on));
    }
    follow(true);
    const turn = (text, label, yaw, pitch) => button(text, label, () => { follow(false); scene.rotate(yaw, pitch); });
    bar.append(followButton, turn("←", "turn to the left", -0.3, 0), turn("→", "turn to the right", 0.3, 0),
      turn("↑", "tilt up", 0, -0.3), turn("↓", "tilt down", 0, 0.3));
    return [bar, () => follow(false)];
  }

  /** A drag turns a solid and moves a plane, as it does a solid with the shift key; the wheel enlarges with ctrl. */
  function listenToPointer(scene, turned) {
    const { canvas } = scene;
    let last = null, moved = false;
    canvas.addEventListener("pointerdown", (event) => {
      [last, moved] = [[event.offsetX, event.offsetY], false];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!last) return;
      const [dx, dy] = [event.offsetX - last[0], event.offsetY - last[1]];
      if (!moved && Math.hypot(dx, dy) < 3) return;
      [last, moved] = [[event.offsetX, event.offsetY], true];
      if (scene.space && !event.shiftKey) { turned(); scene.rotate(0.01 * dx, 0.01 * dy); }
      else scene.centre = [scene.centre[0] - dx / scene.scale, scene.centre[1] + dy / scene.scale];
      scene.draw();
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { last = null; });
    const zoom = (factor, event) => { scene.zoom(factor, [event.offsetX, event.offsetY]); scene.draw(); };
    canvas.addEventListener("dblclick", (event) => zoom(2, event));
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      zoom(Math.exp(-0.004 * event.deltaY), event);
    }, { passive: false });
  }

  // --- the plots against time ---------------------------------------------------------------------------------------

  /** All plots of a case, which share the part of the time that is in view. */
  class Plots {
    constructor(view, box) {
      this.view = view;
      this.range = null;
      this.panels = view.shown.data.panels;
      const height = Math.round(Math.max(150, Math.min(210, 460 / this.panels.length)));
      const holder = element("div", { class: "live-plots" });
      box.append(holder);
      this.charts = this.panels.map((panel, k) => this.chart(element("div"), panel, k, height, holder));
    }

    spec(panel, k) {
      const { shown } = this.view, last = k === this.panels.length - 1;
      return panelChart(shown, panel, { range: this.range ?? [shown.start, shown.end > shown.start ? shown.end : shown.start + 1e-3], last, signs: !k });
    }

    chart(box, panel, k, height, holder) {
      holder.append(box);
      const line = element("div", { class: "now-line" }), drag = element("div", { class: "drag", hidden: true });
      box.className = "plot-box";
      const chart = new Chart(box, this.spec(panel, k), height + (k === this.panels.length - 1 ? 18 : 0), { drawn: (drawn) => this.moveLine(drawn, line) });
      box.append(line, drag);
      chart.line = line;
      const { picture } = chart, { shown } = this.view;
      for (const [name, value] of Object.entries({ role: "slider", tabindex: 0, "aria-label": `${panel.label} against time`, "aria-valuemin": shown.start, "aria-valuemax": shown.end })) picture.setAttribute(name, value);
      picture.addEventListener("keydown", (event) => this.view.keys(event));
      this.listen(chart, drag);
      return chart;
    }

    /** A click goes to its time; a drag shows that part of the time alone, and a double click all of it again. */
    listen(chart, drag) {
      const { picture } = chart;
      let from = null;
      const placeOf = (event) => Math.min(Math.max(event.clientX - picture.getBoundingClientRect().left, chart.box.left), chart.box.right);
      picture.addEventListener("pointerdown", (event) => { from = placeOf(event); picture.setPointerCapture(event.pointerId); });
      picture.addEventListener("pointermove", (event) => {
        if (from === null) return;
        const to = placeOf(event);
        drag.hidden = Math.abs(to - from) < 6;
        drag.style.left = `${Math.min(from, to)}px`;
        drag.style.width = `${Math.abs(to - from)}px`;
      });
      picture.addEventListener("pointerup", (event) => {
        if (from === null) return;
        const ends = [from, placeOf(event)].sort((a, b) => a - b).map(chart.x.value);
        if (drag.hidden) this.view.go(ends[0]); else this.show(ends);
        drag.hidden = true;
        from = null;
      });
      picture.addEventListener("pointercancel", () => { drag.hidden = true; from = null; });
      picture.addEventListener("dblclick", () => this.show(null));
    }

    show(range) { this.range = range; this.draw(); }
    draw() { this.charts.forEach((chart, k) => chart.show(this.spec(this.panels[k], k))); this.move(); }

    moveLine(chart, line) {
      const x = chart.x.place(this.view.shown.time), inside = x >= chart.box.left - 1 && x <= chart.box.right + 1;
      line.hidden = !inside;
      line.style.transform = `translateX(${x}px)`;
      line.style.height = `${chart.box.bottom - chart.box.top}px`;
      line.style.bottom = `${chart.height - chart.box.bottom}px`;
    }

    move() {
      const { shown } = this.view;
      this.charts.forEach((chart, k) => {
        this.moveLine(chart, chart.line);
        const values = shown.visible().map((run) => [run, termValues(run, this.panels[k].terms[0][0])]).filter(([, numbers]) => numbers);
        const words = values.map(([run, numbers]) => `${run.name} ${Number(numbers[sampleAt(run, shown.time)].toPrecision(3))}`);
        chart.picture.setAttribute("aria-valuenow", shown.time);
        chart.picture.setAttribute("aria-valuetext", `${this.view.words(shown.time)}: ${words.join(", ")}`);
      });
    }
  }

  /** The plots of some ticks to either side of a verdict's place, side by side; a click goes to its time. */
  class CloseUp {
    constructor(view, box) {
      Object.assign(this, { view, box, charts: [] });
      this.words = element("figcaption", {});
      this.holder = element("div", { class: "live-plots" });
      box.append(this.words, this.holder);
    }

    /** Show the ticks round a time; nothing of a run that is not much longer. */
    show(time) {
      this.time = time;
      this.range = closeRange(this.view.shown, time);
      this.box.hidden = !this.range;
      if (this.range) this.draw();
    }

    draw() {
      if (!this.range) return;
      const { shown } = this.view;
      this.words.textContent = `${CLOSE_TICKS} ticks to either side of t = ${Number(this.time.toPrecision(6))} s`;
      shown.data.panels.forEach((panel, k) => {
        const spec = panelChart(shown, panel, { range: this.range, last: true, close: true });
        if (this.charts[k]) { this.charts[k].show(spec); return; }
        const holder = this.holder.appendChild(element("div"));
        this.charts[k] = new Chart(holder, spec, 190);
        holder.addEventListener("click", (event) => {
          const chart = this.charts[k];
          this.view.go(chart.x.value(event.clientX - chart.picture.getBoundingClientRect().left));
        });
      });
    }
  }

  // --- the page of a case -------------------------------------------------------------------------------------------

  class View {
    constructor(section, data) {
      this.section = section;
      this.shown = new Case(data);
      const { runs } = this.shown;
      for (const box of this.boxes()) for (const run of runs) if (run.number === Number(box.dataset.run)) run.shown = box.checked;
      this.times = [...new Set(runs.flatMap((run) => [...run.time]))].sort((a, b) => a - b);
      this.verdicts = [...section.querySelectorAll(".check li[data-time]")];
      this.shown.marks = this.marks();
      const views = section.querySelector(".views"), plane = views.querySelector(".plane");
      this.addTransport(views);
      section.classList.add("live");
      this.addScene(plane);
      this.plots = new Plots(this, views.querySelector(".plots"));
      this.closeUp = new CloseUp(this, section.querySelector(".closeup"));
      for (const box of this.boxes()) box.addEventListener("change", () => this.choose(box));
      this.linkVerdicts();
      const worst = document.getElementById(section.dataset.worst)?.closest("li[data-time]");
      worst?.classList.add("current");
      this.addTable();
      if (worst) this.closeUp.show(Number(worst.dataset.time));
      this.go(worst ? Number(worst.dataset.time) : this.shown.start);
    }

    boxes() { return [...this.section.querySelectorAll(".runs-shown input")]; }
    boxOf(run) { return this.boxes().find((box) => Number(box.dataset.run) === run.number); }

    /** The places of verdicts with a number in the figures, each number once. */
    marks() {
      const numbered = new Map(this.verdicts.filter((verdict) => verdict.dataset.mark).map((verdict) => [verdict.dataset.mark, verdict]));
      return [...numbered].map(([number, { dataset }]) => ({
        number, time: Number(dataset.time), run: this.shown.runs.find((run) => run.number === Number(dataset.run)),
      })).filter((mark) => mark.run);
    }

    addScene(plane) {
      this.scene = new Scene(this.shown, plane, this.shown.data.title);
      const [bar, turned] = sceneButtons(this.scene);
      this.scene.changed = () => { this.plots.draw(); this.closeUp.draw(); this.fillValues(); };
      // What is taller than the window is held by its lower edge.
      const stage = this.section.querySelector(".stage"), hold = () => { stage.style.top = `${Math.min(10, innerHeight - stage.offsetHeight - 10)}px`; };
      new ResizeObserver(hold).observe(stage);
      addEventListener("resize", hold);
      this.scene.canvas.before(bar);
      listenToPointer(this.scene, turned);
      scenes.add(this.scene);
    }

    /** The time of a verdict becomes a link that goes there. */
    linkVerdicts() {
      for (const verdict of this.verdicts) {
        const time = verdict.querySelector("i"), link = element("a", { class: "jump", href: `#${verdict.id}` }, time.textContent);
        link.addEventListener("click", (event) => { event.preventDefault(); history.replaceState(null, "", link.hash); this.jump(verdict); });
        time.replaceWith(link);
      }
    }

    choose(box) {
      const run = this.shown.runs.find(({ number }) => number === Number(box.dataset.run));
      if (run) run.shown = box.checked;
      this.scene.draw();
      this.plots.draw();
      this.closeUp.draw();
      this.fillTable();
    }

    /** Below the views: what plays and moves the time, and the values at it. */
    addTransport(views) {
      const { shown } = this, span = shown.end - shown.start;
      this.range = element("input", { type: "range", min: shown.start, max: shown.end, step: "any", "aria-label": "time", oninput: () => this.go(Number(this.range.value)) });
      this.range.addEventListener("keydown", (event) => this.keys(event));
      this.clock = element("output", { class: "clock" });
      this.button = element("button", { type: "button", class: "play", "aria-label": "play", onclick: () => (this.playing ? this.stop() : this.play()) }, "▶");
      const usual = SPEEDS.find((speed) => span / speed <= PLAYING_SECONDS) ?? SPEEDS.at(-1);
      this.speed = element("select", { "aria-label": "speed" }, ...SPEEDS.map((speed) => element("option", { value: speed, selected: speed === usual }, `${speed} ×`)));
      const ticks = [...new Map(shown.marks.map((mark) => [mark.time, mark])).values()].map((mark) =>
        element("i", { style: `left:${(100 * (mark.time - shown.start)) / (span || 1)}%;background:var(--fig-${mark.run.role})` }));
      this.values = element("table", { class: "now" });
      views.after(
        element("div", { class: "transport" }, this.button,
          element("div", { class: "track" }, element("div", { class: "ticks", "aria-hidden": "true" }, ...ticks), this.range), this.clock, this.speed),
        element("div", { class: "scroll-now", tabindex: "0", role: "region", "aria-label": "values at this time" }, this.values));
      const kinds = Object.keys(EVENTS).filter((kind) => shown.runs.some((run) => run.events.some((event) => event[1] === kind)));
      if (kinds.length) views.append(element("p", { class: "event-key quiet" }, kinds.map((kind) => EVENTS[kind].join(" ")).join(" · ")));
      if (shown.runs.length > shown.visible().length) this.addShowAll();
    }

    addShowAll() {
      const all = element("button", { type: "button", onclick: () => {
        for (const box of this.boxes()) if (!box.disabled) { box.checked = true; this.choose(box); }
        all.remove();
      } }, "show all");
      this.section.querySelector(".runs-shown").append(all);
    }

    keys(event) {
      const at = sampleAt({ time: this.times }, this.shown.time), last = this.times.length - 1, page = Math.max(1, Math.round(last / 20));
      const to = { ArrowRight: at + 1, ArrowUp: at + 1, ArrowLeft: at - 1, ArrowDown: at - 1, PageUp: at + page, PageDown: at - page, Home: 0, End: last }[event.key];
      if (to === undefined) return;
      event.preventDefault();
      this.go(this.times[Math.min(Math.max(to, 0), last)]);
    }

    words(time) { return `${time.toFixed(this.shown.end - this.shown.start > 1e-1 ? 3 : 6)} s`; }

    go(time) {
      this.shown.go(time);
      this.range.value = this.shown.time;
      const words = this.words(this.shown.time);
      this.range.setAttribute("aria-valuetext", words);
      this.clock.textContent = `t = ${words}`;
      this.scene.move();
      this.plots.move();
      this.fillValues();
    }

    /** The table of values: a row a renderer that is shown. */
    addTable() {
      this.body = element("tbody");
      this.values.append(element("thead", {}, element("tr", {}, ...HEADINGS.map((text) => element("th", { scope: "col" }, text)))), this.body);
      this.fillTable();
    }

    fillTable() {
      this.rows = this.shown.visible().map((run) => {
        const cells = HEADINGS.slice(1).map((heading) => element("td", { "data-heading": heading })), swatch = this.boxOf(run)?.parentElement.querySelector("svg")?.cloneNode(true);
        return { run, cells, row: element("tr", {}, element("th", { scope: "row" }, swatch ?? "", ` ${run.name}`), ...cells) };
      });
      this.body.replaceChildren(...this.rows.map(({ row }) => row));
      this.fillValues();
    }

    fillValues() {
      const point = (vectors) => (vectors ? vectors.map(([x]) => (MM * x).toFixed(3).replace("-", "−")).join(", ") : "–");
      for (const { run: { now, depthDecimals, forceDecimals }, cells } of this.rows) {
        cells[0].textContent = now.apart ? (MM * size(now.apart, 0)).toFixed(depthDecimals) : "–";
        cells[1].textContent = now.force ? size(now.force, 0).toFixed(forceDecimals) : "–";
        cells[2].textContent = point(!now.gap && now.hip);
        cells[3].textContent = point(!now.gap && now.ihip);
      }
    }

    play() {
      this.setPlaying(true);
      if (this.shown.time >= this.shown.end) this.go(this.shown.start);
      let last = performance.now();
      const frame = (now) => {
        if (!this.playing) return;
        this.go(this.shown.time + ((now - last) / 1000) * Number(this.speed.value));
        last = now;
        if (this.shown.time >= this.shown.end) this.stop(); else requestAnimationFrame(frame);
      };
      requestAnimationFrame(frame);
    }
    stop() { this.setPlaying(false); }
    setPlaying(playing) {
      this.playing = playing;
      this.button.textContent = playing ? "❚❚" : "▶";
      this.button.setAttribute("aria-label", playing ? "pause" : "play");
    }

    /** Go to the place of a verdict, and show its renderer. */
    jump(verdict) {
      this.stop();
      const box = this.boxes().find(({ dataset }) => dataset.run === verdict.dataset.run);
      if (box && !box.checked) { box.checked = true; this.choose(box); }
      for (const current of this.section.querySelectorAll(".check li.current")) current.classList.remove("current");
      verdict.classList.add("current");
      this.closeUp.show(Number(verdict.dataset.time));
      this.go(Number(verdict.dataset.time));
      const views = this.section.querySelector(".views"), { top, bottom } = views.getBoundingClientRect();
      if (bottom < 80 || top > innerHeight - 80) views.scrollIntoView({ block: "start" });
    }
  }

  // --- one case on its page, or all of them on one --------------------------------------------------------------------

  const views = new Map();

  function begin(section) {
    const script = section.querySelector("script.case-data");
    if (!views.has(section) && script) views.set(section, new View(section, JSON.parse(script.textContent)));
    return views.get(section);
  }

  /** Go to the verdict that the address names. */
  function followAddress() {
    const name = location.hash.slice(1);
    const target = name && (document.getElementById(name) ?? document.getElementById(decodeURIComponent(name)));
    const section = target && target.closest(".one-case");
    if (!section || target === section) return;
    const view = begin(section), verdict = target.closest(".check li[data-time]");
    if (view && verdict) view.jump(verdict);
  }

  function start() {
    const sections = [...document.querySelectorAll(".one-case")];
    if (sections.length === 1) begin(sections[0]);
    else {
      // Of many cases each begins where it comes into sight, and all of them for paper.
      const watch = new IntersectionObserver((entries) => {
        for (const { isIntersecting, target } of entries) if (isIntersecting) { watch.unobserve(target); begin(target); }
      }, { rootMargin: "300px" });
      sections.forEach((section) => watch.observe(section));
      addEventListener("beforeprint", () => sections.forEach(begin));
    }
    followAddress();
    document.documentElement.dataset.ready = String(Math.round(performance.now()));
  }

  addEventListener("hashchange", followAddress);
  if (document.readyState === "loading") addEventListener("DOMContentLoaded", start); else start();
})();
