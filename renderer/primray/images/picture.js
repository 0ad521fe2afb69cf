// Shows a picture of primray's at another exposure, and its error over it: reads what stands beside it in the page, asks nobody.
(function () {
  function load(image) {
    return image.decode().then(function () {
      const canvas = document.createElement("canvas");
      canvas.width = image.naturalWidth;
      canvas.height = image.naturalHeight;
      const context = canvas.getContext("2d", { willReadFrequently: true });
      context.drawImage(image, 0, 0);
      return { width: canvas.width, height: canvas.height, data: context.getImageData(0, 0, canvas.width, canvas.height).data };
    });
  }

  // Logarithms of a picture, (3 W H) floats; -Infinity is black.
  function stopsOf(levels, darkest, brightest) {
    const pixels = levels.width * (levels.height / 2);
    const found = new Float32Array(3 * pixels);
    for (let i = 0; i < pixels; i++) {
      for (let c = 0; c < 3; c++) {
        const level = (levels.data[4 * i + c] << 4) | (levels.data[4 * (i + pixels) + c] >> 4);
        found[3 * i + c] = level === 0 ? -Infinity : darkest + ((brightest - darkest) * level) / 4095;
      }
    }
    return found;
  }

  function show(canvas, stops, alpha, cube, exposure, range) {
    const context = canvas.getContext("2d");
    const n = cube.height, out = context.createImageData(canvas.width, canvas.height);
    const scale = (n - 1) / (range[1] - range[0]);
    const at = [0, 0, 0], part = [0, 0, 0];
    for (let i = 0; i < canvas.width * canvas.height; i++) {
      for (let c = 0; c < 3; c++) {
        const place = Math.min(Math.max((stops[3 * i + c] + exposure - range[0]) * scale, 0), n - 1);
        at[c] = Math.min(Math.floor(place), n - 2);
        part[c] = place - at[c];
      }
      let r = 0, g = 0, b = 0;
      for (let corner = 0; corner < 8; corner++) {
        const x = corner & 1, y = (corner >> 1) & 1, z = corner >> 2;
        const weight = (x ? part[0] : 1 - part[0]) * (y ? part[1] : 1 - part[1]) * (z ? part[2] : 1 - part[2]);
        if (weight === 0) continue;
        const k = 4 * ((at[2] + z) * cube.width + (at[1] + y) * n + at[0] + x);
        r += weight * cube.data[k];
        g += weight * cube.data[k + 1];
        b += weight * cube.data[k + 2];
      }
      out.data.set([Math.round(r), Math.round(g), Math.round(b), alpha ? alpha.data[4 * i] : 255], 4 * i);
    }
    context.putImageData(out, 0, 0);
  }

  function begin(root) {
    const part = function (name) { return root.querySelector('[data-part="' + name + '"]'); };
    const canvas = part("canvas"), base = part("base"), exposure = part("exposure"), error = part("error");
    const range = JSON.parse(root.dataset.range);
    let ready = null;
    exposure.oninput = function () {
      const stops = Number(exposure.value);
      part("stops").textContent = (stops > 0 ? "+" : "") + stops.toFixed(1);
      canvas.hidden = stops === 0;
      base.style.visibility = stops === 0 ? "" : "hidden";
      if (stops === 0) return;
      ready = ready || Promise.all([load(part("levels")), load(part("cube")), part("alpha") ? load(part("alpha")) : null]);
      ready.then(function (loaded) {
        if (Number(exposure.value) !== stops) return;
        loaded.stops = loaded.stops || stopsOf(loaded[0], range[0], Number(root.dataset.brightest));
        canvas.width = loaded[0].width;
        canvas.height = loaded[0].height / 2;
        show(canvas, loaded.stops, loaded[2], loaded[1], stops, range);
        root.dataset.shown = String(stops);
      });
    };
    if (error) {
      error.oninput = function () {
        part("heat").style.opacity = Number(error.value) / 100;
        part("legend").style.visibility = Number(error.value) > 0 ? "visible" : "hidden";
      };
    }
    part("controls").hidden = false;  // without scripts there is nothing to control
  }

  document.querySelectorAll("[data-primray]:not([data-ready])").forEach(function (root) {
    root.dataset.ready = "";
    begin(root);
  });
})();
