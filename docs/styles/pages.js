// What scrolls sideways can be reached and scrolled from the keyboard.
const reach = () => document.querySelectorAll("article pre, article div.math, article .table-wrapper")
  .forEach((one) => {
    if (one.scrollWidth > one.clientWidth) one.tabIndex = 0;
    else one.removeAttribute("tabindex");
  });
addEventListener("load", reach);
addEventListener("resize", reach);
