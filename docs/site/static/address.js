// The HTTP reference names the reader's own service: in its examples, and in the links to that service's /docs.

const form = document.getElementById("service-address");

if (form) {
  let shown = "http://127.0.0.1:8700";
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("input", () => {
    const typed = form.elements.address.value.trim().replace(/\/+$/, "");
    if (!/^https?:\/\/[^\s/"'`$\\]+$/.test(typed)) return;
    for (const link of document.querySelectorAll(`a[href^="${shown}/"]`)) link.href = typed + link.getAttribute("href").slice(shown.length);
    for (const example of document.querySelectorAll("article pre")) {
      const texts = document.createTreeWalker(example, NodeFilter.SHOW_TEXT);
      while (texts.nextNode()) texts.currentNode.data = texts.currentNode.data.replaceAll(`${shown}/`, `${typed}/`);
    }
    shown = typed;
  });
}
