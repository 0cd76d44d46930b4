// The whole run at full resolution of the page: drag to zoom, double-click to see all, click a name to hide it.
(() => {
  const views = JSON.parse(document.getElementById("closer-data").textContent);
  const section = document.getElementById("closer");
  const holder = section.querySelector(".chart");
  const choice = section.querySelector(".choice");
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  const numbers = (text) => {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    return Array.from({ length: bytes.length / 4 }, (_, k) => view.getFloat32(4 * k, true)).map((v) => (Number.isNaN(v) ? null : v));
  };
  const short = (value) => (value === null || value === undefined ? "–" : value.toPrecision(4).replace("-", "−"));

  const series = (trace) => [
    // The legend has one row for both edges, that of the upper one.
    { label: trace.name, class: "edge", stroke: trace.color, width: 1, points: { show: false } },
    {
      label: trace.name,
      stroke: trace.color,
      width: 1,
      points: { show: false },
      value: (plot, high, index, at) => (at === null ? "–" : `${short(plot.data[index - 1][at])} … ${short(high)}`),
    },
  ];
  // All digits that a mark has: the library rounds to three decimals.
  const values = (_, marks) => marks.map((mark) => String(Number(mark.toPrecision(6))).replace("-", "−"));
  const axis = (label) => ({ label, values, stroke: css("--ink"), grid: { stroke: css("--rule"), width: 1 }, ticks: { stroke: css("--rule") } });

  let plots = [];
  // Charts of one view show the same time.
  const follow = (leader, key) => {
    if (key !== "x") return;
    const { min, max } = leader.scales.x;
    for (const other of plots) {
      const shown = other.scales.x;
      if (other !== leader && (shown.min !== min || shown.max !== max)) other.setScale("x", { min, max });
    }
  };
  const chart = (view, traces, k, all) => {
    const tables = traces.map((trace) => {
      const low = numbers(trace.low);
      return [low.map((_, i) => trace.start + i * trace.step), low, numbers(trace.high)];
    });
    return new uPlot(
      {
        width: holder.clientWidth,
        height: all.length > 1 ? 210 : 380,
        scales: { x: { time: false } },
        axes: [axis(k === all.length - 1 ? "time [s]" : null), { ...axis(view.label), size: 70 }],
        cursor: { drag: { x: true, y: true, uni: 40 }, sync: { key: "closer" } },
        series: [{ label: "time", value: (_, seconds) => (seconds === null ? "–" : `${seconds.toFixed(4)} s`) }, ...traces.flatMap(series)],
        bands: traces.map((trace, i) => ({ series: [2 * i + 2, 2 * i + 1], fill: `${trace.color}66` })),
        hooks: {
          setScale: [follow],
          setSeries: [(one, index, what) => index > 0 && index % 2 === 0 && "show" in what && one.setSeries(index - 1, { show: what.show })],
        },
      },
      uPlot.join(tables),
      holder,
    );
  };
  const show = (view) => {
    plots.forEach((one) => one.destroy());
    plots = [];
    plots = view.charts.map((traces, k, all) => chart(view, traces, k, all));
    holder.dataset.view = view.title;
  };

  views.forEach((view, k) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = view.title;
    button.addEventListener("click", () => {
      choice.querySelectorAll("button").forEach((one) => one.setAttribute("aria-pressed", String(one === button)));
      show(view);
    });
    button.setAttribute("aria-pressed", String(k === 0));
    choice.append(button);
  });
  section.hidden = false;
  show(views[0]);
  new ResizeObserver(() => plots.forEach((one) => one.setSize({ width: holder.clientWidth, height: one.height }))).observe(holder);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => choice.querySelector("[aria-pressed=true]").click());
})();
