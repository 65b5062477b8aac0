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
  // Sizes in print, where the page cannot be measured before it is laid out.
  const PRINT = { wide: 690, beside: 385, half: 335, low: 300, high: 380 };

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

  // docs/method.md, Equation 6: a raw reading at a control quantity, corrected.
  const corrected = (at, u, { soft_iron, offset, motor }) => soft_iron.map((row, k) =>
    row.reduce((sum, weight, j) => sum + weight * (at[j] + offset[j]), motor[k] * u));

  // What a figure shows where its slider and switch stand: points carried along the line of
  // centres to the slider's place, or corrected, each at the control quantity it belongs to.
  const played = ({ data, layout, play }, { u, mode }) => {
    const moved = data.map((trace, index) => {
      const own = play.u[index] === "color" ? trace.marker.color : play.u[index];
      const carried = own === null || (mode === "raw" && play.u[index] === "color");
      const points = trace.x.map((x, k) => {
        if (x === null) return [null, null, null];
        const there = own === null ? 0 : Array.isArray(own) ? own[k] : own;
        const at = [x, trace.y[k], trace.z[k]];
        const raw = carried ? at.map((v, j) => v + play.slope[j] * (u - there)) : at;
        return mode === "corrected" ? corrected(raw, own === null ? u : there, play) : raw;
      });
      const [x, y, z] = [0, 1, 2].map((j) => points.map((point) => point[j]));
      const style = trace.mode === "lines" ? "line" : "marker";
      const colour = own === null && mode === "corrected" ? { color: "@after" } : {};
      return { ...trace, x, y, z, [style]: { ...trace[style], ...colour } };
    });
    if (mode !== "corrected") return { data: moved, layout };
    // The corrected field stands about zero.
    const centred = ({ range: [low, high], ...axis }) => ({ ...axis, range: [(low - high) / 2, (high - low) / 2] });
    const scene = ({ xaxis, yaxis, zaxis, ...more }) =>
      ({ ...more, xaxis: centred(xaxis), yaxis: centred(yaxis), zaxis: centred(zaxis) });
    return { data: moved, layout: { ...layout, scene: scene(layout.scene), scene2: scene(layout.scene2) } };
  };

  const states = {};

  const figure = (canvas, theme, size = {}) => {
    const stored = figures[canvas.id];
    const shown = states[canvas.id] ? played(stored, states[canvas.id]) : stored;
    const { data, layout } = coloured(shown, PALETTES[theme]);
    // Beside each other two pictures in space are too small on a phone.
    if (layout.scene2 && (size.width ?? canvas.clientWidth) < 560) stacked(data, layout);
    const palette = PALETTES[theme];
    const family = getComputedStyle(document.body).fontFamily;
    return {
      data,
      layout: {
        paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
        font: { family, size: 12, color: palette["@ink"] },
        modebar: { bgcolor: "rgba(0,0,0,0)", color: palette["@muted"], activecolor: palette["@ink"], orientation: "v" },
        hoverlabel: { font: { family } },
        uirevision: "kept",
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

  const stacked = (data, layout) => {
    layout.scene.domain = { x: [0, 0.9], y: [0.42, 1] };
    layout.scene2.domain = { x: [0, 0.9], y: [0, 0.36] };
    // Titles of axes are cut at the edges of a picture, so it is looked at from further away.
    for (const [scene, further] of [[layout.scene, 1.7], [layout.scene2, 1.1]]) {
      for (const axis of "xyz") {
        scene.camera.eye[axis] *= further;
        scene[axis + "axis"].title.text = scene[axis + "axis"].title.text.split(" ")[0];
      }
    }
    for (const trace of data) if (trace.marker?.colorbar) Object.assign(trace.marker.colorbar, { x: 0.88, y: 0.72, len: 0.42 });
    Object.assign(layout.annotations[0], { x: 0.5, y: 0.38, text: layout.annotations[0].text + ", mGauss" });
  };

  const fail = (canvas, error) => {
    canvas.classList.add("failed");
    canvas.textContent = "This picture could not be drawn here: " + error.message;
    canvas.dataset.state = "failed";
    root.dataset.failed = canvas.id + ": " + error.message;
  };

  const theme = () => (dark.matches ? "dark" : "light");

  // The library that draws is in the page as packed text.
  const unpack = async () => {
    const packed = document.getElementById("plotly").textContent;
    const bytes = Uint8Array.from(atob(packed), (sign) => sign.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const script = document.createElement("script");
    script.textContent = await new Response(stream).text();
    document.head.append(script);
  };

  const draw = async (canvas) => {
    try {
      const { data, layout, config } = figure(canvas, theme());
      // A picture in space fills its height: a narrow one must be lower, two need twice as much.
      if (layout.scene2 && canvas.clientWidth < 560) canvas.style.height = "560px";
      else if (layout.scene) canvas.style.maxHeight = `${Math.round(canvas.clientWidth * 0.95)}px`;
      await Plotly.newPlot(canvas, data, layout, config);
      canvas.dataset.state = "drawn";
      // What a graphics card drew does not print, so such a figure keeps a picture of itself.
      if (layout.scene) await picture(canvas);
    } catch (error) { fail(canvas, error); }
  };

  const picture = async (canvas) => {
    const size = figures[canvas.id].layout.scene2 ? { width: 1000, height: 430 } : { width: 560, height: 430 };
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

  // Degrees as magcomp's sentences have them.
  const degrees = (value) => `${value.toFixed(value >= 9.95 ? 0 : value >= 0.1 ? 1 : 2)}°`;

  // A column of the table of heading errors at any control quantity, between its rows.
  const tabled = (rows, u, name) => {
    const next = Math.max(1, rows.findIndex((row) => row.u >= u - 1e-9));
    const [low, high] = [rows[next - 1], rows[next]];
    return low[name] + (high[name] - low[name]) * (u - low.u) / (high.u - low.u);
  };

  const result = document.getElementById("result");
  const compasses = result ? JSON.parse(result.textContent).compasses ?? [] : [];

  const prepare = (block) => {
    const { heading_error_deg, quoted, verdict } = compasses[block.dataset.index];
    const rows = [...heading_error_deg.filter((row) => row.u !== quoted.u), quoted].sort((a, b) => a.u - b.u);
    const slider = block.querySelector("input[type=range]");
    const canvas = [...block.querySelectorAll(".canvas")].find((c) => figures[c.id].play);
    let waiting = false;
    const say = () => {
      const mode = block.querySelector("input[type=radio]:checked").value;
      // The slider has steps; where it was not moved it stands for the quoted row itself.
      const shown = slider.dataset.moved ? Number(slider.value) : quoted.u * slider.dataset.scale;
      const u = shown / slider.dataset.scale;
      states[canvas.id] = { u: shown, mode };
      const bound = tabled(rows, u, "p95");
      const fitted = mode === "corrected";
      const error = fitted ? bound : Math.max(tabled(rows, u, "before"), bound);
      const known = !fitted && error === bound;
      const where = `${Math.round(shown)} ${slider.dataset.unit}`;
      const which = !fitted ? "the correction in force" : verdict === "rejected" ? "numbers that are not to be trusted" : "the new numbers";
      block.classList.toggle("corrected", fitted);
      block.querySelector("output").textContent = where;
      block.querySelector(".compass .said").textContent =
        `At ${where}, with ${which}, the heading is ${fitted || known ? "at most" : "up to"} ${degrees(error)} wrong: the wedge is where the needle can point, the needle its edge.`;
      const turn = Math.min(error, 180), [x, y] = [Math.sin, Math.cos].map((f) => 96 * f(turn * Math.PI / 180));
      block.querySelector(".wedge").setAttribute("d", `M0 0L${-x} ${-y}A96 96 0 ${turn > 90 ? 1 : 0} 1 ${x} ${-y}z`);
      block.querySelector(".hand").setAttribute("transform", `rotate(${turn})`);
    };
    block.addEventListener("input", (event) => {
      if (event.target === slider) slider.dataset.moved = true;
      say();
      if (waiting) return;
      waiting = true;
      requestAnimationFrame(() => { waiting = false; redraw(canvas, theme()); });
    });
    say();
  };
  document.querySelectorAll(".play").forEach(prepare);
  root.classList.add("scripted");

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
    redraw(c, "light", { width: PRINT[place], height: Math.min(c.clientHeight, place === "wide" ? PRINT.high : PRINT.low), autosize: false });
  }));
  addEventListener("afterprint", () => canvases.forEach((c) => redraw(c, theme())));

  const idle = () => new Promise((go) => ("requestIdleCallback" in window)
    ? requestIdleCallback(go, { timeout: 200 }) : setTimeout(go, 20));
  (async () => {
    try {
      await unpack();
      for (const canvas of canvases) { await idle(); await draw(canvas); }
    } catch (error) { canvases.forEach((c) => fail(c, error)); }
    root.dataset.drawn = canvases.filter((c) => c.dataset.state === "drawn").length;
  })();
})();
