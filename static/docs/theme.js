// @ts-check
/** Shows the help in the theme chosen in the dashboard; by default, in that of the system. */
try {
  const chosen = JSON.parse(localStorage.getItem("cipv.theme") ?? "null");
  if (chosen === "dark" || chosen === "light") document.documentElement.dataset.theme = chosen;
} catch {
  // nothing readable is stored: the system decides
}
