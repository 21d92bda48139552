// A line of a command ends between words, never at the hyphens of an option.
document.addEventListener("DOMContentLoaded", () => {
  const places = ".language-console code, :not(pre) > code";
  for (const code of document.querySelectorAll(places)) {
    if (!/(^|\s)-\S/.test(code.textContent)) continue;
    const inBlock = code.parentElement.tagName === "PRE";
    const texts = [];
    const walker = document.createTreeWalker(code, NodeFilter.SHOW_TEXT);
    while (walker.nextNode()) texts.push(walker.currentNode);
    for (const text of texts) {
      const parts = text.data.split(/(\s+)/).map((part) => {
        if (!part.startsWith("-") && !(inBlock && part.includes("-"))) return part;
        const word = document.createElement("span");
        word.className = "word";
        word.textContent = part;
        return word;
      });
      text.replaceWith(...parts);
    }
  }
});
