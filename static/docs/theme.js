// @ts-check
/** The help in the theme that was chosen in the dashboard; without a choice, as the system says. */
try {
  const chosen = JSON.parse(localStorage.getItem("cipv.theme") ?? "null");
  if (chosen === "dark" || chosen === "light") document.documentElement.dataset.theme = chosen;
} catch {
  // nothing readable is stored: the system decides
}
