/** The screen stays on while the page is seen, where the browser lets a page ask for that. */

export function setUp() {
  document.addEventListener("visibilitychange", ask);
  ask();
}

function ask() {
  if (document.visibilityState !== "visible" || !("wakeLock" in navigator)) return;
  navigator.wakeLock.request("screen").catch(() => {}); // a low battery refuses; the page is the same without
}
