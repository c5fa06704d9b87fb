// Pictures and numbers of the page as files.

function download(name, blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

// A drawing by itself: with the colours that the page gives it, and a picture in its frame.
function standalone(drawing, picture = null) {
  const copy = drawing.cloneNode(true);
  copy.setAttribute("xmlns", SVG);
  copy.setAttribute("width", drawing.viewBox.baseVal.width);
  copy.setAttribute("height", drawing.viewBox.baseVal.height);
  const kept = ["fill", "stroke", "stroke-width", "stroke-dasharray", "opacity", "font-size"];
  const [from, to] = [drawing.querySelectorAll("*"), copy.querySelectorAll("*")];
  from.forEach((element, i) => {
    const style = getComputedStyle(element);
    for (const name of kept) to[i].style.setProperty(name, style.getPropertyValue(name));
    to[i].style.setProperty("font-family", "sans-serif");
  });
  if (picture) {
    const { x, y, width, height } = copy.querySelector("clipPath rect").attributes;
    const place = { x: x.value, y: y.value, width: width.value, height: height.value };
    const fitted = { preserveAspectRatio: "none", style: "image-rendering: pixelated" };
    copy.prepend(svg("image", { ...place, ...fitted, href: picture.toDataURL() }));
  }
  const ground = getComputedStyle(document.body).backgroundColor;
  copy.prepend(svg("rect", { width: "100%", height: "100%", fill: ground }));
  return new XMLSerializer().serializeToString(copy);
}

function downloadSvg(drawing, cells, name) {
  download(`${name}.svg`, new Blob([standalone(drawing, cells)], { type: "image/svg+xml" }));
}

async function downloadPng(drawing, cells, name) {
  const picture = new Image();
  const text = encodeURIComponent(standalone(drawing, cells));
  picture.src = `data:image/svg+xml;charset=utf-8,${text}`;
  await picture.decode();
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [2 * picture.width, 2 * picture.height];
  canvas.getContext("2d").drawImage(picture, 0, 0, canvas.width, canvas.height);
  canvas.toBlob((blob) => download(`${name}.png`, blob), "image/png");
}

function downloadJson(content, name) {
  const text = JSON.stringify(content, (_, value) => (value === Infinity ? "inf" : value), 1);
  download(`${name}.json`, new Blob([text], { type: "application/json" }));
}
