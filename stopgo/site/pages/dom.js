// Elements from data. Text from outside gets into the page only here: by textContent, or as an attribute.
const SVG = "http://www.w3.org/2000/svg";

export function h(name, attributes = {}, ...content) {
  return filled(document.createElement(name), attributes, content);
}

export function svg(name, attributes = {}, ...content) {
  return filled(document.createElementNS(SVG, name), attributes, content);
}

function filled(element, attributes, content) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "href" && !/^(\/|#|https?:\/\/)/.test(value)) continue;
    else element.setAttribute(name, value === true ? "" : value);
  }
  for (const one of content.flat(Infinity)) {
    if (one === null || one === undefined || one === false) continue;
    element.append(one instanceof Node ? one : document.createTextNode(String(one)));
  }
  return element;
}

export function fill(element, ...content) {
  element.replaceChildren(...content.flat(Infinity).filter((one) => one !== null && one !== undefined && one !== false));
}

// Set text only where it differs, so that readers of the screen are not disturbed.
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
