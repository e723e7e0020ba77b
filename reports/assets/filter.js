"use strict";
// Search box and filters over the table of every case: a row stays where one of its verdicts is what is asked for, and
// what is asked for stands in the address.
(() => {
  const form = document.querySelector(".filter");
  if (!form) return;
  const words = (standing) => standing.replace("not-applicable", "n/a").replace("-", " ");
  const tiles = [...document.querySelectorAll("#cases .tile")].map((tile) => ({
    tile, renderer: tile.closest("table").rows[0].cells[tile.parentElement.cellIndex].dataset.renderer,
    verdicts: tile.dataset.verdicts.split(" ").filter(Boolean).map((verdict) => [verdict.slice(0, verdict.lastIndexOf("=")), verdict.slice(verdict.lastIndexOf("=") + 1)]),
    look: [tile.className, tile.firstElementChild.textContent, tile.getAttribute("href")],
  }));
  const rows = [...document.querySelectorAll("#cases tbody tr")].map((row) => ({
    row, text: `${row.cells[0].textContent} ${row.closest("details").querySelector("h3").textContent}`.toLowerCase(), tiles: tiles.filter(({ tile }) => row.contains(tile)),
  }));
  const suites = [...document.querySelectorAll("#cases details")].map((suite) => [suite, suite.open]);

  /** Show of a tile the verdict of one check, or what it showed at first. */
  function show({ tile, look }, verdict) {
    const [name, text, href] = verdict ? [`tile standing ${verdict[1]}`, words(verdict[1]), tile.dataset.place + verdict[0]] : look;
    tile.className = name;
    tile.firstElementChild.textContent = text;
    tile.setAttribute("href", href);
    tile.querySelector("small").hidden = Boolean(verdict);
  }

  function apply() {
    const asked = Object.fromEntries([...new FormData(form)].filter(([, value]) => value)), outcomes = asked.outcome?.split(" ");
    const sought = (asked.words ?? "").toLowerCase().split(/\s+/);
    const narrowed = asked.renderer || asked.check || outcomes;
    for (const entry of tiles) {
      const verdict = asked.check && entry.verdicts.find(([check]) => check === asked.check);
      show(entry, verdict);
      entry.meets = (!asked.renderer || entry.renderer === asked.renderer) && (!asked.check || Boolean(verdict))
        && (!outcomes || (verdict ? [verdict] : entry.verdicts).some(([, standing]) => outcomes.includes(standing)));
      entry.tile.classList.toggle("aside", !entry.meets);
      entry.tile.parentElement.hidden = Boolean(asked.renderer) && entry.renderer !== asked.renderer;
    }
    for (const head of document.querySelectorAll("#cases th[data-renderer]")) head.hidden = Boolean(asked.renderer) && head.dataset.renderer !== asked.renderer;
    for (const { row, text, tiles } of rows) {
      row.hidden = !sought.every((word) => text.includes(word)) || (narrowed && !tiles.some((entry) => entry.meets));
      for (const cell of [...row.cells].slice(1)) if (!cell.querySelector(".tile")) cell.hidden = row.closest("table").rows[0].cells[cell.cellIndex].hidden;
    }
    for (const [suite, open] of suites) {
      suite.hidden = !suite.querySelector("tbody tr:not([hidden])");
      suite.open = open || Object.keys(asked).length > 0;
    }
    form.querySelector("output").textContent = `${rows.filter(({ row }) => !row.hidden).length} of ${rows.length} cases`;
    return asked;
  }

  function remember() {
    const query = String(new URLSearchParams(apply()));
    history.replaceState(null, "", (query ? `?${query}` : location.pathname) + location.hash);
  }

  for (const [name, value] of new URLSearchParams(location.search)) if (form.elements[name]) form.elements[name].value = value;
  form.hidden = false;
  form.addEventListener("input", remember);
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("reset", () => setTimeout(remember));
  apply();
})();
