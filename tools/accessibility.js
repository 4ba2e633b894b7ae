/* What a script can tell of the rules of WCAG: names of controls, roles, references, contrast of texts, unique ids.
   Returns what is wrong on the page, in words. */
() => {
  const faults = [], seen = (node) => node.checkVisibility({ opacityProperty: true, visibilityProperty: true }) && node.getClientRects().length;
  const called = (node) => (node.getAttribute("aria-label") || [...(node.labels ?? [])].map((label) => label.textContent).join(" ")
    || (node.getAttribute("aria-labelledby") ?? "").split(" ").map((id) => document.getElementById(id)?.textContent ?? "").join(" ")
    || node.textContent || node.title || "").trim();
  for (const node of document.querySelectorAll("button, input, select, a, progress, [role=tab], [tabindex], canvas, dialog")) {
    if (!called(node)) faults.push(`no name: ${node.outerHTML.slice(0, 90)}`);
  }
  for (const node of document.querySelectorAll("[aria-label]")) {
    if (/^(DIV|SPAN|P)$/.test(node.tagName) && !node.getAttribute("role")) faults.push(`a name without a role: ${node.outerHTML.slice(0, 90)}`);
  }
  for (const node of document.querySelectorAll("[aria-describedby], [aria-labelledby], [aria-controls], label[for]")) {
    for (const key of ["aria-describedby", "aria-labelledby", "aria-controls", "for"]) {
      for (const id of (node.getAttribute(key) ?? "").split(" ").filter(Boolean)) if (!document.getElementById(id)) faults.push(`${key}: no ${id}`);
    }
  }
  const ids = [...document.querySelectorAll("[id]")].filter((node) => !node.closest("svg")).map((node) => node.id);
  for (const id of ids) if (ids.filter((other) => other === id).length > 1) faults.push(`twice: ${id}`);
  const parts = (text) => text.match(/[\d.]+/g).map(Number);
  const light = (text) => parts(text).slice(0, 3).map((c) => c / 255).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  const behind = (node) => { for (let n = node; n; n = n.parentElement) { const b = getComputedStyle(n).backgroundColor; if ((parts(b)[3] ?? 1) > 0.9) return b; } return "rgb(255,255,255)"; };
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const node = walk.currentNode.parentElement;
    if (!walk.currentNode.textContent.trim() || node.closest("svg, noscript, [data-state]:not([data-state='']), option, :disabled, script") || !seen(node)) continue;
    const style = getComputedStyle(node), [a, b] = [light(style.color), light(behind(node))].sort((x, y) => y - x), ratio = (a + 0.05) / (b + 0.05);
    const large = parseFloat(style.fontSize) >= 24 || (parseFloat(style.fontSize) >= 18.66 && Number(style.fontWeight) >= 700);
    if (ratio < (large ? 3 : 4.5)) faults.push(`contrast ${ratio.toFixed(2)}: ${walk.currentNode.textContent.trim().slice(0, 60)}`);
  }
  if (!document.documentElement.lang || !document.title || document.querySelectorAll("h1, main").length !== 2) faults.push("page");
  return faults;
}
