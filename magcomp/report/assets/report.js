// Draws the figures of the page, in the colours of its light, dark or printed form.
(() => {
  "use strict";
  const PALETTES = {
    light: {
      "@before": "#d55e00", "@after": "#0b66b0", "@before-soft": "rgba(213,94,0,.14)",
      "@after-soft": "rgba(11,102,176,.16)", "@shade": "rgba(90,101,115,.08)",
      "@ink": "#1b2430", "@muted": "#5a6573", "@grid": "#e2e6eb",
      "@x": "#0b66b0", "@y": "#c2410c", "@z": "#00795c",
      "@scale": [[0, "#cdbfe6"], [0.5, "#7e62b8"], [1, "#2e1065"]],
    },
    dark: {
      "@before": "#f2935a", "@after": "#62b3f5", "@before-soft": "rgba(242,147,90,.18)",
      "@after-soft": "rgba(98,179,245,.22)", "@shade": "rgba(154,166,180,.10)",
      "@ink": "#e5e9ee", "@muted": "#9aa6b4", "@grid": "#2c343e",
      "@x": "#62b3f5", "@y": "#f2935a", "@z": "#4cc9a0",
      "@scale": [[0, "#4d3f74"], [0.5, "#9a83d4"], [1, "#efe6ff"]],
    },
  };
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const touch = matchMedia("(pointer: coarse)");
  const root = document.documentElement;
  const canvases = [...document.querySelectorAll(".canvas")];
  // Widths in print, where the page cannot be measured before it is laid out.
  const PRINT = { wide: 690, beside: 385, half: 335 };

  // "@scale:0.25" is the colour a quarter of the way along the scale.
  const between = (scale, share) => {
    const next = Math.max(1, scale.findIndex(([at]) => at >= share));
    const [[low, from], [high, to]] = [scale[next - 1], scale[next]];
    const part = (share - low) / (high - low);
    const channel = (colour, k) => parseInt(colour.slice(1 + 2 * k, 3 + 2 * k), 16);
    return `rgb(${[0, 1, 2].map((k) => Math.round(channel(from, k) * (1 - part) + channel(to, k) * part))})`;
  };

  const colour = (name, palette) => {
    const [token, share] = name.split(":");
    const found = palette[token] ?? name;
    return share === undefined ? found : between(found, Number(share));
  };

  const coloured = (node, palette) => {
    if (typeof node === "string") return node[0] === "@" ? colour(node, palette) : node;
    if (Array.isArray(node)) return node.map((item) => coloured(item, palette));
    if (node === null || typeof node !== "object") return node;
    return Object.fromEntries(Object.entries(node).map(([k, v]) => [k, coloured(v, palette)]));
  };

  const figure = (canvas, theme, size = {}) => {
    const { data, layout } = coloured(figures[canvas.id], PALETTES[theme]);
    const palette = PALETTES[theme];
    const family = getComputedStyle(document.body).fontFamily;
    return {
      data,
      layout: {
        paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
        font: { family, size: 12, color: palette["@ink"] },
        modebar: { bgcolor: "rgba(0,0,0,0)", color: palette["@muted"], activecolor: palette["@ink"], orientation: "v" },
        hoverlabel: { font: { family } },
        dragmode: layout.scene ? "orbit" : touch.matches ? false : "zoom",
        ...layout, ...size,
      },
      config: {
        displaylogo: false, responsive: !size.width, scrollZoom: false,
        displayModeBar: Boolean(layout.scene) && !touch.matches,
        modeBarButtons: [["orbitRotation", "zoom3d", "pan3d", "resetCameraDefault3d"]],
      },
    };
  };

  const fail = (canvas, error) => {
    canvas.classList.add("failed");
    canvas.textContent = "This picture could not be drawn here: " + error.message;
    canvas.dataset.state = "failed";
    root.dataset.failed = canvas.id + ": " + error.message;
  };

  const theme = () => (dark.matches ? "dark" : "light");

  const draw = async (canvas) => {
    try {
      const { data, layout, config } = figure(canvas, theme());
      // A picture in space fills its height, so a narrow one must be lower.
      if (layout.scene) canvas.style.maxHeight = `${Math.round(canvas.clientWidth * 0.95)}px`;
      await Plotly.newPlot(canvas, data, layout, config);
      canvas.dataset.state = "drawn";
      // What a graphics card drew does not print, so such a figure keeps a picture of itself.
      if (layout.scene) await picture(canvas);
    } catch (error) { fail(canvas, error); }
  };

  const picture = async (canvas) => {
    const size = { width: 560, height: 430 };
    const image = new Image();
    image.alt = canvas.getAttribute("aria-label");
    image.src = await Plotly.toImage(figure(canvas, "light", size), { format: "png", scale: 2, ...size });
    canvas.after(image);
    canvas.parentNode.classList.add("imaged");
  };

  const redraw = (canvas, as, size) => {
    if (canvas.dataset.state !== "drawn" || (size && figures[canvas.id].layout.scene)) return;
    const { data, layout, config } = figure(canvas, as, size);
    Plotly.react(canvas, data, layout, config);
  };

  const tabs = [...document.querySelectorAll("[role=tab]")];
  const select = (chosen) => {
    for (const tab of tabs) {
      const here = tab === chosen;
      tab.setAttribute("aria-selected", here);
      tab.tabIndex = here ? 0 : -1;
      document.getElementById(tab.getAttribute("aria-controls")).hidden = !here;
    }
  };
  tabs.forEach((tab, index) => {
    tab.addEventListener("click", () => select(tab));
    tab.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step) return;
      const next = tabs[(index + step + tabs.length) % tabs.length];
      select(next);
      next.focus();
    });
  });
  if (tabs.length) { root.classList.add("tabbed"); select(tabs[0]); }

  dark.addEventListener("change", () => canvases.forEach((c) => redraw(c, theme())));
  addEventListener("beforeprint", () => canvases.forEach((c) => {
    const place = c.closest(".wide") ? "wide" : c.closest(".beside") ? "beside" : "half";
    redraw(c, "light", { width: PRINT[place], height: c.clientHeight, autosize: false });
  }));
  addEventListener("afterprint", () => canvases.forEach((c) => redraw(c, theme())));

  const idle = () => new Promise((go) => ("requestIdleCallback" in window)
    ? requestIdleCallback(go, { timeout: 200 }) : setTimeout(go, 20));
  (async () => {
    for (const canvas of canvases) { await idle(); await draw(canvas); }
    root.dataset.drawn = canvases.filter((c) => c.dataset.state === "drawn").length;
  })();
})();
