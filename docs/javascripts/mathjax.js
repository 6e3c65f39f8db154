// Formulas of the derivations: pymdownx.arithmatex leaves TeX in \( \) and \[ \], and MathJax sets it.
window.MathJax = {
  tex: {
    inlineMath: [["\\(", "\\)"]],
    displayMath: [["\\[", "\\]"]],
  },
  options: {
    ignoreHtmlClass: ".*|",
    processHtmlClass: "arithmatex",
  },
};
