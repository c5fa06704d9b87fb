// What scrolls sideways can be reached and scrolled from the keyboard.
const reach = () => document.querySelectorAll("article pre, article div.math, article .table-wrapper")
  .forEach((one) => {
    if (one.scrollWidth > one.clientWidth) one.tabIndex = 0;
    else one.removeAttribute("tabindex");
  });
addEventListener("load", reach);
addEventListener("resize", reach);

// The search of Sphinx appends the summary of each result, which is null for a page without text.
document.addEventListener("DOMContentLoaded", () => {
  if (typeof Search === "undefined") return;
  const summary = Search.makeSearchSummary;
  Search.makeSearchSummary = (...given) => summary(...given) ?? document.createDocumentFragment();
});
