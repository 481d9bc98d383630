// Finds the sections that contain all words of the query; matches in titles rank first.
"use strict";
(() => {
  const most = 12, box = document.getElementById("search");
  const query = document.getElementById("query"), list = document.getElementById("found");
  const rows = window.wheelplaneManual.map(([page, anchor, chapter, title, text]) => ({
    page, anchor, chapter, title, text,
    head: `${title} ${chapter}`.toLowerCase(), body: text.toLowerCase(),
  }));
  box.hidden = false;

  function score(row, words) {
    let sum = 0;
    for (const word of words) {
      const inTitle = row.title.toLowerCase().includes(word), inHead = row.head.includes(word);
      if (!inHead && !row.body.includes(word)) return 0;
      sum += inTitle ? 20 : inHead ? 5 : 1;
    }
    return sum;
  }

  function excerpt(row, word) {
    const at = Math.max(0, row.body.indexOf(word) - 40);
    return (at ? "... " : "") + row.text.slice(at, at + 120);
  }

  function show() {
    const words = query.value.toLowerCase().split(/\s+/).filter((word) => word.length > 1);
    const found = words.length === 0 ? [] : rows
      .map((row) => [score(row, words), row])
      .filter(([points]) => points > 0)
      .sort((a, b) => b[0] - a[0])
      .slice(0, most);
    list.replaceChildren(...found.map(([, row]) => {
      const item = document.createElement("li"), link = document.createElement("a");
      const text = document.createElement("span");
      link.href = `${row.page}#${row.anchor}`;
      link.textContent = row.title === row.chapter ? row.title : `${row.chapter}: ${row.title}`;
      text.textContent = excerpt(row, words[0]);
      item.append(link, text);
      return item;
    }));
    if (words.length > 0 && found.length === 0) {
      const item = document.createElement("li");
      item.textContent = "nothing found";
      list.append(item);
    }
  }

  query.addEventListener("input", show);
  box.addEventListener("keydown", (event) => {
    if (event.key === "Escape") { query.value = ""; show(); }
  });
  document.addEventListener("click", (event) => {
    if (!box.contains(event.target)) list.replaceChildren();
  });
})();
