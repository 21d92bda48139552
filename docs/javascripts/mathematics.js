// Formulas are typeset in the browser by KaTeX, which is part of these pages.
document.addEventListener("DOMContentLoaded", () => {
  for (const element of document.querySelectorAll(".arithmatex")) {
    const text = element.textContent.trim();
    const formula = text.match(/^\\[([]([\s\S]*)\\[)\]]$/);
    if (formula)
      katex.render(formula[1], element, { displayMode: text[1] === "[", throwOnError: false });
  }
});
